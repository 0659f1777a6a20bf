//! Light, baked: sky through the window, a patch of sun, the lamp, and what comes back from walls and floor.

use glam::DVec3;

use crate::field::Field;
use crate::materials::Look;
use crate::math::{frame_of, mix, smooth, v};
use crate::room::{BULB, LEFT, WINDOW, WINDOW_HALF};

/// Directions of a cosine-weighted hemisphere about y, in six cones.
const CONES: [(f64, f64, f64); 6] = [
    (0.0, 1.0, 0.0),
    (0.75, 0.66, 0.0),
    (0.232, 0.66, 0.713),
    (-0.607, 0.66, 0.441),
    (-0.607, 0.66, -0.441),
    (0.232, 0.66, -0.713),
];

/// Direction towards the sun.
pub(crate) fn sun() -> DVec3 {
    v(-0.800, 0.545, 0.13).normalize()
}

/// Share of the surroundings that a place with normal `n` sees.
fn openness(field: &Field, p: DVec3, n: DVec3) -> f64 {
    let frame = frame_of(n);
    let mut open = 0.0;
    for (x, y, z) in CONES {
        let d = frame * v(x, y, z);
        let mut least = 1.0f64;
        for t in [0.022, 0.06, 0.14, 0.3, 0.6] {
            least = least.min(field.distance(p + d * t + n * 0.004) / (0.62 * t));
        }
        open += least.max(0.0) * if y > 0.9 { 0.25 } else { 0.15 };
    }
    open
}

/// How much of the sun's disc comes through the panes to `p`.
fn sun_through_panes(p: DVec3) -> (f64, f64) {
    let s = sun();
    let t = (LEFT - p.x) / s.x;
    let hit = p + s * t;
    let (z, y) = (hit.z - WINDOW.y, hit.y - WINDOW.x);
    let soft = 0.012 + 0.006 * t;
    let rect = smooth(soft, -soft, z.abs() - WINDOW_HALF.x) * smooth(soft, -soft, y.abs() - WINDOW_HALF.y);
    let bars = smooth(-soft, soft, z.abs() - 0.017) * smooth(-soft, soft, (y - 0.12).abs() - 0.014);
    (rect * bars, t)
}

/// Colour, linear and before exposure, of a place `p` with normal `n`.
pub(crate) fn shade(field: &Field, p: DVec3, n: DVec3, look: &Look) -> DVec3 {
    let open = openness(field, p, n);
    // The sky of a lit room: white above, floor-coloured below.
    let up = 0.5 + 0.5 * n.y;
    let mut light = mix(v(0.34, 0.265, 0.205), v(0.49, 0.48, 0.48), up) * open * (0.35 + 0.65 * open);
    let window = v(LEFT + 0.05, WINDOW.x, WINDOW.y);
    for (dy, dz) in [(0.25, -0.35), (0.25, 0.35), (-0.3, 0.0)] {
        let to = window + v(0.0, dy, dz) - p;
        let far = to.length();
        let d = to / far;
        let facing = (n.dot(d) * 0.85 + 0.15).max(0.0) * (-d.x).max(0.0);
        if facing > 0.0 {
            let through = field.light_through(p + n * 0.006, d, far - 0.25, 5.0);
            light += v(1.02, 1.08, 1.20) * (facing * through * 0.98 / (0.35 + far * far));
        }
    }
    let (panes, t) = sun_through_panes(p + n * 0.004);
    let facing = n.dot(sun());
    if panes > 0.0 && facing > 0.0 {
        let through = field.light_through(p + n * 0.006, sun(), t - 0.22, 26.0);
        light += v(2.35, 1.95, 1.40) * (facing * panes * through);
    }
    // The lamp: strong above and below its shade, weak through the cloth.
    let to = BULB - p;
    let far = to.length();
    let d = to / far;
    let steep = smooth(0.45, 0.80, d.y.abs());
    let facing = (n.dot(d) * 0.9 + 0.1).max(0.0);
    if facing > 0.0 {
        let through = field.light_through(p + n * 0.006, d, far - 0.34, 8.0);
        light += v(1.0, 0.62, 0.30) * (facing * (0.16 + 0.62 * steep) * through / (0.10 + far * far));
    }
    look.albedo * light + look.glow
}

/// Where a shiny place mirrors the window: the viewing direction, away from the eye, and the highlight's colour for the display.
pub(crate) fn highlight(field: &Field, p: DVec3, n: DVec3, gloss: f64) -> (DVec3, DVec3) {
    let window = v(LEFT + 0.05, WINDOW.x + 0.2, WINDOW.y);
    let far = (window - p).length();
    let d = (window - p) / far;
    let mirror = d - n * (2.0 * d.dot(n));
    if gloss < 0.5 || d.dot(n) < -0.2 {
        return (DVec3::Y, DVec3::ZERO);
    }
    let through = field.light_through(p + n * 0.006, d, far - 0.25, 5.0);
    let near = 1.0 / (0.7 + 0.12 * far * far);
    (mirror, v(0.62, 0.66, 0.72) * (gloss * through * near * smooth(-0.2, 0.3, d.dot(n))))
}

/// From linear light to the display: exposure, a soft shoulder, gamma 2.
pub(crate) fn develop(light: DVec3) -> DVec3 {
    let curve = |x: f64| {
        let x = (x * 1.85).max(0.0);
        let y = if x < 0.6 { x } else { 0.6 + 0.4 * (1.0 - 1.0 / (1.0 + (x - 0.6) / 0.4)) };
        y.sqrt()
    };
    v(curve(light.x), curve(light.y), curve(light.z))
}
