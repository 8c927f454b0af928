//! The timeline of a render, read as a viewer reads it.

use std::fs;
use std::process::Command;

use serde_json::Value;

const CORNELL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/cornell.obj");
/// A reading of both clocks may be this far apart on a busy machine, microseconds.
const SLACK_US: f64 = 2000.0;

/// A span: name, begin and end in microseconds, arguments.
struct Span<'a> {
    name: &'a str,
    thread: u64,
    begin: f64,
    end: f64,
    args: &'a Value,
}

/// Spans of the process that bears this name.
fn spans_of<'a>(events: &'a [Value], process: &str) -> Vec<Span<'a>> {
    let label = |event: &&Value| event["name"] == "process_name" && event["args"]["name"] == process;
    let pid = &events.iter().find(label).unwrap_or_else(|| panic!("no process {process}"))["pid"];
    let spans = events.iter().filter(|event| event["ph"] == "X" && event["pid"] == *pid);
    spans
        .map(|event| {
            let begin = event["ts"].as_f64().unwrap();
            let end = begin + event["dur"].as_f64().unwrap();
            let (name, thread) = (event["name"].as_str().unwrap(), event["tid"].as_u64().unwrap());
            Span { name, thread, begin, end, args: &event["args"] }
        })
        .collect()
}

/// Each span lies within another one of its thread or apart from it.
fn assert_nested(spans: &[Span<'_>]) {
    let mut open: Vec<&Span<'_>> = Vec::new();
    for span in spans {
        // Times are thousandths; sums of them are not.
        while open.last().is_some_and(|last| last.end <= span.begin + 1e-4 || last.thread != span.thread) {
            open.pop();
        }
        if let Some(last) = open.last() {
            assert!(
                span.begin >= last.begin && span.end <= last.end + 1e-4,
                "{} in {}",
                span.name,
                last.name
            );
        }
        open.push(span);
    }
}

fn traced(arguments: &[&str]) -> (Value, Value, String) {
    let folder = tempfile::tempdir().unwrap();
    let (trace, json) = (folder.path().join("trace.json"), folder.path().join("record.json"));
    let output = Command::new(env!("CARGO_BIN_EXE_cousu"))
        .args(["render", CORNELL, "--validate", "-o"])
        .arg(folder.path().join("picture.png"))
        .arg("--trace")
        .arg(&trace)
        .arg("--json")
        .arg(&json)
        .args(arguments)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && !said.contains("validation:"), "{said}");
    let read = |path| serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    (read(trace), read(json), said)
}

#[test]
fn the_timeline_shows_each_dispatch_within_its_submit() {
    // Brute force and a limited accumulator make several dispatches and several submits.
    for arguments in [
        &["--size", "64x40", "--spp", "16"][..],
        &["--size", "64x40", "--spp", "32", "--accumulator", "rgba32f"],
        &["--size", "256x160", "--spp", "64", "--method", "brute"],
        &["--size", "128x80", "--spp", "16", "--passes", "split"],
        &["--size", "128x80", "--spp", "16", "--passes", "staged"],
    ] {
        let (trace, record, said) = traced(arguments);
        let events = trace["traceEvents"].as_array().unwrap();
        let host = spans_of(events, "host");
        let device = spans_of(events, record["device"].as_str().unwrap());
        assert_nested(&host);
        assert_nested(&device);
        for name in [
            "open device",
            "load scene",
            "build tree",
            "pack and upload",
            "compile kernels",
            "render",
            "write results",
        ] {
            assert_eq!(host.iter().filter(|span| span.name == name).count(), 1, "{name}");
        }
        if trace["otherData"]["device_clock"] == "none" {
            assert!(device.is_empty() && said.contains("no timestamps"), "{said}");
            continue;
        }
        let calibrated = trace["otherData"]["device_clock"] == "calibrated";
        assert_ne!(calibrated, said.contains("timeline"), "{said}");

        let kernels = record["kernels"].as_array().unwrap();
        for kernel in kernels {
            let own: Vec<_> = device.iter().filter(|span| span.name == kernel["name"]).collect();
            assert_eq!(own.len() as u64, kernel["dispatches"].as_u64().unwrap());
            let told: f64 = own.iter().map(|span| span.args["gpu_ms"].as_f64().unwrap()).sum();
            let drawn: f64 = own.iter().map(|span| (span.end - span.begin) * 1e-3).sum();
            let recorded = kernel["gpu_ms"].as_f64().unwrap();
            assert!((told - recorded).abs() <= 1e-9 * recorded, "{told} {recorded}");
            // Drawn in whole nanoseconds, on the host's clock.
            assert!(
                (drawn - recorded).abs() <= 1e-3 * recorded + 1e-6 * own.len() as f64,
                "{drawn} {recorded}"
            );
        }
        assert_eq!(
            device.len() as u64,
            kernels.iter().map(|k| k["dispatches"].as_u64().unwrap()).sum::<u64>()
        );

        let of_submit = |name: &str, number: &Value| {
            host.iter().find(|span| span.name == name && span.args["submit"] == *number).unwrap()
        };
        for span in &device {
            let (submit, wait) =
                (of_submit("submit", &span.args["submit"]), of_submit("wait", &span.args["submit"]));
            assert!(submit.begin - SLACK_US <= span.begin, "{} {}", submit.begin, span.begin);
            assert!(!calibrated || span.end <= wait.end + SLACK_US, "{} {}", span.end, wait.end);
            let pixels = span.args["pixels"].as_array().unwrap();
            assert!(pixels[0].as_u64() < pixels[1].as_u64());
        }
        let rays: u64 = host
            .iter()
            .filter(|span| span.name == "wait")
            .map(|span| span.args["rays"].as_u64().unwrap())
            .sum();
        let recorded = ["primary_rays", "ambient_rays"].map(|key| record[key].as_u64().unwrap());
        assert_eq!(rays, recorded.iter().sum::<u64>());
    }
}
