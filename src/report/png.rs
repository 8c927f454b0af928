//! Pictures for the eye: 8-bit PNG.

use std::io::{self, Write};

use image::{Rgb, RgbImage};

use super::manifest::Manifest;
use crate::lab::figure::Figure;
use crate::render::picture::Picture;

/// How light becomes a byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// IEC 61966-2-1, what screens expect.
    Srgb,
    Linear,
}

impl Encoding {
    /// The byte for light in [0, 1].
    pub fn byte(self, light: f32) -> u8 {
        let light = light.clamp(0.0, 1.0);
        let encoded = match self {
            Self::Linear => light,
            Self::Srgb if light <= 0.003_130_8 => 12.92 * light,
            Self::Srgb => 1.055 * light.powf(1.0 / 2.4) - 0.055,
        };
        (encoded * 255.0).round() as u8
    }
}

/// Writes the picture in grey, black where nothing was hit, with the manifest as a text chunk `cousu`.
pub fn write(
    picture: &Picture,
    encoding: Encoding,
    manifest: &Manifest,
    out: &mut dyn Write,
) -> io::Result<()> {
    let pixels = RgbImage::from_fn(picture.width, picture.height, |x, y| {
        let place = y as usize * picture.width as usize + x as usize;
        Rgb([encoding.byte(picture.light[place]); 3])
    });
    write_rgb(&pixels, encoding, manifest, out)
}

/// Writes an experiment's picture with the manifest as a text chunk `cousu`.
pub fn write_figure(figure: &Figure, manifest: &Manifest, out: &mut dyn Write) -> io::Result<()> {
    let pixels = RgbImage::from_fn(figure.width, figure.height, |x, y| {
        let place = y as usize * figure.width as usize + x as usize;
        Rgb(figure.pixels[place].map(|channel| Encoding::Srgb.byte(channel)))
    });
    write_rgb(&pixels, Encoding::Srgb, manifest, out)
}

/// Writes bytes that are encoded already, with the manifest.
pub fn write_rgb(
    pixels: &RgbImage,
    encoding: Encoding,
    manifest: &Manifest,
    out: &mut dyn Write,
) -> io::Result<()> {
    let mut encoder = png::Encoder::new(out, pixels.width(), pixels.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    if encoding == Encoding::Srgb {
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    } else {
        encoder.set_source_gamma(png::ScaledFloat::new(1.0));
    }
    encoder.add_text_chunk("cousu".into(), manifest.text())?;
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels.as_raw())?;
    writer.finish()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_meets_its_known_values() {
        for (light, byte) in
            [(0.0, 0), (1.0, 255), (0.5, 188), (0.215_860_5, 128), (0.212_230_76, 127), (0.002, 7)]
        {
            assert_eq!(Encoding::Srgb.byte(light), byte, "{light}");
        }
        assert_eq!(Encoding::Linear.byte(0.5), 128);
        assert_eq!(Encoding::Srgb.byte(2.0), 255);
    }
}
