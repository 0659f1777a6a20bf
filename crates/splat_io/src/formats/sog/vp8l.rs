//! A lossless WebP encoder for tables of numbers: no prediction, but repeated runs (LZ77) and a cache of recent colours,
//! which is what pays where neighbours are equal rather than similar. Follows the WebP lossless bitstream specification.

/// Bits of the colour cache's index.
const CACHE_BITS: u32 = 10;
/// First symbol of lengths in the alphabet of green, and of cached colours.
const LENGTHS: usize = 256;
const CACHED: usize = LENGTHS + 24;
const DISTANCES: usize = 40;
const MAX_CODE: u8 = 15;
/// Runs: shortest that pays, longest of the format, how many earlier places are tried, how far they may be.
const LEAST_RUN: usize = 3;
const MOST_RUN: usize = 4096;
const TRIES: usize = 24;
const FARTHEST: usize = (1 << 20) - 121;

/// Bits from the least significant one on.
#[derive(Default)]
struct Bits {
    bytes: Vec<u8>,
    pending: u64,
    count: u32,
}

impl Bits {
    fn put(&mut self, value: u32, count: u32) {
        self.pending |= u64::from(value) << self.count;
        self.count += count;
        while self.count >= 8 {
            self.bytes.push(self.pending as u8);
            self.pending >>= 8;
            self.count -= 8;
        }
    }

    fn finish(mut self) -> Vec<u8> {
        if self.count > 0 {
            self.bytes.push(self.pending as u8);
        }
        self.bytes
    }
}

/// What stands for one or more pixels.
enum Token {
    Literal([u8; 4]),
    Cached(usize),
    Run { length: usize, distance: usize },
}

/// Symbol, number of extra bits, extra bits of a length or a distance code (both from 1).
fn prefix(value: usize) -> (usize, u32, u32) {
    let v = value - 1;
    if v < 4 {
        return (v, 0, 0);
    }
    let high = v.ilog2();
    let extra = high - 1;
    (2 * high as usize + (v >> extra & 1), extra, (v & ((1 << extra) - 1)) as u32)
}

/// Distances as the format counts them: short codes for the pixel before and the one above.
fn distance_code(distance: usize, width: usize) -> usize {
    if distance == width {
        1
    } else if distance == 1 {
        2
    } else {
        distance + 120
    }
}

/// The whole file. `bytes`: 3 or 4 per pixel; both sides 1 to 16,384.
pub(super) fn encode(width: usize, height: usize, channels: usize, bytes: &[u8]) -> Vec<u8> {
    let pixels: Vec<[u8; 4]> =
        bytes.chunks_exact(channels).map(|p| [p[0], p[1], p[2], if channels == 4 { p[3] } else { 255 }]).collect();
    let tokens = tokens(&pixels);
    let mut counts =
        [vec![0u32; CACHED + (1 << CACHE_BITS)], vec![0; 256], vec![0; 256], vec![0; 256], vec![0; DISTANCES]];
    for token in &tokens {
        match *token {
            Token::Literal([r, g, b, a]) => {
                for (count, v) in counts.iter_mut().zip([g, r, b, a]) {
                    count[usize::from(v)] += 1;
                }
            }
            Token::Cached(index) => counts[0][CACHED + index] += 1,
            Token::Run { length, distance } => {
                counts[0][LENGTHS + prefix(length).0] += 1;
                counts[4][prefix(distance_code(distance, width)).0] += 1;
            }
        }
    }
    let mut bits = Bits::default();
    bits.put(0x2f, 8);
    bits.put(width as u32 - 1, 14);
    bits.put(height as u32 - 1, 14);
    bits.put(u32::from(channels == 4), 1);
    // Version 0, no transform, a colour cache, one group of codes.
    bits.put(0, 3);
    bits.put(0, 1);
    bits.put(1, 1);
    bits.put(CACHE_BITS, 4);
    bits.put(0, 1);
    let codes = counts.map(|counts| Code::new(&counts, MAX_CODE));
    for code in &codes {
        code.describe(&mut bits);
    }
    for token in &tokens {
        match *token {
            Token::Literal([r, g, b, a]) => {
                for (code, v) in codes.iter().zip([g, r, b, a]) {
                    code.put(usize::from(v), &mut bits);
                }
            }
            Token::Cached(index) => codes[0].put(CACHED + index, &mut bits),
            Token::Run { length, distance } => {
                let (symbol, extra, value) = prefix(length);
                codes[0].put(LENGTHS + symbol, &mut bits);
                bits.put(value, extra);
                let (symbol, extra, value) = prefix(distance_code(distance, width));
                codes[4].put(symbol, &mut bits);
                bits.put(value, extra);
            }
        }
    }
    let data = bits.finish();
    let padded = data.len().next_multiple_of(2);
    let mut file = b"RIFF".to_vec();
    file.extend((padded as u32 + 12).to_le_bytes());
    file.extend(b"WEBPVP8L");
    file.extend((data.len() as u32).to_le_bytes());
    file.extend(&data);
    file.resize(20 + padded, 0);
    file
}

