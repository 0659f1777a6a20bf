//! [`Cloud`]: the Gaussians of one capture.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{Mat3, Quat, Vec3};

use crate::sh;

mod assemble;

/// Position of a Gaussian in its input file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable)]
#[repr(transparent)]
pub struct GaussianId(pub u32);

impl GaussianId {
    /// The id as an index into the arrays of its [`Cloud`].
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Why arrays do not make a [`Cloud`].
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CloudError {
    /// One array is shorter or longer than the means demand.
    #[error("`{array}` has {found} values, {expected} were expected for {count} Gaussians")]
    Length {
        /// Which array.
        array: String,
        /// Values it has.
        found: usize,
        /// Values it should have.
        expected: usize,
        /// Gaussians of the cloud (length of the means).
        count: usize,
    },
    /// The SH degree is above [`sh::MAX_DEGREE`].
    #[error("SH degree {0} is not supported, 0 to 4 are")]
    Degree(u8),
    /// More Gaussians than 32-bit ids can name.
    #[error("{0} Gaussians are more than the 4294967295 that 32-bit ids can name")]
    TooMany(usize),
}

/// Values of one named property beyond the standard ones, as typed in the file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the variants are named after the type they hold")]
pub enum ExtraValues {
    I8(Vec<i8>),
    U8(Vec<u8>),
    I16(Vec<i16>),
    U16(Vec<u16>),
    I32(Vec<i32>),
    U32(Vec<u32>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

macro_rules! each_extra {
    ($values:expr, $v:ident => $body:expr) => {
        match $values {
            ExtraValues::I8($v) => $body,
            ExtraValues::U8($v) => $body,
            ExtraValues::I16($v) => $body,
            ExtraValues::U16($v) => $body,
            ExtraValues::I32($v) => $body,
            ExtraValues::U32($v) => $body,
            ExtraValues::F32($v) => $body,
            ExtraValues::F64($v) => $body,
        }
    };
}

macro_rules! map_extra {
    ($values:expr, $v:ident => $body:expr) => {
        match $values {
            ExtraValues::I8($v) => ExtraValues::I8($body),
            ExtraValues::U8($v) => ExtraValues::U8($body),
            ExtraValues::I16($v) => ExtraValues::I16($body),
            ExtraValues::U16($v) => ExtraValues::U16($body),
            ExtraValues::I32($v) => ExtraValues::I32($body),
            ExtraValues::U32($v) => ExtraValues::U32($body),
            ExtraValues::F32($v) => ExtraValues::F32($body),
            ExtraValues::F64($v) => ExtraValues::F64($body),
        }
    };
}

impl ExtraValues {
    /// Number of values, one per Gaussian.
    pub fn len(&self) -> usize {
        each_extra!(self, v => v.len())
    }

    /// Whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn pick(&self, ids: &[u32]) -> Self {
        map_extra!(self, v => ids.iter().map(|&i| v[i as usize]).collect())
    }
}

/// A property of the file that no renderer needs, kept so that writing loses nothing (`nx`, `filter_3D`, labels).
#[derive(Clone, Debug, PartialEq)]
pub struct ExtraProperty {
    /// Its name in the file.
    pub name: String,
    /// One value per Gaussian.
    pub values: ExtraValues,
}

/// Where a cloud came from and what its file said about it.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Source {
    /// Short name of the format (`ply`, `spz`), empty for a cloud made in code.
    pub format: String,
    /// Whether the file says that it was trained with the antialiased (mip) low-pass form.
    pub antialiased: bool,
    /// Directions of +X +Y +Z of the data as loaded where the file tells (`RDF`, `RUB`), else empty.
    pub axes: String,
    /// Comments of the file's header, in order.
    pub comments: Vec<String>,
    /// What the format's own writer needs to write an untouched cloud bit for bit; opaque to everybody else.
    pub layout: Option<Arc<[u8]>>,
}

/// The arrays of a [`Cloud`], open for building and editing. One entry per Gaussian unless said otherwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CloudArrays {
    /// Centres, in scene units.
    pub means: Vec<Vec3>,
    /// Natural logarithms of the standard deviations along the Gaussian's own axes.
    pub log_scales: Vec<Vec3>,
    /// Rotations (x, y, z, w) as stored in the file; not necessarily of unit length.
    pub rotations: Vec<Quat>,
    /// Opacities as logits; infinities are legal (alpha 0 and 1).
    pub opacity_logits: Vec<f32>,
    /// Degree of the spherical harmonics, 0 to 4.
    pub sh_degree: u8,
    /// SH coefficients: Gaussian-major, then coefficient, then red, green, blue: `sh[(i * coeffs + k) * 3 + channel]`
    /// with `coeffs = (degree + 1)^2`; coefficient 0 is the constant one (`f_dc`).
    pub sh: Vec<f32>,
    /// Properties beyond these.
    pub extras: Vec<ExtraProperty>,
    /// Where the cloud came from.
    pub source: Source,
}

