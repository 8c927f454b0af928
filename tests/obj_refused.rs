//! The OBJ loader: what it refuses, and with which words.

use std::fmt::Display;
use std::fs;
use std::io::{self, Read};

use cousu::scene::obj::{self, Loaded, MAX_LINE};

/// A unit square in the plane z = 0, without faces.
const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

fn refusal(text: impl AsRef<[u8]>) -> String {
    refusal_of(text.as_ref())
}

fn refusal_of(source: impl Read) -> String {
    one_sentence(obj::read(source, "test.obj"))
}

/// The message of a refusal, which says in one sentence what is wrong, where,
/// and what to do.
fn one_sentence<E: Display>(result: Result<Loaded, E>) -> String {
    let message = match result {
        Ok(_) => panic!("was not refused"),
        Err(error) => error.to_string(),
    };
    assert!(!message.contains('\n') && !message.contains(". "), "{message}");
    assert!(message.contains("; "), "does not say what to do: {message}");
    message
}

#[test]
fn files_that_cannot_be_read() -> io::Result<()> {
    let folder = tempfile::tempdir()?;
    let refusal = |path: &std::path::Path| one_sentence(obj::load(path));
    let missing = refusal(&folder.path().join("none.obj"));
    assert!(missing.contains("none.obj does not exist"), "{missing}");
    let directory = refusal(folder.path());
    assert!(directory.contains("is a directory"), "{directory}");
    let file = folder.path().join("file.obj");
    fs::write(&file, "")?;
    let empty = refusal(&file);
    assert!(empty.contains("file.obj is empty"), "{empty}");
    let below_file = refusal(&file.join("x.obj"));
    assert!(below_file.contains("cannot be opened"), "{below_file}");
    Ok(())
}

#[cfg(unix)]
#[test]
fn a_file_without_permission() -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("locked.obj");
    fs::write(&path, SQUARE)?;
    fs::set_permissions(&path, fs::Permissions::from_mode(0o000))?;
    // The superuser may read it all the same.
    if fs::File::open(&path).is_err() {
        let message = one_sentence(obj::load(&path));
        assert!(message.contains("may not be read"), "{message}");
    }
    Ok(())
}

/// Gives some text, then fails.
struct Failing<'a>(&'a [u8]);

impl Read for Failing<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        match self.0.read(into)? {
            0 => Err(io::Error::other("the disk is gone")),
            count => Ok(count),
        }
    }
}

#[test]
fn a_source_that_fails_midway() {
    let text = SQUARE.repeat(20_000);
    let message = refusal_of(Failing(text.as_bytes()));
    assert!(message.contains("cannot be read after line"), "{message}");
    assert!(message.contains("the disk is gone"), "{message}");
}

#[test]
fn binary_files_are_refused() {
    let with_zero = refusal(b"glTF\x02\0\0\0\x10\0\0\0");
    assert!(with_zero.contains("a zero byte at offset 5"), "{with_zero}");
    let bytes: Vec<u8> = (0..2000).map(|n| (n % 255 + 1) as u8).collect();
    let without_zero = refusal(&bytes);
    assert!(without_zero.contains("is not a text file"), "{without_zero}");
    let utf_16: Vec<u8> = SQUARE.encode_utf16().flat_map(u16::to_le_bytes).collect();
    assert!(refusal(utf_16).contains("is not a text file"));
}

#[test]
fn the_longest_line_is_a_mebibyte() {
    let comment = |length: usize| format!("{SQUARE}f 1 2 3\n#{}\nf 1 2 4", "x".repeat(length - 1));
    let longest = obj::read(comment(MAX_LINE).as_bytes(), "test.obj");
    assert!(longest.is_ok_and(|loaded| loaded.mesh.triangles.len() == 2));
    let message = refusal(comment(MAX_LINE + 1));
    assert!(message.contains("test.obj, line 6: the line is longer than 1 MiB"), "{message}");
    let joined = format!("{SQUARE}f 1 2 3{}", " 1 2 3 4 \\\n".repeat(MAX_LINE / 9));
    assert!(refusal(joined).contains("line 5: the line is longer"));
    let two = format!("{SQUARE}f {}\\\n{}\n", " ".repeat(MAX_LINE / 2), " ".repeat(MAX_LINE / 2));
    assert!(refusal(two).contains("line 5: the line is longer"));
}

/// Counts what is taken from it.
struct Counted<R>(R, u64);

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let count = self.0.read(into)?;
        self.1 += count as u64;
        Ok(count)
    }
}

#[test]
fn a_line_of_gigabytes_is_given_up_early() {
    let mut source = Counted(io::repeat(b'7').take(3_000_000_000), 0);
    let message = refusal_of(&mut source);
    assert!(message.contains("line 1: the line is longer than 1 MiB"), "{message}");
    assert!(source.1 <= 2 * MAX_LINE as u64, "{} bytes were read", source.1);
}

#[test]
fn scenes_without_a_triangle_are_refused() {
    let no_face = refusal(SQUARE);
    assert!(no_face.contains("no face among its 4 lines (4 vertices)"), "{no_face}");
    assert!(refusal("\n \n").contains("no face among its 2 lines"));
    let no_use = refusal(format!("{SQUARE}f 1 1 2\nf 1 2 7\nf 3\nf 2 3\n"));
    assert!(
        no_use.contains(
            "all were dropped: 2 faces with fewer than 3 corners (lines 7, 8), \
             1 face with an index out of range (line 6), 1 triangle without area (line 5)"
        ),
        "{no_use}"
    );
}
