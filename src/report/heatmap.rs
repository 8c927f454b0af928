//! What a picture's rays cost, pixel by pixel, in colours: node visits and triangle tests, of camera and ambient rays.

use font8x8::legacy::BASIC_LEGACY;
use image::{Rgb, RgbImage};

use crate::layout::Work;
use crate::render::tiles::Tiles;
use crate::render::work::WorkCount;

/// Side of a letter, pixels.
const LETTER: u32 = 8;
/// Between panels and around them.
const MARGIN: u32 = 8;
/// Height of a panel's title and of its scale with its figures.
const TITLE: u32 = LETTER + 4;
const SCALE: u32 = 10 + 2 + LETTER + 2;
/// Narrower panels have no room for their text.
const NARROWEST: u32 = 200;
/// The scale ends where this share of the pixels that cost anything lies below: a few rays along edges cost many times
/// as much as the others.
const COVERED: f64 = 0.999;

const PAPER: Rgb<u8> = Rgb([255, 255, 255]);
const INK: Rgb<u8> = Rgb([0, 0, 0]);

/// A figure of each pixel under a title.
struct Panel {
    title: &'static str,
    /// Row by row.
    values: Vec<f64>,
}

/// The map: four panels, each with its own scale. `samples`: ambient rays of a pixel that hit.
pub fn draw(work: &WorkCount, tiles: Tiles, samples: u32) -> RgbImage {
    let (works, rays) = (&work.pixels, f64::from(samples.max(1)));
    // A pixel's camera ray is traced with each dispatch of its samples.
    let pixels = u64::from(tiles.width) * u64::from(tiles.height);
    let times = (work.camera_rays as f64 / pixels.max(1) as f64).max(1.0);
    let panels: [Panel; 4] = [
        panel("node visits per camera ray", works, tiles, |work| f64::from(work.closest_visits) / times),
        panel("triangle tests per camera ray", works, tiles, |work| f64::from(work.closest_tests) / times),
        panel("node visits per ambient ray", works, tiles, |work| f64::from(work.any_visits) / rays),
        panel("triangle tests per ambient ray", works, tiles, |work| f64::from(work.any_tests) / rays),
    ];
    let (wide, high) = (tiles.width.max(NARROWEST), TITLE + tiles.height + 2 + SCALE);
    let mut map = RgbImage::from_pixel(2 * wide + 3 * MARGIN, 2 * high + 3 * MARGIN, PAPER);
    for (place, panel) in panels.iter().enumerate() {
        let (column, row) = (place as u32 % 2, place as u32 / 2);
        let at = (MARGIN + column * (wide + MARGIN), MARGIN + row * (high + MARGIN));
        draw_panel(&mut map, at, tiles, panel);
    }
    map
}

fn panel(title: &'static str, works: &[Work], tiles: Tiles, value: impl Fn(&Work) -> f64) -> Panel {
    let at = |(x, y)| works.get(tiles.number(x, y) as usize).map_or(0.0, &value);
    let values = (0..tiles.height).flat_map(|y| (0..tiles.width).map(move |x| (x, y))).map(at).collect();
    Panel { title, values }
}

/// Where the scale of these values ends.
fn end_of_scale(values: &[f64]) -> f64 {
    let mut costly: Vec<f64> = values.iter().copied().filter(|value| *value > 0.0).collect();
    costly.sort_by(f64::total_cmp);
    let place = (costly.len() as f64 * COVERED) as usize;
    costly.get(place.min(costly.len().saturating_sub(1))).copied().unwrap_or(1.0)
}

/// Viridis: equal steps look equal, also to eyes that see fewer colours.
fn color(share: f64) -> Rgb<u8> {
    let color = colorous::VIRIDIS.eval_continuous(share.clamp(0.0, 1.0));
    Rgb([color.r, color.g, color.b])
}

