//! What can go wrong, as one sentence: what, where, and what to do.

use std::thread::ScopedJoinHandle;

/// An error and the exit code it leads to.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The command line is wrong (exit code 2).
    #[error("{0}")]
    Usage(String),
    /// The input is bad (3).
    #[error("{0}")]
    Input(String),
    /// No usable device, or the device was lost (4).
    #[error("{0}")]
    Device(String),
    /// The rest (1).
    #[error("{0}")]
    Other(String),
}

/// The result of what can fail with an [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    pub fn usage(text: impl Into<String>) -> Self {
        Self::Usage(sentence(text))
    }

    pub fn input(text: impl Into<String>) -> Self {
        Self::Input(sentence(text))
    }

    pub fn device(text: impl Into<String>) -> Self {
        Self::Device(sentence(text))
    }

    pub fn other(text: impl Into<String>) -> Self {
        Self::Other(sentence(text))
    }

    /// The process exit code that tells a script which kind of error it was.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) => 2,
            Self::Input(_) => 3,
            Self::Device(_) => 4,
            Self::Other(_) => 1,
        }
    }
}

/// What a thread gives; one that was lost is an error.
pub fn joined<T>(thread: ScopedJoinHandle<'_, Result<T>>) -> Result<T> {
    thread.join().unwrap_or_else(|_| {
        Err(Error::other("A thread of the program ended before its work was done: report this as a bug"))
    })
}

/// The text with the full stop that ends it.
fn sentence(text: impl Into<String>) -> String {
    let mut text = text.into();
    if !text.ends_with('.') {
        text.push('.');
    }
    text
}
