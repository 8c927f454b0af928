//! The program as a person or a script meets it: files, JSON, exit codes, sentences.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const CORNELL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/cornell.obj");
const MAISON: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/maison.obj");

fn cousu(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cousu")).args(arguments).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Expects success and returns the standard output.
fn succeeds(arguments: &[&str]) -> String {
    let output = cousu(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

/// Expects this exit code and one sentence that contains `words`.
fn fails(arguments: &[&str], code: i32, words: &str) {
    let output = cousu(arguments);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
    assert!(said.contains(words), "{arguments:?}: {said}");
    assert!(!said.contains("panicked"), "{said}");
    if code != 2 {
        let sentences: Vec<&str> = said.lines().filter(|line| line.starts_with("cousu: ")).collect();
        assert_eq!(sentences.len(), 1, "{said}");
        assert!(sentences[0].ends_with('.'), "{said}");
    }
}

fn path(folder: &Path, name: &str) -> String {
    folder.join(name).to_string_lossy().into_owned()
}

#[test]
fn a_render_writes_png_exr_and_json_with_the_manifest() {
    let folder = tempfile::tempdir().unwrap();
    let (png, exr, json) =
        (path(folder.path(), "a.png"), path(folder.path(), "a.exr"), path(folder.path(), "a.json"));
    let common = ["render", CORNELL, "--size", "50x30", "--spp", "8", "--seed", "3", "--validate"];
    let summary = succeeds(&[&common[..], &["-o", &png, "--json", &json]].concat());
    for words in ["device", "bundle", "kernel", " ms in ", "Mrays/s"] {
        assert!(summary.contains(words), "{summary}");
    }
    succeeds(&[&common[..], &["-o", &exr]].concat());

    let record: serde_json::Value = serde_json::from_slice(&fs::read(&json).unwrap()).unwrap();
    for key in [
        "device",
        "driver",
        "scene",
        "size",
        "spp",
        "method",
        "builder",
        "passes",
        "sampler",
        "accumulator",
        "offset",
        "intersector",
        "slabs",
        "camera",
        "seed",
        "kernels",
        "primary_rays",
        "ambient_rays",
        "ambient_mrays_per_s",
        "mrays_per_s",
        "max_stack",
        "overflowed_rays",
        "rmse_estimate",
        "build_ms",
        "load_ms",
        "wall_s",
        "manifest",
    ] {
        assert!(record.get(key).is_some(), "{key} is missing");
    }
    assert_eq!(record["scene"]["triangles"], 32);
    assert_eq!(record["size"], serde_json::json!([50, 30]));
    assert_eq!(record["primary_rays"], 1500);
    assert!(record["kernels"][0]["gpu_ms"].as_f64().unwrap() > 0.0);
    assert!(record["manifest"]["command"].as_str().unwrap().contains("--seed 3"));

    let decoder = png::Decoder::new(std::io::BufReader::new(fs::File::open(&png).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    let info = reader.info();
    assert_eq!((info.width, info.height), (50, 30));
    let chunk = info.uncompressed_latin1_text.iter().find(|chunk| chunk.keyword == "cousu").unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&chunk.text).unwrap();
    assert_eq!(manifest["scene_hash"], record["scene"]["hash"]);

    let image = exr::prelude::read_first_rgba_layer_from_file(
        &exr,
        |size, _| vec![vec![(0f32, 0f32, 0f32, 0f32); size.width()]; size.height()],
        |rows, place, pixel: (f32, f32, f32, f32)| rows[place.y()][place.x()] = pixel,
    )
    .unwrap();
    assert!(image.layer_data.attributes.other.contains_key(&exr::prelude::Text::from("cousu")));
    let rows = &image.layer_data.channel_data.pixels;
    let mut hits = 0;
    for (y, row) in rows.iter().enumerate() {
        for (x, &(r, g, b, a)) in row.iter().enumerate() {
            assert!(r == g && g == b && (0.0..=1.0).contains(&r) && (a == 0.0 || a == 1.0));
            assert!(r <= a, "light is premultiplied");
            let byte = bytes[(y * 50 + x) * 3];
            assert_eq!(
                byte,
                cousu::report::png::Encoding::Srgb.byte(r),
                "PNG and EXR show the same at {x},{y}"
            );
            hits += u64::from(a == 1.0);
        }
    }
    assert_eq!(record["ambient_rays"], hits * 8);
    // The floor is brighter near the opening, which is in front: row 0 is at the top.
    assert!(rows[29].iter().map(|pixel| pixel.3).sum::<f32>() > 0.0);
}

#[test]
fn the_same_command_gives_the_same_bytes_on_standard_output_or_in_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let png = path(folder.path(), "a.png");
    let render = || {
        succeeds(&["render", CORNELL, "--size", "40x25", "--spp", "4", "-o", &png]);
        fs::read(&png).unwrap()
    };
    assert!(render() == render());
    let json = succeeds(&["render", CORNELL, "--size", "9x5", "--spp", "1", "--json", "-"]);
    let record: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(record["rmse_estimate"], serde_json::Value::Null, "one ray has no two halves");
}

#[test]
fn a_render_stops_at_an_error_or_a_time_and_says_what_it_took() {
    let render = |options: &[&str]| -> serde_json::Value {
        let common = ["render", CORNELL, "--size", "64x40", "--json", "-"];
        serde_json::from_str(&succeeds(&[&common[..], options].concat())).unwrap()
    };
    let record = render(&["--target-rmse", "0.03"]);
    let error = record["rmse_estimate"].as_f64().unwrap();
    assert!(error <= 0.03 && error > 0.015, "{record}");
    assert_eq!(record["target_rmse"], 0.03);
    assert!(record["spp"].as_u64().unwrap() > 16, "{record}");
    assert!(render(&["--time", "0.5"])["spp"].as_u64().unwrap() >= 16);
    let record = render(&["--adaptive", "--spp", "32", "--antialias", "4"]);
    assert_eq!((&record["adaptive"], &record["antialias"]), (&true.into(), &4.into()));
    let spp = record["spp"].as_u64().unwrap();
    assert!((24..=36).contains(&spp), "{spp}");
    assert_eq!(render(&["--antialias", "6"])["spp"], 72, "the default is rounded up");
}

#[test]
fn bad_command_lines_exit_with_2() {
    for (arguments, words) in [
        (vec!["render"], "SCENE"),
        (vec!["render", CORNELL, "--size", "0x5"], "1024x640"),
        (vec!["render", CORNELL, "--size", "99999x5"], "limit"),
        (vec!["render", CORNELL, "--spp", "0"], "--spp"),
        (vec!["render", CORNELL, "--method", "stack0"], "entries"),
        (vec!["render", CORNELL, "--method", "magic"], "stackN"),
        (vec!["render", CORNELL, "--preset", "original", "--spp", "6"], "multiple"),
        (vec!["render", CORNELL, "--eye", "1,2"], "three numbers"),
        (vec!["render", CORNELL, "--eye", "0,0,1", "--target", "0,0,1"], "same point"),
        (vec!["render", CORNELL, "--eye", "0,5,0", "--target", "0,0,0"], "--up"),
        (vec!["render", CORNELL, "--eye", "0,0,5", "--fov", "180"], "--fov"),
        (vec!["render", CORNELL, "--eye", "0,0,5", "--orbit", "1,2"], "cannot be used with"),
        (vec!["render", CORNELL, "--eye", "1e30,0,0"], "closer"),
        (vec!["render", CORNELL, "--eye", "0,1,5", "--fov", "1e-9"], "--fov"),
        (vec!["render", CORNELL, "-o", "picture.jpg"], ".png"),
        (vec!["render", CORNELL, "-o", "/"], ".png"),
        (vec!["render", MAISON, "--method", "stack8", "--size", "8x8"], "--allow-overflow"),
        (vec!["render", CORNELL, "--target-rmse", "0"], "0.01"),
        (vec!["render", CORNELL, "--target-rmse", "0.1", "--spp", "4"], "cannot be used with"),
        (vec!["render", CORNELL, "--time", "0"], "2.5"),
        (vec!["render", CORNELL, "--time", "1", "--accumulator", "rgba32f"], "--accumulator count"),
        (vec!["render", CORNELL, "--adaptive", "--preset", "original"], "--accumulator count"),
        (vec!["render", CORNELL, "--antialias", "3", "--spp", "64"], "multiple of 3"),
        (vec!["scene", "castle", "-o", "x.obj"], "maison"),
        (vec!["scene", "cornell", "--triangles", "9", "-o", "x.obj"], "cornell"),
        (vec!["scene", "maison", "--triangles", "9", "-o", "x.obj"], "2000000"),
        (vec!["fly"], "fly"),
    ] {
        fails(&arguments, 2, words);
    }
}

#[test]
fn bad_scenes_exit_with_3() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, content: &[u8]| {
        let path = path(folder.path(), name);
        fs::write(&path, content).unwrap();
        path
    };
    let missing = path(folder.path(), "missing.obj");
    let folder_path = folder.path().to_string_lossy().into_owned();
    for scene in [
        missing,
        folder_path,
        file("empty.obj", b""),
        file("binary.obj", &[0, 159, 146, 150, 0, 1, 2, 3]),
        file("none.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"),
        file("before.obj", b"f 1 2 3\n"),
        file("zero.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n"),
        file("range.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n"),
        file("nan.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        file("flat.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"),
        file("long.obj", &[b'v'; 3 << 20]),
    ] {
        for command in ["render", "inspect", "plan"] {
            fails(&[command, &scene], 3, &scene);
        }
    }
}

#[test]
fn places_that_cannot_be_written_leave_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let nowhere = path(folder.path(), "no/such/folder/a.png");
    fails(&["render", CORNELL, "--size", "8x8", "-o", &nowhere], 1, "folder does not exist");
    fails(&["render", CORNELL, "--size", "8x8", "--json", "/dev/full"], 1, "disk is full");
    let scene = path(folder.path(), "scene.png");
    fs::copy(CORNELL, &scene).unwrap();
    fails(&["render", &scene, "--size", "8x8", "-o", &scene], 2, "written over");
    fails(&["bench", &scene, "--quick", "--csv", &scene], 2, "written over");
    assert!(fs::read(&scene).unwrap() == fs::read(CORNELL).unwrap());
    fs::remove_file(&scene).unwrap();
    let same = path(folder.path(), "same.png");
    fails(&["render", CORNELL, "--size", "8x8", "-o", &same, "--json", &same], 2, "written over");
    fails(&["render", CORNELL, "--size", "8x8", "-o", &same, "--trace", &same], 2, "written over");
    fails(&["render", CORNELL, "--size", "8x8", "-o", &same, "--heatmap", &same], 2, "written over");
    let map = path(folder.path(), "map.exr");
    fails(&["render", CORNELL, "--size", "8x8", "--heatmap", &map], 2, "does not end in .png");
    fails(&["bench", CORNELL, "--quick", "--json", &same, "--csv", &same], 2, "written over");
    fails(&["bench", CORNELL, "--quick", "--json", "-"], 2, "name a file");
    fails(&["render", CORNELL, "--size", "8x8", "--trace", &nowhere], 1, "folder does not exist");
    let kept = path(folder.path(), "kept.png");
    fs::write(&kept, "old").unwrap();
    fails(&["render", MAISON, "--method", "stack8", "--size", "8x8", "-o", &kept], 2, "overflow");
    assert_eq!(fs::read_to_string(&kept).unwrap(), "old");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn devices_that_are_not_there_exit_with_4() {
    fails(&["render", CORNELL, "--device", "no such device"], 4, "--device");
    for number in ["77", "5", ""] {
        fails(&["render", CORNELL, "--device", number], 4, "--device");
    }
    let output = Command::new(env!("CARGO_BIN_EXE_cousu"))
        .args(["render", CORNELL])
        .env("VK_DRIVER_FILES", "/nonexistent.json")
        .env("VK_ICD_FILENAMES", "/nonexistent.json")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(4), "{}", text(&output.stderr));
}

/// 20,000 triangles are more than a frame may test by brute force where loops are limited: counts can be cut,
/// running means are refused.
#[test]
fn brute_force_beyond_a_frame_is_cut_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let scene = path(folder.path(), "terrain.obj");
    succeeds(&["scene", "terrain", "--triangles", "20000", "-o", &scene]);
    let brute = ["render", &scene, "--method", "brute", "--size", "8x8", "--spp", "4"];
    succeeds(&brute);
    let limited = succeeds(&["doctor"]).contains("leaves loops silently");
    if limited {
        fails(&[&brute[..], &["--accumulator", "rgba8"]].concat(), 2, "--accumulator count");
    }
}

#[test]
#[cfg(unix)]
fn a_path_that_is_no_unicode_is_a_path() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join(std::ffi::OsStr::from_bytes(b"b\xffad.obj"));
    fs::copy(CORNELL, &scene).unwrap();
    let picture = folder.path().join("x.png");
    let status = Command::new(env!("CARGO_BIN_EXE_cousu"))
        .arg("render")
        .arg(&scene)
        .args(["--size", "8x8", "--spp", "4", "-o"])
        .arg(&picture)
        .output()
        .unwrap()
        .status;
    assert!(status.success() && picture.exists());
}

