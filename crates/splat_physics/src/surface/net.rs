//! Naive surface nets over any lattice: one vertex in each cell that the surface runs through.

use std::collections::HashMap;

use glam::{DVec3, IVec3};

/// Crossings stay this far from the ends of an edge, in parts of it: so no two vertices are at one place.
const MARGIN: f64 = 0.02;
/// Steps from a cell's least corner to its corners.
const CORNERS: [IVec3; 8] = [
    IVec3::new(0, 0, 0),
    IVec3::new(1, 0, 0),
    IVec3::new(0, 1, 0),
    IVec3::new(1, 1, 0),
    IVec3::new(0, 0, 1),
    IVec3::new(1, 0, 1),
    IVec3::new(0, 1, 1),
    IVec3::new(1, 1, 1),
];

/// A surface of quads; a lattice point `p` (the middle of a voxel) is at `p` itself.
#[derive(Debug, Default)]
pub(crate) struct Net {
    /// Places of the vertices, in lattice units.
    pub(crate) places: Vec<DVec3>,
    /// The cell that each vertex is in, by its least corner.
    pub(crate) cells: Vec<IVec3>,
    /// Corners counter-clockwise seen from outside.
    pub(crate) quads: Vec<[u32; 4]>,
}

impl Net {
    /// The surface between the lattice points `inside`, where `value` is 0.5 or more, and those around them where it is less.
    ///
    /// Vertices depend on the values around them alone: the surfaces of two parts of a lattice meet without a crack.
    pub(crate) fn new(inside: impl Iterator<Item = IVec3>, value: impl Fn(IVec3) -> f32) -> Self {
        let mut net = Self::default();
        let mut known: HashMap<IVec3, u32> = HashMap::new();
        for p in inside {
            for axis in 0..3 {
                let step = IVec3::AXES[axis];
                let (b, c) = (IVec3::AXES[(axis + 1) % 3], IVec3::AXES[(axis + 2) % 3]);
                for ahead in [true, false] {
                    let beyond = if ahead { p + step } else { p - step };
                    if value(beyond) >= 0.5 {
                        continue;
                    }
                    let base = if ahead { p } else { beyond };
                    let around = [base - b - c, base - c, base, base - b];
                    let quad = around.map(|cell| {
                        *known.entry(cell).or_insert_with(|| {
                            net.places.push(vertex(cell, &value));
                            net.cells.push(cell);
                            net.places.len() as u32 - 1
                        })
                    });
                    net.quads.push(if ahead { quad } else { [quad[3], quad[2], quad[1], quad[0]] });
                }
            }
        }
        net
    }

    /// Two triangles for each quad, cut along its shorter diagonal.
    pub(crate) fn triangles(&self) -> Vec<[u32; 3]> {
        let far = |a: u32, b: u32| self.places[a as usize].distance_squared(self.places[b as usize]);
        let cut = |&[a, b, c, d]: &[u32; 4]| {
            if far(a, c) <= far(b, d) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
        };
        self.quads.iter().flat_map(cut).collect()
    }
}

/// The mean of where the surface crosses the edges of a cell.
fn vertex(cell: IVec3, value: &impl Fn(IVec3) -> f32) -> DVec3 {
    let values = CORNERS.map(|corner| f64::from(value(cell + corner)));
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    for (from, start) in values.iter().enumerate() {
        for axis in 0..3 {
            let to = from | 1 << axis;
            let end = values[to];
            if to == from || (*start >= 0.5) == (end >= 0.5) {
                continue;
            }
            let along = ((0.5 - start) / (end - start)).clamp(MARGIN, 1.0 - MARGIN);
            sum += CORNERS[from].as_dvec3() + along * DVec3::AXES[axis];
            count += 1.0;
        }
    }
    cell.as_dvec3() + sum / f64::max(count, 1.0)
}
