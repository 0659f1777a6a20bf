//! Values of options, as users type them: mostly numbers between commas.

use std::path::PathBuf;

use splat_core::glam::{Vec2, Vec3};

/// Numbers between commas; all finite, as many as `counts` allows.
pub(crate) fn numbers(text: &str, counts: &[usize]) -> Result<Vec<f32>, String> {
    let parts: Result<Vec<f32>, String> = text.split(',').map(number).collect();
    let parts = parts?;
    if counts.contains(&parts.len()) {
        return Ok(parts);
    }
    let wanted: Vec<String> = counts.iter().map(usize::to_string).collect();
    Err(format!("{} numbers between commas were expected, {} were given", wanted.join(" or "), parts.len()))
}

/// One finite number.
pub(crate) fn number(text: &str) -> Result<f32, String> {
    match text.trim().parse::<f32>() {
        Ok(v) if v.is_finite() => Ok(v),
        _ => Err(format!("`{text}` is not a number")),
    }
}

/// `X,Y,Z`.
pub(crate) fn vec3(text: &str) -> Result<Vec3, String> {
    Ok(Vec3::from_slice(&numbers(text, &[3])?))
}

/// `X,Y,Z` that point somewhere, as a unit vector.
pub(crate) fn direction(text: &str) -> Result<Vec3, String> {
    vec3(text)?.try_normalize().ok_or_else(|| "a direction other than 0,0,0 is needed".to_owned())
}

/// `X,Y;X,Y;...`.
pub(crate) fn points(text: &str) -> Result<Vec<Vec2>, String> {
    text.split(';').map(|p| Ok(Vec2::from_slice(&numbers(p, &[2])?))).collect()
}

/// `WIDTHxHEIGHT`, each 1 to 32768.
pub(crate) fn size(text: &str) -> Result<(u32, u32), String> {
    let side = |s: &str| s.parse::<u32>().ok().filter(|n| (1..=32_768).contains(n));
    let parts = text.split_once(['x', 'X']).and_then(|(w, h)| Some((side(w)?, side(h)?)));
    parts.ok_or_else(|| "WIDTHxHEIGHT was expected, each 1 to 32768, for example 1280x720".to_owned())
}

/// An angle in degrees that opens a picture.
pub(crate) fn opening(text: &str) -> Result<f32, String> {
    let degrees = number(text)?;
    if (1.0..=170.0).contains(&degrees) {
        Ok(degrees.to_radians())
    } else {
        Err("an angle of 1 to 170 degrees is needed".to_owned())
    }
}

/// A number above zero.
pub(crate) fn positive(text: &str) -> Result<f32, String> {
    number(text).and_then(|v| if v > 0.0 { Ok(v) } else { Err("a number above 0 is needed".to_owned()) })
}

/// The name of a picture to write.
pub(crate) fn png(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        Ok(path)
    } else {
        Err("pictures are written as PNG; name one that ends in .png".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused_with_a_reason() {
        assert_eq!(numbers("1, 2,-3e1", &[3]), Ok(vec![1.0, 2.0, -30.0]));
        for bad in ["", "1,2", "1,2,3,4", "1,x,3", "1,,3", "nan,1,2", "inf,1,2"] {
            assert!(vec3(bad).is_err(), "{bad}");
        }
        assert_eq!(size("1280x720"), Ok((1280, 720)));
        for bad in ["", "x", "0x5", "5x0", "1280", "-1x5", "99999x5", "1.5x2"] {
            assert!(size(bad).is_err(), "{bad}");
        }
        assert!(direction("0,0,0").is_err());
        assert_eq!(points("1,2;3,4"), Ok(vec![Vec2::new(1.0, 2.0), Vec2::new(3.0, 4.0)]));
        assert!(png("a/b.PNG").is_ok() && png("a.jpg").is_err() && png("png").is_err());
        assert!(opening("0").is_err() && opening("171").is_err());
    }
}
