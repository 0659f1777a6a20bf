//! [`BakeReader`].

use xxhash_rust::xxh3::xxh3_64;

use super::{BakeError, Baked, ENTRY, HEADER, MAGIC, MOST_SECTIONS, Tag, VERSION};

/// The sections of a file, their bounds and checksums checked.
#[derive(Clone, Debug)]
pub struct BakeReader<'a> {
    sections: Vec<(Tag, &'a [u8])>,
}

/// Where values are read from: a section, from some place on.
#[derive(Clone, Debug)]
pub struct Source<'a> {
    section: Tag,
    left: &'a [u8],
}

impl<'a> BakeReader<'a> {
    /// Looks at a whole file.
    ///
    /// # Errors
    /// Anything that is not a whole, unchanged file of this version.
    pub fn new(file: &'a [u8]) -> Result<Self, BakeError> {
        if file.len() < MAGIC.len() || file[..MAGIC.len()] != MAGIC {
            return Err(BakeError::NotABake);
        }
        let part = |first: u64, bytes: u64| {
            let cut = BakeError::Truncated { need: first.saturating_add(bytes), have: file.len() };
            let end =
                first.checked_add(bytes).and_then(|end| usize::try_from(end).ok()).filter(|&end| end <= file.len());
            // `first` is no more than `end`, which is in the file.
            end.map(|end| &file[first as usize..end]).ok_or(cut)
        };
        let (version, count) = (u32_of(part(8, 4)?), u32_of(part(12, 4)?));
        if version != VERSION {
            return Err(BakeError::Version { found: version, known: VERSION });
        }
        if count as usize > MOST_SECTIONS {
            return Err(BakeError::TooManySections { found: count, most: MOST_SECTIONS });
        }
        let checksum = u64_of(part(16, 8)?);
        let table = part(HEADER as u64, u64::from(count) * ENTRY as u64)?;
        if xxh3_64(table) != checksum {
            return Err(BakeError::TableChecksum);
        }
        let mut sections: Vec<(Tag, &[u8])> = Vec::with_capacity(count as usize);
        for entry in table.chunks_exact(ENTRY) {
            let section = Tag([entry[0], entry[1], entry[2], entry[3]]);
            let bytes = part(u64_of(&entry[8..]), u64_of(&entry[16..]))?;
            if xxh3_64(bytes) != u64_of(&entry[24..]) {
                return Err(BakeError::Checksum { section });
            }
            if sections.iter().any(|(other, _)| *other == section) {
                return Err(BakeError::Twice { section });
            }
            sections.push((section, bytes));
        }
        Ok(Self { sections })
    }

    /// The names of the sections, in the order they were written.
    pub fn tags(&self) -> impl Iterator<Item = Tag> {
        self.sections.iter().map(|(tag, _)| *tag)
    }

    /// Whether there is a section of this name.
    pub fn has(&self, tag: Tag) -> bool {
        self.sections.iter().any(|(other, _)| *other == tag)
    }

    /// A section, to be read value by value; end with [`Source::end`].
    ///
    /// # Errors
    /// [`BakeError::Missing`].
    pub fn section(&self, tag: Tag) -> Result<Source<'a>, BakeError> {
        let found = self.sections.iter().find(|(other, _)| *other == tag);
        found.map(|&(section, left)| Source { section, left }).ok_or(BakeError::Missing { section: tag })
    }

    /// The value that a section holds.
    ///
    /// # Errors
    /// [`BakeError::Missing`], [`BakeError::Short`], [`BakeError::Long`], [`BakeError::Unsound`].
    pub fn get<T: Baked>(&self, tag: Tag) -> Result<T, BakeError> {
        let mut source = self.section(tag)?;
        let value = source.get()?;
        source.end()?;
        Ok(value)
    }
}

impl<'a> Source<'a> {
    /// The next bytes as they are.
    ///
    /// # Errors
    /// [`BakeError::Short`].
    pub fn bytes(&mut self, count: usize) -> Result<&'a [u8], BakeError> {
        let (bytes, left) = self.left.split_at_checked(count).ok_or(BakeError::Short { section: self.section })?;
        self.left = left;
        Ok(bytes)
    }

    /// The next value.
    ///
    /// # Errors
    /// [`BakeError::Short`], [`BakeError::Unsound`].
    pub fn get<T: Baked>(&mut self) -> Result<T, BakeError> {
        T::read(self)
    }

    /// Bytes that have not been read.
    pub fn left(&self) -> usize {
        self.left.len()
    }

    /// An answer for numbers that cannot be.
    pub fn unsound(&self, what: &'static str) -> BakeError {
        BakeError::Unsound { section: self.section, what }
    }

    /// Answers with [`BakeError::Short`], for a reader that knows how much must follow.
    pub fn short(&self) -> BakeError {
        BakeError::Short { section: self.section }
    }

    /// Makes sure that all has been read.
    ///
    /// # Errors
    /// [`BakeError::Long`].
    pub fn end(self) -> Result<(), BakeError> {
        match self.left.len() {
            0 => Ok(()),
            bytes => Err(BakeError::Long { section: self.section, bytes }),
        }
    }
}

/// The first four bytes, of at least as many.
fn u32_of(bytes: &[u8]) -> u32 {
    u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
}

/// The first eight bytes, of at least as many.
fn u64_of(bytes: &[u8]) -> u64 {
    u64::from(u32_of(bytes)) | u64::from(u32_of(&bytes[4..])) << 32
}
