//! Structures that Rust writes and shaders read: declared once in Rust, held against the WGSL by a test.

use bytemuck::{Pod, Zeroable};

/// Where the fields of a structure are, in bytes.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// Its name, in WGSL as in Rust.
    pub name: &'static str,
    /// The stage that declares it.
    pub stage: &'static str,
    /// Bytes of the whole.
    pub size: usize,
    /// Name and place of each field.
    pub fields: &'static [(&'static str, usize)],
}

macro_rules! layouts {
    ($(
        $(#[$doc:meta])*
        $name:ident of $stage:literal { $($(#[$field_doc:meta])* $field:ident: $kind:ty,)* }
    )*) => {
        $(
            $(#[$doc])*
            #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
            #[repr(C)]
            pub struct $name {
                $($(#[$field_doc])* pub $field: $kind,)*
            }
        )*

        /// All structures.
        pub const LAYOUTS: &[Layout] = &[$(Layout {
            name: stringify!($name),
            stage: $stage,
            size: size_of::<$name>(),
            fields: &[$((stringify!($field), std::mem::offset_of!($name, $field))),*],
        }),*];
    };
}

layouts! {
    /// What is projected: some Gaussians of a page of a cloud, and from where.
    Job of "project" {
        /// First row of the map from the cloud's space to camera space, then camera x of the cloud's origin.
        row_x: [f32; 4],
        /// As `row_x`, for y.
        row_y: [f32; 4],
        /// As `row_x`, for z.
        row_z: [f32; 4],
        /// In the cloud's space: the camera's centre, or the viewing direction where there is no perspective.
        camera: [f32; 3],
        /// Nothing nearer is drawn.
        near: f32,
        /// In pixels.
        focal: [f32; 2],
        /// Principal point, in pixels.
        center: [f32; 2],
        /// Least and largest x / z, then y / z, for which the projection is linearised.
        limits: [f32; 4],
        /// Of the picture, in pixels.
        size: [f32; 2],
        /// `FLAG_*`.
        flags: u32,
        /// 0 to 4.
        sh_degree: u32,
        /// Slot of the first thread.
        first_slot: u32,
        /// Threads with a Gaussian.
        count: u32,
        /// Position of the first thread's Gaussian in the subset, or where there is none in the cloud.
        first: u32,
        /// Id of the page's first Gaussian.
        page_first: u32,
    }

    /// What a dispatch blends.
    BlendParams of "blend" {
        /// Of the picture, in pixels.
        size: [u32; 2],
        /// Tiles across the picture.
        tiles_across: u32,
        /// Tiles of the picture.
        tiles: u32,
        /// T at or below which a pixel is hit.
        hit: f32,
        /// Largest weight that does not count as visible.
        unseen: f32,
        /// First channel of this dispatch.
        channel: u32,
        /// Channels altogether.
        channels: u32,
        /// First mask of this dispatch.
        mask: u32,
        /// Masks of this dispatch.
        masks: u32,
        /// Gaussians of the scene.
        slots: u32,
        /// Bits of infinity: no depth.
        none: u32,
    }
}
