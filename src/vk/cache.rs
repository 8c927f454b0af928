//! Compiled kernels kept on disk from run to run, so that drivers need not compile them again.
//!
//! A file holds what `vkGetPipelineCacheData` gave, behind a header of our own with its length and a hash: drivers are not
//! obliged to survive data that was damaged. It is named after the device, its driver and the kernels, so that any number of
//! them have their places, and it is written beside and renamed: of two processes that end at once the last one's stays,
//! whole. A file that is not what it should be is passed over, and written anew.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use ash::vk;
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

use crate::kernels::SPIRV_HASH;

/// Whose compiled kernels they are, as the specification tells drivers apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct CacheKey {
    pub vendor: u32,
    pub device: u32,
    pub driver_version: u32,
    pub uuid: [u8; vk::UUID_SIZE],
}

impl CacheKey {
    pub(super) fn of(properties: &vk::PhysicalDeviceProperties) -> Self {
        Self {
            vendor: properties.vendor_id,
            device: properties.device_id,
            driver_version: properties.driver_version,
            uuid: properties.pipeline_cache_uuid,
        }
    }

    fn file_name(&self, kernels: u64) -> String {
        let mut hasher = Xxh3::new();
        [self.vendor, self.device, self.driver_version].iter().for_each(|n| hasher.update(&n.to_le_bytes()));
        hasher.update(&self.uuid);
        format!("{:016x}-{kernels:016x}.pipelines", hasher.digest())
    }

    /// Whether the data is what a driver of this device wrote (the header that the specification gives it).
    fn wrote(&self, data: &[u8]) -> bool {
        let word = |place: usize| {
            let bytes = data.get(place..place + 4)?;
            Some(u32::from_le_bytes(bytes.try_into().ok()?))
        };
        word(0).is_some_and(|length| length as usize >= VULKAN_HEADER)
            && word(4) == Some(vk::PipelineCacheHeaderVersion::ONE.as_raw() as u32)
            && word(8) == Some(self.vendor)
            && word(12) == Some(self.device)
            && data.get(16..VULKAN_HEADER) == Some(&self.uuid[..])
    }
}

/// Bytes of the header of what a driver gives; such data holds no kernel.
const VULKAN_HEADER: usize = 16 + vk::UUID_SIZE;
/// What our files begin with; the last byte counts their versions.
const MAGIC: [u8; 8] = *b"cousuPC\x01";
/// The beginning, the data's length and its hash.
const HEADER: usize = MAGIC.len() + 8 + 8;
/// Larger files are not ours.
const MOST_BYTES: u64 = 256 << 20;

/// A device's cache of compiled kernels. Whoever makes it destroys it by [`Self::close`].
pub(super) struct PipelineCache {
    /// Null where nothing is kept.
    pub(super) raw: vk::PipelineCache,
    file: PathBuf,
    /// Hash of the data that the file had.
    known: Option<u64>,
}

impl PipelineCache {
    /// Keeps nothing.
    pub(super) fn none() -> Self {
        Self { raw: vk::PipelineCache::null(), file: PathBuf::new(), known: None }
    }

    /// With what an earlier run left in `folder`; whatever goes wrong, the cache begins empty or is none.
    pub(super) fn open(device: &ash::Device, key: &CacheKey, folder: &Path) -> Self {
        let file = folder.join(key.file_name(SPIRV_HASH));
        let data = read(&file, key).unwrap_or_else(|why| {
            debug(&format!("{} is passed over: {why}", file.display()));
            None
        });
        let made = data.as_deref().and_then(|data| create(device, data).ok());
        let known = made.and(data.as_deref()).map(xxh3_64);
        match made.map_or_else(|| create(device, &[]), Ok) {
            Ok(raw) => Self { raw, file, known },
            Err(result) => {
                debug(&format!(
                    "compiled kernels are not kept: the driver makes no cache of them ({result:?})"
                ));
                Self::none()
            }
        }
    }

    /// Writes the file if there is something new, and destroys the cache.
    ///
    /// # Safety
    /// The cache is of this device, nothing is being compiled, and this is called once.
    pub(super) unsafe fn close(&self, device: &ash::Device) {
        if self.raw == vk::PipelineCache::null() {
            return;
        }
        // SAFETY: the cache is alive, says the caller.
        match unsafe { device.get_pipeline_cache_data(self.raw) } {
            Ok(data) if data.len() <= VULKAN_HEADER => {
                debug("the driver put nothing into its pipeline cache")
            }
            Ok(data) if self.known == Some(xxh3_64(&data)) => {}
            Ok(data) => match write(&self.file, &data) {
                Ok(()) => debug(&format!("{} written, {} bytes", self.file.display(), data.len())),
                Err(error) => debug(&format!("{} could not be written ({error})", self.file.display())),
            },
            Err(result) => debug(&format!("the driver does not give its pipeline cache ({result:?})")),
        }
        // SAFETY: likewise.
        unsafe { device.destroy_pipeline_cache(self.raw, None) };
    }
}

fn create(device: &ash::Device, data: &[u8]) -> Result<vk::PipelineCache, vk::Result> {
    let info = vk::PipelineCacheCreateInfo::default().initial_data(data);
    // SAFETY: the device is alive, and the data is empty or what this driver gave.
    unsafe { device.create_pipeline_cache(&info, None) }
}

