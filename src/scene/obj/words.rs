//! The words of an OBJ line: numbers and face corners.

use glam::DVec3;

/// Iterates over the blank-separated words of a line, up to a comment.
///
/// A comment starts at a word that begins with `#`; a `#` inside a word is
/// part of it.
pub struct Words<'a> {
    rest: &'a [u8],
}

impl<'a> Words<'a> {
    /// The words of `text`.
    pub fn new(text: &'a [u8]) -> Self {
        Self { rest: text }
    }

    /// What was not iterated over, blanks and comments included.
    pub fn rest(&self) -> &'a [u8] {
        self.rest
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let start = self.rest.iter().position(|&byte| !is_blank(byte))?;
        let word = &self.rest[start..];
        let end = word.iter().position(|&byte| is_blank(byte));
        let (word, rest) = word.split_at(end.unwrap_or(word.len()));
        if word[0] == b'#' {
            self.rest = &[];
            return None;
        }
        self.rest = rest;
        Some(word)
    }
}

/// White space, line ends included: either may be left on a line.
fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t'..=b'\r')
}

/// What a `v` line says.
pub enum Vertex<'a> {
    /// A usable position.
    Good {
        /// Its coordinates, in scene units.
        position: DVec3,
        /// The three words they were read from.
        words: [&'a [u8]; 3],
        /// Whether a fourth number other than 1 follows, a weight `w`.
        weighted: bool,
    },
    /// A coordinate is NaN, infinite or too large for a 32-bit float.
    NonFinite,
    /// Fewer than three numbers, or a word that is no number.
    Malformed,
}

/// Reads the words after `v`: three coordinates, then numbers that are only
/// checked to be numbers (a weight, or a colour).
pub fn vertex<'a>(words: &mut Words<'a>) -> Vertex<'a> {
    let mut taken = [&[][..]; 3];
    let mut position = DVec3::ZERO;
    for (axis, slot) in taken.iter_mut().enumerate() {
        let Some(word) = words.next() else {
            return Vertex::Malformed;
        };
        let Some(value) = number(word) else {
            return Vertex::Malformed;
        };
        *slot = word;
        position[axis] = value;
    }
    let mut extra = 0;
    let mut last = 1.0;
    for word in words {
        let Some(value) = number(word) else {
            return Vertex::Malformed;
        };
        last = value;
        extra += 1;
    }
    // The renderer computes in 32-bit floats: a coordinate that becomes
    // infinite there is as useless as one that is infinite here.
    if !position.as_vec3().is_finite() {
        return Vertex::NonFinite;
    }
    Vertex::Good { position, words: taken, weighted: extra == 1 && last != 1.0 }
}

/// A decimal number, `inf` and `nan` included. Numbers too large for a 64-bit
/// float are infinite.
fn number(word: &[u8]) -> Option<f64> {
    let text = str::from_utf8(word).ok()?;
    match text.parse() {
        Ok(value) => Some(value),
        // How some C libraries print what is no number.
        Err(_) => {
            let bare = text.trim_start_matches(['+', '-']).to_ascii_lowercase();
            (bare.starts_with("nan(") || bare.starts_with("1.#")).then_some(f64::NAN)
        }
    }
}

/// The vertex index of a face corner `v`, `v/vt`, `v//vn` or `v/vt/vn`, as
/// written: counted from 1, or backwards if negative. An index too large for
/// the type is clamped. `None` if the corner is malformed.
pub fn corner(word: &[u8]) -> Option<i64> {
    let (vertex, mut rest) = integer(word)?;
    for _ in 0..2 {
        let Some(after) = rest.strip_prefix(b"/") else {
            break;
        };
        rest = match after.first() {
            None | Some(b'/') => after,
            Some(_) => integer(after)?.1,
        };
    }
    rest.is_empty().then_some(vertex)
}

/// The integer that `text` begins with, clamped, and what follows it.
fn integer(text: &[u8]) -> Option<(i64, &[u8])> {
    let (negative, digits) = match text {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    let mut value = 0_i64;
    let mut length = 0;
    while let Some(byte) = digits.get(length).filter(|byte| byte.is_ascii_digit()) {
        let digit = i64::from(byte - b'0');
        value = value.saturating_mul(10).saturating_add(digit);
        length += 1;
    }
    let value = if negative { -value } else { value };
    (length > 0).then_some((value, &digits[length..]))
}
