//! The picture as the formulas say, in double precision.
//!
//! Written from the formulas of 3D Gaussian splatting and nothing else: an EWA projection with 0.3 px^2 on the diagonal,
//! Gaussians in order of camera depth, `alpha = min(0.99, opacity exp(-q / 2))` skipped under 1/255, the pixel ended before
//! the Gaussian that brings the transmittance under 1e-4, colours clamped at 0 from below. Tiles only say which Gaussians
//! can reach a pixel at all.

use rayon::prelude::*;
use splat_core::glam::{DMat3, DQuat, DVec2, DVec3};
use splat_core::{Cloud, View};
use splat_io::picture::Picture;

/// Side of a tile, in pixels.
const TILE: usize = 16;

/// A Gaussian as the picture has it.
struct Splat {
    id: usize,
    mean: DVec2,
    /// Inverse of the covariance in the picture: xx, xy, yy.
    conic: DVec3,
    opacity: f64,
    depth: f64,
    color: DVec3,
    /// Beyond this distance alpha is under 1/255 everywhere.
    reach: f64,
}

/// Red, green and blue of every pixel over black, sRGB-encoded, not clamped; row-major.
pub(crate) fn draw(cloud: &Cloud, view: &View) -> Vec<[f64; 3]> {
    let mut splats: Vec<Splat> = (0..cloud.len()).into_par_iter().filter_map(|g| project(cloud, g, view)).collect();
    splats.par_sort_unstable_by(|a, b| a.depth.total_cmp(&b.depth).then(a.id.cmp(&b.id)));
    let (width, height) = (view.width as usize, view.height as usize);
    let (across, down) = (width.div_ceil(TILE), height.div_ceil(TILE));
    let tiles: Vec<Vec<[f64; 3]>> = (0..across * down)
        .into_par_iter()
        .map(|tile| {
            let (left, top) = (tile % across * TILE, tile / across * TILE);
            let reaches = |s: &&Splat| {
                let touches = |at: f64, from: usize| at + s.reach > from as f64 && at - s.reach < (from + TILE) as f64;
                touches(s.mean.x, left) && touches(s.mean.y, top)
            };
            let near: Vec<&Splat> = splats.iter().filter(reaches).collect();
            let pixel = |k: usize| DVec2::new((left + k % TILE) as f64 + 0.5, (top + k / TILE) as f64 + 0.5);
            (0..TILE * TILE).map(|k| blend(&near, pixel(k))).collect()
        })
        .collect();
    let of = |x: usize, y: usize| tiles[y / TILE * across + x / TILE][y % TILE * TILE + x % TILE];
    (0..width * height).map(|p| of(p % width, p / width)).collect()
}

/// One pixel, front to back.
fn blend<'a>(splats: impl IntoIterator<Item = &'a &'a Splat>, pixel: DVec2) -> [f64; 3] {
    let (mut color, mut transmittance) = (DVec3::ZERO, 1.0);
    for s in splats {
        let d = pixel - s.mean;
        let q = s.conic.x * d.x * d.x + 2.0 * s.conic.y * d.x * d.y + s.conic.z * d.y * d.y;
        let alpha = (s.opacity * (-0.5 * q).exp()).min(0.99);
        if alpha < 1.0 / 255.0 {
            continue;
        }
        let after = transmittance * (1.0 - alpha);
        if after < 1e-4 {
            break;
        }
        color += alpha * transmittance * s.color;
        transmittance = after;
    }
    color.to_array()
}

fn project(cloud: &Cloud, g: usize, view: &View) -> Option<Splat> {
    if !cloud.drawable(g) {
        return None;
    }
    let i = view.intrinsics;
    let (fx, fy) = (f64::from(i.fx), f64::from(i.fy));
    let (cx, cy) = (f64::from(i.cx), f64::from(i.cy));
    let view_from_world = view.pose.world_from_view.as_dmat3().transpose();
    let seen_from = cloud.means()[g].as_dvec3() - view.pose.position.as_dvec3();
    let t = view_from_world * seen_from;
    // NaN fails this guard.
    if !(t.z > f64::from(view.near)) {
        return None;
    }
    let q = cloud.rotations()[g];
    let q = DQuat::from_xyzw(q.x.into(), q.y.into(), q.z.into(), q.w.into());
    let rotation = DMat3::from_quat(if q.length() > 1e-12 { q.normalize() } else { DQuat::IDENTITY });
    let scale = cloud.log_scales()[g].as_dvec3();
    let m = view_from_world * rotation * DMat3::from_diagonal(DVec3::new(scale.x.exp(), scale.y.exp(), scale.z.exp()));
    let sigma = m * m.transpose();
    // The slope of the projection is taken at most 0.3 of the picture outside it.
    let limit = |v: f64, size: f64, focal: f64, center: f64| {
        let rim = 0.3 * size / (2.0 * focal);
        v.clamp(-(center / focal) - rim, (size - center) / focal + rim)
    };
    let x = limit(t.x / t.z, f64::from(view.width), fx, cx);
    let y = limit(t.y / t.z, f64::from(view.height), fy, cy);
    let (j0, j1) = (DVec3::new(fx, 0.0, -fx * x) / t.z, DVec3::new(0.0, fy, -fy * y) / t.z);
    let (a, b, c) = (j0.dot(sigma * j0) + 0.3, j0.dot(sigma * j1), j1.dot(sigma * j1) + 0.3);
    let determinant = a * c - b * b;
    let opacity = 1.0 / (1.0 + (-f64::from(cloud.opacity_logits()[g])).exp());
    if !(determinant > 0.0) || opacity < 1.0 / 255.0 {
        return None;
    }
    let widest = 0.5 * (a + c) + (0.25 * (a - c) * (a - c) + b * b).sqrt();
    let basis = harmonics(seen_from.normalize());
    let coefficients = cloud.sh_of(g);
    let channel = |k: usize| {
        let sum: f64 = basis.iter().zip(coefficients.iter().skip(k).step_by(3)).map(|(b, &c)| b * f64::from(c)).sum();
        (0.5 + sum).max(0.0)
    };
    Some(Splat {
        id: g,
        mean: DVec2::new(fx * t.x / t.z + cx, fy * t.y / t.z + cy),
        conic: DVec3::new(c, -b, a) / determinant,
        opacity,
        depth: t.z,
        color: DVec3::new(channel(0), channel(1), channel(2)),
        reach: (2.0 * (255.0 * opacity).ln() * widest).sqrt() + 1e-6,
    })
}

