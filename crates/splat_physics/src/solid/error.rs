//! [`SolidError`].

/// Why a part's Gaussians make no solid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SolidError {
    /// The part has too few Gaussians that can be used.
    #[error("{have} of the part's {of} Gaussians can be used, but a solid needs {need}; select more")]
    TooFewSplats {
        /// How many are solid enough, small enough and not alone.
        have: usize,
        /// How many were given.
        of: usize,
        /// How many there must be.
        need: usize,
    },
    /// Nothing is dense enough.
    #[error("nothing in the part is {:.0} % opaque, so there is no surface; lower the cut", 100.0 * cut)]
    EmptyOccupancy {
        /// [`SolidSettings::cut`](super::SolidSettings::cut).
        cut: f32,
    },
    /// The shell does not close.
    #[error(
        "the part's surface has holes wider than {} voxels ({hole:.3} m), so it holds {filled:.3e} m^3 where its shell alone has \
         {shell:.3e}; close its bottom, raise max_closing, or take its hull", 2 * closing_tried
    )]
    ShellLeaks {
        /// The largest closing tried, in voxels.
        closing_tried: u32,
        /// The widest hole that one closes, in metres.
        hole: f64,
        /// Volume of what was filled, in m^3.
        filled: f64,
        /// Volume of the shell, in m^3.
        shell: f64,
    },
    /// The part falls into pieces.
    #[error("the part is in {pieces} pieces and the largest has {:.0} % of it; remove specks or split it", 100.0 * largest)]
    Disconnected {
        /// How many hold at least 1 % of its volume.
        pieces: usize,
        /// Share of the largest, 0..=1.
        largest: f64,
    },
    /// The part is flat: its sides cannot be told apart.
    #[error("the part is flat, about {voxels} voxels ({thickness:.2e} m) thick: use a box, or more voxels")]
    TooThin {
        /// About how many voxels it is thick.
        voxels: u32,
        /// What that is in metres.
        thickness: f64,
    },
    /// None of the Gaussians has finite values.
    #[error("all {count} Gaussians of the part have values that are NaN or infinite")]
    NotFinite {
        /// How many there are.
        count: usize,
    },
    /// The part cannot be measured in metres.
    #[error("at {metres_per_unit} metres per unit the part has a size of {size:.3e} m; bodies are 1e-5 m to 1e6 m")]
    ScaleOutOfRange {
        /// As given.
        metres_per_unit: f64,
        /// Diagonal of the part, in metres; NaN if the scale is no positive number.
        size: f64,
    },
    /// A region has no density.
    #[error("region {region} has a density of {density} kg/m^3; a body that moves needs one above 0")]
    ZeroDensity {
        /// Which.
        region: u8,
        /// As given.
        density: f32,
    },
    /// A region has no material.
    #[error("region {region} has no material, there are only {materials}")]
    MaterialMissing {
        /// Which.
        region: u8,
        /// How many materials were given.
        materials: usize,
    },
    /// A Gaussian that is not in the cloud.
    #[error("the part names Gaussian {id}, but the cloud has only {len}")]
    UnknownGaussian {
        /// The first such.
        id: u32,
        /// Gaussians of the cloud.
        len: usize,
    },
    /// Regions and Gaussians do not go together.
    #[error("there are {regions} regions for {ids} Gaussians; each needs one")]
    RegionsMismatch {
        /// How many were given.
        regions: usize,
        /// How many Gaussians were given.
        ids: usize,
    },
    /// A setting has no meaning.
    #[error("{setting} cannot be {value}; it is {range}")]
    Setting {
        /// Its name.
        setting: &'static str,
        /// What it is.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
}
