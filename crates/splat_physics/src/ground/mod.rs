//! What is left of a capture as something that stands still: [`Ground`], and how far points are from it: [`DistanceField`].

mod bytes;
mod close;
mod field;
mod fill;
mod lattice;
mod seen;
mod settings;
mod surface;
#[cfg(test)]
mod tests;

use glam::{DQuat, DVec3, IVec3, UVec3};
use splat_core::orient::{FloorSettings, floor_plane};
use splat_core::{Cloud, Selection};
use xxhash_rust::xxh3::Xxh3;

use crate::SurfaceMesh;
pub use field::DistanceField;
pub use settings::{Fill, GroundError, GroundReport, GroundSettings, GroundSource};
use surface::Place;

/// Fewer Gaussians are no ground.
const LEAST_SPLATS: usize = 50;
/// Smaller pieces, in voxels, are floaters.
const LEAST_PIECE: usize = 24;
/// Share of the voxels that must be on a plane for it to be the ground.
const ALL: f64 = 0.995;
/// Metres per unit that captures have.
const SCALES: std::ops::RangeInclusive<f64> = 1e-9..=1e9;
/// Columns of a heightfield, at most.
const MOST_COLUMNS: f64 = 64e6;

/// The surface of what is left of a capture, in pieces; in metres, in the body's frame of the capture.
#[derive(Clone, Debug, PartialEq)]
pub struct Ground {
    chunks: Vec<GroundChunk>,
    report: GroundReport,
    key: u64,
}

/// A piece of a ground.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundChunk {
    /// Which: multiples of the edge of a piece along the axes of the grid. A plane is one piece.
    pub at: IVec3,
    /// What it is.
    pub surface: GroundSurface,
}

/// The surface of a piece of ground.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum GroundSurface {
    /// All below a plane, `normal . p <= offset`, without end.
    Plane {
        /// Unit vector, upwards.
        normal: DVec3,
        /// In metres.
        offset: f64,
    },
    /// Heights on a square grid: sample (i, j) is at `origin + rotation * (i spacing, heights[i + dims[0] j], j spacing)`.
    Heights {
        /// Of sample (0, 0), at height 0.
        origin: DVec3,
        /// Turns x and z along the grid and y upwards.
        rotation: DQuat,
        /// Metres between samples.
        spacing: f64,
        /// Samples along x and z, 2 or more; pieces share the samples at their borders.
        dims: [u32; 2],
        /// In metres.
        heights: Vec<f32>,
    },
    /// Triangles, outward. Open where the next piece goes on.
    Mesh(SurfaceMesh),
    /// Voxels: cell (i, j, k) begins at `origin + rotation * (voxel (i, j, k))`.
    Voxels {
        /// Least corner of cell (0, 0, 0).
        origin: DVec3,
        /// Turns the axes of the cells.
        rotation: DQuat,
        /// Side of a cell in metres.
        voxel: f64,
        /// Those that are solid, each once.
        cells: Vec<UVec3>,
    },
}

