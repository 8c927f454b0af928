//! Reading pictures from OpenEXR files.

use std::fs;
use std::io::{self, Cursor};
use std::path::Path;

use exr::image::{AnyChannels, FlatSamples};
use exr::meta::MetaData;
use exr::prelude::{AttributeValue, ReadChannels, ReadLayers};

use crate::error::{Error, Result};
use crate::render::picture::Picture;

/// A picture and the texts that its file carries, by name.
pub struct Read {
    pub picture: Picture,
    pub texts: Vec<(String, String)>,
}

impl Read {
    pub fn text(&self, name: &str) -> Option<&str> {
        self.texts.iter().find(|(known, _)| known == name).map(|(_, text)| text.as_str())
    }
}

/// Channels that hold the light, in the order of preference: in a picture of ambient light all colours are equal.
const LIGHT: [&str; 4] = ["R", "Y", "G", "B"];
const COVERAGE: &str = "A";

/// Reads a picture that must have this size. Light is premultiplied by coverage, as `render` writes it.
pub fn read(path: &Path, size: (u32, u32)) -> Result<Read> {
    let shown = path.display();
    let bytes = fs::read(path).map_err(|error| {
        let advice = match error.kind() {
            io::ErrorKind::NotFound => "there is no such file: check its name".to_string(),
            io::ErrorKind::PermissionDenied => {
                "permission was denied: change it or copy the file".to_string()
            }
            _ => format!("{error}: choose another file"),
        };
        Error::input(format!("{shown} could not be read, {advice}."))
    })?;
    decode(&bytes, size).map_err(|reason| Error::input(format!("{shown} {reason}.")))
}

/// The reason is the rest of a sentence that begins with the file's name.
fn decode(bytes: &[u8], (width, height): (u32, u32)) -> std::result::Result<Read, String> {
    let not_readable = |error: exr::error::Error| match error {
        exr::error::Error::NotSupported(what) => {
            format!("is an EXR of a kind that is not read ({what}): save it flat, as scan lines")
        }
        error => format!("is not a whole EXR file ({error}): write it again, for instance with cousu render"),
    };
    // The size first: what a header promises is allocated.
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(not_readable)?;
    let header = meta.headers.iter().find(|header| !header.deep).ok_or("has no flat layer: save it flat")?;
    let found = header.layer_size;
    if (found.x(), found.y()) != (width as usize, height as usize) {
        return Err(format!(
            "is {}x{} pixels where the pictures are {width}x{height}: choose --size {}x{} or another reference",
            found.x(),
            found.y(),
            found.x(),
            found.y()
        ));
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(not_readable)?;
    let layer = image.layer_data;
    let light = LIGHT.iter().find_map(|name| channel(&layer.channel_data, name));
    let light = light.ok_or("has no channel R, Y, G or B: it holds no light")?;
    let coverage = channel(&layer.channel_data, COVERAGE).ok_or(
        "has no channel A, so that it is not known which pixels are covered: write it with cousu render, or add one",
    )?;
    let pixels = width as usize * height as usize;
    if light.len() != pixels || coverage.len() != pixels {
        return Err("has channels of a lower resolution: save all of them in full".into());
    }
    if let Some(place) = light.iter().chain(&coverage).position(|value| !value.is_finite()) {
        let place = place % pixels;
        return Err(format!(
            "has a pixel that is no number, in column {} of row {}: mend it or choose another reference",
            place % width as usize,
            place / width as usize
        ));
    }
    let texts = layer.attributes.other.iter().filter_map(|(name, value)| match value {
        AttributeValue::Text(text) => Some((name.to_string(), text.to_string())),
        _ => None,
    });
    let texts = texts.collect();
    Ok(Read { picture: Picture { width, height, light, coverage }, texts })
}

fn channel(channels: &AnyChannels<FlatSamples>, name: &str) -> Option<Vec<f32>> {
    let found = channels.list.iter().find(|channel| channel.name == *name)?;
    Some(found.sample_data.values_as_f32().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::exr;

    fn picture() -> Picture {
        let light: Vec<f32> = (0..12).map(|i| i as f32 / 11.0).collect();
        Picture { width: 4, height: 3, coverage: light.iter().map(|l| l.ceil()).collect(), light }
    }

    fn written(picture: &Picture, texts: &[(&str, String)]) -> Vec<u8> {
        let mut out = Cursor::new(Vec::new());
        exr::write_with_texts(picture, texts, &mut out).unwrap();
        out.into_inner()
    }

    fn reason(bytes: &[u8], size: (u32, u32)) -> String {
        decode(bytes, size).err().expect("it is refused")
    }

    #[test]
    fn a_picture_and_its_texts_come_back_bit_for_bit() {
        let read = decode(&written(&picture(), &[("cousu", "{}".into()), ("more", "a b".into())]), (4, 3));
        let read = read.unwrap();
        assert_eq!(read.picture, picture());
        assert_eq!(
            (read.text("cousu"), read.text("more"), read.text("none")),
            (Some("{}"), Some("a b"), None)
        );
    }

    #[test]
    fn what_is_no_such_picture_is_refused_with_its_reason() {
        let good = written(&picture(), &[]);
        assert!(reason(&good, (3, 4)).contains("4x3 pixels where the pictures are 3x4"));
        assert!(reason(b"not an exr", (4, 3)).contains("not a whole EXR"));
        assert!(reason(&[], (4, 3)).contains("not a whole EXR"));
        for length in (0..good.len()).step_by(7) {
            decode(&good[..length], (4, 3)).err().expect("cut short");
        }
        let mut broken = picture();
        broken.light[6] = f32::NAN;
        assert!(reason(&written(&broken, &[]), (4, 3)).contains("column 2 of row 1"));
        let missing = read(Path::new("no-such.exr"), (4, 3)).err().unwrap().to_string();
        assert!(missing.contains("no-such.exr could not be read, there is no such file"), "{missing}");
    }

    /// Whatever a byte is changed to, there is an answer.
    #[test]
    fn damaged_files_do_no_harm() {
        let good = written(&picture(), &[("cousu", "{}".into())]);
        for place in 0..good.len() {
            for change in [1, 0x80, 0xff] {
                let mut bad = good.clone();
                bad[place] ^= change;
                let _ = decode(&bad, (4, 3));
            }
        }
    }

    #[test]
    fn a_file_without_coverage_is_refused() {
        use ::exr::prelude::*;
        let channels = SpecificChannels::rgb(|_: Vec2<usize>| (0.5f32, 0.5f32, 0.5f32));
        let mut out = Cursor::new(Vec::new());
        Image::from_channels((4, 3), channels).write().to_buffered(&mut out).unwrap();
        assert!(reason(&out.into_inner(), (4, 3)).contains("no channel A"));
    }
}
