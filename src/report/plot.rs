//! A canvas for plots: lines, markers and text at a place, as a picture of pixels and as SVG from the same calls.

use std::io;
use std::sync::OnceLock;

use image::RgbImage;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::register_font;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// A place in units of the plot, which are pixels of the SVG.
pub type At = (f64, f64);

/// Where text stands in relation to its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    Left,
    Middle,
    Right,
}

/// Shapes that tell curves apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marker {
    Circle,
    Square,
    Diamond,
    Up,
    Down,
    Cross,
}

/// How a line is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Stroke {
    pub colour: RGBColor,
    pub alpha: f64,
    pub width: f64,
    /// Lengths of a dash and of the gap after it.
    pub dash: Option<(f64, f64)>,
}

impl Stroke {
    pub fn new(colour: RGBColor, width: f64) -> Self {
        Self { colour, alpha: 1.0, width, dash: None }
    }

    pub fn faint(self, alpha: f64) -> Self {
        Self { alpha, ..self }
    }

    pub fn dashed(self, dash: f64, gap: f64) -> Self {
        Self { dash: Some((dash, gap)), ..self }
    }
}

/// What a plot is drawn on.
pub struct Canvas<B: DrawingBackend> {
    area: DrawingArea<B, Shift>,
    /// Pixels of a unit.
    scale: f64,
}

const FONT: &str = "sans-serif";
/// Pictures of pixels are drawn larger by this and averaged: the backend's edges are hard.
const SMOOTHING: u32 = 2;
/// Pixels of a unit in a picture of pixels.
const SHARPNESS: u32 = 2;

/// Whether there is text at all: the font comes with the program, since a machine without a screen may have none.
fn font_is_there() -> bool {
    static REGISTERED: OnceLock<bool> = OnceLock::new();
    *REGISTERED
        .get_or_init(|| register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT).is_ok())
}

/// Draws into pixels.
pub fn pixels(
    (width, height): (u32, u32),
    draw: impl FnOnce(&Canvas<BitMapBackend<'_>>) -> io::Result<()>,
) -> io::Result<RgbImage> {
    let scale = SMOOTHING * SHARPNESS;
    let size = (width * scale, height * scale);
    let mut large = vec![255u8; size.0 as usize * size.1 as usize * 3];
    {
        let area = BitMapBackend::with_buffer(&mut large, size).into_drawing_area();
        let canvas = Canvas { area, scale: f64::from(scale) };
        canvas.clear()?;
        draw(&canvas)?;
        canvas.area.present().map_err(failed)?;
    }
    let row = size.0 as usize * 3;
    Ok(RgbImage::from_fn(width * SHARPNESS, height * SHARPNESS, |x, y| {
        let mean = |channel: usize| {
            let mut sum = 0;
            for dy in 0..SMOOTHING {
                for dx in 0..SMOOTHING {
                    let (x, y) = ((x * SMOOTHING + dx) as usize, (y * SMOOTHING + dy) as usize);
                    sum += u32::from(large[y * row + x * 3 + channel]);
                }
            }
            (sum / (SMOOTHING * SMOOTHING)) as u8
        };
        image::Rgb([mean(0), mean(1), mean(2)])
    }))
}

/// Draws SVG.
pub fn svg(
    size: (u32, u32),
    draw: impl FnOnce(&Canvas<SVGBackend<'_>>) -> io::Result<()>,
) -> io::Result<String> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        let canvas = Canvas { area, scale: 1.0 };
        canvas.clear()?;
        draw(&canvas)?;
        canvas.area.present().map_err(failed)?;
    }
    Ok(text)
}

fn failed<E: std::error::Error + Send + Sync>(error: DrawingAreaErrorKind<E>) -> io::Error {
    io::Error::other(error.to_string())
}

impl<B: DrawingBackend> Canvas<B> {
    fn clear(&self) -> io::Result<()> {
        if !font_is_there() {
            return Err(io::Error::other("the font that comes with the program cannot be read"));
        }
        self.area.fill(&WHITE).map_err(failed)
    }

    fn place(&self, (x, y): At) -> (i32, i32) {
        ((x * self.scale).round() as i32, (y * self.scale).round() as i32)
    }

    fn style(&self, stroke: &Stroke) -> ShapeStyle {
        stroke.colour.mix(stroke.alpha).stroke_width((stroke.width * self.scale).round().max(1.0) as u32)
    }

