//! The CPU back end: draws with [`CpuRasterizer`] and hands the pixels to the graphics device.
//!
//! On adapters that are a CPU themselves, fragments are what costs: finished pixels are copied into the target wherever
//! one copy can do, and a picture is taken again while nothing changed.

use std::sync::Arc;

use bevy::color::ColorToComponents;
use bevy::ecs::entity::EntityHashMap;
use bevy::log::warn_once;
use bevy::math::{URect, UVec2, Vec4};
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, Extent3d, Origin3d, TexelCopyBufferInfo, TexelCopyBufferLayout,
    TexelCopyTextureInfo, Texture, TextureAspect, TextureFormat, TextureUsages,
};
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue};
use rayon::prelude::*;
use splat_core::View;
use splat_raster::cpu::CpuRasterizer;
use splat_raster::{Features, Frame, Outputs, Rasterizer, Scene};

use super::composite::Target;
use super::extract::ExtractedEntity;
use super::pass::CompositeView;
use super::prepare::{Plan, Route};
use super::read_back::{ReadBack, stride};
use super::selected::{Selected, same_arc};
use super::settings::SplatOutline;

/// One camera's working memory on the CPU, and what it drew last.
#[derive(Default)]
pub(super) struct CpuView {
    rasterizer: CpuRasterizer,
    frame: Frame,
    /// Finished pixels in rows of [`stride`] bytes: over the background for copies, premultiplied for the composite.
    bytes: Vec<u8>,
    /// The pixels on the device, for copies.
    staging: Option<Buffer>,
    /// The pixels on the device, for the composite.
    pub(super) splats: Option<Target>,
    /// Camera z at which splats become half opaque.
    pub(super) depth: Option<Target>,
    pub(super) read_back: ReadBack,
    pub(super) composite: CompositeView,
    /// Where the picture is not empty.
    pub(super) touched: URect,
    /// What `bytes` shows, if it may be taken again.
    drawn: Option<Drawn>,
    selected: Selected,
    /// How often `selected` was made.
    selections: u64,
}

/// Everything a picture depends on.
struct Drawn {
    view: View,
    scene: Scene,
    /// Which selection, counted; none: nothing is selected, or no outline wanted.
    selected: Option<u64>,
    outline: Option<SplatOutline>,
    background: Option<Vec4>,
    route: Route,
    depth: bool,
}

impl CpuView {
    /// Lets go of everything that belongs to the main world; working memory is kept.
    pub(super) fn forget(&mut self) {
        self.drawn = None;
        self.selected.forget();
    }

    /// Draws the plan's splats into `bytes` (and depth), unless they are what is there; whether they were.
    ///
    /// `read`: whether `read_back` holds what is behind the splats. `None`: nothing could be drawn.
    pub(super) fn draw(
        &mut self,
        plan: &Plan,
        entities: &EntityHashMap<ExtractedEntity>,
        read: bool,
        (device, queue): (&RenderDevice, &RenderQueue),
    ) -> Option<bool> {
        let outline = plan.settings.outline;
        let selected = outline.and_then(|_| self.selected.update(&plan.entities, entities)).map(|anew| {
            self.selections += u64::from(anew);
            self.selections
        });
        let now = Drawn {
            view: plan.camera.view,
            scene: plan.scene.clone(),
            selected,
            outline,
            background: plan.clear.filter(|_| plan.route != Route::Blend),
            route: plan.route,
            depth: plan.needs_depth(),
        };
        if !read && self.drawn.as_ref().is_some_and(|drawn| drawn.same(&now)) {
            return Some(true);
        }
        self.drawn = None;
        let outputs = Outputs {
            color: true,
            median_depth: plan.needs_depth(),
            features: selected.map(|_| Features { channels: 1, values: &self.selected.values }),
            limit: (read && plan.meshes).then_some(&*self.read_back.limits),
            ..Outputs::default()
        };
        if let Err(error) = self.rasterizer.draw(&plan.scene, &plan.camera.view, &outputs, &mut self.frame) {
            warn_once!("splats are not drawn: {error}");
            return None;
        }
        let size = UVec2::new(plan.camera.view.width, plan.camera.view.height);
        let row = stride(size.x) as usize;
        let behind = match plan.route {
            Route::Blend => Behind::Nothing,
            Route::Copy { .. } => match plan.clear {
                Some(color) => Behind::Color(color),
                None => Behind::Pixels(&self.read_back.pixels),
            },
        };
        let swap = plan.route == (Route::Copy { swap: true });
        self.bytes.resize(row * size.y as usize, 0);
        finish(&self.frame.color, size.x as usize, behind, swap, &mut self.bytes);
        if let Some(outline) = outline.filter(|_| selected.is_some()) {
            draw_outline(&self.frame.features, size, outline, swap, &mut self.bytes);
        }
        match plan.route {
            Route::Copy { .. } => self.stage(device, queue),
            Route::Blend => {
                self.touched = touched(&self.bytes, row, size);
                self.upload(size, device, queue);
            }
        }
        if plan.needs_depth() {
            self.upload_depth(size, device, queue);
        }
        // What was behind may change without our knowing.
        if !read {
            self.drawn = Some(now);
        }
        Some(false)
    }