fn draw_panel(map: &mut RgbImage, (left, top): (u32, u32), tiles: Tiles, panel: &Panel) {
    let end = end_of_scale(&panel.values);
    write_text(map, (left, top), panel.title);
    for (place, value) in panel.values.iter().enumerate() {
        let (x, y) = (place as u32 % tiles.width, place as u32 / tiles.width);
        map.put_pixel(left + x, top + TITLE + y, color(value / end));
    }
    let (width, below) = (tiles.width.max(NARROWEST), top + TITLE + tiles.height + 2);
    for x in 0..width {
        for y in 0..10 {
            map.put_pixel(left + x, below + y, color(f64::from(x) / f64::from(width - 1)));
        }
    }
    let most = panel.values.iter().copied().fold(0.0, f64::max);
    let last = if most > end { format!("{}+ (most {})", figure(end), figure(most)) } else { figure(end) };
    let row = below + 12;
    write_text(map, (left, row), "0");
    let middle = figure(end / 2.0);
    let length = |text: &str| text.len() as u32 * LETTER;
    write_text(map, (left + (width / 2).saturating_sub(length(&middle)), row), &middle);
    write_text(map, (left + width.saturating_sub(length(&last)), row), &last);
}

/// Three digits or so.
fn figure(value: f64) -> String {
    if value >= 100.0 { format!("{value:.0}") } else { format!("{value:.1}") }
}

/// ASCII, a letter every eight pixels.
fn write_text(map: &mut RgbImage, (left, top): (u32, u32), text: &str) {
    for (place, letter) in text.bytes().enumerate() {
        let Some(rows) = BASIC_LEGACY.get(usize::from(letter)) else { continue };
        for (y, row) in rows.iter().enumerate() {
            for x in (0..LETTER).filter(|x| row >> x & 1 == 1) {
                let (x, y) = (left + place as u32 * LETTER + x, top + y as u32);
                if x < map.width() && y < map.height() {
                    map.put_pixel(x, y, INK);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::work::RayWork;

    #[test]
    fn costs_are_coloured_where_they_arise() {
        let tiles = Tiles { width: 240, height: 9, jitters: 1 };
        let mut works = vec![Work::default(); tiles.padded_pixels() as usize];
        works[tiles.number(3, 2) as usize] = Work { closest_visits: 8, any_tests: 40, ..Work::default() };
        works[tiles.number(4, 2) as usize] = Work { closest_visits: 4, any_tests: 20, ..Work::default() };
        let (closest, any) = (RayWork::default(), RayWork::default());
        let work = WorkCount { pixels: works, camera_rays: 240 * 9, closest, any, repeats: 0 };
        let map = draw(&work, tiles, 4);
        let panel_high = TITLE + 9 + 2 + SCALE;
        let at = |column: u32, row: u32, x: u32, y: u32| {
            *map.get_pixel(
                MARGIN + column * (240 + MARGIN) + x,
                MARGIN + row * (panel_high + MARGIN) + TITLE + y,
            )
        };
        assert_eq!(at(0, 0, 3, 2), color(1.0));
        assert_eq!(at(0, 0, 4, 2), color(0.5));
        assert_eq!(at(0, 0, 5, 2), color(0.0));
        assert_eq!(at(1, 1, 3, 2), color(1.0));
        assert_eq!(at(1, 0, 3, 2), color(0.0), "no tests of camera rays");
        let dark = map.pixels().filter(|pixel| **pixel == INK).count();
        assert!(dark > 200, "titles and figures are written: {dark}");
    }

    #[test]
    fn the_scale_leaves_out_a_few_extremes() {
        let mut values: Vec<f64> = (1..=10_000).map(f64::from).collect();
        values.push(1e9);
        values.extend([0.0; 50_000]);
        let end = end_of_scale(&values);
        assert!((9_980.0..=10_000.0).contains(&end), "{end}");
        assert_eq!(end_of_scale(&[0.0; 4]), 1.0);
    }
}
