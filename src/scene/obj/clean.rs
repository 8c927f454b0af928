//! The clean text: a pipe from the pre-pass to the OBJ reader.
//!
//! The pre-pass writes faultless OBJ text here, and the reader consumes it on
//! another thread while it is written, so that the text as a whole is never in
//! memory. The text has `v`, `f` and `o` lines only. An `o` line starts a new
//! part after every [`PART_TRIANGLES`]: the reader needs some hundred bytes for
//! each face of the part at hand, and a table of its vertices, and both stay
//! small that way.
//!
//! In each part the reader numbers the vertices anew, in the order of their
//! first use. [`Numbering`] records that order, to undo it afterwards.

use std::io::{self, BufRead, Read};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// Triangles of a part; the last face of a part may exceed it.
const PART_TRIANGLES: usize = 1 << 16;

/// Bytes that are handed over at once.
const BLOCK: usize = 256 << 10;

/// Blocks that may wait for the reader.
const BLOCKS_WAITING: usize = 4;

/// Which vertices of the file the faces use, and how the reader numbers them.
#[derive(Default)]
pub struct Numbering {
    /// For each vertex of the file the latest part that uses it, counted from
    /// 1; 0 if none does.
    pub last_part: Vec<u32>,
    /// For each part its vertices, by number in the file counted from 0, in the
    /// order of their first use.
    pub parts: Vec<Vec<u32>>,
}

/// The end of the pipe that the pre-pass writes to. Dropping it ends the text.
pub struct CleanWriter {
    block: Vec<u8>,
    blocks: SyncSender<Vec<u8>>,
    part_triangles: usize,
    numbering: Numbering,
}

/// The end of the pipe that the reader reads from.
pub struct CleanReader {
    block: Vec<u8>,
    read: usize,
    blocks: Receiver<Vec<u8>>,
}

/// A new pipe.
pub fn pipe() -> (CleanWriter, CleanReader) {
    let (sender, receiver) = sync_channel(BLOCKS_WAITING);
    let writer =
        CleanWriter { block: Vec::new(), blocks: sender, part_triangles: 0, numbering: Numbering::default() };
    let reader = CleanReader { block: Vec::new(), read: 0, blocks: receiver };
    (writer, reader)
}

impl CleanWriter {
    /// Writes a vertex with coordinates as they stand in the file, so that the
    /// reader parses the very same numbers.
    pub fn vertex(&mut self, words: [&[u8]; 3]) {
        self.block.push(b'v');
        for word in words {
            self.block.push(b' ');
            self.block.extend_from_slice(word);
        }
        self.numbering.last_part.push(0);
        self.end_line();
    }

    /// Writes a face whose corners are vertices already written, counted from
    /// 0, with at least three corners.
    pub fn face(&mut self, corners: &[u32]) {
        if self.part_triangles >= PART_TRIANGLES || self.numbering.parts.is_empty() {
            self.start_part();
        }
        self.part_triangles += corners.len() - 2;
        let part = self.numbering.parts.len() as u32;
        self.block.push(b'f');
        for &corner in corners {
            self.block.push(b' ');
            push_decimal(&mut self.block, u64::from(corner) + 1);
            let last = &mut self.numbering.last_part[corner as usize];
            if *last != part {
                *last = part;
                if let Some(vertices) = self.numbering.parts.last_mut() {
                    vertices.push(corner);
                }
            }
        }
        self.end_line();
    }

    /// Hands over the rest of the text and ends it.
    pub fn finish(mut self) -> Numbering {
        self.hand_over();
        self.numbering
    }

    fn start_part(&mut self) {
        self.numbering.parts.push(Vec::new());
        self.part_triangles = 0;
        self.block.extend_from_slice(b"o\n");
    }

    fn end_line(&mut self) {
        self.block.push(b'\n');
        if self.block.len() >= BLOCK {
            self.hand_over();
        }
    }

    fn hand_over(&mut self) {
        let next = Vec::with_capacity(BLOCK + BLOCK / 8);
        let block = std::mem::replace(&mut self.block, next);
        // A reader that hung up has an error of its own to return; nobody
        // misses this block then.
        let _ = self.blocks.send(block);
    }
}

/// Appends `value` in decimal digits.
fn push_decimal(text: &mut Vec<u8>, mut value: u64) {
    let mut digits = [0; 20];
    let mut start = digits.len();
    loop {
        start -= 1;
        digits[start] = b'0' + (value % 10) as u8;
        value /= 10;
        if value == 0 {
            break;
        }
    }
    text.extend_from_slice(&digits[start..]);
}

impl Read for CleanReader {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let mut available = self.fill_buf()?;
        let count = available.read(into)?;
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for CleanReader {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        while self.read >= self.block.len() {
            let Ok(block) = self.blocks.recv() else {
                return Ok(&[]);
            };
            self.block = block;
            self.read = 0;
        }
        Ok(&self.block[self.read..])
    }

    fn consume(&mut self, count: usize) {
        self.read += count;
    }
}
