//! Damaged files: every format, cut off, with flipped bytes, inflated numbers and pieces of itself spliced in, is read or
//! refused with one clear error, without a panic, and without taking more memory than the size of the file justifies.
//!
//! The seed is printed with a failure; `SPLAT_MUTATIONS=100000` tries each file more often than the suite does.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use common::{Random, capture, random_cloud};
use splat_io::{FORMATS, InMemory, SourceName, WriteOptions, read_with, write_as};

/// Counts the bytes in use, so that a test can bound them.
struct Counting;

static USED: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is handed to the system's allocator unchanged; counting touches no memory of the caller.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        // SAFETY: the caller keeps the contract of `alloc_zeroed`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        USED.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

fn count(size: usize) {
    let used = USED.fetch_add(size, Ordering::Relaxed) + size;
    PEAK.fetch_max(used, Ordering::Relaxed);
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Only one test at a time, or one's memory counts as the other's.
static ONE: Mutex<()> = Mutex::new(());

/// What a file of this size may take while it is read: unpacked bytes are limited to 16 MiB and 100 times the file, and
/// a Gaussian takes at most 4 times its unpacked bytes as arrays, beside the unpacked bytes themselves.
fn allowed(file: usize) -> usize {
    5 * ((16 << 20) + 100 * file) + (8 << 20)
}

/// A file and those beside it.
struct Sample {
    name: String,
    bytes: Vec<u8>,
    files: InMemory,
}

/// Whether reading ended well, after checking that it ended in order.
fn survive(sample: &Sample, bytes: &[u8], what: &str) -> bool {
    let name = SourceName::from(sample.name.as_str());
    let before = USED.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let result = catch_unwind(AssertUnwindSafe(|| read_with(bytes, &name, &sample.files)));
    let taken = PEAK.load(Ordering::Relaxed).saturating_sub(before);
    let beside: usize = sample.files.files.values().map(Vec::len).sum();
    let limit = allowed(bytes.len() + beside);
    assert!(taken <= limit, "{}: {what} took {taken} bytes of memory, {limit} are justified", sample.name);
    match result {
        Ok(Ok((cloud, _))) => {
            assert_eq!(cloud.sh().len(), cloud.len() * cloud.sh_stride());
            true
        }
        Ok(Err(error)) => {
            let text = error.to_string();
            assert!(text.len() < 2000 && !text.contains('\n'), "{}: {what}: not one sentence: {text}", sample.name);
            false
        }
        Err(_) => panic!("{}: {what} made the reader panic", sample.name),
    }
}

/// One file per way of writing a format, small enough for thousands of attempts.
fn samples() -> Vec<Sample> {
    let mut samples = Vec::new();
    for format in FORMATS.iter().filter(|f| f.writable()) {
        for (version, degree) in [(None, 0), (None, 3), (Some(2), 1), (Some(4), 2), (Some(4), 4)] {
            if version.is_some() && format.name() != "spz" {
                continue;
            }
            let mut options = WriteOptions::default();
            options.version = version;
            let mut bytes = Vec::new();
            write_as(*format, &random_cloud(11, 40, degree), &options, &mut bytes).unwrap();
            let name = format!("v{}d{degree}.{}", version.unwrap_or(0), format.extensions()[0]);
            samples.push(Sample { name, bytes, files: InMemory::default() });
        }
    }
    samples.push(ksplat());
    // Text formats by other programs: properties as text, and a glTF whose data lies in its text.
    let ascii = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
                 property float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\nproperty float opacity\n\
                 property float scale_0\nproperty float scale_1\nproperty float scale_2\nproperty float rot_0\n\
                 property float rot_1\nproperty float rot_2\nproperty float rot_3\nend_header\n\
                 1 2 3 0 0 0 1 -3 -3 -3 1 0 0 0\n4 5 6 .1 .2 .3 2 -4 -4 -4 0 1 0 0\n";
    samples.push(Sample { name: "text.ply".to_owned(), bytes: ascii.into(), files: InMemory::default() });
    samples
}

/// A level-1 file with one full and one partly filled bucket (the format has no writer here).
fn ksplat() -> Sample {
    let (full, partial) = (8u32, 3u32);
    let count = full + partial;
    let mut bytes = vec![0; 4096 + 1024];
    let mut put = |at: usize, value: u32| bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
    for (at, value) in [(4, 1), (8, 1), (12, count), (16, count), (20, 1)] {
        put(at, value);
    }
    let section =
        [(0, count), (4, count), (8, full), (12, 2), (16, 5f32.to_bits()), (20, 12), (32, 1), (36, 1), (40, 1)];
    for (at, value) in section {
        put(4096 + at, value);
    }
    bytes[1] = 1;
    bytes.extend(partial.to_le_bytes());
    for center in [1.0f32, 2.0, 3.0, -4.0, 0.5, 7.0] {
        bytes.extend(center.to_le_bytes());
    }
    let mut random = Random(3);
    bytes.extend((0..count * 42).map(|_| random.below(60) as u8));
    let sample = Sample { name: "made.ksplat".to_owned(), bytes, files: InMemory::default() };
    assert!(survive(&sample, &sample.bytes, "nothing"), "the made .ksplat must be sound");
    sample
}

/// One change, or several on top of each other.
fn mutate(random: &mut Random, original: &[u8], other: &[u8]) -> (Vec<u8>, String) {
    let mut bytes = original.to_vec();
    let mut what = String::new();
    for _ in 0..1 + random.below(3) {
        let n = bytes.len().max(1);
        // Headers decide most: half of the changes fall there.
        let reach = if random.below(2) == 0 { n.min(200) } else { n };
        let at = random.below(reach);
        match random.below(6) {
            0 => {
                bytes.truncate(at);
                what += &format!("cut at {at}; ");
            }
            1 if at < bytes.len() => {
                let bit = random.below(8);
                bytes[at] ^= 1 << bit;
                what += &format!("bit {bit} of byte {at}; ");
            }
            2 if at < bytes.len() => {
                bytes[at] = [0, 1, 0x7f, 0x80, 0xff][random.below(5)];
                what += &format!("byte {at} set; ");
            }
            3 if at + 4 <= bytes.len() => {
                let value = [0u32, 1, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 1 << 20, 1 << 28][random.below(7)];
                bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
                what += &format!("{value:#x} at {at}; ");
            }
            4 => {
                // Inflates a number that is written as text.
                let digit = (at..bytes.len()).find(|&i| bytes[i].is_ascii_digit());
                if let Some(digit) = digit {
                    let more = b"99999999"[..1 + random.below(8)].to_vec();
                    bytes.splice(digit..digit, more);
                    what += &format!("digits at {digit}; ");
                }
            }
            _ => {
                let from = random.below(other.len().max(1));
                let length = random.below(64).min(other.len() - from);
                let over = random.below(64).min(bytes.len().saturating_sub(at));
                let start = at.min(bytes.len());
                bytes.splice(start..start + over, other[from..from + length].iter().copied());
                what += &format!("{length} bytes for {over} at {at}; ");
            }
        }
    }
    (bytes, what)
}

fn attempts() -> usize {
    std::env::var("SPLAT_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(3000)
}

#[test]
fn damaged_files_are_read_or_refused_in_order() {
    let _one = ONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let samples = samples();
    let mut read = 0;
    for (number, sample) in samples.iter().enumerate() {
        assert!(survive(sample, &sample.bytes, "nothing"), "{} must be sound", sample.name);
        let mut random = Random(0x5eed + number as u64);
        for attempt in 0..attempts() {
            let other = &samples[random.below(samples.len())].bytes;
            let (bytes, what) = mutate(&mut random, &sample.bytes, other);
            read += usize::from(survive(sample, &bytes, &format!("attempt {attempt}: {what}")));
        }
    }
    // A test in which nothing is read, or everything, would test nothing.
    let all = attempts() * samples.len();
    assert!(read > all / 50 && read < all * 9 / 10, "{read} of {all} were read");
}

#[test]
fn every_cut_of_every_file_is_survived() {
    let _one = ONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    for sample in samples() {
        let step = (sample.bytes.len() / 400).max(1);
        for cut in (0..sample.bytes.len()).step_by(step) {
            survive(&sample, &sample.bytes[..cut], &format!("cut at {cut}"));
        }
    }
}

#[test]
fn folders_are_read_or_refused_in_order_and_never_left() {
    let _one = ONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let leaving = ["../means_l.webp", "/etc/passwd", "C:\\x.webp", "a\\..\\..\\b", "http://x/y", ""];
    for name in leaving {
        let meta = format!(
            r#"{{"version":2,"count":1,"means":{{"mins":[0,0,0],"maxs":[1,1,1],"files":["{0}","{0}"]}},
            "scales":{{"codebook":[0],"files":["s.webp"]}},"quats":{{"files":["q.webp"]}},
            "sh0":{{"codebook":[0],"files":["c.webp"]}}}}"#,
            name.replace('\\', "\\\\")
        );
        let gltf = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":12,"uri":"{}"}}],
            "bufferViews":[{{"buffer":0,"byteLength":12}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":1,"type":"VEC3"}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"extensions":{{"KHR_gaussian_splatting":{{}}}}}}]}}]}}"#,
            name.replace('\\', "%5c")
        );
        for text in [meta, gltf] {
            let error = splat_io::read_bytes(text.as_bytes(), "made.json").unwrap_err();
            assert!(matches!(error, splat_io::ReadError::Outside { .. }), "`{name}`: {error}");
        }
    }
    let Some(folder) = capture("formats/sample_sog_v1_dir") else { return };
    let mut files = InMemory::default();
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        files.files.insert(entry.file_name().to_string_lossy().into_owned(), std::fs::read(entry.path()).unwrap());
    }
    let bytes = files.files.remove("meta.json").unwrap();
    let mut sample = Sample { name: "meta.json".to_owned(), bytes, files };
    assert!(survive(&sample, &sample.bytes, "nothing"));
    let mut random = Random(77);
    for attempt in 0..60 {
        let names: Vec<String> = sample.files.files.keys().cloned().collect();
        let name = &names[random.below(names.len())];
        let original = sample.files.files[name].clone();
        let (bytes, what) = mutate(&mut random, &original, &sample.bytes);
        sample.files.files.insert(name.clone(), bytes);
        let (meta, and) = mutate(&mut random, &sample.bytes, &original);
        let meta = if attempt % 2 == 0 { &sample.bytes } else { &meta };
        survive(&sample, meta, &format!("attempt {attempt}: {name}: {what} {and}"));
        sample.files.files.insert(name.clone(), original);
    }
}

