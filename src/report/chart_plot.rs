//! A chart as a picture: error over GPU time, and below it the mean error, curve by curve.

use std::collections::HashMap;
use std::io;

use image::RgbImage;
use plotters::prelude::{DrawingBackend, RGBColor};

use super::chart::Record;
use super::plot::{self, Anchor, At, Canvas, LogAxis, Marker, Stroke};
use crate::lab::chart::SceneFacts;
use crate::lab::chart::curves::Varies;
use crate::lab::chart::results::{Curve, Point};

/// Size of the picture in units.
const SIZE: (u32, u32) = (1400, 1000);
/// Edges of the panels.
const LEFT: f64 = 92.0;
const RIGHT: f64 = 1080.0;
const TOP: f64 = 88.0;
const MIDDLE: f64 = 630.0;
const LOWER: f64 = 682.0;
const BOTTOM: f64 = 934.0;
/// Where the legend begins.
const LEGEND: f64 = 1112.0;

const INK: RGBColor = RGBColor(30, 30, 34);
const SOFT: RGBColor = RGBColor(105, 105, 112);
const GRID: RGBColor = RGBColor(208, 210, 216);
const GOLD: RGBColor = RGBColor(255, 190, 40);

/// The picture in pixels.
pub fn pixels(record: &Record, facts: &SceneFacts) -> io::Result<RgbImage> {
    plot::pixels(SIZE, |canvas| draw(canvas, record, facts))
}

/// The same as SVG, with the manifest.
pub fn svg(record: &Record, facts: &SceneFacts) -> io::Result<String> {
    let text = plot::svg(SIZE, |canvas| draw(canvas, record, facts))?;
    // Of what the manifest's JSON may hold, XML minds these.
    let manifest = record.manifest.text().replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let metadata = format!("<metadata id=\"cousu\">{manifest}</metadata>\n</svg>");
    Ok(text.trim_end().strip_suffix("</svg>").map_or(text.clone(), |start| format!("{start}{metadata}\n")))
}

/// How a curve looks.
struct Look {
    colour: RGBColor,
    marker: Marker,
    width: f64,
    dash: Option<(f64, f64)>,
}

/// Colours of a kind of curves: kinds differ by family and marker, curves of a kind by their colour.
fn colours(varies: Varies) -> &'static [(u8, u8, u8)] {
    match varies {
        Varies::Original => &[(178, 34, 34), (120, 120, 126)],
        Varies::Base => &[(0, 0, 0)],
        Varies::Nothing => &[(16, 92, 215)],
        Varies::Sampler => {
            &[(150, 20, 60), (226, 38, 38), (255, 128, 14), (226, 92, 170), (245, 175, 100), (190, 100, 60)]
        }
        Varies::Method => {
            &[(0, 105, 92), (23, 165, 188), (96, 178, 48), (20, 140, 70), (110, 190, 170), (150, 160, 20)]
        }
        Varies::Passes => &[(120, 60, 185), (180, 125, 222), (80, 30, 120)],
        Varies::Surface => &[(130, 82, 64), (196, 152, 30), (96, 100, 112)],
        Varies::Asked => &[
            (226, 38, 38),
            (26, 148, 80),
            (148, 80, 190),
            (255, 128, 14),
            (23, 165, 188),
            (140, 86, 75),
            (226, 92, 170),
            (130, 140, 20),
        ],
    }
}

fn look(varies: Varies, place: usize) -> Look {
    let colours = colours(varies);
    let (r, g, b) = colours[place % colours.len()];
    let plain = |marker| Look { colour: RGBColor(r, g, b), marker, width: 1.6, dash: None };
    match varies {
        Varies::Original => Look { dash: Some((9.0, 5.0)), width: 1.8, ..plain(Marker::Cross) },
        Varies::Base => Look { width: 3.2, ..plain(Marker::Cross) },
        Varies::Nothing => Look { width: 4.2, ..plain(Marker::Circle) },
        Varies::Sampler | Varies::Asked => plain(Marker::Up),
        Varies::Method => plain(Marker::Square),
        Varies::Passes => plain(Marker::Diamond),
        Varies::Surface => plain(Marker::Down),
    }
}