    /// A line through places.
    pub fn line(&self, places: &[At], stroke: &Stroke) -> io::Result<()> {
        let pieces = match stroke.dash {
            Some((dash, gap)) => dashes(places, dash, gap),
            None => vec![places.to_vec()],
        };
        for piece in pieces {
            let path: Vec<(i32, i32)> = piece.into_iter().map(|at| self.place(at)).collect();
            self.area.draw(&PathElement::new(path, self.style(stroke))).map_err(failed)?;
        }
        Ok(())
    }

    /// A rectangle that is filled.
    pub fn fill(&self, from: At, to: At, colour: RGBColor, alpha: f64) -> io::Result<()> {
        let rectangle = Rectangle::new([self.place(from), self.place(to)], colour.mix(alpha).filled());
        self.area.draw(&rectangle).map_err(failed)
    }

    /// A disc.
    pub fn disc(&self, at: At, radius: f64, colour: RGBColor, alpha: f64) -> io::Result<()> {
        let radius = (radius * self.scale).round() as i32;
        self.area.draw(&Circle::new(self.place(at), radius, colour.mix(alpha).filled())).map_err(failed)
    }

    /// A marker, filled or with a white inside.
    pub fn marker(
        &self,
        marker: Marker,
        at: At,
        radius: f64,
        colour: RGBColor,
        filled: bool,
    ) -> io::Result<()> {
        if marker == Marker::Cross {
            let r = radius * 0.85;
            let arm = |dx: f64, dy: f64| [(at.0 - dx, at.1 - dy), (at.0 + dx, at.1 + dy)];
            self.line(&arm(r, r), &Stroke::new(colour, 1.9))?;
            return self.line(&arm(r, -r), &Stroke::new(colour, 1.9));
        }
        if marker == Marker::Circle {
            self.disc(at, radius, colour, 1.0)?;
            return if filled { Ok(()) } else { self.disc(at, radius - 1.4, WHITE, 1.0) };
        }
        self.polygon(&corners(marker, at, radius), colour)?;
        if filled { Ok(()) } else { self.polygon(&corners(marker, at, radius - 1.6), WHITE) }
    }

    fn polygon(&self, corners: &[At], colour: RGBColor) -> io::Result<()> {
        let corners: Vec<(i32, i32)> = corners.iter().map(|&at| self.place(at)).collect();
        self.area.draw(&Polygon::new(corners, colour.filled())).map_err(failed)
    }

    /// Text whose middle line is at the place.
    pub fn text(&self, text: &str, at: At, size: f64, colour: RGBColor, anchor: Anchor) -> io::Result<()> {
        self.text_turned(text, at, size, colour, anchor, false)
    }

    /// The same, upwards if `turned`.
    pub fn text_turned(
        &self,
        text: &str,
        at: At,
        size: f64,
        colour: RGBColor,
        anchor: Anchor,
        turned: bool,
    ) -> io::Result<()> {
        let across = match anchor {
            Anchor::Left => HPos::Left,
            Anchor::Middle => HPos::Center,
            Anchor::Right => HPos::Right,
        };
        let transform = if turned { FontTransform::Rotate270 } else { FontTransform::None };
        let style = TextStyle::from((FONT, size * self.scale).into_font().transform(transform))
            .color(&colour)
            .pos(Pos::new(across, VPos::Center));
        self.area.draw(&Text::new(text.to_string(), self.place(at), style)).map_err(failed)
    }
}

/// Corners of a marker at a place.
fn corners(marker: Marker, at: At, radius: f64) -> Vec<At> {
    let (r, s, t) = (radius * 1.3, radius * 0.9, radius * 1.15);
    let corners: &[At] = match marker {
        Marker::Square => &[(-s, -s), (s, -s), (s, s), (-s, s)],
        Marker::Diamond => &[(0.0, -r), (r, 0.0), (0.0, r), (-r, 0.0)],
        Marker::Up => &[(0.0, -r), (t, s), (-t, s)],
        _ => &[(0.0, r), (t, -s), (-t, -s)],
    };
    corners.iter().map(|(x, y)| (at.0 + x, at.1 + y)).collect()
}

/// A line through places in pieces.
fn dashes(places: &[At], dash: f64, gap: f64) -> Vec<Vec<At>> {
    let mut pieces = Vec::new();
    let mut piece: Vec<At> = places.first().copied().into_iter().collect();
    let (mut drawing, mut left) = (true, dash);
    for pair in places.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let length = (to.0 - from.0).hypot(to.1 - from.1);
        let mut gone = 0.0;
        while length - gone > left {
            gone += left;
            let part = gone / length;
            let at = (from.0 + part * (to.0 - from.0), from.1 + part * (to.1 - from.1));
            if drawing {
                piece.push(at);
                pieces.push(std::mem::take(&mut piece));
            } else {
                piece = vec![at];
            }
            drawing = !drawing;
            left = if drawing { dash } else { gap };
        }
        left -= length - gone;
        if drawing {
            piece.push(to);
        }
    }
    if piece.len() > 1 {
        pieces.push(piece);
    }
    pieces
}