#[test]
fn bombs_are_refused_before_they_unfold() {
    let _one = ONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let bomb = |count: u32, version: u32| {
        let mut inner = b"NGSP".to_vec();
        inner.extend(version.to_le_bytes());
        inner.extend(count.to_le_bytes());
        inner.extend([3, 12, 0, 0]);
        inner
    };
    // 64 MiB of zeros in 64 KiB of gzip, sound in every other way.
    let mut inner = bomb(1 << 20, 3);
    inner.resize(16 + (65 << 20), 0);
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    std::io::Write::write_all(&mut gzip, &inner).unwrap();
    let gzip = gzip.finish().unwrap();
    drop(inner);
    assert!(gzip.len() < 100_000);
    let sample = |name: &str, bytes: Vec<u8>| Sample { name: name.to_owned(), bytes, files: InMemory::default() };
    let gzip = sample("bomb.spz", gzip);
    assert!(!survive(&gzip, &gzip.bytes, "a gzip bomb"));
    // A whole stream that promises far more than it holds.
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    std::io::Write::write_all(&mut gzip, &bomb(200_000, 3)).unwrap();
    let liar = sample("liar.spz", gzip.finish().unwrap());
    assert!(!survive(&liar, &liar.bytes, "a short stream"));
    // A tiny mesh that a thousand nodes show.
    let nodes: Vec<String> = (0..100_000).map(|_| r#"{"mesh":0}"#.to_owned()).collect();
    let scene: Vec<String> = (0..nodes.len()).map(|i| i.to_string()).collect();
    let mut bytes = Vec::new();
    write_as(
        splat_io::format_named("gltf").unwrap(),
        &random_cloud(1, 20_000, 0),
        &WriteOptions::default(),
        &mut bytes,
    )
    .unwrap();
    let length = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
    let text = String::from_utf8(bytes[20..20 + length].to_vec()).unwrap();
    let mut json: serde_json::Value = serde_json::from_str(&text).unwrap();
    json["nodes"] = serde_json::from_str(&format!("[{}]", nodes.join(","))).unwrap();
    json["scenes"] = serde_json::from_str(&format!(r#"[{{"nodes":[{}]}}]"#, scene.join(","))).unwrap();
    let mut text = serde_json::to_vec(&json).unwrap();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut crowd = b"glTF\x02\0\0\0".to_vec();
    crowd.extend(((12 + 8 + text.len() + bytes.len() - 20 - length) as u32).to_le_bytes());
    crowd.extend((text.len() as u32).to_le_bytes());
    crowd.extend(b"JSON");
    crowd.extend(&text);
    crowd.extend(&bytes[20 + length..]);
    let crowd = sample("crowd.glb", crowd);
    assert!(!survive(&crowd, &crowd.bytes, "a mesh shown 100,000 times"));
}