/// A set of 3D Gaussians, immutable once built: share it as `Arc<Cloud>`.
///
/// Values are kept as stored (log scales, opacity logits, raw quaternions), so that an untouched cloud can be written
/// back bit for bit; accessors such as [`Cloud::opacity`] and [`Cloud::covariance`] give the activated ones.
/// Values may be NaN or infinite where the file has them: whoever draws skips such Gaussians, ids never shift.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    arrays: CloudArrays,
}

impl Cloud {
    /// Checks that all arrays fit together.
    ///
    /// # Errors
    /// [`CloudError`] when a length does not fit, the degree is above 4 or ids would not fit 32 bits.
    pub fn new(arrays: CloudArrays) -> Result<Self, CloudError> {
        let count = arrays.means.len();
        if u32::try_from(count).is_err() {
            return Err(CloudError::TooMany(count));
        }
        if arrays.sh_degree > sh::MAX_DEGREE {
            return Err(CloudError::Degree(arrays.sh_degree));
        }
        let check = |array: &str, found: usize, expected: usize| {
            if found == expected {
                Ok(())
            } else {
                Err(CloudError::Length { array: array.to_owned(), found, expected, count })
            }
        };
        check("log_scales", arrays.log_scales.len(), count)?;
        check("rotations", arrays.rotations.len(), count)?;
        check("opacity_logits", arrays.opacity_logits.len(), count)?;
        check("sh", arrays.sh.len(), count * 3 * sh::coefficient_count(arrays.sh_degree))?;
        for extra in &arrays.extras {
            check(&extra.name, extra.values.len(), count)?;
        }
        Ok(Self { arrays })
    }

    /// Gives the arrays back for editing.
    pub fn into_arrays(self) -> CloudArrays {
        self.arrays
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.arrays.means.len()
    }

    /// Whether there are no Gaussians.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Centres, in scene units.
    pub fn means(&self) -> &[Vec3] {
        &self.arrays.means
    }

    /// Natural logarithms of the standard deviations.
    pub fn log_scales(&self) -> &[Vec3] {
        &self.arrays.log_scales
    }

    /// Rotations as stored; see [`Cloud::rotation`] for unit ones.
    pub fn rotations(&self) -> &[Quat] {
        &self.arrays.rotations
    }

    /// Opacity logits as stored.
    pub fn opacity_logits(&self) -> &[f32] {
        &self.arrays.opacity_logits
    }

    /// Degree of the spherical harmonics, 0 to 4.
    pub fn sh_degree(&self) -> u8 {
        self.arrays.sh_degree
    }

    /// All SH coefficients; layout as in [`CloudArrays::sh`].
    pub fn sh(&self) -> &[f32] {
        &self.arrays.sh
    }

    /// Floats per Gaussian in [`Cloud::sh`]: 3, 12, 27, 48 or 75.
    pub fn sh_stride(&self) -> usize {
        3 * sh::coefficient_count(self.arrays.sh_degree)
    }

    /// SH coefficients of Gaussian `i`: coefficient-major, red green blue inner.
    pub fn sh_of(&self, i: usize) -> &[f32] {
        let stride = self.sh_stride();
        &self.arrays.sh[i * stride..(i + 1) * stride]
    }

    /// Properties beyond the standard ones.
    pub fn extras(&self) -> &[ExtraProperty] {
        &self.arrays.extras
    }