/// Titles of the legend, in its order.
const KINDS: [(Varies, &str); 8] = [
    (Varies::Nothing, "default choices"),
    (Varies::Base, "the original made unbiased"),
    (Varies::Original, "the original"),
    (Varies::Sampler, "other random numbers"),
    (Varies::Method, "other methods"),
    (Varies::Passes, "other passes"),
    (Varies::Surface, "other offsets and boxes"),
    (Varies::Asked, "asked for"),
];

/// A curve with its look and the labels of those that share its points.
struct Shown<'a> {
    curve: &'a Curve,
    look: Look,
    /// Labels of curves that make the same choices.
    same: Vec<&'a str>,
}

fn shown<'a>(record: &'a Record, facts: &'a SceneFacts) -> Vec<Shown<'a>> {
    let mut places: HashMap<&str, usize> = HashMap::new();
    let own = record.curves_of(&facts.scene).filter(|curve| curve.same_as.is_none());
    let curves = own.map(|curve| {
        let kind = KINDS.iter().find(|(kind, _)| *kind == curve.varies).map_or("", |(_, title)| title);
        let place = places.entry(kind).or_default();
        let look = look(curve.varies, *place);
        *place += 1;
        let same =
            record.curves_of(&facts.scene).filter(|other| other.same_as.as_ref() == Some(&curve.label));
        Shown { curve, look, same: same.map(|curve| &curve.label[..]).collect() }
    });
    curves.collect()
}

fn draw<B: DrawingBackend>(canvas: &Canvas<B>, record: &Record, facts: &SceneFacts) -> io::Result<()> {
    let curves = shown(record, facts);
    let points = || curves.iter().flat_map(|shown| &shown.curve.points);
    let time = LogAxis::holding(points().map(|point| point.gpu_ms), 1.5, (LEFT, RIGHT));
    let rmse = LogAxis::holding(points().map(|point| point.place().1), 1.35, (MIDDLE, TOP));
    let bias = LogAxis::holding(points().map(size_of_bias), 1.35, (BOTTOM, LOWER));
    let title = format!("{}: error over GPU time", facts.scene);
    canvas.text(&title, (LEFT, 30.0), 30.0, INK, Anchor::Left)?;
    let [width, height] = record.size;
    let nearest = facts.max_distance.map_or(String::new(), |d| format!(", occluders up to {d} away"));
    let what = format!(
        "{} triangles, {width}x{height} pixels{nearest}, {} ({})",
        facts.triangles, record.device, record.driver
    );
    canvas.text(&what, (LEFT, 62.0), 17.0, SOFT, Anchor::Left)?;
    frame(canvas, &time, &rmse, "RMSE")?;
    frame(canvas, &time, &bias, "|bias|")?;
    let times = "summed GPU time of all kernels";
    canvas.text(times, ((LEFT + RIGHT) * 0.5, BOTTOM + 46.0), 18.0, INK, Anchor::Middle)?;
    unresolved(canvas, facts, &rmse)?;
    guides(canvas, &curves, &time, &rmse)?;
    front(canvas, &curves, &time, &rmse)?;
    // The emphasized ones last, on top.
    let mut order: Vec<&Shown<'_>> = curves.iter().collect();
    order.sort_by(|a, b| a.look.width.total_cmp(&b.look.width));
    for shown in &order {
        error_curve(canvas, shown, &time, &rmse)?;
        bias_curve(canvas, shown, &time, &bias)?;
    }
    legend(canvas, &curves)
}

/// Grid, ticks and title of a panel.
fn frame<B: DrawingBackend>(canvas: &Canvas<B>, x: &LogAxis, y: &LogAxis, title: &str) -> io::Result<()> {
    for (power, value) in x.ticks() {
        let at = x.at(value);
        canvas.line(&[(at, y.from), (at, y.to)], &grid(power))?;
        if y.from == BOTTOM && is_named(x, power, value) {
            canvas.text(&time_text(value), (at, y.from + 18.0), 16.0, INK, Anchor::Middle)?;
        }
    }
    for (power, value) in y.ticks() {
        let at = y.at(value);
        canvas.line(&[(x.from, at), (x.to, at)], &grid(power))?;
        if is_named(y, power, value) {
            canvas.text(&number_text(value), (x.from - 9.0, at), 16.0, INK, Anchor::Right)?;
        }
    }
    let edge = [(x.from, y.to), (x.to, y.to), (x.to, y.from), (x.from, y.from), (x.from, y.to)];
    canvas.line(&edge, &Stroke::new(SOFT, 1.0))?;
    canvas.text_turned(title, (26.0, (y.from + y.to) * 0.5), 18.0, INK, Anchor::Middle, true)
}

