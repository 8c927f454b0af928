//! Where things are kept from run to run that can be made again.

use std::path::PathBuf;

/// Names another folder than the system's, or `off`.
pub const VARIABLE: &str = "COUSU_CACHE";

/// The folder for things of this kind: in the one that COUSU_CACHE names, or in the user's cache folder (XDG Base Directory
/// Specification: relative paths are ignored). `None` if COUSU_CACHE is `off` or empty, or if there is no such folder.
pub fn folder(kind: &str) -> Option<PathBuf> {
    let absolute = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let own = match std::env::var_os(VARIABLE) {
        Some(value) if value.is_empty() || value.eq_ignore_ascii_case("off") => return None,
        Some(value) => PathBuf::from(value),
        None => absolute("XDG_CACHE_HOME").or_else(|| Some(absolute("HOME")?.join(".cache")))?.join("cousu"),
    };
    Some(own.join(kind))
}