    /// Where the cloud came from.
    pub fn source(&self) -> &Source {
        &self.arrays.source
    }

    /// Standard deviations of Gaussian `i` along its own axes, in scene units.
    pub fn scale(&self, i: usize) -> Vec3 {
        let s = self.arrays.log_scales[i];
        Vec3::new(s.x.exp(), s.y.exp(), s.z.exp())
    }

    /// Unit rotation of Gaussian `i`; the identity where the stored one has no direction (zero or not finite).
    pub fn rotation(&self, i: usize) -> Quat {
        let q = self.arrays.rotations[i];
        let length = q.length();
        if length > 1e-12 && length.is_finite() { q / length } else { Quat::IDENTITY }
    }

    /// Opacity of Gaussian `i`, 0..=1: the logistic function of its logit.
    pub fn opacity(&self, i: usize) -> f32 {
        1.0 / (1.0 + (-self.arrays.opacity_logits[i]).exp())
    }

    /// 3D covariance of Gaussian `i`, in scene units squared: `R diag(s^2) R^T`.
    pub fn covariance(&self, i: usize) -> Mat3 {
        let m = Mat3::from_quat(self.rotation(i)) * Mat3::from_diagonal(self.scale(i));
        m * m.transpose()
    }

    /// Colour of Gaussian `i` without its view-dependent part: `0.5 + C0 * dc`, sRGB-encoded, not clamped.
    pub fn base_color(&self, i: usize) -> Vec3 {
        let dc = &self.sh_of(i)[..3];
        Vec3::new(dc[0], dc[1], dc[2]) * sh::C0 + 0.5
    }

    /// Whether every standard value of Gaussian `i` can be drawn: mean, scales and rotation finite, opacity not NaN.
    pub fn drawable(&self, i: usize) -> bool {
        let a = &self.arrays;
        a.means[i].is_finite()
            && a.log_scales[i].is_finite()
            && a.rotations[i].is_finite()
            && !a.opacity_logits[i].is_nan()
    }

    /// A cloud of the Gaussians `ids`, in that order, extras included.
    ///
    /// # Panics
    /// If an id is not below [`Cloud::len`].
    pub fn pick(&self, ids: &[u32]) -> Cloud {
        let a = &self.arrays;
        let stride = self.sh_stride();
        let mut sh = Vec::with_capacity(ids.len() * stride);
        for &i in ids {
            sh.extend_from_slice(self.sh_of(i as usize));
        }
        let arrays = CloudArrays {
            means: ids.iter().map(|&i| a.means[i as usize]).collect(),
            log_scales: ids.iter().map(|&i| a.log_scales[i as usize]).collect(),
            rotations: ids.iter().map(|&i| a.rotations[i as usize]).collect(),
            opacity_logits: ids.iter().map(|&i| a.opacity_logits[i as usize]).collect(),
            sh_degree: a.sh_degree,
            sh,
            extras: a
                .extras
                .iter()
                .map(|e| ExtraProperty { name: e.name.clone(), values: e.values.pick(ids) })
                .collect(),
            source: a.source.clone(),
        };
        Cloud { arrays }
    }

    /// Hash of all standard values, for caches and saved selections: equal clouds have equal hashes on every machine.
    pub fn content_hash(&self) -> u128 {
        use rayon::prelude::*;
        use xxhash_rust::xxh3::Xxh3;
        const BLOCK: usize = 1 << 22;
        let a = &self.arrays;
        let columns: [&[u8]; 5] = [
            bytemuck::cast_slice(&a.means),
            bytemuck::cast_slice(&a.log_scales),
            bytemuck::cast_slice(&a.rotations),
            bytemuck::cast_slice(&a.opacity_logits),
            bytemuck::cast_slice(&a.sh),
        ];
        let mut whole = Xxh3::new();
        whole.update(&[a.sh_degree, u8::from(a.source.antialiased)]);
        for column in columns {
            whole.update(&(column.len() as u64).to_le_bytes());
            let blocks: Vec<u128> = column.par_chunks(BLOCK).map(xxhash_rust::xxh3::xxh3_128).collect();
            for block in blocks {
                whole.update(&block.to_le_bytes());
            }
        }
        whole.digest128()
    }
}