/// Powers of ten have their numbers, and where there are few of them, 2 and 5 times each too.
fn is_named(axis: &LogAxis, power: bool, value: f64) -> bool {
    let decades = (axis.high / axis.low).log10();
    let room = (axis.to - axis.from).abs() / decades;
    let digit = (value / 10f64.powf((value.log10() + 1e-9).floor())).round() as u32;
    power || room > 180.0 && [2, 5].contains(&digit)
}

fn grid(power: bool) -> Stroke {
    Stroke::new(GRID, if power { 1.1 } else { 0.6 }).faint(if power { 1.0 } else { 0.55 })
}

fn time_text(ms: f64) -> String {
    match ms {
        ms if ms >= 999.0 => format!("{} s", number_text(ms * 1e-3)),
        ms if ms >= 0.99 => format!("{} ms", ms.round()),
        ms => format!("{} ms", number_text(ms)),
    }
}

fn number_text(value: f64) -> String {
    let places = (-(value.log10() + 1e-9).floor()).max(0.0) as usize;
    format!("{value:.places$}")
}

/// Below this line errors drown in the references' noise.
fn unresolved<B: DrawingBackend>(canvas: &Canvas<B>, facts: &SceneFacts, y: &LogAxis) -> io::Result<()> {
    let Some(resolution) = facts.resolution.filter(|resolution| y.holds(*resolution)) else { return Ok(()) };
    canvas.fill((LEFT, y.at(resolution)), (RIGHT, y.from), GRID, 0.35)?;
    let at = (LEFT + 10.0, (y.at(resolution) + y.from) * 0.5);
    canvas.text("below the references' noise", at, 14.0, SOFT, Anchor::Left)
}