fn tokens(pixels: &[[u8; 4]]) -> Vec<Token> {
    const NONE: u32 = u32::MAX;
    const HASH_BITS: u32 = 16;
    let word = |[r, g, b, a]: [u8; 4]| u32::from_be_bytes([a, r, g, b]);
    let hash = |at: usize| {
        let mixed = word(pixels[at]).wrapping_mul(0x9e37_79b1)
            ^ word(pixels[at + 1]).wrapping_mul(0x85eb_ca77)
            ^ word(pixels[at + 2]).wrapping_mul(0xc2b2_ae3d);
        (mixed.wrapping_mul(0x27d4_eb2f) >> (32 - HASH_BITS)) as usize
    };
    let mut heads = vec![NONE; 1 << HASH_BITS];
    let mut before = vec![NONE; pixels.len()];
    let mut cache = vec![0u32; 1 << CACHE_BITS];
    let mut tokens = Vec::new();
    let mut at = 0;
    while at < pixels.len() {
        let mut run = (LEAST_RUN - 1, 0);
        if at + LEAST_RUN <= pixels.len() {
            let mut place = heads[hash(at)];
            for _ in 0..TRIES {
                if place == NONE || at - place as usize > FARTHEST {
                    break;
                }
                let there = place as usize;
                let same = pixels[at..].iter().zip(&pixels[there..]).take(MOST_RUN).take_while(|(a, b)| a == b).count();
                if same > run.0 {
                    run = (same, at - there);
                }
                place = before[there];
            }
        }
        let length = if run.1 > 0 { run.0 } else { 1 };
        for i in at..at + length {
            let color = word(pixels[i]);
            let index = (color.wrapping_mul(0x1e35_a7bd) >> (32 - CACHE_BITS)) as usize;
            if run.1 == 0 {
                tokens.push(if cache[index] == color { Token::Cached(index) } else { Token::Literal(pixels[i]) });
            }
            cache[index] = color;
            if i + LEAST_RUN <= pixels.len() {
                let head = &mut heads[hash(i)];
                before[i] = std::mem::replace(head, i as u32);
            }
        }
        if run.1 > 0 {
            tokens.push(Token::Run { length, distance: run.1 });
        }
        at += length;
    }
    tokens
}

/// A canonical prefix code.
struct Code {
    lengths: Vec<u8>,
    /// Bits as they are written, the first one least significant.
    words: Vec<u16>,
    /// A single symbol takes no bits.
    single: bool,
}

impl Code {
    fn new(counts: &[u32], longest: u8) -> Self {
        let used = counts.iter().filter(|c| **c > 0).count();
        let lengths = lengths(counts, longest);
        let mut words = vec![0; counts.len()];
        let mut next = 0u32;
        for length in 1..=longest {
            next <<= 1;
            for (symbol, _) in lengths.iter().enumerate().filter(|(_, l)| **l == length) {
                words[symbol] = (next as u16).reverse_bits() >> (16 - length);
                next += 1;
            }
        }
        Self { lengths, words, single: used < 2 }
    }

    fn put(&self, symbol: usize, bits: &mut Bits) {
        if !self.single {
            bits.put(u32::from(self.words[symbol]), u32::from(self.lengths[symbol]));
        }
    }