#[test]
fn the_commands_that_tell() {
    assert!(succeeds(&["devices"]).contains("Vulkan"));
    let doctor = succeeds(&["doctor"]);
    assert!(doctor.contains("usable") && doctor.contains("loader      found"), "{doctor}");
    let folder = tempfile::tempdir().unwrap();
    let scene = path(folder.path(), "faulty.obj");
    fs::write(&scene, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nf 1 2 3\nf 1 2 9\nf 1 2 4\nf 1 1 2\n").unwrap();
    let inspected = succeeds(&["inspect", &scene]);
    for words in ["triangles   1", "line 6", "line 7", "line 8"] {
        assert!(inspected.contains(words), "{words}: {inspected}");
    }
    let plan = succeeds(&["plan", MAISON]);
    assert!((plan.contains("bundle") || plan.contains("wide")) && plan.contains("robust"), "{plan}");
    succeeds(&["plan", MAISON, "--spp", "8", "--size", "64x40", "--orbit", "0,90", "--antialias", "4"]);
    succeeds(&["plan", MAISON, "--size", "64x40", "--antialias", "6"]);
    // What render refuses.
    fails(&["plan", MAISON, "--spp", "6", "--antialias", "4"], 2, "multiple of 4");
    fails(&["plan", MAISON, "--size", "4294967295x4294967295"], 2, "beyond this device's limit");
    fails(
        &["plan", MAISON, "--eye", "1e30,0,0", "--up", "0,0,1"],
        2,
        "a million times the scene's size away",
    );
    fails(&["plan", MAISON, "--method", "stack8"], 2, "stack8 can overflow");
    let by_address = ["plan", MAISON, "--accessor", "address", "--method"];
    assert!(succeeds(&[&by_address[..], &["entry"]].concat()).contains("address"));
    let threaded = succeeds(&[&by_address[..], &["threaded"]].concat());
    assert!(threaded.contains("no kernel of these choices reads by device address"), "{threaded}");
    fails(&["plan", MAISON, "--accessor", "restrict"], 2, "address");
}

#[test]
fn a_record_names_the_accessors_of_its_kernels() {
    let render = ["render", CORNELL, "--size", "8x8", "--spp", "4", "--method", "entry", "--passes"];
    let by_address = |passes| {
        succeeds(&[&render[..], &[passes, "--accessor", "address", "--validate", "--json", "-"]].concat())
    };
    assert!(by_address("split").contains("\"ambient_list/entry/address\""));
    assert!(by_address("staged").contains("\"trace/entry/ssbo\""));
}

#[test]
fn a_scene_that_was_written_is_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let obj = path(folder.path(), "s.obj");
    succeeds(&["scene", "maison", "-o", &obj]);
    assert!(
        fs::read(&obj).unwrap() == fs::read(MAISON).unwrap(),
        "assets/maison.obj is what the command writes"
    );
    let said = succeeds(&["inspect", &obj]);
    assert!(said.contains("triangles   5456 ") && said.contains("dropped     nothing"), "{said}");
    succeeds(&["scene", "hairball", "--triangles", "500", "--seed", "4", "-o", &obj]);
    let rendered = succeeds(&["render", &obj, "--size", "16x16", "--spp", "2", "--json", "-"]);
    assert!(serde_json::from_str::<serde_json::Value>(&rendered).unwrap()["ambient_rays"].as_u64() > Some(0));
}