/// How errors fall with the number of samples N, from the lower left where no curve is: independent samples, and better
/// ones.
fn guides<B: DrawingBackend>(
    canvas: &Canvas<B>,
    curves: &[Shown<'_>],
    x: &LogAxis,
    y: &LogAxis,
) -> io::Result<()> {
    let points = || curves.iter().flat_map(|shown| &shown.curve.points);
    // Below all points: the product of time and squared error of the best of them, and less.
    let best = points().map(|point| point.gpu_ms * point.place().1.powi(2)).fold(f64::INFINITY, f64::min);
    let Some(first) = points().map(|point| point.gpu_ms).min_by(f64::total_cmp) else { return Ok(()) };
    let start = ((best / first).sqrt() * 0.62).clamp(y.low, y.high);
    for (power, name) in [(-0.5, "-1/2"), (-0.75, "-3/4"), (-1.0, "-1")] {
        let value = |t: f64| start * (t / first).powf(power);
        // To the panel's edge, but no farther than three decades.
        let end = (first * (start / y.low).powf(-1.0 / power)).min(x.high).min(first * 1e3);
        if end <= first * 1.5 {
            continue;
        }
        let at = |t: f64| (x.at(t), y.at(value(t)));
        canvas.line(&[at(first), at(end)], &Stroke::new(SOFT, 1.0).dashed(2.0, 4.0))?;
        let (left, middle) = at(end * 0.75);
        let (left, middle) = (left + 10.0, middle - 3.0);
        canvas.text("N", (left, middle), 15.0, SOFT, Anchor::Left)?;
        canvas.text(name, (left + 12.0, middle - 6.0), 11.0, SOFT, Anchor::Left)?;
    }
    Ok(())
}

/// The points that no other beats.
fn front<B: DrawingBackend>(
    canvas: &Canvas<B>,
    curves: &[Shown<'_>],
    x: &LogAxis,
    y: &LogAxis,
) -> io::Result<()> {
    let kept = curves.iter().flat_map(|shown| &shown.curve.points).filter(|point| point.pareto);
    let mut places: Vec<At> = kept.map(Point::place).collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let places: Vec<At> = places.into_iter().map(|(ms, rmse)| (x.at(ms), y.at(rmse))).collect();
    canvas.line(&places, &Stroke::new(GOLD, 13.0).faint(0.38))?;
    places.iter().try_for_each(|&at| canvas.disc(at, 11.0, GOLD, 0.75))
}

fn error_curve<B: DrawingBackend>(
    canvas: &Canvas<B>,
    shown: &Shown<'_>,
    x: &LogAxis,
    y: &LogAxis,
) -> io::Result<()> {
    let Look { colour, marker, width, dash } = shown.look;
    let at = |point: &Point| (x.at(point.gpu_ms), y.at(point.place().1));
    let places: Vec<At> = shown.curve.points.iter().map(at).collect();
    canvas.line(&places, &Stroke { colour, alpha: 0.9, width, dash })?;
    let radius = if width > 3.0 { 5.5 } else { 4.2 };
    for point in &shown.curve.points {
        canvas.marker(marker, at(point), radius, colour, point.rmse.is_some())?;
    }
    Ok(())
}

/// The mean error's size, at least its standard error: less is not known.
fn size_of_bias(point: &Point) -> f64 {
    point.bias.abs().max(point.bias_error)
}

/// Halfway to white.
fn pale(RGBColor(r, g, b): RGBColor) -> RGBColor {
    let half = |channel: u8| ((u16::from(channel) + 255) / 2) as u8;
    RGBColor(half(r), half(g), half(b))
}

fn bias_curve<B: DrawingBackend>(
    canvas: &Canvas<B>,
    shown: &Shown<'_>,
    x: &LogAxis,
    y: &LogAxis,
) -> io::Result<()> {
    let Look { colour, marker, width, dash } = shown.look;
    let at = |point: &Point| (x.at(point.gpu_ms), y.at(size_of_bias(point).clamp(y.low, y.high)));
    let sure = |point: &Point| point.bias.abs() >= 2.0 * point.bias_error;
    for pair in shown.curve.points.windows(2) {
        let alpha = if sure(&pair[0]) && sure(&pair[1]) { 0.9 } else { 0.22 };
        canvas.line(&[at(&pair[0]), at(&pair[1])], &Stroke { colour, alpha, width: width * 0.8, dash })?;
    }
    for point in &shown.curve.points {
        let (radius, colour) = if sure(point) { (4.2, colour) } else { (3.0, pale(colour)) };
        canvas.marker(marker, at(point), radius, colour, sure(point))?;
    }
    Ok(())
}

/// Beside the panels, where no curve is.
fn legend<B: DrawingBackend>(canvas: &Canvas<B>, curves: &[Shown<'_>]) -> io::Result<()> {
    let mut y = TOP + 6.0;
    for (kind, title) in KINDS {
        let of_kind: Vec<&Shown<'_>> = curves.iter().filter(|shown| shown.curve.varies == kind).collect();
        if of_kind.is_empty() {
            continue;
        }
        canvas.text(title, (LEGEND, y), 15.0, SOFT, Anchor::Left)?;
        y += 24.0;
        for shown in of_kind {
            let Look { colour, marker, width, dash } = shown.look;
            let line = [(LEGEND, y), (LEGEND + 40.0, y)];
            canvas.line(&line, &Stroke { colour, alpha: 0.9, width, dash })?;
            let radius = if width > 3.0 { 5.5 } else { 4.2 };
            canvas.marker(marker, (LEGEND + 20.0, y), radius, colour, true)?;
            canvas.text(&shown.curve.label, (LEGEND + 52.0, y), 17.0, INK, Anchor::Left)?;
            y += 25.0;
            for pair in shown.same.chunks(2) {
                let text = format!("= {}", pair.join(", "));
                canvas.text(&text, (LEGEND + 52.0, y - 5.0), 14.0, SOFT, Anchor::Left)?;
                y += 17.0;
            }
        }
        y += 9.0;
    }
    let notes = LOWER.max(y + 10.0);
    canvas
        .line(&[(LEGEND, notes + 8.0), (LEGEND + 40.0, notes + 8.0)], &Stroke::new(GOLD, 13.0).faint(0.38))?;
    canvas.disc((LEGEND + 20.0, notes + 8.0), 11.0, GOLD, 0.75)?;
    canvas.text("Pareto front", (LEGEND + 52.0, notes + 8.0), 17.0, INK, Anchor::Left)?;
    let lines = [
        "RMSE: hollow where it is below what",
        "the references resolve",
        "|bias|: mean error; hollow and pale",
        "within two standard errors of 0",
    ];
    for (place, line) in lines.iter().enumerate() {
        canvas.text(line, (LEGEND, notes + 46.0 + 20.0 * place as f64), 14.0, SOFT, Anchor::Left)?;
    }
    Ok(())
}
