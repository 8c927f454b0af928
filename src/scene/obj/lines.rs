//! The lines of an OBJ file, read in blocks and held to a length.
//!
//! Nothing here knows what a line means. This file makes sure that the rest of
//! the loader sees text, one logical line at a time, with its line number, and
//! that no input makes it hold more than a fixed number of bytes.

use std::io::{ErrorKind, Read};
use std::ops::Range;

use memchr::memchr;

use crate::error::Error;

/// The longest logical line, in bytes, line end not counted. A longer one is
/// refused as soon as this many bytes of it were read.
pub const MAX_LINE: usize = 1 << 20;

/// How much is asked of the source at once, in bytes.
const READ: usize = 256 << 10;

/// How much of the start of the file is looked at to tell text from binary.
const FIRST_BLOCK: usize = 64 << 10;

/// The byte order mark that some editors put before UTF-8 text.
const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";

/// One logical line: lines joined by a final `\` are one.
pub struct Line<'a> {
    /// Number of its first line in the file, counted from 1.
    pub number: u64,
    /// Its bytes without the line end; a carriage return may be left.
    pub text: &'a [u8],
}

/// Reads a source line by line through one buffer of fixed size.
pub struct Lines<'n, R> {
    source: R,
    name: &'n str,
    buffer: Vec<u8>,
    unread: Range<usize>,
    source_ended: bool,
    line_end: u8,
    joined: Vec<u8>,
    lines: u64,
    bytes: u64,
}

impl<'n, R: Read> Lines<'n, R> {
    /// Starts to read `source`, which messages call `name`.
    ///
    /// # Errors
    /// The source is empty, is binary, or cannot be read.
    pub fn new(source: R, name: &'n str) -> Result<Self, Error> {
        let mut lines = Self {
            source,
            name,
            // The longest line allowed, and room to read behind it.
            buffer: vec![0; MAX_LINE + 2 * READ],
            unread: 0..0,
            source_ended: false,
            line_end: b'\n',
            joined: Vec::new(),
            lines: 0,
            bytes: 0,
        };
        while !lines.source_ended && lines.unread.len() < FIRST_BLOCK {
            lines.fill()?;
        }
        let first = &lines.buffer[lines.unread.clone()];
        if first.is_empty() {
            return Err(Error::input(format!(
                "{name} is empty; give a Wavefront OBJ file with `v` and `f` lines"
            )));
        }
        let first = &first[..first.len().min(FIRST_BLOCK)];
        if let Some(sign) = sign_of_binary(first) {
            return Err(Error::input(format!(
                "{name} is not a text file ({sign}); give a Wavefront OBJ file in plain text"
            )));
        }
        // Files of old Macintosh programs have no line feed at all.
        if memchr(b'\n', first).is_none() && memchr(b'\r', first).is_some() {
            lines.line_end = b'\r';
        }
        if first.starts_with(BYTE_ORDER_MARK) {
            lines.unread.start += BYTE_ORDER_MARK.len();
        }
        Ok(lines)
    }

    /// The name that messages use.
    pub fn name(&self) -> &'n str {
        self.name
    }

    /// Lines read so far, those joined by `\` counted singly.
    pub fn lines(&self) -> u64 {
        self.lines
    }

    /// Bytes read from the source so far.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The next logical line, or `None` after the last.
    ///
    /// # Errors
    /// The line is longer than [`MAX_LINE`], or the source cannot be read.
    pub fn next_line(&mut self) -> Result<Option<Line<'_>>, Error> {
        let Some(mut range) = self.next_physical()? else {
            return Ok(None);
        };
        let number = self.lines;
        let Some(mut piece) = continued(&self.buffer[range.clone()]) else {
            let text = &self.buffer[range];
            return Ok(Some(Line { number, text }));
        };
        self.joined.clear();
        loop {
            let text = &self.buffer[range.start..range.start + piece];
            if self.joined.len() + text.len() > MAX_LINE {
                return Err(self.too_long(number));
            }
            self.joined.extend_from_slice(text);
            // The `\` and the line end together part words, as a blank does.
            self.joined.push(b' ');
            let Some(next) = self.next_physical()? else {
                break;
            };
            range = next;
            let text = &self.buffer[range.clone()];
            match continued(text) {
                Some(length) => piece = length,
                None if self.joined.len() + text.len() > MAX_LINE => {
                    return Err(self.too_long(number));
                }
                None => {
                    self.joined.extend_from_slice(text);
                    break;
                }
            }
        }
        let text = &self.joined;
        Ok(Some(Line { number, text }))
    }

    /// Where in the buffer the next line of the file lies.
    fn next_physical(&mut self) -> Result<Option<Range<usize>>, Error> {
        let mut searched = 0;
        loop {
            let unread = &self.buffer[self.unread.clone()];
            let found = memchr(self.line_end, &unread[searched..]).map(|at| searched + at);
            searched = unread.len();
            let length = found.unwrap_or(searched);
            if length > MAX_LINE {
                return Err(self.too_long(self.lines + 1));
            }
            let start = self.unread.start;
            if found.is_some() {
                self.unread.start += length + 1;
            } else if self.source_ended {
                if length == 0 {
                    return Ok(None);
                }
                self.unread.start += length;
            } else {
                self.fill()?;
                continue;
            }
            self.lines += 1;
            return Ok(Some(start..start + length));
        }
    }

    /// Reads one more block behind the unread bytes, which are at most
    /// [`MAX_LINE`] long here and so always leave room.
    fn fill(&mut self) -> Result<(), Error> {
        if self.buffer.len() - self.unread.end < READ {
            self.buffer.copy_within(self.unread.clone(), 0);
            self.unread = 0..self.unread.len();
        }
        let room = self.unread.end..self.unread.end + READ;
        let count = loop {
            match self.source.read(&mut self.buffer[room.clone()]) {
                Ok(count) => break count,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => {
                    return Err(Error::input(format!(
                        "{} cannot be read after line {} ({error}); check the file and its disk",
                        self.name, self.lines
                    )));
                }
            }
        };
        self.source_ended = count == 0;
        self.unread.end += count;
        self.bytes += count as u64;
        Ok(())
    }

    fn too_long(&self, line: u64) -> Error {
        Error::input(format!(
            "{}, line {line}: the line is longer than 1 MiB; give a Wavefront OBJ file with one \
             statement to a line",
            self.name
        ))
    }
}

/// The length of `text` before its final `\`, if it goes on in the next line.
///
/// A line with a comment never does: `# from C:\models\` would otherwise
/// swallow the line below and, were that a vertex, shift every index.
fn continued(text: &[u8]) -> Option<usize> {
    let before = text.trim_ascii_end().strip_suffix(b"\\")?;
    memchr(b'#', before).is_none().then_some(before.len())
}

/// What shows that a file beginning with `block` is binary, if anything does:
/// a zero byte, or more than a third of bytes that are neither printable ASCII,
/// nor white space, nor UTF-8. The share is that large so that comments in an
/// old 8-bit encoding pass.
fn sign_of_binary(block: &[u8]) -> Option<String> {
    if let Some(at) = memchr(0, block) {
        return Some(format!("a zero byte at offset {at}"));
    }
    let mut strange = 0;
    for chunk in block.utf8_chunks() {
        let control = |byte: &u8| byte.is_ascii_control() && !(b'\t'..=b'\r').contains(byte);
        strange += chunk.valid().bytes().filter(|byte| control(byte)).count();
        strange += chunk.invalid().len();
    }
    (strange > block.len() / 3).then(|| "mostly bytes that are no text".to_owned())
}
