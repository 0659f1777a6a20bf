//! ZIP archives, as far as `.sog` files need them: stored and deflated entries are read, stored ones written.
//!
//! Entries are looked up by name in memory; nothing is ever unpacked to a disk, so no name can lead out of the archive.

use std::borrow::Cow;
use std::io::{Read, Write};

use flate2::Crc;

use super::super::limit;
use crate::{ReadError, SourceName};

const END: [u8; 4] = *b"PK\x05\x06";
const ENTRY: [u8; 4] = *b"PK\x01\x02";
const LOCAL: [u8; 4] = *b"PK\x03\x04";
const END_SIZE: usize = 22;
const ENTRY_SIZE: usize = 46;
const LOCAL_SIZE: usize = 30;
/// The longest comment after the end record.
const MAX_COMMENT: usize = 65535;

/// First bytes of an archive that is not empty.
pub(super) const MAGIC: [u8; 4] = LOCAL;

/// An archive in memory and the places of its entries.
pub(super) struct Archive<'a> {
    bytes: &'a [u8],
    entries: Vec<Entry<'a>>,
    name: &'a SourceName,
}

struct Entry<'a> {
    name: &'a [u8],
    flags: u16,
    method: u16,
    crc: u32,
    packed: usize,
    unpacked: usize,
    /// Of the local header.
    at: usize,
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

impl<'a> Archive<'a> {
    /// Reads the central directory.
    pub(super) fn open(bytes: &'a [u8], name: &'a SourceName) -> Result<Self, ReadError> {
        let cut = || ReadError::truncated("ends of the ZIP archive", 1, 0, name);
        let first = bytes.len().saturating_sub(END_SIZE + MAX_COMMENT);
        let last = bytes.len().checked_sub(END_SIZE).ok_or_else(cut)?;
        let end = (first..=last)
            .rev()
            .find(|&at| bytes[at..at + 4] == END && at + END_SIZE + usize::from(u16_at(bytes, at + 20)) <= bytes.len());
        let end = end.ok_or_else(cut)?;
        let (size, offset) = (u32_at(bytes, end + 12) as usize, u32_at(bytes, end + 16) as usize);
        if u32_at(bytes, end + 16) == u32::MAX {
            return Err(ReadError::unsupported("a ZIP archive above 4 GiB", "unpack it and open its folder", name));
        }
        let damaged = |found: String| {
            ReadError::malformed("the directory of the ZIP archive", "entries inside the file", found, name)
        };
        // What other programs put before an archive shifts all its offsets.
        let Some(shift) = end.checked_sub(size).and_then(|start| start.checked_sub(offset)) else {
            return Err(damaged(format!("{size} bytes at {offset}")));
        };
        let mut rest = &bytes[end - size..end];
        let mut entries = Vec::new();
        while rest.len() >= ENTRY_SIZE && rest[..4] == ENTRY {
            let name_end = ENTRY_SIZE + usize::from(u16_at(rest, 28));
            let next = name_end + usize::from(u16_at(rest, 30)) + usize::from(u16_at(rest, 32));
            if next > rest.len() {
                return Err(damaged("an entry that is cut off".to_owned()));
            }
            entries.push(Entry {
                name: &rest[ENTRY_SIZE..name_end],
                flags: u16_at(rest, 8),
                method: u16_at(rest, 10),
                crc: u32_at(rest, 16),
                packed: u32_at(rest, 20) as usize,
                unpacked: u32_at(rest, 24) as usize,
                at: shift.saturating_add(u32_at(rest, 42) as usize),
            });
            rest = &rest[next..];
        }
        if entries.len() % 0x1_0000 != usize::from(u16_at(bytes, end + 10)) {
            return Err(damaged(format!("{} of {} entries", entries.len(), u16_at(bytes, end + 10))));
        }
        Ok(Self { bytes, entries, name })
    }

    /// The folder in the archive that holds `file` (empty or ending with a slash); the shortest one if there are several.
    pub(super) fn folder_of(&self, file: &str) -> Option<String> {
        let folders = self.entries.iter().filter_map(|e| {
            let folder = std::str::from_utf8(e.name).ok()?.strip_suffix(file)?;
            (folder.is_empty() || folder.ends_with('/')).then_some(folder)
        });
        folders.min_by_key(|folder| folder.len()).map(str::to_owned)
    }

