//! One dimension of a Gaussian, cut into pieces.

/// A piece of a Gaussian along one of its axes, in units of the Gaussian's standard deviation along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Where its mean lies.
    pub center: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// Its opacity, 0..=1.
    pub opacity: f64,
    /// Whether it lies on the side of the cut where the Gaussian's own mean is.
    pub own: bool,
}

/// Contributions under this alpha are not drawn (see `splat_raster`).
const LEAST_ALPHA: f64 = 1.0 / 255.0;
/// Samples along the axis for fitting.
const SAMPLES: usize = 48;
/// Shares of the peak at which the fit is made: on the axis, and off it, where the other two axes have let alpha fall.
const LEVELS: [f64; 2] = [1.0, 0.4];

/// How much alpha on the wrong side of the cut weighs against alpha that is missing.
const LEAK_WEIGHT: f64 = 0.3;

/// Half of the length over which a Gaussian of this opacity is drawn, in standard deviations.
fn reach(opacity: f64) -> f64 {
    (2.0 * (opacity / LEAST_ALPHA).max(1.0).ln()).sqrt().max(0.5)
}

/// Cuts a Gaussian of `opacity` at `low` and `high` (in standard deviations; infinite for no cut) into about `count`
/// pieces that together look like it.
///
/// Every stretch between cuts is divided into parts, narrower ones next to a cut, and every part becomes a piece with the part's
/// own mean and spread. Widths (a common factor) and opacities are fitted so that the pieces, blended over each other,
/// have the Gaussian's alpha (least squares over the axis, on it and off it).
pub fn split(opacity: f64, low: f64, high: f64, count: usize) -> Vec<Piece> {
    let end = reach(opacity);
    let (low, high) = (low.max(-end), high.min(end));
    let stretches = [(-end, low, false), (low, high, true), (high, end, false)];
    let stretches: Vec<_> = stretches.into_iter().filter(|s| s.1 - s.0 > 0.05).collect();
    let length: f64 = stretches.iter().map(|s| s.1 - s.0).sum();
    let mut parts = Vec::new();
    for &(a, b, own) in &stretches {
        let n = ((count as f64 * (b - a) / length).round() as usize).max(1);
        divide(a, b, n, (a > -end, b < end), |a, b| parts.push((moments(a, b), own)));
    }
    let mut best: Option<(f64, Vec<Piece>)> = None;
    for factor in [1.2, 1.4, 1.7, 2.0] {
        let mut pieces: Vec<Piece> = parts
            .iter()
            .map(|&((center, sigma), own)| {
                let sigma = (sigma * factor).min(1.0);
                Piece { center, sigma, opacity: opacity * gauss(center, 1.0), own }
            })
            .collect();
        // Wide pieces look more like the whole, narrow ones reach less over the cut: both count.
        let error = fit(opacity, (-end, end), &mut pieces) + LEAK_WEIGHT * leak((-end, end), (low, high), &pieces);
        if best.as_ref().is_none_or(|b| error < b.0) {
            best = Some((error, pieces));
        }
    }
    best.map(|b| b.1).unwrap_or_default()
}

/// Mean square of the alpha that pieces have on the other side of the cut.
fn leak((from, to): (f64, f64), (low, high): (f64, f64), pieces: &[Piece]) -> f64 {
    let mut sum = 0.0;
    for k in 0..SAMPLES {
        let x = from + (to - from) * (k as f64 + 0.5) / SAMPLES as f64;
        let own = x > low && x < high;
        let foreign = pieces.iter().filter(|p| p.own != own);
        let through: f64 = foreign.map(|p| 1.0 - p.opacity * gauss(x - p.center, p.sigma)).product();
        sum += (1.0 - through) * (1.0 - through);
    }
    sum / SAMPLES as f64
}

/// Divides a stretch into `n` parts whose widths rise with the distance from the ends that are cuts.
fn divide(a: f64, b: f64, n: usize, (cut_low, cut_high): (bool, bool), mut part: impl FnMut(f64, f64)) {
    let width = |k: usize| match (cut_low, cut_high) {
        (true, true) => 1.0 + k.min(n - 1 - k) as f64,
        (true, false) => 1.0 + k as f64,
        (false, true) => (n - k) as f64,
        (false, false) => 1.0,
    };
    let all: f64 = (0..n).map(width).sum();
    let mut from = a;
    for k in 0..n {
        let to = from + (b - a) * width(k) / all;
        part(from, to);
        from = to;
    }
}

/// Mean and standard deviation of the standard normal distribution cut off outside `a..b`.
fn moments(a: f64, b: f64) -> (f64, f64) {
    let (mut mass, mut first, mut second) = (0.0, 0.0, 0.0);
    for k in 0..64 {
        let x = a + (b - a) * (f64::from(k) + 0.5) / 64.0;
        let g = gauss(x, 1.0);
        mass += g;
        first += g * x;
        second += g * x * x;
    }
    let center = first / mass;
    (center, (second / mass - center * center).max(1e-6).sqrt())
}