    fn stage(&mut self, device: &RenderDevice, queue: &RenderQueue) {
        let size = self.bytes.len() as u64;
        if self.staging.as_ref().is_none_or(|buffer| buffer.size() != size) {
            self.staging = Some(device.create_buffer(&BufferDescriptor {
                label: Some("splat_pixels"),
                size,
                usage: BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }));
        }
        if let Some(buffer) = &self.staging {
            queue.write_buffer(buffer, 0, &self.bytes);
        }
    }

    /// Records the copy of the finished pixels into the camera's target.
    pub(super) fn copy_into(&self, target: &Texture, plan: &Plan, ctx: &mut RenderContext) {
        let Some(buffer) = &self.staging else { return };
        let view = &plan.camera.view;
        ctx.command_encoder().copy_buffer_to_texture(
            TexelCopyBufferInfo {
                buffer,
                layout: TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(stride(view.width)),
                    rows_per_image: None,
                },
            },
            TexelCopyTextureInfo {
                texture: target,
                mip_level: 0,
                origin: Origin3d { x: plan.corner.x, y: plan.corner.y, z: 0 },
                aspect: TextureAspect::All,
            },
            Extent3d { width: view.width, height: view.height, depth_or_array_layers: 1 },
        );
    }

    fn upload(&mut self, size: UVec2, device: &RenderDevice, queue: &RenderQueue) {
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST;
        let target = Target::fitting(&mut self.splats, device, "splat_picture", size, TextureFormat::Rgba8Unorm, usage);
        write(queue, &target.texture, &self.bytes, stride(size.x), size);
    }

    fn upload_depth(&mut self, size: UVec2, device: &RenderDevice, queue: &RenderQueue) {
        // Shaders may take NaN for any number.
        self.frame.median_depth.par_iter_mut().filter(|z| z.is_nan()).for_each(|z| *z = f32::INFINITY);
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST;
        let target = Target::fitting(&mut self.depth, device, "splat_depth", size, TextureFormat::R32Float, usage);
        write(queue, &target.texture, bytemuck::cast_slice(&self.frame.median_depth), 4 * size.x, size);
    }
}

/// Fills a texture of four bytes a pixel.
fn write(queue: &RenderQueue, texture: &Texture, bytes: &[u8], row: u32, size: UVec2) {
    queue.write_texture(
        TexelCopyTextureInfo { texture, mip_level: 0, origin: Origin3d::ZERO, aspect: TextureAspect::All },
        bytes,
        TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
        Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
    );
}

