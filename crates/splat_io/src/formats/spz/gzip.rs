//! Gzip: bounded inflating, and deflating on all cores.

use std::io::{ErrorKind, Read, Write};

use flate2::{Compress, Compression, Crc, FlushCompress, Status};
use rayon::prelude::*;

use super::super::limit;
use crate::{ReadError, SourceName};

/// A gzip stream that is read array by array.
pub(super) struct Gzip<'a> {
    decoder: flate2::bufread::GzDecoder<&'a [u8]>,
    file_len: usize,
    inflated: u64,
    name: &'a SourceName,
}

impl<'a> Gzip<'a> {
    pub(super) fn new(bytes: &'a [u8], name: &'a SourceName) -> Self {
        let decoder = flate2::bufread::GzDecoder::new(bytes);
        Self { decoder, file_len: bytes.len(), inflated: 0, name }
    }

    /// The next `length` bytes. Memory grows with what is there, not with what is asked for.
    pub(super) fn take(&mut self, length: usize, what: &str) -> Result<Vec<u8>, ReadError> {
        limit::check("the unpacked size", self.inflated + length as u64, self.file_len, self.name)?;
        let mut out = Vec::new();
        let mut filled = 0;
        while filled < length {
            if filled == out.len() {
                let step = out.len().max(4 * self.file_len).max(1 << 16);
                out.resize(out.len() + step.min(length - out.len()), 0);
            }
            match self.read(&mut out[filled..])? {
                0 => {
                    return Err(ReadError::truncated(
                        format!("bytes of the {what}"),
                        length as u64,
                        filled as u64,
                        self.name,
                    ));
                }
                n => filled += n,
            }
        }
        Ok(out)
    }

    /// Everything after the arrays, at most `keep` bytes of it kept, and how many bytes follow in the stream and after
    /// it. Checks the checksum.
    pub(super) fn rest(&mut self, keep: usize) -> Result<(Vec<u8>, u64), ReadError> {
        let mut kept = Vec::new();
        let mut dropped = 0;
        let mut buffer = vec![0; 1 << 14];
        loop {
            let n = self.read(&mut buffer)?;
            if n == 0 {
                return Ok((kept, dropped + self.decoder.get_ref().len() as u64));
            }
            limit::check("the unpacked size", self.inflated, self.file_len, self.name)?;
            let space = n.min(keep - kept.len());
            kept.extend_from_slice(&buffer[..space]);
            dropped += (n - space) as u64;
        }
    }

    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ReadError> {
        loop {
            match self.decoder.read(buffer) {
                Ok(n) => {
                    self.inflated += n as u64;
                    return Ok(n);
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
                    let found = self.file_len as u64;
                    return Err(ReadError::truncated("bytes of a whole gzip stream", found + 1, found, self.name));
                }
                Err(error) => {
                    return Err(ReadError::malformed("the gzip stream", "sound data", error.to_string(), self.name));
                }
            }
        }
    }
}

/// Input bytes of a block that is deflated by itself. A block cannot refer to the one before: less than 1 % in size.
const BLOCK: usize = 1 << 20;

/// Writes one gzip stream, its blocks deflated in parallel. Returns its length. The bytes do not depend on the number
/// of threads.
pub(super) fn deflate(parts: &[&[u8]], sink: &mut dyn Write) -> std::io::Result<u64> {
    let mut blocks: Vec<&[u8]> = parts.iter().flat_map(|part| part.chunks(BLOCK)).collect();
    if blocks.is_empty() {
        blocks.push(&[]);
    }
    let last = blocks.len() - 1;
    let packed: Vec<(Vec<u8>, Crc)> =
        blocks.par_iter().enumerate().map(|(i, block)| deflate_block(block, i == last)).collect();
    // No name, no time: equal input gives equal bytes.
    sink.write_all(&[0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 0xff])?;
    let mut crc = Crc::new();
    let mut length = 18;
    for (bytes, part) in &packed {
        sink.write_all(bytes)?;
        length += bytes.len() as u64;
        crc.combine(part);
    }
    sink.write_all(&crc.sum().to_le_bytes())?;
    sink.write_all(&crc.amount().to_le_bytes())?;
    Ok(length)
}

fn deflate_block(block: &[u8], last: bool) -> (Vec<u8>, Crc) {
    let mut crc = Crc::new();
    crc.update(block);
    let mut compress = Compress::new(Compression::new(LEVEL), false);
    let mut out = Vec::with_capacity(block.len() / 2 + 64);
    let flush = if last { FlushCompress::Finish } else { FlushCompress::Sync };
    loop {
        let done = compress.total_in() as usize;
        let before = out.len();
        let status = compress.compress_vec(&block[done..], &mut out, flush);
        let finished = match status {
            Ok(Status::StreamEnd) => true,
            // A flush is complete when all is taken and the space was not filled.
            Ok(_) => !last && compress.total_in() as usize == block.len() && out.len() < out.capacity(),
            // Nothing to do: the flush had been complete with the space just filled.
            Err(_) => true,
        };
        if finished || (status.is_ok() && out.len() == before && out.len() < out.capacity()) {
            return (out, crc);
        }
        out.reserve(block.len() / 4 + 64);
    }
}

/// Effort of deflating: higher ones take several times as long for 1 % in size.
const LEVEL: u32 = 6;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_make_one_stream_that_inflates_to_the_input() {
        let name = SourceName::from("test");
        let mut seed = 1u32;
        let mut noise = |n: usize| -> Vec<u8> {
            (0..n)
                .map(|_| {
                    seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    (seed >> 24) as u8 & 0x3f
                })
                .collect()
        };
        for sizes in [vec![], vec![0, 5], vec![BLOCK], vec![BLOCK + 1, 3 * BLOCK - 7, 1]] {
            let parts: Vec<Vec<u8>> = sizes.iter().map(|&n| noise(n)).collect();
            let all = parts.concat();
            let mut file = Vec::new();
            let slices: Vec<&[u8]> = parts.iter().map(Vec::as_slice).collect();
            assert_eq!(deflate(&slices, &mut file).unwrap(), file.len() as u64);
            let mut gzip = Gzip::new(&file, &name);
            assert!(gzip.take(all.len(), "test").unwrap() == all);
            assert_eq!(gzip.rest(9).unwrap(), (Vec::new(), 0));
        }
    }
}
