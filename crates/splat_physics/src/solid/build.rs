//! [`Solid::build`]: the stages one after another.

use glam::{DVec3, IVec3};
use splat_core::Cloud;

use super::base::close_base;
use super::candidates::Candidates;
use super::hollow::hollow;
use super::hull::hull;
use super::morphology::{Mask, faces, large_pieces};
use super::occupancy::occupancy;
use super::regions::spread;
use super::thickness::thickness;
use super::{Leaks, Pieces, Solid, SolidError, SolidReport, SolidSettings, VoxelGrid};

/// A piece is large above one part in so many of the largest.
const LARGE: usize = 100;
/// More large pieces are no body.
const MOST_PIECES: usize = 32;
/// A surface that holds so many times its shell is closed.
const ENCLOSES: f64 = 1.5;
/// If none of the closings does, the one that holds most is taken if it holds so much, as a thing of thin limbs does: one of eight
/// voxels 1.3 times its shell, while a ball that leaks holds 1.03 times.
const LIMBS: f64 = 1.25;
/// What fills so much of its convex hull encloses nothing and need not.
const FILLS_HULL: f64 = 0.5;
/// Voxels along the diagonal that are enough to try half as many.
const COARSEST: u32 = 48;
/// What is less voxels thick is flat: its two sides cannot be told apart.
const FLAT: f64 = 2.5;

impl Solid {
    /// The solid of the Gaussians `ids` of `cloud`, in metres, in the body's frame.
    ///
    /// `regions`: for each of `ids`, which of the materials it is made of; all 0 without. What of the solid no Gaussian tells
    /// takes the region of the nearest that one does.
    ///
    /// Robust: haze, monsters and floaters are left out; a surface thinner than a voxel counts wherever it passes; the underside
    /// is closed; holes are closed, the narrowest closing that suffices; what the surface encloses is filled. The same bits on any
    /// number of threads.
    ///
    /// # Errors
    /// [`SolidError`], each with the numbers that say why; never a panic, whatever the values are.
    pub fn build(
        cloud: &Cloud,
        ids: &[u32],
        metres_per_unit: f64,
        regions: Option<&[u8]>,
        settings: &SolidSettings,
    ) -> Result<Self, SolidError> {
        settings.check()?;
        let found = Candidates::new(cloud, ids, metres_per_unit, regions)?;
        let grid = grid_around(&found, settings);
        let occupied = occupancy(&found.splats, &grid, settings.cut, regions.is_some());
        let (shell, ..) = large_pieces(&occupied.mask, LARGE, false);
        if shell.count() == 0 {
            return Err(SolidError::EmptyOccupancy { cut: settings.cut });
        }
        let thick = thickness(&shell, &grid);
        if thick < FLAT {
            return Err(SolidError::TooThin { voxels: thick.round().max(1.0) as u32, thickness: thick * grid.voxel });
        }

        let closed = Closed::new(&shell, &grid, settings)?;
        if closed.leaked && settings.leaks == Leaks::Hull && settings.voxels >= COARSEST {
            // Few Gaussians leave gaps of many small voxels, which are closed as gaps of few large ones.
            let coarser = SolidSettings { voxels: settings.voxels / 2, leaks: Leaks::Refuse, ..settings.clone() };
            if let Ok(solid) = Self::build(cloud, ids, metres_per_unit, regions, &coarser) {
                return Ok(solid);
            }
        }
        let (filled, pieces, largest) = large_pieces(&closed.filled, LARGE, settings.pieces == Pieces::Largest);
        if pieces > MOST_PIECES || (pieces > 1 && settings.pieces == Pieces::One) {
            return Err(SolidError::Disconnected { pieces, largest });
        }
        let left_out = 1.0 - filled.count() as f64 / closed.filled.count() as f64;

        let skin = shell_of(&filled, &closed.shell);
        let mut weights: Vec<f32> =
            filled.voxels.iter().zip(&skin.voxels).map(|(&f, &s)| f32::from(f) * (1.0 - 0.5 * f32::from(s))).collect();
        if let Some(wall) = settings.hollow {
            hollow(&mut weights, &filled, wall / grid.voxel);
        }
        let mut of_voxels = occupied.regions;
        if regions.is_some() {
            spread(&mut of_voxels, &shell, &filled);
        }
        let mut solid = Self { grid, weights, regions: of_voxels, report: SolidReport::default() };
        solid.report = SolidReport {
            used: found.splats.len(),
            unused: found.unused,
            volume: solid.volume(),
            shell_volume: skin.count() as f64 * grid.voxel_volume(),
            voxels: solid.occupied().count(),
            pieces,
            left_out,
            closing: closed.closing,
            base: closed.base,
            leaked: closed.leaked,
        };
        Ok(solid)
    }
}

