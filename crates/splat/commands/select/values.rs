//! [`Filter`]: Gaussians by a value.

use std::str::FromStr;

use splat_core::bounds::robust_bounds;
use splat_core::{Cloud, ExtraValues, Selection};

use crate::failure::Failure;
use crate::parse;

/// `NAME<NUMBER` and the like.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Filter {
    name: String,
    comparison: Comparison,
    number: f32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Comparison {
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Equal,
    Different,
}

/// Signs, the longer of two that begin alike first.
const SIGNS: [(&str, Comparison); 6] = [
    ("<=", Comparison::LessOrEqual),
    (">=", Comparison::GreaterOrEqual),
    ("!=", Comparison::Different),
    ("<", Comparison::Less),
    (">", Comparison::Greater),
    ("=", Comparison::Equal),
];

impl FromStr for Filter {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = SIGNS.iter().find_map(|&(sign, comparison)| Some((text.split_once(sign)?, comparison)));
        let ((name, number), comparison) =
            found.ok_or("NAME<NUMBER was expected, with < <= > >= = or !=, for example opacity<0.1")?;
        let name = name.trim();
        if name.is_empty() {
            return Err("the name of a value is missing, for example opacity<0.1".to_owned());
        }
        Ok(Self { name: name.to_owned(), comparison, number: parse::number(number)? })
    }
}

impl Filter {
    /// The Gaussians whose value compares so; NaN compares with nothing.
    ///
    /// # Errors
    /// [`Failure::Usage`] if the capture has no such value.
    pub(crate) fn select(&self, cloud: &Cloud) -> Result<Selection, Failure> {
        let value = value(cloud, &self.name).ok_or_else(|| {
            let extras: Vec<&str> = cloud.extras().iter().map(|e| e.name.as_str()).collect();
            let extras = if extras.is_empty() { "no extra properties".to_owned() } else { extras.join(", ") };
            Failure::usage(format!(
                "there is no value `{}`; take one of {} or of the file's own: {extras}",
                self.name,
                NAMES.join(", ")
            ))
        })?;
        let n = self.number;
        Ok(Selection::from_fn(cloud.len(), |i| {
            let v = value(i);
            match self.comparison {
                Comparison::Less => v < n,
                Comparison::LessOrEqual => v <= n,
                Comparison::Greater => v > n,
                Comparison::GreaterOrEqual => v >= n,
                Comparison::Equal => v == n,
                Comparison::Different => v != n && !v.is_nan(),
            }
        }))
    }
}

/// Values that every capture has.
const NAMES: [&str; 10] = ["opacity", "scale", "volume", "x", "y", "z", "red", "green", "blue", "radius"];

fn value<'a>(cloud: &'a Cloud, name: &str) -> Option<Box<dyn Fn(usize) -> f32 + 'a>> {
    Some(match name {
        "opacity" => Box::new(|i| cloud.opacity(i)),
        // The largest standard deviation, in scene units.
        "scale" => Box::new(|i| cloud.scale(i).max_element()),
        "volume" => Box::new(|i| cloud.scale(i).element_product()),
        "x" => Box::new(|i| cloud.means()[i].x),
        "y" => Box::new(|i| cloud.means()[i].y),
        "z" => Box::new(|i| cloud.means()[i].z),
        "red" => Box::new(|i| cloud.base_color(i).x),
        "green" => Box::new(|i| cloud.base_color(i).y),
        "blue" => Box::new(|i| cloud.base_color(i).z),
        "radius" => {
            let center = robust_bounds(cloud).map(|b| b.center).unwrap_or_default();
            Box::new(move |i| cloud.means()[i].distance(center))
        }
        extra => {
            let extra = cloud.extras().iter().find(|e| e.name == extra)?;
            match &extra.values {
                ExtraValues::I8(v) => Box::new(|i| f32::from(v[i])),
                ExtraValues::U8(v) => Box::new(|i| f32::from(v[i])),
                ExtraValues::I16(v) => Box::new(|i| f32::from(v[i])),
                ExtraValues::U16(v) => Box::new(|i| f32::from(v[i])),
                ExtraValues::I32(v) => Box::new(|i| v[i] as f32),
                ExtraValues::U32(v) => Box::new(|i| v[i] as f32),
                ExtraValues::F32(v) => Box::new(|i| v[i]),
                ExtraValues::F64(v) => Box::new(|i| v[i] as f32),
                _ => return None,
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_are_read_whole() {
        let f: Filter = "opacity <= 0.5".parse().unwrap();
        assert_eq!((f.name.as_str(), f.comparison, f.number), ("opacity", Comparison::LessOrEqual, 0.5));
        assert_eq!("x!=-1".parse::<Filter>().unwrap().comparison, Comparison::Different);
        for bad in ["", "opacity", "<3", "opacity<", "opacity<x", "opacity<<3"] {
            assert!(bad.parse::<Filter>().is_err(), "{bad}");
        }
    }
}