/// The data of a file; `None` if there is no file, and why if it is not to be used.
fn read(path: &Path, key: &CacheKey) -> Result<Option<Vec<u8>>, String> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error.to_string()),
    };
    let mut content = Vec::new();
    file.take(MOST_BYTES + 1).read_to_end(&mut content).map_err(|error| error.to_string())?;
    if content.len() as u64 > MOST_BYTES {
        return Err("it is too large to be a cache of this program".into());
    }
    let data = unpack(&content).ok_or("it is damaged, or of another version of this program")?;
    if !key.wrote(data) {
        return Err("another device or driver wrote it".into());
    }
    Ok(Some(data.to_vec()))
}

/// What lies behind our header, if all of it is there and unharmed.
fn unpack(content: &[u8]) -> Option<&[u8]> {
    let number = |place: usize| Some(u64::from_le_bytes(content.get(place..place + 8)?.try_into().ok()?));
    let data = content.get(HEADER..)?;
    let whole = content.starts_with(&MAGIC)
        && number(MAGIC.len())? == data.len() as u64
        && number(MAGIC.len() + 8)? == xxh3_64(data);
    whole.then_some(data)
}

fn write(path: &Path, data: &[u8]) -> io::Result<()> {
    if (data.len() + HEADER) as u64 > MOST_BYTES {
        return Err(io::Error::from(io::ErrorKind::FileTooLarge));
    }
    let folder = path.parent().unwrap_or(Path::new("."));
    make_private(folder)?;
    let mut file = tempfile::Builder::new().prefix(".cousu-").tempfile_in(folder)?;
    file.write_all(&MAGIC)?;
    file.write_all(&(data.len() as u64).to_le_bytes())?;
    file.write_all(&xxh3_64(data).to_le_bytes())?;
    file.write_all(data)?;
    file.persist(path).map_err(|error| error.error)?;
    Ok(())
}

/// Makes a folder that only its user enters: what lies there is run on the device.
fn make_private(folder: &Path) -> io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.recursive(true).create(folder)
}

/// Tells what a person wants to know only while looking for a fault.
fn debug(text: &str) {
    if std::env::var_os("COUSU_DEBUG").is_some() {
        let _ = writeln!(io::stderr(), "debug: {text}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: CacheKey =
        CacheKey { vendor: 0x10005, device: 7, driver_version: 3, uuid: [9; vk::UUID_SIZE] };

    /// As a driver gives it.
    fn data_of(key: &CacheKey) -> Vec<u8> {
        let mut data = Vec::new();
        for word in [VULKAN_HEADER as u32, 1, key.vendor, key.device] {
            data.extend(word.to_le_bytes());
        }
        data.extend(key.uuid);
        data.extend(b"compiled kernels");
        data
    }

    #[test]
    fn what_was_written_is_read_and_nothing_is_left_beside() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/er").join(KEY.file_name(1));
        assert_eq!(read(&path, &KEY), Ok(None), "no file is no fault");
        for data in [data_of(&KEY), [data_of(&KEY), vec![1; 1000]].concat()] {
            write(&path, &data).unwrap();
            assert_eq!(read(&path, &KEY), Ok(Some(data)));
        }
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }

    #[test]
    fn damaged_files_are_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cache");
        write(&path, &data_of(&KEY)).unwrap();
        let whole = fs::read(&path).unwrap();
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).unwrap();
            assert!(read(&path, &KEY).is_err(), "cut to {length} bytes");
        }
        for place in 0..whole.len() {
            let mut other = whole.clone();
            other[place] ^= 0x10;
            fs::write(&path, &other).unwrap();
            assert!(read(&path, &KEY).is_err(), "byte {place} is another");
        }
        fs::write(&path, [whole, vec![0]].concat()).unwrap();
        assert!(read(&path, &KEY).is_err(), "a byte too many");
        assert!(read(folder.path(), &KEY).is_err(), "a folder");
    }

    #[test]
    fn another_device_s_data_are_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cache");
        let others = [
            CacheKey { vendor: 1, ..KEY },
            CacheKey { device: 1, ..KEY },
            CacheKey { uuid: [8; vk::UUID_SIZE], ..KEY },
        ];
        for other in others {
            write(&path, &data_of(&other)).unwrap();
            assert!(read(&path, &KEY).is_err(), "{other:?}");
            assert_ne!(other.file_name(1), KEY.file_name(1));
        }
        assert_ne!(CacheKey { driver_version: 4, ..KEY }.file_name(1), KEY.file_name(1));
        assert_ne!(KEY.file_name(1), KEY.file_name(2), "other kernels");
    }

    /// Writers never leave a mixture: a reader sees one whole file or another.
    #[test]
    fn many_writers_at_once_leave_whole_files() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cache");
        std::thread::scope(|scope| {
            for writer in 0..4u8 {
                let path = &path;
                scope.spawn(move || {
                    for _ in 0..50 {
                        write(path, &[data_of(&KEY), vec![writer; 5000]].concat()).unwrap();
                        assert!(read(path, &KEY).unwrap().is_some());
                    }
                });
            }
        });
    }
}
