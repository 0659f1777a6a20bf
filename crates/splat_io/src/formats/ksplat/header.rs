//! Headers of a `.ksplat` file, checked against its length.

use splat_core::sh;

use crate::{ReadError, SourceName};

const FILE_HEADER: usize = 4096;
const SECTION_HEADER: usize = 1024;
/// Highest SH degree of the format.
const MAX_DEGREE: u8 = 2;

/// A whole file, cut into sections.
pub(super) struct File<'a> {
    /// 0: 32-bit floats; 1: 16 bits; 2: 16 bits, harmonics in 8.
    pub(super) level: u16,
    /// Range of 8-bit harmonics.
    pub(super) sh_range: [f32; 2],
    pub(super) sections: Vec<Section<'a>>,
    /// Bytes after the last section.
    pub(super) trailing: usize,
}

/// One section of a file.
pub(super) struct Section<'a> {
    /// Gaussians.
    pub(super) count: usize,
    pub(super) degree: u8,
    /// Gaussians in a full bucket.
    pub(super) bucket_size: usize,
    pub(super) full_buckets: usize,
    /// Length of a bucket's side over the integers that span it.
    pub(super) step: f32,
    /// The integer of a bucket's centre.
    pub(super) middle: f32,
    /// Gaussians of each partly filled bucket, 4 bytes each.
    pub(super) partial: &'a [[u8; 4]],
    /// Centres of the buckets.
    pub(super) centers: &'a [[u8; 12]],
    /// Records, `count` of them.
    pub(super) records: &'a [u8],
    /// Bytes of a record.
    pub(super) stride: usize,
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

fn f32_at(bytes: &[u8], at: usize) -> f32 {
    f32::from_bits(u32_at(bytes, at))
}

/// Bytes of a record by level and SH degree.
fn stride(level: u16, degree: u8) -> usize {
    let values = 3 * (sh::coefficient_count(degree) - 1);
    match level {
        0 => 44 + 4 * values,
        1 => 24 + 2 * values,
        _ => 24 + values,
    }
}

/// There is no magic number: the version, the level and the counts must fit each other.
pub(super) fn sniff(head: &[u8], file_len: u64) -> bool {
    if head.len() < FILE_HEADER || head[0] != 0 || head[1] == 0 {
        return false;
    }
    let [max_sections, sections, max_count, count] = [4, 8, 12, 16].map(|at| u64::from(u32_at(head, at)));
    // The file may have been cut off, so that only the headers must be inside.
    u16_at(head, 20) <= 2
        && (1..=1 << 20).contains(&max_sections)
        && sections <= max_sections
        && count <= max_count
        && file_len >= FILE_HEADER as u64 + SECTION_HEADER as u64 * max_sections
        && head.get(FILE_HEADER..FILE_HEADER + SECTION_HEADER).is_none_or(|section| {
            u32_at(section, 0) <= u32_at(section, 4) && u16_at(section, 40) <= u16::from(MAX_DEGREE)
        })
}

impl<'a> File<'a> {
    /// Finds all sections. Everything that is indexed later is inside `bytes`.
    pub(super) fn parse(bytes: &'a [u8], name: &SourceName) -> Result<Self, ReadError> {
        let truncated = |what: &str, expected: u64| ReadError::truncated(what, expected, bytes.len() as u64, name);
        if bytes.len() < FILE_HEADER {
            return Err(truncated("bytes of the header", FILE_HEADER as u64));
        }
        let level = u16_at(bytes, 20);
        if level > 2 {
            return Err(ReadError::malformed("the compression level", "0 to 2", level.to_string(), name));
        }
        let (max_sections, sections) = (u32_at(bytes, 4) as usize, u32_at(bytes, 8) as usize);
        if sections > max_sections {
            return Err(ReadError::malformed(
                "the number of sections",
                format!("at most {max_sections}"),
                sections.to_string(),
                name,
            ));
        }
        let start = FILE_HEADER as u64 + SECTION_HEADER as u64 * max_sections as u64;
        if start > bytes.len() as u64 {
            return Err(truncated("bytes up to the end of the section headers", start));
        }
        let or = |value: f32, usual: f32| if value == 0.0 { usual } else { value };
        let mut file = Self {
            level,
            sh_range: [or(f32_at(bytes, 36), -1.5), or(f32_at(bytes, 40), 1.5)],
            sections: Vec::with_capacity(sections),
            trailing: 0,
        };
        let mut rest = &bytes[start as usize..];
        for header in bytes[FILE_HEADER..].chunks_exact(SECTION_HEADER).take(sections) {
            let (section, after) = Section::parse(header, rest, level, name)?;
            file.sections.push(section);
            rest = after;
        }
        file.trailing = rest.len();
        let expected = u64::from(u32_at(bytes, 16));
        let found: u64 = file.sections.iter().map(|s| s.count as u64).sum();
        if found != expected {
            let what = "the number of Gaussians of all sections";
            return Err(ReadError::malformed(what, expected.to_string(), found.to_string(), name));
        }
        Ok(file)
    }
}

