//! Pictures of a segmentation: where was clicked, what was selected, the object by itself, what is left.

use std::path::Path;
use std::sync::Arc;

use splat_core::glam::{Vec2, Vec3};
use splat_core::{Cloud, Mask2d, Pose, View};
use splat_io::picture;
use splat_raster::cpu::CpuRasterizer;
use splat_raster::{Features, Frame, Outputs, Rasterizer, Scene};
use splat_segment::graph::clicks::ClickKind;
use splat_segment::graph::look::Look;
use splat_segment::graph::prepared::Prepared;

use super::solve::Answer;
use super::task::{Shape, Task};
use crate::failure::Failure;
use crate::paint;

/// Over the object, in pictures of the selection.
const TINT: [u8; 3] = [255, 140, 30];
const POSITIVE: [u8; 3] = [40, 190, 90];
const NEGATIVE: [u8; 3] = [225, 50, 50];
/// Behind an object by itself.
const STUDIO: [f32; 3] = [0.80, 0.81, 0.83];
/// Pixels of each of the four sides, across and down.
const SIDE: u32 = 560;
/// Opening angle of their camera, in radians: 30 degrees.
const SIDE_FOV: f32 = std::f32::consts::FRAC_PI_6;

/// A picture in the making: red, green and blue per pixel.
struct Canvas {
    width: u32,
    height: u32,
    rgb: Vec<u8>,
}

/// What pictures are made of.
pub(crate) struct Subject<'a> {
    pub(crate) task: &'a Task,
    pub(crate) answer: &'a Answer,
    pub(crate) scene: &'a Scene,
    pub(crate) prepared: &'a Prepared,
    pub(crate) object: &'a Arc<Cloud>,
    pub(crate) rest: &'a Arc<Cloud>,
    pub(crate) up: Vec3,
}

/// Makes all pictures in a folder; gives their names.
///
/// # Errors
/// [`Failure::Failed`] if one cannot be written.
pub(crate) fn make(s: &Subject<'_>, raster: &mut CpuRasterizer, folder: &Path) -> Result<Vec<String>, Failure> {
    let mut made = Vec::new();
    let mut keep = |name: String, canvas: &Canvas| {
        picture::write_png_rgb8(folder.join(&name), canvas.width, canvas.height, &canvas.rgb)?;
        made.push(name);
        Ok::<(), Failure>(())
    };
    let share: Vec<f32> = (0..s.scene.len()).map(|i| if s.answer.selection.contains(i) { 1.0 } else { 0.0 }).collect();
    let mut plain = None;
    for (k, view) in s.task.views.iter().enumerate() {
        let ending = if k == 0 { String::new() } else { format!("_{}", k + 1) };
        let mut frame = Frame::default();
        let features = Some(Features { channels: 1, values: &share });
        raster.draw(s.scene, view, &Outputs { color: true, features, ..Outputs::default() }, &mut frame)?;
        let mut canvas = Canvas { width: view.width, height: view.height, rgb: paint::over(&frame.color, [0.0; 3]) };
        if k == 0 {
            plain = Some(canvas.rgb.clone());
        }
        let shown = Mask2d::new(
            view.width,
            view.height,
            frame.features.iter().map(|v| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8).collect(),
        )?;
        let mut tinted = Canvas { rgb: canvas.rgb.clone(), ..canvas };
        canvas.mark(s.task, k);
        keep(format!("view{ending}.png"), &canvas)?;
        tinted.tint(&shown);
        keep(format!("selection{ending}.png"), &tinted)?;
    }
    if let (Some(plain), Some(look)) = (&plain, s.answer.looks.get(&0))
        && s.answer.offers.proposals.len() > 1
    {
        keep("proposals.png".to_owned(), &proposals(s, look, plain))?;
    }
    keep("object.png".to_owned(), &four_sides(s, raster)?)?;
    let view = &s.task.views[0];
    let color = raster.render(&Scene::of(s.rest.clone()), view)?;
    keep(
        "rest.png".to_owned(),
        &Canvas { width: view.width, height: view.height, rgb: paint::over(&color, [0.0; 3]) },
    )?;
    Ok(made)
}

