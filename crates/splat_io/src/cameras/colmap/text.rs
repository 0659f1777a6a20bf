//! `cameras.txt` and `images.txt`.

use std::fmt::Write;
use std::str::FromStr;

use super::{Image, Lens, MODELS};
use crate::{ReadError, SourceName};

pub(super) fn lenses(bytes: &[u8], name: &SourceName) -> Result<Vec<Lens>, ReadError> {
    let text = String::from_utf8_lossy(bytes);
    let mut lenses = Vec::new();
    for (number, line) in text.lines().enumerate().filter(|(_, l)| !l.starts_with('#') && !l.trim().is_empty()) {
        let mut words = Words { rest: line, number: number + 1, name };
        let id = words.number::<u32>("a camera id")?;
        let model = words.word("a camera model")?;
        let Some(index) = MODELS.iter().position(|m| m.0 == model) else {
            let what = format!("COLMAP's camera model `{}` (line {})", model.escape_debug(), number + 1);
            return Err(ReadError::unsupported(what, "undistort the pictures to PINHOLE", name));
        };
        let size = [words.number("a width")?, words.number("a height")?];
        let mut values = [0.0; 12];
        for value in &mut values[..MODELS[index].2] {
            *value = words.number("a parameter")?;
        }
        lenses.push(Lens::new(id, index, size, &values[..MODELS[index].2]));
    }
    Ok(lenses)
}

pub(super) fn images(bytes: &[u8], name: &SourceName) -> Result<Vec<Image>, ReadError> {
    let text = String::from_utf8_lossy(bytes);
    let mut lines = text.lines().enumerate();
    let mut images = Vec::new();
    while let Some((number, line)) = lines.next() {
        if line.starts_with('#') || line.trim().is_empty() {
            continue;
        }
        let mut words = Words { rest: line, number: number + 1, name };
        let id = words.number("an image id")?;
        let mut pose = [0.0; 7];
        for value in &mut pose {
            *value = words.number("a number of the pose")?;
        }
        let [w, x, y, z, tx, ty, tz] = pose;
        let lens = words.number("a camera id")?;
        // A name may hold spaces.
        let picture = words.rest.trim().to_owned();
        images.push(Image { id, rotation: [w, x, y, z], translation: [tx, ty, tz], lens, name: picture });
        // The features: one line for every image, empty where there are none.
        lines.next();
    }
    Ok(images)
}

pub(super) fn write_lenses(lenses: &[Lens]) -> Vec<u8> {
    let mut out = String::from("# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n");
    for lens in lenses {
        let p = &lens.pinhole;
        // Writing to a string cannot fail.
        let _ = writeln!(out, "{} PINHOLE {} {} {} {} {} {}", lens.id, p.width, p.height, p.fx, p.fy, p.cx, p.cy);
    }
    out.into_bytes()
}

pub(super) fn write_images(images: &[Image]) -> Vec<u8> {
    let mut out = String::from("# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME, then a line of features\n");
    for image in images {
        let _ = write!(out, "{}", image.id);
        for v in image.rotation.iter().chain(&image.translation) {
            let _ = write!(out, " {v}");
        }
        let _ = writeln!(out, " {} {}\n", image.lens, image.name);
    }
    out.into_bytes()
}

/// Words of a line.
struct Words<'a> {
    rest: &'a str,
    number: usize,
    name: &'a SourceName,
}

impl<'a> Words<'a> {
    fn word(&mut self, expected: &str) -> Result<&'a str, ReadError> {
        let rest = self.rest.trim_start();
        if rest.is_empty() {
            let what = format!("line {}", self.number);
            return Err(ReadError::malformed(what, expected, "at its end", self.name));
        }
        let (word, rest) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        self.rest = rest;
        Ok(word)
    }

    fn number<T: FromStr>(&mut self, expected: &str) -> Result<T, ReadError> {
        let word = self.word(expected)?;
        word.parse().map_err(|_| {
            let found: String = word.chars().take(40).collect();
            let what = format!("a word of line {}", self.number);
            ReadError::malformed(what, expected, format!("`{}`", found.escape_debug()), self.name)
        })
    }
}