/// Whatever lies where compiled kernels are kept, the picture comes.
#[test]
fn compiled_kernels_are_kept_or_not_and_the_picture_is_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let picture = |cache: &Path, name: &str| {
        let place = path(folder.path(), name);
        let output = Command::new(env!("CARGO_BIN_EXE_cousu"))
            .args(["render", CORNELL, "--size", "24x15", "--spp", "4", "--validate", "-o", &place])
            .env("COUSU_CACHE", cache)
            .env("COUSU_DEBUG", "1")
            .output()
            .expect("the program starts");
        let said = text(&output.stderr);
        assert!(output.status.success() && !said.contains("validation:"), "{said}");
        let decoder = png::Decoder::new(std::io::BufReader::new(fs::File::open(&place).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        (pixels, said)
    };
    let cache = folder.path().join("cache");
    let (first, _) = picture(&cache, "first.png");
    assert_eq!(picture(&cache, "second.png").0, first);
    // Some drivers keep nothing.
    for file in fs::read_dir(cache.join("pipelines")).into_iter().flatten() {
        let file = file.unwrap().path();
        assert!(file.extension().is_some_and(|ending| ending == "pipelines"), "{}", file.display());
        fs::write(&file, "no compiled kernels").unwrap();
        let (pixels, said) = picture(&cache, "third.png");
        assert!(pixels == first && said.contains("is passed over"), "{said}");
    }
    let not_a_folder = folder.path().join("first.png");
    assert_eq!(picture(&not_a_folder, "fourth.png").0, first);
    let before = fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(picture(Path::new("off"), "fifth.png").0, first);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), before + 1, "the picture alone");
}
