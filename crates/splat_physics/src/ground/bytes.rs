//! A ground as bytes and back, for caches.

use glam::IVec3;

use super::{Ground, GroundChunk, GroundReport, GroundSurface};
use crate::SurfaceMesh;
use crate::bake::{BakeError, BakeReader, BakeWriter, Baked, Sink, Source, Tag};

/// Of what [`Ground::build`] makes of the same input, and of how it is written.
pub(super) const VERSION: u8 = 1;
const GROUND: Tag = Tag(*b"GRND");

impl Ground {
    /// A file of it: sections with checksums, as of a [`BakeWriter`].
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut file = BakeWriter::new();
        file.put(GROUND, self);
        file.finish()
    }

    /// The ground of a file; the same bits as were written.
    ///
    /// # Errors
    /// [`BakeError`]: the bytes are no such file, of another version, cut off or changed.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, BakeError> {
        BakeReader::new(bytes)?.get(GROUND)
    }
}

impl Baked for Ground {
    const LEAST: usize = 1;

    fn write(&self, to: &mut Sink) {
        let GroundReport { used, voxel, doubled, voxels, closed, hanging, open } = &self.report;
        to.put(&VERSION);
        to.put(&self.key);
        to.put(&[*used as u64, *voxels as u64, *closed as u64, *hanging as u64]);
        to.put(voxel);
        to.put(doubled);
        to.put(open);
        to.put(&(self.chunks.len() as u64));
        self.chunks.iter().for_each(|chunk| to.put(chunk));
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        if from.get::<u8>()? != VERSION {
            return Err(from.unsound("the ground is of another version"));
        }
        let key = from.get()?;
        let [used, voxels, closed, hanging] = from.get::<[u64; 4]>()?.map(|n| n as usize);
        let voxel: f64 = from.get()?;
        if !(voxel > 0.0 && voxel.is_finite()) {
            return Err(from.unsound("a voxel has no size"));
        }
        let report = GroundReport { used, voxel, voxels, closed, hanging, doubled: from.get()?, open: from.get()? };
        let chunks: Vec<GroundChunk> = from.get()?;
        let kind = |chunk: &GroundChunk| std::mem::discriminant(&chunk.surface);
        if chunks.windows(2).any(|pair| kind(&pair[0]) != kind(&pair[1])) {
            return Err(from.unsound("pieces of a ground are of several kinds"));
        }
        Ok(Self { chunks, report, key })
    }
}

impl Baked for GroundChunk {
    const LEAST: usize = 13;

    fn write(&self, to: &mut Sink) {
        to.put(&self.at.to_array());
        match &self.surface {
            GroundSurface::Plane { normal, offset } => {
                to.put(&0u8);
                to.put(normal);
                to.put(offset);
            }
            GroundSurface::Heights { origin, rotation, spacing, dims, heights } => {
                to.put(&1u8);
                to.put(origin);
                to.put(rotation);
                to.put(spacing);
                to.put(dims);
                to.put_all(heights);
            }
            GroundSurface::Mesh(mesh) => {
                to.put(&2u8);
                to.put_all(&mesh.vertices);
                to.put_all(&mesh.triangles);
            }
            GroundSurface::Voxels { origin, rotation, voxel, cells } => {
                to.put(&3u8);
                to.put(origin);
                to.put(rotation);
                to.put(voxel);
                to.put_all(cells);
            }
        }
    }

    fn read(from: &mut Source<'_>) -> Result<Self, BakeError> {
        let at = IVec3::from_array(from.get()?);
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let surface = match from.get::<u8>()? {
            0 => GroundSurface::Plane { normal: from.get()?, offset: from.get()? },
            1 => {
                let (origin, rotation, spacing) = (from.get()?, from.get()?, from.get()?);
                let dims: [u32; 2] = from.get()?;
                let heights: Vec<f32> = from.get()?;
                let fits = heights.len() as u64 == u64::from(dims[0]) * u64::from(dims[1]);
                if !fits || dims.iter().any(|&d| d < 2) || !positive(spacing) {
                    return Err(from.unsound("heights do not fill their grid"));
                }
                GroundSurface::Heights { origin, rotation, spacing, dims, heights }
            }
            2 => {
                let mesh = SurfaceMesh { vertices: from.get()?, triangles: from.get()? };
                if mesh.triangles.iter().flatten().any(|&v| v as usize >= mesh.vertices.len()) {
                    return Err(from.unsound("a triangle has a corner that is not there"));
                }
                GroundSurface::Mesh(mesh)
            }
            3 => {
                let (origin, rotation, voxel) = (from.get()?, from.get()?, from.get()?);
                if !positive(voxel) {
                    return Err(from.unsound("a voxel has no size"));
                }
                GroundSurface::Voxels { origin, rotation, voxel, cells: from.get()? }
            }
            _ => return Err(from.unsound("a piece of ground is of no kind that is known")),
        };
        Ok(Self { at, surface })
    }
}