    /// Writes the lengths, from which the reader makes the same code.
    fn describe(&self, bits: &mut Bits) {
        const ORDER: [usize; 19] = [17, 18, 0, 1, 2, 3, 4, 5, 16, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
        if self.single {
            // One symbol of 8 bits; the first pixel is never a run, so that it is below 256.
            let symbol = self.lengths.iter().position(|l| *l > 0).unwrap_or(0);
            bits.put(0b101, 3);
            bits.put(symbol as u32, 8);
            return;
        }
        // Symbols of lengths: themselves, or 17 and 18 for 3 to 138 zeros. Extra bits go with them.
        let mut symbols: Vec<(usize, u32, u32)> = Vec::new();
        let mut rest = self.lengths.as_slice();
        while let Some(&first) = rest.first() {
            let zeros = rest.iter().take(138).take_while(|l| **l == 0).count();
            let taken = match zeros {
                0..3 => {
                    symbols.push((usize::from(first), 0, 0));
                    1
                }
                3..11 => {
                    symbols.push((17, 3, zeros as u32 - 3));
                    zeros
                }
                _ => {
                    symbols.push((18, 7, zeros as u32 - 11));
                    zeros
                }
            };
            rest = &rest[taken..];
        }
        let mut counts = [0u32; 19];
        for (symbol, ..) in &symbols {
            counts[*symbol] += 1;
        }
        if counts.iter().filter(|c| **c > 0).count() < 2 {
            // A second symbol keeps the code complete.
            counts[if counts[0] == 0 { 0 } else { 1 }] = 1;
        }
        let code = Self::new(&counts, 7);
        bits.put(0, 1);
        bits.put(19 - 4, 4);
        for symbol in ORDER {
            bits.put(u32::from(code.lengths[symbol]), 3);
        }
        // Lengths of the whole alphabet follow.
        bits.put(0, 1);
        for (symbol, extra, value) in symbols {
            code.put(symbol, bits);
            bits.put(value, extra);
        }
    }
}

/// Huffman's lengths, none above `longest`: rare symbols are counted as if more frequent until all fit.
fn lengths(counts: &[u32], longest: u8) -> Vec<u8> {
    let symbols: Vec<usize> = (0..counts.len()).filter(|&s| counts[s] > 0).collect();
    let mut lengths = vec![0u8; counts.len()];
    if symbols.len() < 2 {
        for &symbol in &symbols {
            lengths[symbol] = 1;
        }
        return lengths;
    }
    let mut least = 1u64;
    loop {
        let mut heap: std::collections::BinaryHeap<std::cmp::Reverse<(u64, usize)>> = symbols
            .iter()
            .enumerate()
            .map(|(node, &s)| std::cmp::Reverse((u64::from(counts[s]).max(least), node)))
            .collect();
        let mut parents = vec![0usize; 2 * symbols.len() - 1];
        let mut next = symbols.len();
        while let (Some(a), Some(b)) = (heap.pop(), heap.pop()) {
            parents[a.0.1] = next;
            parents[b.0.1] = next;
            heap.push(std::cmp::Reverse((a.0.0 + b.0.0, next)));
            next += 1;
            if next == parents.len() {
                break;
            }
        }
        let mut depths = vec![0u32; parents.len()];
        for node in (0..parents.len() - 1).rev() {
            depths[node] = depths[parents[node]] + 1;
        }
        if depths[..symbols.len()].iter().all(|d| *d <= u32::from(longest)) {
            for (&symbol, depth) in symbols.iter().zip(depths) {
                lengths[symbol] = depth as u8;
            }
            return lengths;
        }
        least *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(file: &[u8]) -> Vec<u8> {
        let mut decoder = image_webp::WebPDecoder::new(std::io::Cursor::new(file)).unwrap();
        let mut bytes = vec![0; decoder.output_buffer_size().unwrap()];
        decoder.read_image(&mut bytes).unwrap();
        bytes
    }

    #[test]
    fn pictures_come_back_from_another_decoder() {
        let mut state = 7u64;
        let mut random = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) % below) as u8
        };
        let sizes = [(1, 1), (4, 1), (1, 9), (16, 16), (64, 40), (300, 257), (2, 4000)];
        for (case, (width, height)) in sizes.into_iter().enumerate() {
            for kind in 0..6 {
                let channels = if kind % 2 == 0 { 3 } else { 4 };
                let bytes: Vec<u8> = (0..width * height * channels)
                    .map(|i| match kind {
                        0 => random(256),
                        1 => random(3) * 80,
                        2 => (i / 700) as u8,
                        3 => (i % 28) as u8,
                        4 => random(256) & random(256) & random(256) & random(256),
                        _ => 9,
                    })
                    .collect();
                let file = encode(width, height, channels, &bytes);
                assert!(decoded(&file) == bytes, "picture {case}, kind {kind}");
            }
        }
    }

    #[test]
    fn lengths_keep_their_limit_and_fill_the_code() {
        let mut fibonacci = vec![1u32, 1];
        while fibonacci.len() < 40 {
            fibonacci.push(fibonacci[fibonacci.len() - 1] + fibonacci[fibonacci.len() - 2]);
        }
        for longest in [7, 15] {
            let lengths = lengths(&fibonacci, longest);
            assert!(lengths.iter().all(|l| (1..=longest).contains(l)));
            assert_eq!(lengths.iter().map(|l| 1u32 << (longest - l)).sum::<u32>(), 1 << longest);
        }
    }
}
