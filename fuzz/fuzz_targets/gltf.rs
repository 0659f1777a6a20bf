//! GLB and glTF, with SPZ inside.
#![no_main]

use libfuzzer_sys::fuzz_target;
use splat_io::{InMemory, SourceName, format_named};

fuzz_target!(|data: &[u8]| {
    let format = format_named("gltf").expect("a format of this name");
    let _ = format.sniff(data, data.len() as u64);
    let _ = format.read(data, &SourceName::from("fuzz"), &InMemory::default());
});
