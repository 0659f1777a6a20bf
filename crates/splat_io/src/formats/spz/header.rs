//! The header of an SPZ file, the sizes of its arrays, and its extension records.

use glam::{Mat3, Vec3};
use splat_core::sh;

use super::super::limit;
use crate::{ReadError, SourceName};

/// First bytes of every header.
pub(super) const MAGIC: [u8; 4] = *b"NGSP";
/// Bytes of the header inside a gzip stream.
pub(super) const INNER_HEADER: usize = 16;
/// Bytes of the plain header of version 4.
pub(super) const PLAIN_HEADER: usize = 32;
/// Flag: trained with the antialiased form.
pub(super) const ANTIALIASED: u8 = 1;
/// Flag: extension records follow.
const EXTENSIONS: u8 = 2;

/// What the arrays hold, in the order in which they lie in a file.
pub(super) const ARRAYS: [&str; 6] = ["positions", "opacities", "colours", "scales", "rotations", "harmonics"];

/// The part that all versions share.
#[derive(Clone, Copy, Debug)]
pub(super) struct Header {
    pub(super) version: u32,
    pub(super) count: usize,
    pub(super) degree: u8,
    /// Positions are integers over 2 to this power.
    pub(super) fractional_bits: u8,
    pub(super) antialiased: bool,
    pub(super) extensions: bool,
}

impl Header {
    /// Parses 16 bytes, the same in all versions up to the flags.
    pub(super) fn parse(bytes: &[u8; INNER_HEADER], file_len: usize, name: &SourceName) -> Result<Self, ReadError> {
        if bytes[..4] != MAGIC {
            return Err(ReadError::malformed(
                "the first four bytes",
                "NGSP",
                bytes[..4].escape_ascii().to_string(),
                name,
            ));
        }
        let version = word(bytes, 4);
        if !(1..=4).contains(&version) {
            return Err(ReadError::unsupported(
                format!("SPZ version {version}"),
                "versions 1 to 4 are; write it again as version 3",
                name,
            ));
        }
        let [degree, fractional_bits, flags] = [bytes[12], bytes[13], bytes[14]];
        if degree > sh::MAX_DEGREE {
            return Err(ReadError::malformed("the SH degree", "0 to 4", degree.to_string(), name));
        }
        if fractional_bits > 24 {
            return Err(ReadError::malformed(
                "the number of fractional bits",
                "at most 24",
                fractional_bits.to_string(),
                name,
            ));
        }
        let header = Self {
            version,
            count: word(bytes, 8) as usize,
            degree,
            fractional_bits,
            antialiased: flags & ANTIALIASED != 0,
            extensions: flags & EXTENSIONS != 0,
        };
        let unpacked = header.count as u64 * header.sizes_per_gaussian().iter().sum::<usize>() as u64;
        limit::check("the unpacked size", unpacked, file_len, name)?;
        Ok(header)
    }

    /// Bytes per Gaussian of each array.
    fn sizes_per_gaussian(&self) -> [usize; 6] {
        let positions = if self.version == 1 { 6 } else { 9 };
        let rotations = if self.version < 3 { 3 } else { 4 };
        [positions, 1, 3, 3, rotations, 3 * (sh::coefficient_count(self.degree) - 1)]
    }

    /// Bytes of each array.
    pub(super) fn sizes(&self) -> [usize; 6] {
        self.sizes_per_gaussian().map(|bytes| bytes * self.count)
    }
}

/// A little-endian 32-bit number; `at` must be inside.
pub(super) fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// Number of the extension that names the axes of the data (Adobe).
const COORDINATE_SYSTEM: u32 = 0xadbe_0003;

/// What the extension records say.
#[derive(Debug, Default)]
pub(super) struct Extensions {
    /// Number of the coordinate system, 0 if none is given.
    pub(super) system: u32,
    /// Sentences about the records that were skipped.
    pub(super) notes: Vec<String>,
    /// Bytes after the last whole record.
    pub(super) trailing: usize,
}

impl Extensions {
    /// Reads records of a type, a length and a payload each, up to the end.
    pub(super) fn parse(mut bytes: &[u8], name: &SourceName) -> Result<Self, ReadError> {
        let mut extensions = Self::default();
        while bytes.len() >= 8 {
            let (kind, length) = (word(bytes, 0), word(bytes, 4) as usize);
            let rest = &bytes[8..];
            if length > rest.len() {
                let what = format!("bytes of extension {kind:#010x}");
                return Err(ReadError::truncated(what, length as u64, rest.len() as u64, name));
            }
            let payload = &rest[..length];
            bytes = &rest[length..];
            if kind == COORDINATE_SYSTEM && length == 4 {
                extensions.system = word(payload, 0);
                if extensions.system > 16 {
                    let found = extensions.system.to_string();
                    return Err(ReadError::malformed("the coordinate system", "0 to 16", found, name));
                }
            } else {
                extensions.notes.push(format!("the extension {kind:#010x} ({length} bytes) was skipped"));
            }
        }
        extensions.trailing = bytes.len();
        Ok(extensions)
    }
}

/// Directions of +X +Y +Z of a coordinate system by its number: the first eight differ in signs, the last eight have
/// y and z swapped.
pub(super) fn axes_name(system: u32) -> &'static str {
    const NAMES: [&str; 17] = [
        "RUB", "LDB", "RDB", "LUB", "RUB", "LDF", "RDF", "LUF", "RUF", "LBD", "RBD", "LBU", "RBU", "LFD", "RFD", "LFU",
        "RFU",
    ];
    NAMES[system.min(16) as usize]
}

/// Maps coordinates along the named axes to right, down, forward.
pub(super) fn rdf_from(axes: &str) -> Mat3 {
    let direction = |letter: u8| match letter {
        b'L' => Vec3::NEG_X,
        b'R' => Vec3::X,
        b'D' => Vec3::Y,
        b'U' => Vec3::NEG_Y,
        b'F' => Vec3::Z,
        _ => Vec3::NEG_Z,
    };
    let letters = axes.as_bytes();
    Mat3::from_cols(direction(letters[0]), direction(letters[1]), direction(letters[2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn systems_map_to_right_down_forward() {
        assert_eq!(rdf_from("RDF"), Mat3::IDENTITY);
        assert_eq!(rdf_from(axes_name(4)) * Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.0, -2.0, -3.0));
        assert_eq!(rdf_from("RFU") * Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.0, -3.0, 2.0));
        for system in 1..=16 {
            let m = rdf_from(axes_name(system));
            assert_eq!(m * m.transpose(), Mat3::IDENTITY, "system {system}");
        }
    }
}