/// What was offered, side by side at half size; the one that was taken has a bright frame.
fn proposals(s: &Subject<'_>, look: &Look, plain: &[u8]) -> Canvas {
    let (width, height) = (look.view.width, look.view.height);
    let step = if width > 900 { 2 } else { 1 };
    let (tile_w, tile_h) = (width / step, height / step);
    let offers = &s.answer.offers.proposals;
    let mut sheet = Canvas::blank(tile_w * offers.len() as u32, tile_h, [0; 3]);
    for (k, offer) in offers.iter().enumerate() {
        let inside = |id: u32| id != Frame::NO_ID && offer.patches.contains(s.prepared.graph.of[id as usize] as usize);
        let mask = Mask2d::new(width, height, look.solid.iter().map(|&id| if inside(id) { 255 } else { 0 }).collect());
        let mut tile = Canvas { width, height, rgb: plain.to_vec() };
        if let Ok(mask) = mask {
            tile.tint(&mask);
        }
        tile.mark(s.task, 0);
        let mut tile = tile.shrunk(step);
        if offer.taken {
            tile.frame(3, TINT);
        }
        sheet.place(&tile, k as u32 * tile_w, 0);
    }
    sheet
}

/// The object by itself from the user's side and three others, two by two.
fn four_sides(s: &Subject<'_>, raster: &mut CpuRasterizer) -> Result<Canvas, Failure> {
    let scene = Scene::of(s.object.clone());
    let mut sheet = Canvas::blank(2 * SIDE, 2 * SIDE, [0; 3]);
    let views = framed(sides(s.object, &s.task.views[0], s.up), &scene, raster)?;
    for (k, view) in views.iter().enumerate() {
        let color = raster.render(&scene, view)?;
        let tile = Canvas { width: SIDE, height: SIDE, rgb: studio(&color) };
        let (column, row) = (k as u32 % 2, k as u32 / 2);
        sheet.place(&tile, column * SIDE, row * SIDE);
    }
    Ok(sheet)
}

/// Over a background that is a little darker at the bottom.
fn studio(color: &[[f32; 4]]) -> Vec<u8> {
    let rows = color.chunks_exact(SIDE as usize).enumerate();
    rows.flat_map(|(y, row)| {
        let shade = 1.0 - 0.22 * y as f32 / SIDE as f32;
        paint::over(row, STUDIO.map(|v| v * shade))
    })
    .collect()
}

/// Four cameras around an object, the first on the user's side, all slightly above it and with one scale, so that sizes compare.
fn sides(object: &Cloud, user: &View, up: Vec3) -> [View; 4] {
    let shown: Vec<usize> = (0..object.len()).filter(|&i| object.drawable(i) && object.opacity(i) > 0.3).collect();
    let middle = |axis: usize| {
        let mut along: Vec<f32> = shown.iter().map(|&i| object.means()[i][axis]).collect();
        0.5 * (quantile(&mut along, 0.01) + quantile(&mut along, 0.99))
    };
    let center = Vec3::new(middle(0), middle(1), middle(2));
    let reach = |&i: &usize| object.means()[i].distance(center) + object.scale(i).max_element();
    let radius = quantile(&mut shown.iter().map(reach).collect::<Vec<f32>>(), 0.998).max(1e-6);
    let distance = radius / (0.5 * SIDE_FOV).sin();
    let back = (user.pose.position - center).reject_from_normalized(up).try_normalize();
    let back = back.unwrap_or_else(|| up.any_orthonormal_vector());
    let right = up.cross(back);
    [0.0f32, 90.0, 180.0, 270.0].map(|turn| {
        let (sin, cos) = turn.to_radians().sin_cos();
        let (lift, level) = 18f32.to_radians().sin_cos();
        let eye = center + distance * (level * (cos * back + sin * right) + lift * up);
        let view = View::perspective(Pose::look_at(eye, center, up), SIDE_FOV, SIDE, SIDE);
        View { near: view.near.min(1e-3 * distance), ..view }
    })
}