/// The part of a Gaussian between `low` and `high` as one Gaussian: mean and spread of the truncated distribution, opacity fitted
/// in between.
pub fn trim(opacity: f64, low: f64, high: f64) -> Piece {
    let end = reach(opacity);
    let (low, high) = (low.max(-end), high.min(end));
    let (center, sigma) = moments(low, high);
    let mut piece = [Piece { center, sigma, opacity: opacity * gauss(center, 1.0), own: true }];
    fit(opacity, (low, high), &mut piece);
    piece[0]
}

fn gauss(x: f64, sigma: f64) -> f64 {
    (-0.5 * (x / sigma) * (x / sigma)).exp()
}

/// Fits the opacities by damped Gauss-Newton steps; gives the mean squared error of alpha over the stretch.
fn fit(opacity: f64, (from, to): (f64, f64), pieces: &mut [Piece]) -> f64 {
    let n = pieces.len();
    let at = |k: usize| from + (to - from) * (k as f64 + 0.5) / SAMPLES as f64;
    let shape: Vec<Vec<f64>> =
        (0..SAMPLES).map(|k| pieces.iter().map(|p| gauss(at(k) - p.center, p.sigma)).collect()).collect();
    let mut error = f64::INFINITY;
    for _ in 0..8 {
        let mut a = vec![0.0; n * n];
        let mut b = vec![0.0; n];
        let mut sum = 0.0;
        for (k, g) in shape.iter().enumerate() {
            for level in LEVELS {
                let clear = |j: usize| 1.0 - pieces[j].opacity * level * g[j];
                let through: f64 = (0..n).map(clear).product();
                let residual = opacity * level * gauss(at(k), 1.0) - (1.0 - through);
                sum += residual * residual;
                // Derivative of the blended alpha by each opacity: what the others let through.
                let slope = |j: usize| level * g[j] * through / clear(j).max(1e-3);
                for i in 0..n {
                    b[i] += slope(i) * residual;
                    for j in 0..=i {
                        a[i * n + j] += slope(i) * slope(j);
                    }
                }
            }
        }
        error = sum / (SAMPLES * LEVELS.len()) as f64;
        for i in 0..n {
            a[i * n + i] += 1e-3;
        }
        for (p, d) in pieces.iter_mut().zip(solve(a, b, n)) {
            p.opacity = (p.opacity + d).clamp(0.5 * LEAST_ALPHA, 0.99);
        }
    }
    error
}

/// Solves the symmetric positive definite system `a x = b` by Cholesky; only the lower triangle of `a` is read.
fn solve(mut a: Vec<f64>, mut b: Vec<f64>, n: usize) -> Vec<f64> {
    for j in 0..n {
        for k in 0..j {
            for i in j..n {
                a[i * n + j] -= a[i * n + k] * a[j * n + k];
            }
        }
        let root = a[j * n + j].max(1e-12).sqrt();
        for i in j..n {
            a[i * n + j] /= root;
        }
    }
    for i in 0..n {
        for k in 0..i {
            b[i] -= a[i * n + k] * b[k];
        }
        b[i] /= a[i * n + i];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            b[i] -= a[k * n + i] * b[k];
        }
        b[i] /= a[i * n + i];
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blended(pieces: &[Piece], x: f64) -> f64 {
        1.0 - pieces.iter().map(|p| 1.0 - p.opacity * gauss(x - p.center, p.sigma)).product::<f64>()
    }

    #[test]
    fn pieces_together_look_like_the_whole() {
        for opacity in [0.05, 0.3, 0.7, 0.95] {
            for cut in [-1.5, -0.5, 0.0, 0.4, 1.2] {
                let pieces = split(opacity, f64::NEG_INFINITY, cut, 4);
                assert!(pieces.iter().any(|p| p.own) && pieces.iter().any(|p| !p.own));
                let error = |x: f64| blended(&pieces, x) - opacity * gauss(x, 1.0);
                let steps = || (-30..=30).map(|k| f64::from(k) * 0.1);
                let rms = (steps().map(|x| error(x).powi(2)).sum::<f64>() / 61.0).sqrt();
                let worst = steps().map(|x| error(x).abs()).fold(0.0, f64::max);
                assert!(rms < 0.08 * opacity + 0.005, "opacity {opacity} cut {cut}: {rms}");
                assert!(worst < 0.3 * opacity + 0.01, "opacity {opacity} cut {cut}: {worst}");
            }
        }
    }

    #[test]
    fn pieces_lie_on_their_side_of_the_cut() {
        for p in split(0.8, -1.0, 0.7, 6) {
            assert_eq!(p.own, p.center > -1.0 && p.center < 0.7, "{p:?}");
        }
    }

    #[test]
    fn trimming_keeps_the_inner_part_and_loses_the_outer() {
        let p = trim(0.8, f64::NEG_INFINITY, 0.5);
        assert!(p.center < 0.0 && p.sigma < 1.0);
        assert!((blended(&[p], -0.3) - 0.8 * gauss(-0.3, 1.0)).abs() < 0.1);
        assert!(blended(&[p], 1.5) < 0.5 * 0.8 * gauss(1.5, 1.0));
    }
}