/// An axis in logarithms: values from `low` to `high` lie between two places.
#[derive(Clone, Copy, Debug)]
pub struct LogAxis {
    pub low: f64,
    pub high: f64,
    pub from: f64,
    pub to: f64,
}

impl LogAxis {
    /// An axis that holds these values with some room; of none, from 0.1 to 1.
    pub fn holding(values: impl Iterator<Item = f64>, room: f64, (from, to): At) -> Self {
        let usable = values.filter(|value| *value > 0.0 && value.is_finite());
        let (low, high) = usable.fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
        let (low, high) = if low <= high { (low, high) } else { (0.1, 1.0) };
        Self { low: low / room, high: high * room, from, to }
    }

    pub fn at(&self, value: f64) -> f64 {
        let part = (value / self.low).ln() / (self.high / self.low).ln();
        self.from + part * (self.to - self.from)
    }

    pub fn holds(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    /// Powers of ten, and 2 to 9 times each: whether it is a power, and the value.
    pub fn ticks(&self) -> Vec<(bool, f64)> {
        let (first, last) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        (first..=last)
            .flat_map(|power| (1..10).map(move |n| (n == 1, f64::from(n) * 10f64.powi(power))))
            .filter(|(_, value)| self.holds(*value))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dashed_line_goes_round_corners_and_has_the_right_length() {
        let pieces = dashes(&[(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)], 3.0, 2.0);
        let length = |piece: &[At]| -> f64 {
            piece.windows(2).map(|p| (p[1].0 - p[0].0).hypot(p[1].1 - p[0].1)).sum()
        };
        let lengths: Vec<f64> = pieces.iter().map(|piece| length(piece)).collect();
        assert_eq!(lengths.len(), 4);
        assert!(lengths.iter().all(|length| (length - 3.0).abs() < 1e-9), "{lengths:?}");
        assert!(dashes(&[], 3.0, 2.0).is_empty() && dashes(&[(0.0, 0.0)], 3.0, 2.0).is_empty());
    }

    #[test]
    fn an_axis_holds_its_values_and_ticks_them() {
        let axis = LogAxis::holding([0.02, 3.0, 0.0, f64::NAN].into_iter(), 2.0, (100.0, 0.0));
        assert!((axis.low - 0.01).abs() < 1e-12 && (axis.high - 6.0).abs() < 1e-12);
        assert!((axis.at(0.01) - 100.0).abs() < 1e-9 && axis.at(6.0).abs() < 1e-9);
        let powers: Vec<f64> = axis.ticks().iter().filter(|tick| tick.0).map(|tick| tick.1).collect();
        assert!(powers.len() >= 2 && (powers[powers.len() - 1] - 1.0).abs() < 1e-9, "{powers:?}");
        let none = LogAxis::holding(std::iter::empty(), 1.5, (0.0, 1.0));
        assert!(none.low < none.high);
    }

    #[test]
    #[expect(clippy::redundant_closure, reason = "each canvas has a lifetime of its own")]
    fn pixels_and_svg_show_text_and_markers() {
        fn draw<B: DrawingBackend>(canvas: &Canvas<B>) -> io::Result<()> {
            canvas.text("RMSE", (30.0, 10.0), 12.0, BLACK, Anchor::Middle)?;
            for (i, marker) in
                [Marker::Circle, Marker::Square, Marker::Diamond, Marker::Up, Marker::Down, Marker::Cross]
                    .into_iter()
                    .enumerate()
            {
                canvas.marker(marker, (5.0 + 10.0 * i as f64, 30.0), 4.0, RED, i % 2 == 0)?;
            }
            canvas.line(&[(0.0, 40.0), (60.0, 40.0)], &Stroke::new(BLUE, 1.0).dashed(3.0, 3.0))
        }
        let image = pixels((60, 50), |canvas| draw(canvas)).unwrap();
        assert_eq!(image.dimensions(), (120, 100));
        let dark = |rows: std::ops::Range<u32>| {
            rows.flat_map(|y| (0..120).map(move |x| (x, y)))
                .filter(|&(x, y)| image.get_pixel(x, y).0.iter().any(|&c| c < 100))
                .count()
        };
        assert!(dark(8..32) > 50, "the text is there without a font of the system");
        assert!(dark(50..70) > 100);
        let text = svg((60, 50), |canvas| draw(canvas)).unwrap();
        assert!(text.starts_with("<svg") && text.contains("RMSE"), "{text}");
    }
}
