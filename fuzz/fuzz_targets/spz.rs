//! SPZ: the file as it is, and as the content of a sound gzip stream, so that checksums do not stop the fuzzer.
#![no_main]

use libfuzzer_sys::fuzz_target;
use splat_io::{InMemory, SourceName, format_named};

fuzz_target!(|data: &[u8]| {
    let format = format_named("spz").expect("a format of this name");
    let name = SourceName::from("fuzz");
    let _ = format.read(data, &name, &InMemory::default());
    let mut gzip = Vec::new();
    let mut reader = flate2::bufread::GzEncoder::new(data, flate2::Compression::fast());
    if std::io::Read::read_to_end(&mut reader, &mut gzip).is_ok() {
        let _ = format.read(&gzip, &name, &InMemory::default());
    }
});
