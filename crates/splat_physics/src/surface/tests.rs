use std::collections::HashMap;
use std::f64::consts::PI;

use glam::{DVec3, UVec3};

use super::*;
use crate::{Solid, VoxelGrid};

/// The voxels of a cube of `size` metres about the origin, weighted by how deep in a thing they are: half where the surface is.
pub(crate) fn carved(size: f64, voxels: u32, distance: impl Fn(DVec3) -> f64, shell: bool) -> Solid {
    let voxel = size / f64::from(voxels);
    let grid = VoxelGrid { origin: DVec3::splat(-0.5 * size), voxel, dims: UVec3::splat(voxels) };
    let mut solid = Solid::cuboid(grid.origin, -grid.origin, voxel);
    for v in 0..grid.len() {
        let d = distance(grid.center(v));
        let half = if shell { 0.87 * voxel } else { 0.0 };
        solid.weights[v] = match d {
            d if d < -half => 1.0,
            d if d <= half => 0.5,
            _ => 0.0,
        };
    }
    solid
}

fn each_edge_twice(mesh: &SurfaceMesh) -> bool {
    let mut edges: HashMap<(u32, u32), usize> = HashMap::new();
    for t in &mesh.triangles {
        (0..3).for_each(|k| *edges.entry((t[k], t[(k + 1) % 3])).or_default() += 1);
    }
    edges.iter().all(|(&(a, b), &n)| n == 1 && edges.get(&(b, a)) == Some(&1))
}

#[test]
fn the_surface_of_a_ball_is_closed_outward_and_holds_what_the_ball_does() {
    let exact = 4.0 / 3.0 * PI * 0.125;
    for shell in [false, true] {
        let solid = carved(1.2, 48, |p| p.length() - 0.5, shell);
        let full = SurfaceMesh::full(&solid);
        let mesh = SurfaceMesh::of(&solid);
        for mesh in [&full, &mesh] {
            assert!(mesh.closed() && each_edge_twice(mesh));
            assert!((mesh.volume() / exact - 1.0).abs() < 0.03, "{shell}: {}", mesh.volume() / exact);
            let outward = |t: &[u32; 3]| mesh.cross(t).dot(mesh.corners(t)[0]) > 0.0;
            assert!(mesh.triangles.iter().all(outward));
            let off = mesh.vertices.iter().map(|p| (p.length() - 0.5).abs()).fold(0.0, f64::max);
            assert!(off < 0.6 * solid.grid.voxel, "{}", off / solid.grid.voxel);
        }
        assert!(mesh.triangles.len() < full.triangles.len());
    }
}

#[test]
fn flat_faces_become_few_triangles_where_they_were() {
    let solid = Solid::cuboid(DVec3::ZERO, DVec3::new(2.0, 1.0, 0.5), 0.05);
    let mesh = SurfaceMesh::of(&solid);
    assert!(mesh.closed() && each_edge_twice(&mesh));
    assert!((mesh.volume() - 1.0).abs() < 0.02, "{}", mesh.volume());
    assert!(mesh.triangles.len() * 5 < SurfaceMesh::full(&solid).triangles.len(), "{}", mesh.triangles.len());
    let (low, high) = mesh.vertices.iter().fold((DVec3::MAX, DVec3::MIN), |(l, h), p| (l.min(*p), h.max(*p)));
    assert!(low.abs_diff_eq(DVec3::ZERO, 0.01) && high.abs_diff_eq(DVec3::new(2.0, 1.0, 0.5), 0.01), "{low} {high}");
    assert!(mesh.triangles.iter().all(|t| mesh.cross(t).length() > 0.0));
}

#[test]
fn sheets_one_voxel_thick_and_shells_without_an_inside_keep_their_surface() {
    let sheet = Solid::cuboid(DVec3::ZERO, DVec3::new(1.0, 1.0, 0.05), 0.05);
    let mesh = SurfaceMesh::of(&sheet);
    assert!(mesh.closed() && (mesh.volume() / 0.05 - 1.0).abs() < 0.2, "{}", mesh.volume());
    let mut shell = sheet.clone();
    shell.weights.fill(0.5);
    let mesh = SurfaceMesh::of(&shell);
    assert!(mesh.closed() && mesh.volume() > 0.0);
}

#[test]
fn a_solid_without_voxels_has_no_surface() {
    let mut solid = Solid::cuboid(DVec3::ZERO, DVec3::ONE, 0.5);
    solid.weights.fill(0.0);
    assert_eq!(SurfaceMesh::of(&solid), SurfaceMesh::default());
    assert!(surface_points(&solid, 10, 0).is_empty());
    assert_eq!(SurfaceMesh::default().volume(), 0.0);
}

#[test]
fn points_on_a_surface_are_on_it_and_apart() {
    let solid = carved(1.2, 40, |p| p.length() - 0.5, true);
    let points = surface_points(&solid, 100, 0);
    assert_eq!(points.len(), 100);
    assert_eq!(points, surface_points(&solid, 100, 0));
    let voxel = solid.grid.voxel;
    assert!(points.iter().all(|p| (p.length() - 0.5).abs() < 1.5 * voxel));
    // Of 100 discs that cover a sphere evenly none is nearer to the next than this.
    let apart = |k: usize| (0..k).map(|j| points[j].distance(points[k])).fold(f64::INFINITY, f64::min);
    assert!((1..100).map(apart).fold(f64::INFINITY, f64::min) > 0.1);
    assert_eq!(surface_points(&solid, 0, 0), Vec::new());
}
