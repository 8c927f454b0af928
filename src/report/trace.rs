//! A timeline of host and device in Chrome's trace event format: "X" events with times in microseconds, read by
//! Perfetto and chrome://tracing.
//! <https://docs.google.com/document/d/1CvAClvFfyA5R-PhYUmn5OOQtYMH4h6I0nSsKchNAySU>

use std::io;
use std::time::Instant;

use serde::Serialize;
use serde_json::{Value, json};

use super::atomic::WriteSeek;
use super::manifest::Manifest;
use crate::render::spans::{Spans, Submit};
use crate::vk::Calibration;

/// Processes of the trace, one a clock, and their threads.
const HOST: u32 = 1;
const DEVICE: u32 = 2;
const TRACK: u32 = 1;
/// The host's second thread.
const BESIDE: u32 = 2;

/// How times of the device came onto the host's clock.
enum Alignment<'a> {
    Calibrated(&'a Calibration),
    /// This time of the device's clock is taken for that moment of the host's.
    FirstSubmit(u64, Instant),
    NoTimestamps,
}

/// The timeline of a render.
pub struct Timeline<'a> {
    spans: &'a Spans,
    manifest: &'a Manifest,
    alignment: Alignment<'a>,
}

#[derive(Serialize)]
struct Event {
    name: String,
    ph: &'static str,
    pid: u32,
    tid: u32,
    /// Microseconds since the program began.
    #[serde(skip_serializing_if = "Option::is_none")]
    ts: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    dur: Option<f64>,
    args: Value,
}

impl Event {
    /// `times`: begin and end, ns.
    fn span(name: &str, pid: u32, times: (f64, f64), args: Value) -> Self {
        // Whole ns, so that spans which touch do so exactly.
        let (begin, end) = (times.0.round(), times.1.round());
        Self {
            name: name.to_string(),
            ph: "X",
            pid,
            tid: TRACK,
            ts: Some(begin / 1e3),
            dur: Some((end - begin).max(0.0) / 1e3),
            args,
        }
    }

    fn label(what: &str, pid: u32, name: &str) -> Self {
        let args = json!({ "name": name });
        Self { name: what.to_string(), ph: "M", pid, tid: TRACK, ts: None, dur: None, args }
    }
}

impl<'a> Timeline<'a> {
    /// `calibration` places what the device did; without it the first dispatch starts with its submit.
    pub fn new(spans: &'a Spans, calibration: Option<&'a Calibration>, manifest: &'a Manifest) -> Self {
        let first = spans.submits.iter().find_map(|submit| {
            let start = submit.finished.timings.iter().find_map(|timing| timing.start_ns)?;
            Some((start, submit.finished.host.submit))
        });
        let alignment = match (first, calibration) {
            (None, _) => Alignment::NoTimestamps,
            (_, Some(calibration)) => Alignment::Calibrated(calibration),
            (Some((start, submit)), None) => Alignment::FirstSubmit(start, submit),
        };
        Self { spans, manifest, alignment }
    }

