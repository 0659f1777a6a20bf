//! Any bytes, the format decided by their content.
#![no_main]

use libfuzzer_sys::fuzz_target;
use splat_io::read_bytes;

fuzz_target!(|data: &[u8]| {
    let _ = read_bytes(data, "fuzz");
});