impl Ground {
    /// The ground that the Gaussians `ids` of a cloud are.
    ///
    /// `removed`: Gaussians of each part that was taken out; what they stood on goes on below them. `metres_per_unit`: of the
    /// cloud. The same bits on any number of threads; pieces that do not change have the same bits.
    ///
    /// # Errors
    /// [`GroundError`]: there is nothing to stand on, or no plane where one is asked for.
    pub fn build(
        cloud: &Cloud,
        ids: &[u32],
        removed: &[&[u32]],
        metres_per_unit: f64,
        settings: &GroundSettings,
    ) -> Result<Self, GroundError> {
        settings.check()?;
        if !SCALES.contains(&metres_per_unit) {
            return Err(GroundError::Scale { metres_per_unit });
        }
        let mut all = std::iter::once(ids).chain(removed.iter().copied()).flatten();
        if let Some(&id) = all.find(|&&id| id as usize >= cloud.len()) {
            return Err(GroundError::UnknownGaussian { id, len: cloud.len() });
        }
        let up = settings.up.normalize();
        let grid_from_body = if up == DVec3::Y { DQuat::IDENTITY } else { DQuat::from_rotation_arc(up, DVec3::Y) };
        let grains = seen::grains(cloud, ids, metres_per_unit, grid_from_body);
        if grains.len() < LEAST_SPLATS {
            return Err(GroundError::TooFewSplats { have: grains.len(), of: ids.len(), need: LEAST_SPLATS });
        }
        let key = Self::key(cloud, ids, removed, metres_per_unit, settings);
        let mut report = GroundReport { used: grains.len(), voxel: settings.voxel, ..GroundReport::default() };
        let plane = || {
            let selection = Selection::from_ids(cloud.len(), ids.iter().copied());
            let floor = floor_plane(cloud, Some(&selection), up.as_vec3(), &FloorSettings::default())?;
            let (normal, offset) = (floor.normal.as_dvec3(), f64::from(floor.offset) * metres_per_unit);
            let length = normal.length();
            Some((normal / length, offset / length))
        };
        let one = |(normal, offset), report| {
            let surface = GroundSurface::Plane { normal, offset };
            Self { chunks: vec![GroundChunk { at: IVec3::ZERO, surface }], report, key }
        };
        if settings.source == GroundSource::Plane {
            return plane().map(|found| one(found, report)).ok_or(GroundError::NoFloor);
        }

        let mut seen = seen::seen(&grains, report.voxel, settings.cut);
        while seen.len() > settings.most_voxels || columns_of(&seen) > MOST_COLUMNS {
            report.doubled += 1;
            report.voxel *= 2.0;
            seen = seen::seen(&grains, report.voxel, settings.cut);
        }
        drop(grains);
        fill::without_specks(&mut seen, LEAST_PIECE);
        if seen.is_empty() {
            return Err(GroundError::EmptyOccupancy { cut: settings.cut });
        }
        for part in removed {
            let grains = seen::grains(cloud, part, metres_per_unit, grid_from_body);
            let mut part = seen::seen(&grains, report.voxel, settings.cut);
            fill::without_specks(&mut part, LEAST_PIECE);
            match close::close(&mut seen, &part) {
                Some(added) => report.closed += added,
                None if part.is_empty() => {}
                None => report.hanging += 1,
            }
        }
        report.voxels = seen.len();
        let place = Place { body_from_grid: grid_from_body.conjugate(), voxel: report.voxel };
        if settings.source == GroundSource::Auto
            && let Some((normal, offset)) = plane()
        {
            let off = |at: &IVec3| (place.body(at.as_dvec3()).dot(normal) - offset).abs();
            let near = seen.keys().filter(|at| off(at) <= 2.0 * report.voxel).count();
            if near as f64 >= ALL * seen.len() as f64 && normal.dot(up) > 0.5 {
                return Ok(one((normal, offset), report));
            }
        }
        let edge = (settings.chunk / report.voxel).round().clamp(4.0, 65536.0) as i32;
        let chunks = match settings.source {
            GroundSource::Heightfield => surface::heights(&fill::columns(&seen), &place, edge),
            GroundSource::Voxels | GroundSource::Mesh | GroundSource::Auto | GroundSource::Plane => {
                let (solid, told) = fill::solid(&seen, settings.fill, report.voxel);
                report.open = !told;
                if settings.source == GroundSource::Voxels {
                    surface::voxels(&solid, &place, edge)
                } else {
                    surface::meshes(&solid, &seen, &place, edge)
                }
            }
        };
        Ok(Self { chunks, report, key })
    }

    /// What a ground is made from in a number, for caches: of the Gaussians, the parts that are out, the scale and the settings.
    ///
    /// # Panics
    /// Never: Gaussians that are not in the cloud count by their id.
    pub fn key(cloud: &Cloud, ids: &[u32], removed: &[&[u32]], metres_per_unit: f64, settings: &GroundSettings) -> u64 {
        let mut hash = Xxh3::new();
        let mut list = |ids: &[u32]| {
            hash.update(&(ids.len() as u64).to_le_bytes());
            for &id in ids {
                hash.update(&id.to_le_bytes());
                let k = id as usize;
                if k < cloud.len() {
                    hash.update(bytemuck::bytes_of(&cloud.means()[k]));
                    hash.update(bytemuck::bytes_of(&cloud.log_scales()[k]));
                    hash.update(bytemuck::bytes_of(&cloud.rotations()[k]));
                    hash.update(&cloud.opacity_logits()[k].to_le_bytes());
                }
            }
        };
        list(ids);
        removed.iter().for_each(|part| list(part));
        let GroundSettings { source, voxel, cut, fill, chunk, up, most_voxels } = settings;
        hash.update(&[bytes::VERSION, *source as u8, *fill as u8]);
        for number in [*voxel, f64::from(*cut), *chunk, up.x, up.y, up.z, metres_per_unit, *most_voxels as f64] {
            hash.update(&number.to_le_bytes());
        }
        hash.digest()
    }

    /// Its pieces, in rising order of where they are.
    pub fn chunks(&self) -> &[GroundChunk] {
        &self.chunks
    }

    /// What was found and done.
    pub fn report(&self) -> &GroundReport {
        &self.report
    }

    /// The [`key`](Self::key) of what it was made from.
    pub fn content_key(&self) -> u64 {
        self.key
    }

    /// What whoever uses the ground should know, a sentence each.
    pub fn notes(&self) -> impl Iterator<Item = String> {
        self.report.notes()
    }

    /// What it is, in a word.
    pub fn name(&self) -> &'static str {
        match self.chunks.first().map(|chunk| &chunk.surface) {
            Some(GroundSurface::Plane { .. }) => "plane",
            Some(GroundSurface::Heights { .. }) => "heightfield",
            Some(GroundSurface::Mesh(_)) => "mesh",
            Some(GroundSurface::Voxels { .. }) => "voxels",
            None => "nothing",
        }
    }

    /// How far points are from it.
    pub fn field(&self) -> DistanceField {
        DistanceField::of(self)
    }
}

/// Columns of the box around all voxels.
fn columns_of(seen: &lattice::PlaceMap<lattice::Seen>) -> f64 {
    let (low, high) = seen.keys().fold((IVec3::MAX, IVec3::MIN), |(l, h), at| (l.min(*at), h.max(*at)));
    if seen.is_empty() { 0.0 } else { f64::from(high.x - low.x + 1) * f64::from(high.z - low.z + 1) }
}