    /// The content of an entry, checked against its checksum.
    pub(super) fn get(&self, file: &str) -> Result<Cow<'a, [u8]>, ReadError> {
        let Some(entry) = self.entries.iter().find(|e| e.name == file.as_bytes()) else {
            return Err(ReadError::malformed(
                format!("the file `{file}` in the archive"),
                "present",
                "missing",
                self.name,
            ));
        };
        let bad = |found: String| {
            ReadError::malformed(format!("the file `{file}` in the archive"), "sound data", found, self.name)
        };
        if entry.flags & 1 != 0 {
            return Err(ReadError::unsupported("an encrypted archive", "unpack it with its password first", self.name));
        }
        let start = entry.at;
        let local = self.bytes.get(start..).filter(|local| local.len() >= LOCAL_SIZE && local[..4] == LOCAL);
        let local = local.ok_or_else(|| bad(format!("no header at {start}")))?;
        let from = LOCAL_SIZE + usize::from(u16_at(local, 26)) + usize::from(u16_at(local, 28));
        let Some(packed) = local.get(from..).and_then(|data| data.get(..entry.packed)) else {
            let left = local.len().saturating_sub(from) as u64;
            return Err(ReadError::truncated(format!("bytes of `{file}`"), entry.packed as u64, left, self.name));
        };
        limit::check(&format!("the unpacked size of `{file}`"), entry.unpacked as u64, self.bytes.len(), self.name)?;
        let data = match entry.method {
            0 => Cow::Borrowed(packed),
            8 => {
                // One byte more than promised shows a stream that is longer.
                let mut data = Vec::with_capacity(entry.unpacked.min(16 * packed.len()));
                let mut stream = flate2::bufread::DeflateDecoder::new(packed).take(entry.unpacked as u64 + 1);
                stream.read_to_end(&mut data).map_err(|error| bad(error.to_string()))?;
                Cow::Owned(data)
            }
            method => {
                return Err(ReadError::unsupported(
                    format!("compression method {method} of a ZIP archive"),
                    "pack it again, stored or deflated",
                    self.name,
                ));
            }
        };
        if data.len() != entry.unpacked {
            return Err(bad(format!("{} of {} bytes", data.len(), entry.unpacked)));
        }
        let mut crc = Crc::new();
        crc.update(&data);
        if crc.sum() != entry.crc {
            return Err(bad(format!("a checksum of {:08x} instead of {:08x}", crc.sum(), entry.crc)));
        }
        Ok(data)
    }
}

/// Writes files, stored, as one archive; no times, so that equal input gives equal bytes. Returns its length.
///
/// # Errors
/// Those of the sink, and `InvalidInput` above 4 GiB.
pub(super) fn write(files: &[(&str, &[u8])], sink: &mut dyn Write) -> std::io::Result<u64> {
    let total: usize = files.iter().map(|(name, data)| data.len() + 2 * name.len() + LOCAL_SIZE + ENTRY_SIZE).sum();
    if total + END_SIZE > u32::MAX as usize {
        let text = "archives above 4 GiB cannot be written";
        return Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, text));
    }
    let mut directory = Vec::new();
    let mut at = 0u32;
    for (name, data) in files {
        let mut crc = Crc::new();
        crc.update(data);
        // Version 2.0, no flags, stored, 1 January 1980, checksum, both sizes, lengths of the name and of no extras.
        let mut common = vec![20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0];
        common.extend(crc.sum().to_le_bytes());
        common.extend((data.len() as u32).to_le_bytes());
        common.extend((data.len() as u32).to_le_bytes());
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        sink.write_all(&LOCAL)?;
        sink.write_all(&common)?;
        sink.write_all(name.as_bytes())?;
        sink.write_all(data)?;
        directory.extend(ENTRY);
        directory.extend([20, 0]);
        directory.extend(&common);
        // No comment, first disk, no attributes.
        directory.extend([0; 10]);
        directory.extend(at.to_le_bytes());
        directory.extend(name.as_bytes());
        at += (LOCAL_SIZE + name.len() + data.len()) as u32;
    }
    sink.write_all(&directory)?;
    let mut end = Vec::with_capacity(END_SIZE);
    end.extend(END);
    end.extend([0; 4]);
    end.extend((files.len() as u16).to_le_bytes());
    end.extend((files.len() as u16).to_le_bytes());
    end.extend((directory.len() as u32).to_le_bytes());
    end.extend(at.to_le_bytes());
    end.extend([0, 0]);
    sink.write_all(&end)?;
    Ok(u64::from(at) + (directory.len() + END_SIZE) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_come_back_and_only_by_their_own_names() {
        let name = SourceName::from("test.sog");
        let mut bytes = b"junk before".to_vec();
        let length = write(&[("a/meta.json", b"{}"), ("a/x.webp", &[7; 300]), ("empty", b"")], &mut bytes).unwrap();
        assert_eq!(length + 11, bytes.len() as u64);
        let archive = Archive::open(&bytes, &name).unwrap();
        assert_eq!(archive.folder_of("meta.json").as_deref(), Some("a/"));
        assert_eq!(archive.get("a/x.webp").unwrap(), [7; 300].as_slice());
        assert!(archive.get("empty").unwrap().is_empty());
        assert!(archive.get("../a/x.webp").is_err() && archive.get("x.webp").is_err());
        let middle = bytes.iter().position(|&b| b == 7).unwrap();
        bytes[middle] = 8;
        let damaged = Archive::open(&bytes, &name).unwrap();
        assert!(damaged.get("a/x.webp").unwrap_err().to_string().contains("checksum"));
    }
}
