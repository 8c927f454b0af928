//! Points of an earlier run that asked the same: read from its chart.json.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::chart::Record;
use crate::lab::chart::SceneFacts;
use crate::lab::chart::curves::Choices;
use crate::lab::chart::results::Point;

/// What an earlier run left.
#[derive(Default)]
pub struct Earlier {
    saved: Option<Value>,
}

impl Earlier {
    /// Nothing, if there is no file; the reason, if it can't be read.
    pub fn read(path: &Path) -> (Self, Option<String>) {
        let Ok(text) = fs::read(path) else { return (Self::default(), None) };
        match serde_json::from_slice::<Value>(&text) {
            Ok(saved) if saved["curves"].is_array() => (Self { saved: Some(saved) }, None),
            _ => {
                let note = format!("{} is no chart's record: it is written anew.", path.display());
                (Self::default(), Some(note))
            }
        }
    }

    /// In what the earlier run's question differs whatever the scene; `None` if in nothing.
    pub fn differs(&self, record: &Record) -> Option<String> {
        let saved = self.saved.as_ref()?;
        let now = serde_json::to_value(record).ok()?;
        for key in ["device", "driver", "size", "seed"] {
            if saved[key] != now[key] {
                return Some(format!("its {key} was {}", saved[key]));
            }
        }
        if saved["manifest"]["spirv_hash"] != now["manifest"]["spirv_hash"] {
            return Some("its kernels were others".into());
        }
        None
    }

    /// The same of a scene that it asked about.
    pub fn scene_differs(&self, facts: &SceneFacts) -> Option<String> {
        let scene = self.scene(&facts.scene)?;
        let now = serde_json::to_value(facts).ok()?;
        ["hash", "camera", "max_distance", "references"].into_iter().find_map(|key| {
            let name = if key == "hash" { "geometry" } else { key };
            (scene[key] != now[key]).then(|| format!("its {name} was {}", short(&scene[key])))
        })
    }

    /// Lets a record keep what is known of scenes whose turn has not come, so that it is not lost if the run is cut again.
    pub fn keep_in(&self, record: &mut Record, scenes: &[String]) {
        let Some(saved) = &self.saved else { return };
        let of = |list: &str| -> Vec<Value> {
            let wanted = |one: &&Value| scenes.iter().any(|scene| one["scene"] == **scene);
            saved[list].as_array().into_iter().flatten().filter(wanted).cloned().collect()
        };
        record.scenes.kept = of("scenes");
        record.curves.kept = of("curves");
        record.time_to_rmse.kept = of("time_to_rmse");
    }

    /// Whether it has curves of this scene that are not among these.
    pub fn has_others(&self, scene: &str, choices: &[&Choices]) -> bool {
        let now: Vec<Value> =
            choices.iter().filter_map(|choices| serde_json::to_value(choices).ok()).collect();
        let curves = self.saved.as_ref().and_then(|saved| saved["curves"].as_array());
        curves.into_iter().flatten().any(|curve| curve["scene"] == scene && !now.contains(&curve["choices"]))
    }

    /// Leaves out a scene of which it asked something else.
    pub fn forget(&mut self, scene: &str) {
        if let Some(curves) = self.saved.as_mut().and_then(|saved| saved["curves"].as_array_mut()) {
            curves.retain(|curve| curve["scene"] != scene);
        }
    }

    /// Names of the scenes it measured.
    pub fn scenes(&self) -> Vec<String> {
        let scenes = self.saved.as_ref().and_then(|saved| saved["scenes"].as_array());
        let name = |scene: &Value| scene["scene"].as_str().map(str::to_string);
        scenes.into_iter().flatten().filter_map(name).collect()
    }

    fn scene(&self, name: &str) -> Option<&Value> {
        self.saved.as_ref()?["scenes"].as_array()?.iter().find(|scene| scene["scene"] == name)
    }

    /// The points of the curve that made these choices.
    pub fn points(&self, scene: &str, choices: &Choices) -> Vec<Point> {
        let find = || -> Option<Vec<Point>> {
            let choices = serde_json::to_value(choices).ok()?;
            let curves = self.saved.as_ref()?["curves"].as_array()?;
            let curve = curves.iter().find(|curve| curve["scene"] == scene && curve["choices"] == choices)?;
            serde_json::from_value(curve["points"].clone()).ok()
        };
        let mut points = find().unwrap_or_default();
        points.retain(|point| point.spp > 0 && point.gpu_ms.is_finite());
        points.sort_by_key(|point| point.spp);
        points.dedup_by_key(|point| point.spp);
        points
    }
}

/// Values may be long.
fn short(value: &Value) -> String {
    let text: String = value.to_string().chars().take(80).collect();
    if text.len() < 80 { text } else { "another".into() }
}