/// Shifts and enlarges the pictures of the four sides so that what is solid in them fills them. Bounds of means cannot tell: a
/// few large Gaussians may be half of the object, and a few small ones far off may be nothing.
fn framed(mut views: [View; 4], scene: &Scene, raster: &mut CpuRasterizer) -> Result<[View; 4], Failure> {
    const SMALL: u32 = 160;
    let scale = SIDE as f32 / SMALL as f32;
    let mut boxes = [None; 4];
    for (view, found) in views.iter().zip(&mut boxes) {
        let color = raster.render(scene, &view.resized(SMALL, SMALL))?;
        let solid = |x: u32, y: u32| x < SMALL && y < SMALL && color[(y * SMALL + x) as usize][3] > 0.4;
        for (x, y) in (0..SMALL).flat_map(|y| (0..SMALL).map(move |x| (x, y))) {
            // Single pixels are floaters.
            let around = [(x + 1, y), (x.wrapping_sub(1), y), (x, y + 1), (x, y.wrapping_sub(1))];
            if solid(x, y) && around.iter().filter(|&&(x, y)| solid(x, y)).count() >= 3 {
                let (low, high) = found.get_or_insert((Vec2::MAX, Vec2::MIN));
                let at = Vec2::new(x as f32, y as f32);
                (*low, *high) = (low.min(at), high.max(at + 1.0));
            }
        }
    }
    let largest = boxes.iter().flatten().map(|(low, high)| (*high - *low).max_element()).fold(0.0, f32::max);
    if largest <= 0.0 {
        return Ok(views);
    }
    let zoom = 0.84 * SIDE as f32 / (largest * scale);
    for (view, found) in views.iter_mut().zip(boxes) {
        let middle = found.map_or(Vec2::splat(0.5 * SIDE as f32), |(low, high)| 0.5 * scale * (low + high));
        let i = &mut view.intrinsics;
        (i.cx, i.cy) = (zoom * (i.cx - middle.x) + 0.5 * SIDE as f32, zoom * (i.cy - middle.y) + 0.5 * SIDE as f32);
        (i.fx, i.fy) = (zoom * i.fx, zoom * i.fy);
    }
    Ok(views)
}

/// Value below which `share` of the values lie; 0 without values.
fn quantile(values: &mut [f32], share: f32) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let k = ((values.len() - 1) as f32 * share).round() as usize;
    *values.select_nth_unstable_by(k, f32::total_cmp).1
}

impl Canvas {
    fn blank(width: u32, height: u32, color: [u8; 3]) -> Self {
        Self { width, height, rgb: color.repeat(width as usize * height as usize) }
    }

    fn blend(&mut self, x: u32, y: u32, color: [u8; 3], share: f32) {
        let at = 3 * (y as usize * self.width as usize + x as usize);
        for (v, c) in self.rgb[at..at + 3].iter_mut().zip(color) {
            *v = (f32::from(*v) * (1.0 - share) + f32::from(c) * share + 0.5) as u8;
        }
    }

    /// Blends a colour where `cover` of a pixel's centre is above 0, within `reach` of a point.
    fn stamp(&mut self, at: Vec2, reach: f32, color: [u8; 3], cover: impl Fn(Vec2) -> f32) {
        let from = (at - reach).max(Vec2::ZERO);
        let to = at + reach;
        for y in from.y as u32..(to.y.max(0.0) as u32 + 1).min(self.height) {
            for x in from.x as u32..(to.x.max(0.0) as u32 + 1).min(self.width) {
                let share = cover(Vec2::new(x as f32 + 0.5, y as f32 + 0.5) - at).clamp(0.0, 1.0);
                if share > 0.0 {
                    self.blend(x, y, color, share);
                }
            }
        }
    }

    /// The prompts in a view.
    fn mark(&mut self, task: &Task, view: usize) {
        for prompt in task.prompts.iter().filter(|p| p.view == view) {
            match &prompt.shape {
                Shape::Click(at, kind) => self.pin(*at, *kind),
                Shape::Box(corners) => self.rectangle(*corners),
                Shape::Scribble(points) => self.stroke(points),
                Shape::Mask(mask) => self.outline(mask, POSITIVE, 2),
            }
        }
    }

    /// A disc with a plus or a minus, ringed white and black so that it shows on anything.
    fn pin(&mut self, at: Vec2, kind: ClickKind) {
        let r = (self.height as f32 / 60.0).clamp(6.0, 16.0);
        let disc = |radius: f32| move |d: Vec2| radius + 0.5 - d.length();
        let color = if kind == ClickKind::Positive { POSITIVE } else { NEGATIVE };
        for (grown, color) in [(3.5, [0; 3]), (2.2, [255; 3]), (0.0, color)] {
            self.stamp(at, r + grown + 2.0, color, disc(r + grown));
        }
        let (long, thick) = (0.6 * r, (0.16 * r).max(1.0));
        let bar = |half: Vec2| move |d: Vec2| (half.x + 0.5 - d.x.abs()).min(half.y + 0.5 - d.y.abs());
        self.stamp(at, r, [255; 3], bar(Vec2::new(long, thick)));
        if kind == ClickKind::Positive {
            self.stamp(at, r, [255; 3], bar(Vec2::new(thick, long)));
        }
    }

