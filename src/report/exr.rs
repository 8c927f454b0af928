//! Pictures for further work: 32-bit float OpenEXR, linear, premultiplied by coverage.

use std::io;

use exr::prelude::{
    AttributeValue, Encoding, Image, Layer, LayerAttributes, SpecificChannels, Text, Vec2, WritableImage,
};

use super::atomic::WriteSeek;
use super::manifest::Manifest;
use crate::render::picture::Picture;

/// Writes R = G = B = light, A = coverage, with the manifest as attribute `cousu`.
pub fn write(picture: &Picture, manifest: &Manifest, out: &mut dyn WriteSeek) -> io::Result<()> {
    write_with_texts(picture, &[("cousu", manifest.text())], out)
}

/// The same with any attributes, by name.
pub fn write_with_texts(
    picture: &Picture,
    texts: &[(&str, String)],
    out: &mut dyn WriteSeek,
) -> io::Result<()> {
    let width = picture.width as usize;
    let channels = SpecificChannels::rgba(|place: Vec2<usize>| {
        let index = place.y() * width + place.x();
        let light = picture.light[index];
        (light, light, light, picture.coverage[index])
    });
    let mut attributes = LayerAttributes::default();
    for (name, text) in texts {
        let text = Text::new_or_none(text).unwrap_or_default();
        if let Some(name) = Text::new_or_none(name) {
            attributes.other.insert(name, AttributeValue::Text(text));
        }
    }
    let size = (width, picture.height as usize);
    let image = Image::from_layer(Layer::new(size, attributes, Encoding::SMALL_FAST_LOSSLESS, channels));
    image.write().to_buffered(out).map_err(|error| match error {
        exr::error::Error::Io(error) => error,
        other => io::Error::other(other.to_string()),
    })
}