    /// What a reader has to know about the device's track, if it is not what it seems.
    pub fn note(&self) -> Option<&'static str> {
        match self.alignment {
            Alignment::Calibrated(_) => None,
            Alignment::FirstSubmit(..) => Some(
                "The device's clock can't be read from the host: in the timeline its first dispatch starts with its \
                 submit.",
            ),
            Alignment::NoTimestamps => {
                Some("The device has no timestamps: the timeline shows only what the host did.")
            }
        }
    }

    /// Writes the whole file.
    pub fn write(&self, out: &mut dyn WriteSeek) -> io::Result<()> {
        let file = json!({
            "traceEvents": self.events(),
            "displayTimeUnit": "ms",
            "otherData": {
                "manifest": self.manifest,
                "device_clock": match self.alignment {
                    Alignment::Calibrated(_) => "calibrated",
                    Alignment::FirstSubmit(..) => "aligned with the first submit",
                    Alignment::NoTimestamps => "none",
                },
                "device_clock_deviation_us": match self.alignment {
                    Alignment::Calibrated(calibration) => Some(calibration.deviation_ns() as f64 / 1e3),
                    _ => None,
                },
                "note": self.note(),
            },
        });
        serde_json::to_writer(&mut *out, &file)?;
        out.write_all(b"\n")
    }

    fn events(&self) -> Vec<Event> {
        let mut spans = Vec::new();
        for span in &self.spans.phases {
            let event = Event::span(span.name, HOST, (self.host(span.begin), self.host(span.end)), json!({}));
            spans.push(Event { tid: if span.beside { BESIDE } else { TRACK }, ..event });
        }
        for (number, submit) in self.spans.submits.iter().enumerate() {
            self.add_submit(number, submit, &mut spans);
        }
        // What lies within another span stands after it.
        let order =
            |event: &Event| (event.pid, event.tid, event.ts.unwrap_or(0.0), -event.dur.unwrap_or(0.0));
        spans.sort_by(|a, b| order(a).partial_cmp(&order(b)).unwrap_or(std::cmp::Ordering::Equal));
        let mut events = vec![
            Event::label("process_name", HOST, "host"),
            Event::label("thread_name", HOST, "cousu"),
            Event { tid: BESIDE, ..Event::label("thread_name", HOST, "cousu, beside") },
            Event::label("process_name", DEVICE, &self.manifest.device),
            Event::label("thread_name", DEVICE, "queue"),
        ];
        events.append(&mut spans);
        events
    }

    fn add_submit(&self, number: usize, submit: &Submit, events: &mut Vec<Event>) {
        let timings = &submit.finished.timings;
        let host = submit.finished.host;
        let about = json!({ "submit": number, "dispatches": timings.len(), "rays": submit.rays });
        for (name, begin, end) in [
            ("record", host.record, host.submit),
            ("submit", host.submit, host.submitted),
            ("wait", host.wait, host.waited),
            ("read timestamps", host.waited, host.read),
        ] {
            events.push(Event::span(name, HOST, (self.host(begin), self.host(end)), about.clone()));
        }
        for (place, timing) in timings.iter().enumerate() {
            let (Some(start), Some(end)) = (timing.start_ns, timing.end_ns) else { continue };
            let (Some(start), Some(end)) = (self.device(start), self.device(end)) else { continue };
            let mut args =
                json!({ "submit": number, "gpu_ms": timing.gpu_ms, "rays_of_submit": submit.rays });
            if let Some(range) = submit.ranges.get(place) {
                args["pixels"] = json!([range.pixel_begin, range.pixel_end]);
                args["samples"] = json!([range.sample_begin, range.sample_end]);
                args["triangles"] = json!([range.triangle_begin, range.triangle_end]);
            }
            events.push(Event::span(&timing.label, DEVICE, (start, end), args));
        }
    }

    /// A moment of the host as ns since the timeline began.
    fn host(&self, moment: Instant) -> f64 {
        moment.saturating_duration_since(self.spans.origin).as_nanos() as f64
    }

    /// A time of the device's clock as ns since the timeline began.
    fn device(&self, device_ns: u64) -> Option<f64> {
        match self.alignment {
            Alignment::Calibrated(calibration) => Some(calibration.host_ns(device_ns, self.spans.origin)),
            Alignment::FirstSubmit(start, submit) => {
                Some(self.host(submit) + (i128::from(device_ns) - i128::from(start)) as f64)
            }
            Alignment::NoTimestamps => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::Range;
    use crate::vk::{Finished, HostTimes, Pair, Timing};
    use std::time::Duration;

    /// One submit of one dispatch, recorded from 1 to 2 ms, done at 9 ms; 5 ms on the device.
    fn spans(timestamps: bool) -> Spans {
        let origin = Instant::now();
        let at = |ms| origin + Duration::from_millis(ms);
        let mut spans = Spans::new(origin);
        let host = HostTimes {
            record: at(1),
            submit: at(2),
            submitted: at(3),
            wait: at(3),
            waited: at(9),
            read: at(9),
        };
        let timing = Timing {
            label: "kernel".into(),
            gpu_ms: timestamps.then_some(5.0),
            start_ns: timestamps.then_some(1_000_000_000),
            end_ns: timestamps.then_some(1_005_000_000),
        };
        let finished = Finished { timings: vec![timing], host };
        spans.submits.push(Submit { ranges: vec![Range::default()], rays: 7, finished });
        spans
    }

    fn manifest() -> Manifest {
        Manifest {
            version: "0",
            command: String::new(),
            device: "a device".into(),
            driver: String::new(),
            scene_hash: String::new(),
            spirv_hash: String::new(),
            seed: 0,
        }
    }

    fn file(timeline: &Timeline<'_>) -> Value {
        let mut out = io::Cursor::new(Vec::new());
        timeline.write(&mut out).unwrap();
        serde_json::from_slice(out.get_ref()).unwrap()
    }

    fn device_spans(file: &Value) -> Vec<(f64, f64)> {
        let events = file["traceEvents"].as_array().unwrap().iter();
        let spans = events.filter(|event| event["pid"] == DEVICE && event["ph"] == "X");
        spans.map(|event| (event["ts"].as_f64().unwrap(), event["dur"].as_f64().unwrap())).collect()
    }

    #[test]
    fn a_device_without_calibration_is_aligned_and_says_so() {
        let (spans, manifest) = (spans(true), manifest());
        let timeline = Timeline::new(&spans, None, &manifest);
        assert!(timeline.note().is_some());
        let file = file(&timeline);
        assert_eq!(device_spans(&file), [(2000.0, 5000.0)]);
        assert!(file["otherData"]["note"].as_str().unwrap().contains("submit"));
    }

    #[test]
    fn a_calibrated_device_is_where_its_clock_says() {
        let (spans, manifest) = (spans(true), manifest());
        let pair =
            Pair { device_ns: 999_000_000, host: spans.origin + Duration::from_millis(2), deviation_ns: 5 };
        let calibration = Calibration::of_pairs(pair, pair, None);
        let timeline = Timeline::new(&spans, Some(&calibration), &manifest);
        assert!(timeline.note().is_none());
        assert_eq!(device_spans(&file(&timeline)), [(3000.0, 5000.0)]);
    }

    #[test]
    fn a_device_without_timestamps_has_no_spans() {
        let (spans, manifest) = (spans(false), manifest());
        let timeline = Timeline::new(&spans, None, &manifest);
        assert!(timeline.note().is_some_and(|note| note.contains("no timestamps")));
        assert!(device_spans(&file(&timeline)).is_empty());
    }
}