    fn rectangle(&mut self, [x0, y0, x1, y1]: [u32; 4]) {
        for (grown, color) in [(2u32, [255; 3]), (1, POSITIVE)] {
            for y in y0.saturating_sub(grown)..=(y1 + grown).min(self.height - 1) {
                for x in x0.saturating_sub(grown)..=(x1 + grown).min(self.width - 1) {
                    let inside = |g: u32| x >= x0 + g && x + g <= x1 && y >= y0 + g && y + g <= y1;
                    if !inside(grown) {
                        self.blend(x, y, color, 1.0);
                    }
                }
            }
        }
    }

    fn stroke(&mut self, points: &[Vec2]) {
        let width = (self.height as f32 / 200.0).max(2.0);
        for (grown, color) in [(1.5, [255; 3]), (0.0, POSITIVE)] {
            for pair in points.windows(2) {
                let (a, line) = (pair[0], pair[1] - pair[0]);
                let middle = a + 0.5 * line;
                self.stamp(middle, 0.5 * line.length() + width + grown + 1.0, color, |d| {
                    let p = d + middle - a;
                    let t = (p.dot(line) / line.length_squared().max(1e-6)).clamp(0.0, 1.0);
                    width + grown + 0.5 - p.distance(t * line)
                });
            }
        }
    }

    /// Blends the tint over a mask in proportion and draws the mask's outline, white without and bright within.
    fn tint(&mut self, mask: &Mask2d) {
        for (k, &m) in mask.values().iter().enumerate() {
            if m > 0 {
                let (x, y) = (k as u32 % self.width, k as u32 / self.width);
                self.blend(x, y, TINT, 0.42 * f32::from(m) / 255.0);
            }
        }
        self.outline(mask, TINT, 2);
    }

    /// The edge of a mask: `thick` pixels of the colour inside, one white pixel outside.
    fn outline(&mut self, mask: &Mask2d, color: [u8; 3], thick: i64) {
        let (width, height) = (i64::from(self.width), i64::from(self.height));
        let inside = |x: i64, y: i64| mask.contains(x as u32, y as u32);
        for y in 0..height {
            for x in 0..width {
                let own = inside(x, y);
                // Beyond the picture's edge a mask goes on.
                let differs = |dx: i64, dy: i64| {
                    let (u, v) = (x + dx, y + dy);
                    (0..width).contains(&u) && (0..height).contains(&v) && inside(u, v) != own
                };
                let near = |reach: i64| {
                    (1..=reach).any(|r| differs(r, 0) || differs(-r, 0) || differs(0, r) || differs(0, -r))
                };
                if own && near(thick) {
                    self.blend(x as u32, y as u32, color, 1.0);
                } else if !own && near(1) {
                    self.blend(x as u32, y as u32, [255; 3], 0.85);
                }
            }
        }
    }

    fn frame(&mut self, thick: u32, color: [u8; 3]) {
        for y in 0..self.height {
            for x in 0..self.width {
                if x.min(y).min(self.width - 1 - x).min(self.height - 1 - y) < thick {
                    self.blend(x, y, color, 1.0);
                }
            }
        }
    }

    /// Every `step` x `step` pixels become their mean.
    fn shrunk(&self, step: u32) -> Self {
        let (width, height) = (self.width / step, self.height / step);
        let mut rgb = Vec::with_capacity(3 * width as usize * height as usize);
        for y in 0..height {
            for x in 0..width {
                for c in 0..3 {
                    let mut sum = 0u32;
                    for v in 0..step {
                        for u in 0..step {
                            let at = (y * step + v) as usize * self.width as usize + (x * step + u) as usize;
                            sum += u32::from(self.rgb[3 * at + c]);
                        }
                    }
                    rgb.push((sum / (step * step)) as u8);
                }
            }
        }
        Self { width, height, rgb }
    }

    fn place(&mut self, tile: &Canvas, left: u32, top: u32) {
        let row = 3 * tile.width as usize;
        for y in 0..tile.height as usize {
            let to = 3 * ((top as usize + y) * self.width as usize + left as usize);
            self.rgb[to..to + row].copy_from_slice(&tile.rgb[y * row..(y + 1) * row]);
        }
    }
}

/// The direction that is up in most of some pictures; `None` without pictures, or if they contradict each other.
pub(crate) fn up_of_views(views: &[View]) -> Option<Vec3> {
    let sum: Vec3 = views.iter().map(|v| -v.pose.world_from_view.y_axis).sum();
    (sum.length() > 0.3 * views.len() as f32).then(|| sum.normalize())
}
