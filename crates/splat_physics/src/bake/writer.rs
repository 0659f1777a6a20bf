//! [`BakeWriter`].

use xxhash_rust::xxh3::xxh3_64;

use super::{Baked, ENTRY, HEADER, MAGIC, Tag, VERSION};

/// Gathers sections and makes a file of them.
#[derive(Clone, Debug, Default)]
pub struct BakeWriter {
    sections: Vec<(Tag, Vec<u8>)>,
}

/// Where values are written to.
#[derive(Clone, Debug, Default)]
pub struct Sink {
    bytes: Vec<u8>,
}

impl Sink {
    /// Appends bytes as they are.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Appends a value.
    pub fn put<T: Baked>(&mut self, value: &T) {
        value.write(self);
    }

    /// Appends the number of values and the values, as a `Vec` of them is written.
    pub fn put_all<'a, T: Baked + 'a>(&mut self, values: impl IntoIterator<Item = &'a T, IntoIter: ExactSizeIterator>) {
        let values = values.into_iter();
        self.put(&(values.len() as u64));
        values.for_each(|value| value.write(self));
    }
}

impl BakeWriter {
    /// No sections yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a section that holds one value; takes the place of one of the same name.
    pub fn put<T: Baked>(&mut self, tag: Tag, value: &T) {
        self.section(tag, |sink| sink.put(value));
    }

    /// Adds a section with what `write` writes; takes the place of one of the same name.
    pub fn section(&mut self, tag: Tag, write: impl FnOnce(&mut Sink)) {
        let mut sink = Sink::default();
        write(&mut sink);
        self.sections.retain(|(other, _)| *other != tag);
        self.sections.push((tag, sink.bytes));
    }

    /// The file. The same sections in the same order give the same bytes.
    pub fn finish(self) -> Vec<u8> {
        let mut table = Vec::with_capacity(self.sections.len() * ENTRY);
        let mut at = HEADER + self.sections.len() * ENTRY;
        for (tag, bytes) in &self.sections {
            table.extend_from_slice(&tag.0);
            table.extend_from_slice(&[0; 4]);
            for number in [at as u64, bytes.len() as u64, xxh3_64(bytes)] {
                table.extend_from_slice(&number.to_le_bytes());
            }
            at += bytes.len().next_multiple_of(8);
        }
        let mut file = Vec::with_capacity(at);
        file.extend_from_slice(&MAGIC);
        file.extend_from_slice(&VERSION.to_le_bytes());
        file.extend_from_slice(&(self.sections.len() as u32).to_le_bytes());
        file.extend_from_slice(&xxh3_64(&table).to_le_bytes());
        file.extend_from_slice(&table);
        for (_, bytes) in &self.sections {
            file.extend_from_slice(bytes);
            file.resize(file.len().next_multiple_of(8), 0);
        }
        file
    }
}
