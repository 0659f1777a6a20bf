//! Camera files: every format on the same bytes, whatever they look like, with the bytes as every file beside them too.
#![no_main]

use libfuzzer_sys::fuzz_target;
use splat_io::cameras::CAMERA_FORMATS;
use splat_io::{ReadError, Siblings, SourceName};

/// A folder in which every file has the same content.
struct Same<'a>(&'a [u8]);

impl Siblings for Same<'_> {
    fn get(&self, _name: &str) -> Result<Vec<u8>, ReadError> {
        Ok(self.0.to_vec())
    }
}

fuzz_target!(|data: &[u8]| {
    for format in CAMERA_FORMATS {
        for file in format.file_names() {
            let _ = format.sniff(file, data);
            let _ = format.read(data, &SourceName::from(*file), &Same(data));
        }
    }
});
