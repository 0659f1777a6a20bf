//! The text at the start of a PLY file.

use crate::{ReadError, SourceName};

/// Longest header read, in bytes: thousands of comments fit.
const MAX_TEXT: usize = 1 << 20;

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(word: &str) -> Option<Self> {
        Some(match word {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// The word that old and new readers know.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::I8 => "char",
            Self::U8 => "uchar",
            Self::I16 => "short",
            Self::U16 => "ushort",
            Self::I32 => "int",
            Self::U32 => "uint",
            Self::F32 => "float",
            Self::F64 => "double",
        }
    }

    /// Bytes of a value.
    pub(crate) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// How numbers are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    Ascii,
    Little,
    Big,
}

/// One number or a list of numbers per record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    One(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Property {
    pub(crate) name: String,
    pub(crate) kind: Kind,
}

/// A table of records.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Element {
    pub(crate) name: String,
    pub(crate) count: u64,
    pub(crate) properties: Vec<Property>,
}

impl Element {
    /// Bytes of a record in a binary file; `None` if lists make it vary.
    pub(crate) fn stride(&self) -> Option<usize> {
        self.properties.iter().map(|p| if let Kind::One(s) = p.kind { Some(s.size()) } else { None }).sum()
    }

    pub(crate) fn has(&self, name: &str) -> bool {
        self.properties.iter().any(|p| p.name == name)
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Header {
    pub(crate) encoding: Encoding,
    pub(crate) elements: Vec<Element>,
    /// Without the word `comment` and the space after it.
    pub(crate) comments: Vec<String>,
    /// Bytes up to and with the line feed after `end_header`: the data starts here.
    pub(crate) len: usize,
}

impl Header {
    /// Whether a file starts as a PLY file does.
    pub(crate) fn sniff(head: &[u8]) -> bool {
        head.starts_with(b"ply\n") || head.starts_with(b"ply\r\n")
    }

    /// The header as text, with its last line feed.
    pub(crate) fn to_text(&self) -> Vec<u8> {
        let encoding = match self.encoding {
            Encoding::Ascii => "ascii",
            Encoding::Little => "binary_little_endian",
            Encoding::Big => "binary_big_endian",
        };
        let mut text = format!("ply\nformat {encoding} 1.0\n");
        for comment in &self.comments {
            text += &format!("comment {comment}\n");
        }
        for element in &self.elements {
            text += &format!("element {} {}\n", element.name, element.count);
            for property in &element.properties {
                let name = &property.name;
                text += &match property.kind {
                    Kind::One(scalar) => format!("property {} {name}\n", scalar.word()),
                    Kind::List { count, item } => format!("property list {} {} {name}\n", count.word(), item.word()),
                };
            }
        }
        text += "end_header\n";
        text.into_bytes()
    }

    pub(crate) fn parse(bytes: &[u8], name: &SourceName) -> Result<Self, ReadError> {
        let bad = |what: &str, expected: &str, found: &str| Err(ReadError::malformed(what, expected, found, name));
        let mut lines = Lines { bytes: &bytes[..bytes.len().min(MAX_TEXT)], at: 0 };
        if lines.next().as_deref() != Some("ply") {
            return bad("the first line", "`ply`", "something else");
        }
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut comments = Vec::new();
        let mut number = 1;
        while let Some(line) = lines.next() {
            number += 1;
            let here = || format!("line {number} of the header");
            let (word, rest) = line.split_once([' ', '\t']).unwrap_or((&line, ""));
            match word {
                "comment" | "obj_info" => {
                    comments.push(rest.to_owned());
                    continue;
                }
                "end_header" => {
                    let Some(encoding) = encoding else {
                        return bad("the header", "a line `format`", "none");
                    };
                    return Ok(Self { encoding, elements, comments, len: lines.at });
                }
                _ => {}
            }
            let words: Vec<&str> = rest.split_ascii_whitespace().collect();
            match (word, words.as_slice()) {
                ("", []) => {}
                ("format", [kind, _version]) => {
                    encoding = Some(match *kind {
                        "ascii" => Encoding::Ascii,
                        "binary_little_endian" => Encoding::Little,
                        "binary_big_endian" => Encoding::Big,
                        other => {
                            let known = "ascii, binary_little_endian or binary_big_endian";
                            return bad(&here(), known, &format!("`{other}`"));
                        }
                    });
                }
                ("element", [element, count]) => {
                    let Ok(count) = count.parse() else {
                        return bad(&here(), "a whole number", &format!("`{count}`"));
                    };
                    elements.push(Element { name: (*element).to_owned(), count, properties: Vec::new() });
                }
                ("property", words) => {
                    let kind = match words {
                        ["list", count, item, _] => Scalar::parse(count)
                            .zip(Scalar::parse(item))
                            .map(|(count, item)| Kind::List { count, item }),
                        [kind, _] => Scalar::parse(kind).map(Kind::One),
                        _ => None,
                    };
                    let (Some(kind), Some(property), Some(element)) = (kind, words.last(), elements.last_mut()) else {
                        return bad(&here(), "`property TYPE NAME` after an element", &format!("`{}`", shown(&line)));
                    };
                    if element.has(property) {
                        return bad(&here(), "every property once", &format!("a second `{}`", shown(property)));
                    }
                    // The look for doubles is quadratic; no honest file comes near this.
                    if element.properties.len() >= 4096 {
                        return bad(&here(), "at most 4096 properties", "more");
                    }
                    element.properties.push(Property { name: (*property).to_owned(), kind });
                }
                _ => {
                    return bad(
                        &here(),
                        "format, element, property, comment or end_header",
                        &format!("`{}`", shown(&line)),
                    );
                }
            }
        }
        Err(ReadError::truncated("lines `end_header` of the header", 1, 0, name))
    }
}

/// At most 60 characters of a line, for an error.
fn shown(line: &str) -> String {
    line.chars().take(60).collect::<String>().escape_default().to_string()
}

struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Lines<'_> {
    fn next(&mut self) -> Option<String> {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|&b| b == b'\n')?;
        self.at += end + 1;
        let line = &rest[..end];
        Some(String::from_utf8_lossy(line.strip_suffix(b"\r").unwrap_or(line)).into_owned())
    }
}