impl Drawn {
    fn same(&self, other: &Self) -> bool {
        (self.view, self.outline, self.background) == (other.view, other.outline, other.background)
            && (self.route, self.depth) == (other.route, other.depth)
            && self.selected == other.selected
            && self.scene.instances.len() == other.scene.instances.len()
            && self.scene.instances.iter().zip(&other.scene.instances).all(|(a, b)| {
                Arc::ptr_eq(&a.cloud, &b.cloud)
                    && a.transform == b.transform
                    && same_arc(&a.hidden, &b.hidden)
                    && same_arc(&a.subset, &b.subset)
                    && same_arc(&a.tint, &b.tint)
                    && same_arc(&a.deformation, &b.deformation)
            })
    }
}

/// What is behind the splats.
#[derive(Clone, Copy)]
enum Behind<'a> {
    /// Premultiplied pixels are wanted.
    Nothing,
    /// sRGB-encoded, straight alpha.
    Color(Vec4),
    /// Four encoded bytes a pixel, straight alpha, in the rows and the order of the result.
    Pixels(&'a [u8]),
}

/// Puts a drawn picture over what is behind it: `C + T * background` in display space, in bytes.
fn finish(color: &[[f32; 4]], width: usize, behind: Behind, swap: bool, bytes: &mut [u8]) {
    let row = stride(width as u32) as usize;
    let byte = |v: f32| (255.0 * v.clamp(0.0, 1.0) + 0.5) as u8;
    let over = |[r, g, b, a]: [f32; 4], back: [f32; 4]| {
        let rest = (1.0 - a) * back[3];
        let alpha = a + rest;
        // Opaque where the background is: no division to lose a bit by.
        let scale = if back[3] >= 1.0 || alpha <= 0.0 { 1.0 } else { 1.0 / alpha };
        [(r + rest * back[0]) * scale, (g + rest * back[1]) * scale, (b + rest * back[2]) * scale, alpha]
    };
    let order = |[r, g, b, a]: [f32; 4]| if swap { [b, g, r, a] } else { [r, g, b, a] };
    bytes.par_chunks_mut(row).zip(color.par_chunks(width)).enumerate().for_each(|(y, (bytes, color))| {
        let to = bytes.as_chunks_mut::<4>().0;
        match behind {
            Behind::Nothing => to.iter_mut().zip(color).for_each(|(to, c)| *to = c.map(byte)),
            Behind::Color(back) => {
                let back = back.to_array();
                to.iter_mut().zip(color).for_each(|(to, &c)| *to = order(over(c, back)).map(byte));
            }
            Behind::Pixels(pixels) => {
                let from = pixels[y * row..][..4 * width].as_chunks::<4>().0;
                for ((to, &c), from) in to.iter_mut().zip(color).zip(from) {
                    let back = order(from.map(|v| f32::from(v) / 255.0));
                    *to = if c[3] == 0.0 { *from } else { order(over(c, back)).map(byte) };
                }
            }
        }
    });
}

/// Draws a line of `outline.width_px` pixels along the outside of where the selected weight is half or more
/// (`outline_at` of `composite.wgsl`).
fn draw_outline(selected: &[f32], size: UVec2, outline: SplatOutline, swap: bool, bytes: &mut [u8]) {
    let (width, height) = (size.x as usize, size.y as usize);
    let reach = outline.width_px.min(8) as usize;
    let row = stride(size.x) as usize;
    let [r, g, b, strength] = outline.color.to_f32_array();
    let color = if swap { [b, g, r, 1.0] } else { [r, g, b, 1.0] }.map(|v| 255.0 * v.clamp(0.0, 1.0));
    let strength = strength.clamp(0.0, 1.0);
    let inside = |x: usize, y: usize| selected[y * width + x] >= 0.5;
    bytes.par_chunks_mut(row).enumerate().for_each(|(y, bytes)| {
        let rows = y.saturating_sub(reach)..(y + reach + 1).min(height);
        // Most rows are far from any selection.
        if !rows.clone().any(|y| selected[y * width..][..width].iter().any(|&s| s >= 0.5)) {
            return;
        }
        for x in 0..width {
            let near = || {
                let columns = x.saturating_sub(reach)..(x + reach + 1).min(width);
                rows.clone().any(|v| {
                    columns
                        .clone()
                        .any(|u| u.abs_diff(x).pow(2) + v.abs_diff(y).pow(2) <= reach * reach && inside(u, v))
                })
            };
            if !inside(x, y) && near() {
                for (to, color) in bytes[4 * x..][..4].iter_mut().zip(color) {
                    *to = (f32::from(*to) + strength * (color - f32::from(*to)) + 0.5) as u8;
                }
            }
        }
    });
}

