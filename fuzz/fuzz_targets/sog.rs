//! SOG: the file as an archive, and as a folder: pieces between lines of `--` are `meta.json` and the files `0`, `1`, ...
#![no_main]

use libfuzzer_sys::fuzz_target;
use splat_io::{InMemory, SourceName, format_named};

fuzz_target!(|data: &[u8]| {
    let format = format_named("sog").expect("a format of this name");
    let name = SourceName::from("fuzz");
    let _ = format.read(data, &name, &InMemory::default());
    let mut pieces: Vec<Vec<u8>> = vec![Vec::new()];
    let mut rest = data;
    while let Some((&first, after)) = rest.split_first() {
        if let Some(after) = rest.strip_prefix(b"\n--\n") {
            pieces.push(Vec::new());
            rest = after;
        } else {
            pieces.last_mut().expect("there is a first piece").push(first);
            rest = after;
        }
    }
    let meta = pieces.remove(0);
    let mut files = InMemory::default();
    files.files.extend(pieces.into_iter().enumerate().map(|(i, piece)| (i.to_string(), piece)));
    let _ = format.read(&meta, &name, &files);
});