impl<'a> Section<'a> {
    /// Takes one section off the front of `body`.
    fn parse(header: &[u8], body: &'a [u8], level: u16, name: &SourceName) -> Result<(Self, &'a [u8]), ReadError> {
        let number = |at: usize| u64::from(u32_at(header, at));
        let (count, max_count) = (number(0), number(4));
        let (bucket_size, buckets, full, partial) = (number(8), number(12), number(32), number(36));
        let degree = header[40];
        if u16_at(header, 40) > u16::from(MAX_DEGREE) {
            return Err(ReadError::malformed("the SH degree", "0 to 2", u16_at(header, 40).to_string(), name));
        }
        let too_many = |what: &str, limit: u64, found: u64| {
            Err(ReadError::malformed(what, format!("at most {limit}"), found.to_string(), name))
        };
        if count > max_count {
            return too_many("the number of Gaussians of a section", max_count, count);
        }
        let stride = stride(level, degree);
        let (lengths, centers) = (4 * partial, 12 * buckets);
        let size = lengths + centers + max_count * stride as u64;
        if size > body.len() as u64 {
            return Err(ReadError::truncated("bytes of a section", size, body.len() as u64, name));
        }
        if level > 0 && full + partial > buckets {
            return too_many("the number of buckets in use", buckets, full + partial);
        }
        let (lengths, rest) = body.split_at(lengths as usize);
        let (centers, rest) = rest.split_at(centers as usize);
        let (records, rest) = rest.split_at(max_count as usize * stride);
        let partial = lengths.as_chunks::<4>().0;
        if level > 0 {
            let held = full * bucket_size + partial.iter().map(|n| u64::from(u32::from_le_bytes(*n))).sum::<u64>();
            if held < count {
                let what = "the number of Gaussians in all buckets";
                return Err(ReadError::malformed(what, count.to_string(), held.to_string(), name));
            }
        }
        let range = match u32_at(header, 24) {
            0 if level == 0 => 1,
            0 => 32767,
            range => range,
        };
        let section = Self {
            count: count as usize,
            degree,
            bucket_size: bucket_size as usize,
            full_buckets: full as usize,
            step: f32_at(header, 16) / 2.0 / range as f32,
            middle: range as f32,
            partial,
            centers: centers.as_chunks::<12>().0,
            records: &records[..count as usize * stride],
            stride,
        };
        Ok((section, rest))
    }

    /// Number after the last Gaussian of every partly filled bucket, in order.
    pub(super) fn partial_ends(&self) -> Vec<u64> {
        let mut end = self.full_buckets as u64 * self.bucket_size as u64;
        let ends = self.partial.iter().map(|n| {
            end += u64::from(u32::from_le_bytes(*n));
            end
        });
        ends.collect()
    }

    /// Bucket of record `i`.
    pub(super) fn bucket(&self, i: usize, partial_ends: &[u64]) -> usize {
        if (i as u64) < self.full_buckets as u64 * self.bucket_size as u64 {
            i / self.bucket_size
        } else {
            self.full_buckets + partial_ends.partition_point(|end| *end <= i as u64)
        }
    }
}
