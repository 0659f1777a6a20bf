//! Selections and parts for serde: runs of equal values as variable-length numbers in base64, so that they stay small in text
//! formats and in binary ones alike.

mod base64;
mod parts;
mod selection;
mod small;
mod varint;