/// Real spherical harmonics to degree 3, in the order and signs of the reference trainer.
fn harmonics(d: DVec3) -> [f64; 16] {
    let (x, y, z) = (d.x, d.y, d.z);
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        0.28209479177387814,
        -0.4886025119029199 * y,
        0.4886025119029199 * z,
        -0.4886025119029199 * x,
        1.0925484305920792 * x * y,
        -1.0925484305920792 * y * z,
        0.31539156525252005 * (2.0 * zz - xx - yy),
        -1.0925484305920792 * x * z,
        0.5462742152960396 * (xx - yy),
        -0.5900435899266435 * y * (3.0 * xx - yy),
        2.890611442640554 * x * y * z,
        -0.4570457994644658 * y * (4.0 * zz - xx - yy),
        0.3731763325901154 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -0.4570457994644658 * x * (4.0 * zz - xx - yy),
        1.445305721320277 * z * (xx - yy),
        -0.5900435899266435 * x * (xx - 3.0 * yy),
    ]
}

/// Peak signal to noise ratio over red, green and blue of values that a screen can show, in decibels; infinite for equal
/// pictures. A picture that differs by rounding to 8 bits alone has 58.9.
pub(crate) fn psnr(reference: &[[f64; 3]], picture: &[[f64; 3]]) -> f64 {
    if reference.len() != picture.len() {
        return f64::NAN;
    }
    let pairs = reference.iter().flatten().zip(picture.iter().flatten());
    let sum: f64 = pairs.map(|(a, b)| (a.clamp(0.0, 1.0) - b.clamp(0.0, 1.0)).powi(2)).sum();
    -10.0 * (sum / (3 * reference.len()) as f64).log10()
}

/// Red, green and blue of a picture, 0 to 1.
pub(crate) fn colors(picture: &Picture) -> Vec<[f64; 3]> {
    let pixels = picture.values.chunks_exact(picture.channels.max(1));
    let channel = |p: &[u8], k: usize| f64::from(p[if picture.channels < 3 { 0 } else { k }]) / 255.0;
    pixels.map(|p| [0, 1, 2].map(|k| channel(p, k))).collect()
}

/// sRGB undone: what a screen makes of a value.
pub(crate) fn decoded(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene;

    #[test]
    fn tiles_only_leave_out_what_cannot_be_seen() {
        let cloud = scene::generated(600).unwrap();
        let view = scene::view(&scene::cameras(&cloud, None, (50, 40)).unwrap(), (50, 40));
        let mut splats: Vec<Splat> = (0..cloud.len()).filter_map(|g| project(&cloud, g, &view)).collect();
        splats.sort_by(|a, b| a.depth.total_cmp(&b.depth));
        let all: Vec<&Splat> = splats.iter().collect();
        let drawn = draw(&cloud, &view);
        for (p, &color) in drawn.iter().enumerate() {
            let pixel = DVec2::new((p % 50) as f64 + 0.5, (p / 50) as f64 + 0.5);
            assert_eq!(color, blend(&all, pixel), "pixel {p}");
        }
        assert!(drawn.iter().flatten().sum::<f64>() > 100.0);
    }

    #[test]
    fn psnr_is_that_of_its_definition() {
        let (a, b) = (vec![[0.0; 3]; 4], vec![[0.1; 3]; 4]);
        assert!((psnr(&a, &b) - 20.0).abs() < 1e-9);
        assert_eq!(psnr(&a, &a), f64::INFINITY);
        // Beyond white there is nothing to see.
        assert_eq!(psnr(&[[1.0; 3]], &[[1.7; 3]]), f64::INFINITY);
    }
}
