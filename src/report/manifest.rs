//! Where a result comes from: written into every output.

use serde::Serialize;

use crate::kernels::SPIRV_HASH;
use crate::scene::Scene;
use crate::vk::Adapter;

/// Enough to make the result again, and to tell whether it would be the same.
#[derive(Clone, Debug, Serialize)]
pub struct Manifest {
    pub version: &'static str,
    pub command: String,
    pub device: String,
    pub driver: String,
    /// Of the triangles, hexadecimal.
    pub scene_hash: String,
    /// Of all kernels, hexadecimal.
    pub spirv_hash: String,
    pub seed: u32,
}

impl Manifest {
    pub fn new(scene: &Scene, adapter: &Adapter, seed: u32) -> Self {
        Self::of_several(&[scene.hash], adapter, seed)
    }

    /// Of a result from several scenes, given the hashes of their triangles: one hash for all of them.
    pub fn of_several(scenes: &[u64], adapter: &Adapter, seed: u32) -> Self {
        let scene_hash = match scenes {
            [one] => *one,
            several => xxhash_rust::xxh3::xxh3_64(bytemuck::cast_slice(several)),
        };
        let command: Vec<String> =
            std::env::args_os().map(|argument| quoted(&argument.to_string_lossy())).collect();
        Self {
            version: env!("CARGO_PKG_VERSION"),
            command: command.join(" "),
            device: adapter.name.clone(),
            driver: adapter.driver.clone(),
            scene_hash: format!("{scene_hash:016x}"),
            spirv_hash: format!("{SPIRV_HASH:016x}"),
            seed,
        }
    }

    /// One line of JSON in ASCII, fit for a PNG text chunk and an EXR attribute.
    pub fn text(&self) -> String {
        let json = serde_json::to_string(self).unwrap_or_default();
        let mut text = String::with_capacity(json.len());
        for letter in json.chars() {
            if letter.is_ascii() {
                text.push(letter);
            } else {
                let mut units = [0; 2];
                for unit in letter.encode_utf16(&mut units) {
                    text += &format!("\\u{unit:04x}");
                }
            }
        }
        text
    }
}

/// An argument as a shell would need it.
fn quoted(argument: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+@%".contains(c);
    if !argument.is_empty() && argument.chars().all(plain) {
        argument.to_string()
    } else {
        format!("'{}'", argument.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_is_ascii_json_that_reads_back() {
        let manifest = Manifest {
            version: "1",
            command: format!("cousu render {}", quoted("l'été 🌞.obj")),
            device: "d".into(),
            driver: "e".into(),
            scene_hash: "0".into(),
            spirv_hash: "1".into(),
            seed: 7,
        };
        let text = manifest.text();
        assert!(text.is_ascii());
        let back: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(back["command"], "cousu render 'l'\\''été 🌞.obj'");
        assert_eq!(back["seed"], 7);
    }
}