/// A grid with as many voxels along the part's diagonal as asked for, around all that its Gaussians reach, with room to go around it.
fn grid_around(found: &Candidates, settings: &SolidSettings) -> VoxelGrid {
    let thickest = found.splats.iter().map(|splat| splat.sigma.max_element()).fold(0.0, f64::max);
    let diagonal = (found.high - found.low).length().max(4.0 * thickest);
    let voxel = diagonal / f64::from(settings.voxels);
    // Large Gaussians may reach out, but do not decide how large the grid is.
    let most = DVec3::splat(0.1 * diagonal);
    let (mut low, mut high) = (found.low, found.high);
    for splat in &found.splats {
        let reach = (2.5 * splat.spread()).min(most);
        low = low.min(splat.mean - reach).max(found.low - most);
        high = high.max(splat.mean + reach).min(found.high + most);
    }
    let margin = f64::from(settings.max_closing) + 3.0;
    let dims = ((high - low) / voxel + 2.0 * margin).ceil().as_uvec3().max(glam::UVec3::splat(3));
    VoxelGrid { origin: 0.5 * (low + high) - 0.5 * dims.as_dvec3() * voxel, voxel, dims }
}

/// A shell with an underside, and what it encloses.
struct Closed {
    shell: Mask,
    filled: Mask,
    closing: u32,
    base: usize,
    leaked: bool,
}

impl Closed {
    /// With the least closing that holds, and an underside only where it does not hold without.
    fn new(shell: &Mask, grid: &VoxelGrid, settings: &SolidSettings) -> Result<Self, SolidError> {
        let room = inner_room(shell, settings.max_closing + 1);
        let up = settings.up.normalize();
        let attempt = |closing: u32, bottom: bool| {
            let mut shell = room.clone();
            let base = if bottom { close_base(&mut shell, up, 2 * closing) } else { 0 };
            let filled = shell.filled(closing);
            Self { shell, filled, closing, base, leaked: false }
        };
        let bottoms = if settings.close_bottom { &[false, true][..] } else { &[false] };
        let mut best: Option<(f64, Self)> = None;
        for closing in 1..=settings.max_closing {
            for &bottom in bottoms {
                let closed = attempt(closing, bottom);
                let holds = closed.holds();
                if holds >= ENCLOSES {
                    return Ok(closed);
                }
                if holds >= LIMBS && best.as_ref().is_none_or(|(most, _)| holds > *most) {
                    best = Some((holds, closed));
                }
            }
        }
        if let Some((_, closed)) = best {
            return Ok(closed);
        }
        let thin = attempt(1, settings.close_bottom);
        let convex = hull(&room, grid);
        if thin.filled.count() as f64 >= FILLS_HULL * convex.count() as f64 {
            return Ok(thin);
        }
        let closing = settings.max_closing;
        match settings.leaks {
            Leaks::Refuse => {
                let last = attempt(closing, settings.close_bottom);
                let volume = |mask: &Mask| mask.count() as f64 * grid.voxel_volume();
                Err(SolidError::ShellLeaks {
                    closing_tried: closing,
                    hole: f64::from(2 * closing) * grid.voxel,
                    filled: volume(&last.filled),
                    shell: volume(&last.shell),
                })
            }
            Leaks::Hull => Ok(Self { filled: convex, shell: room, closing, base: 0, leaked: true }),
            Leaks::Shell => Ok(Self { filled: room.filled(1), shell: room, closing, base: 0, leaked: true }),
        }
    }

    /// How many times its shell it holds.
    fn holds(&self) -> f64 {
        self.filled.count() as f64 / shell_of(&self.filled, &self.shell).count().max(1) as f64
    }
}

/// `shell` without what is nearer than `margin` to the grid's faces: parts of Gaussians that reach beyond.
fn inner_room(shell: &Mask, margin: u32) -> Mask {
    let dims = shell.dims;
    let (nx, ny) = (dims.x as usize, dims.y as usize);
    let mut room = shell.clone();
    for (k, voxel) in room.voxels.iter_mut().enumerate() {
        let at = glam::UVec3::new((k % nx) as u32, (k / nx % ny) as u32, (k / (nx * ny)) as u32);
        let away = at.min(dims - 1 - at).min_element();
        *voxel &= u8::from(away >= margin);
    }
    room
}

/// Whether a voxel is set and all that share a face with it.
fn depth_above_one(mask: &Mask, voxel: usize) -> bool {
    mask.voxels[voxel] != 0 && faces(voxel, mask.dims).all(|(near, _)| mask.voxels[near] != 0)
}

/// The voxels of `filled` that the surface runs through: at most two voxels from the outside and opaque themselves, or right at
/// the outside. Opaque voxels further in are clutter inside the body.
fn shell_of(filled: &Mask, opaque: &Mask) -> Mask {
    let (nx, ny) = (filled.dims.x as i32, filled.dims.y as i32);
    let offsets: Vec<i32> = (0..125)
        .map(|k| IVec3::new(k % 5 - 2, k / 5 % 5 - 2, k / 25 - 2))
        .filter(|o| (1..=4).contains(&o.length_squared()))
        .map(|o| o.x + nx * (o.y + ny * o.z))
        .collect();
    let empty = |voxel: usize, offset: i32| {
        let near = voxel as i64 + i64::from(offset);
        filled.voxels.get(near as usize).is_none_or(|&near| near == 0)
    };
    let is_shell = |voxel: usize| {
        filled.voxels[voxel] != 0
            && if opaque.voxels[voxel] != 0 {
                offsets.iter().any(|&offset| empty(voxel, offset))
            } else {
                !depth_above_one(filled, voxel)
            }
    };
    Mask { dims: filled.dims, voxels: (0..filled.voxels.len()).map(|voxel| u8::from(is_shell(voxel))).collect() }
}