/// The box around all pixels with an alpha.
fn touched(bytes: &[u8], row: usize, size: UVec2) -> URect {
    let width = size.x as usize;
    let seen = |pixel: &[u8; 4]| pixel[3] != 0;
    let spans = bytes.par_chunks(row).take(size.y as usize).enumerate().filter_map(|(y, bytes)| {
        let pixels = &bytes.as_chunks::<4>().0[..width];
        let first = pixels.iter().position(seen)?;
        let last = pixels.iter().rposition(seen)?;
        Some(URect::new(first as u32, y as u32, last as u32 + 1, y as u32 + 1))
    });
    spans.reduce(|| URect::EMPTY, |a, b| a.union(b))
}

#[cfg(test)]
mod tests {
    use bevy::color::Srgba;

    use super::*;

    #[test]
    fn pixels_are_put_over_colours_and_pixels_alike() {
        let color = [[0.0; 4], [0.5, 0.25, 0.0, 0.5], [1.2, 0.0, 0.0, 1.0]];
        let row = stride(3) as usize;
        let mut over_color = vec![0; row];
        finish(&color, 3, Behind::Color(Vec4::new(0.0, 1.0, 0.5, 1.0)), false, &mut over_color);
        assert_eq!(&over_color[..12], [0, 255, 128, 255, 128, 191, 64, 255, 255, 0, 0, 255]);
        let mut behind = vec![0; row];
        behind[..12].copy_from_slice(&[128, 255, 0, 255, 128, 255, 0, 255, 128, 255, 0, 255]);
        let mut swapped = vec![0; row];
        finish(&color, 3, Behind::Pixels(&behind), true, &mut swapped);
        assert_eq!(&swapped[..12], [128, 255, 0, 255, 64, 191, 128, 255, 0, 0, 255, 255]);
        let mut premultiplied = vec![0; row];
        finish(&color, 3, Behind::Nothing, false, &mut premultiplied);
        assert_eq!(&premultiplied[4..8], [128, 64, 0, 128]);
        // Over nothing at all, colours are straight.
        finish(&color, 3, Behind::Color(Vec4::ZERO), false, &mut over_color);
        assert_eq!(&over_color[..8], [0, 0, 0, 0, 255, 128, 0, 128]);
    }

    #[test]
    fn the_touched_box_is_as_small_as_can_be() {
        let size = UVec2::new(5, 4);
        let row = stride(5) as usize;
        let mut bytes = vec![0; row * 4];
        assert!(touched(&bytes, row, size).is_empty());
        bytes[row + 4 * 2 + 3] = 1;
        bytes[2 * row + 4 * 3 + 3] = 9;
        assert_eq!(touched(&bytes, row, size), URect::new(2, 1, 4, 3));
    }

    #[test]
    fn an_outline_runs_along_the_outside_of_what_is_selected() {
        let size = UVec2::new(7, 5);
        let mut selected = vec![0.0; 35];
        selected[2 * 7 + 3] = 0.9;
        let row = stride(7) as usize;
        let mut bytes = vec![0; row * 5];
        let outline = SplatOutline { color: Srgba::new(1.0, 0.0, 0.0, 1.0), width_px: 1 };
        draw_outline(&selected, size, outline, false, &mut bytes);
        let lit: Vec<_> = (0..35).filter(|i| bytes[i / 7 * row + i % 7 * 4] == 255).collect();
        assert_eq!(lit, [10, 16, 18, 24]);
    }
}
