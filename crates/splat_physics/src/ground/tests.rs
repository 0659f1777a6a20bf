use glam::{DQuat, DVec3, Quat, Vec3};
use splat_core::{Cloud, CloudArrays};

use super::field::closest;
use super::*;
use crate::world::ContactWorld;

/// Flat, opaque Gaussians: places and normals.
#[derive(Default)]
struct Sheets(Vec<(DVec3, DVec3)>);

impl Sheets {
    /// A sheet of Gaussians 4 cm apart, about a middle, along two half sides.
    fn sheet(mut self, middle: DVec3, u: DVec3, v: DVec3, keep: impl Fn(DVec3) -> bool) -> Self {
        let normal = v.cross(u).normalize();
        let count = |side: DVec3| (side.length() / 0.04) as i32;
        for i in -count(u)..=count(u) {
            for j in -count(v)..=count(v) {
                let p = middle + u * (f64::from(i) / f64::from(count(u))) + v * (f64::from(j) / f64::from(count(v)));
                if keep(p) {
                    self.0.push((p, normal));
                }
            }
        }
        self
    }

    fn cuboid(self, middle: DVec3, half: DVec3) -> Self {
        let [x, y, z] = [DVec3::X * half.x, DVec3::Y * half.y, DVec3::Z * half.z];
        let all = |_| true;
        [(x, y, z), (y, z, x), (z, x, y)]
            .into_iter()
            .fold(self, |sheets, (out, u, v)| sheets.sheet(middle + out, u, v, all).sheet(middle - out, u, v, all))
    }

    fn cloud(&self) -> Cloud {
        let mut arrays = CloudArrays::default();
        for (p, normal) in &self.0 {
            arrays.means.push(p.as_vec3());
            arrays.log_scales.push(Vec3::new(0.025f32.ln(), 0.025f32.ln(), 0.003f32.ln()));
            arrays.rotations.push(Quat::from_rotation_arc(Vec3::Z, normal.as_vec3()));
            arrays.opacity_logits.push(3.0);
            arrays.sh.extend([0.0; 3]);
        }
        Cloud::new(arrays).unwrap()
    }
}

/// A floor of 4 m by 4 m at height 0.013 with a wall at its end, and a box of half a metre on it, below which nothing was seen.
fn room() -> (Cloud, Vec<u32>, Vec<u32>) {
    let uncovered = |p: DVec3| p.x.abs().max(p.z.abs()) > 0.25;
    let seen = Sheets::default().sheet(DVec3::Y * HEIGHT, DVec3::X * 2.0, DVec3::Z * 2.0, uncovered).sheet(
        DVec3::new(-2.0, 0.75, 0.0),
        DVec3::Y * 0.75,
        DVec3::Z * 2.0,
        |_| true,
    );
    let rest = seen.0.len() as u32;
    let all = seen.cuboid(DVec3::new(0.0, 0.28, 0.0), DVec3::splat(0.25));
    let count = all.0.len() as u32;
    (all.cloud(), (0..rest).collect(), (rest..count).collect())
}

const HEIGHT: f64 = 0.013;

fn settings(source: GroundSource) -> GroundSettings {
    GroundSettings { source, ..GroundSettings::default() }
}

fn triangles(ground: &Ground) -> Vec<[DVec3; 3]> {
    let mut out = Vec::new();
    for chunk in ground.chunks() {
        let GroundSurface::Mesh(mesh) = &chunk.surface else { panic!("{}", ground.name()) };
        out.extend(mesh.triangles.iter().map(|t| mesh.corners(t)));
    }
    out
}

#[test]
fn the_floor_goes_on_below_a_part_that_was_taken_out() {
    let (cloud, rest, part) = room();
    for source in [GroundSource::Mesh, GroundSource::Voxels, GroundSource::Heightfield] {
        let open = Ground::build(&cloud, &rest, &[], 1.0, &settings(source)).unwrap();
        let ground = Ground::build(&cloud, &rest, &[&part], 1.0, &settings(source)).unwrap();
        assert!(ground.report().closed > 40 && ground.report().hanging == 0, "{:?}", ground.report());
        let field = ground.field();
        // Voxels end at their faces; the others run through the middle of what was seen.
        let most = if source == GroundSource::Voxels { 0.05 } else { 0.025 };
        for k in 0..400 {
            let at = DVec3::new(f64::from(k % 20) * 0.1 - 0.95, 0.05, f64::from(k / 20) * 0.1 - 0.95);
            let (gap, normal) = field.nearest(at).unwrap();
            assert!((gap - (0.05 - HEIGHT)).abs() < most, "{source:?} {at}: {gap}");
            assert!(normal.y > 0.7, "{source:?} {at}: {normal}");
        }
        if source == GroundSource::Mesh {
            let above = open.field().nearest(DVec3::new(0.0, 0.05, 0.0));
            assert!(above.is_none_or(|(gap, _)| gap > 0.1), "without the part the hole is open: {above:?}");
        }
    }
}

#[test]
fn a_hole_is_closed_whichever_way_is_up_and_whatever_the_unit() {
    let (cloud, rest, part) = room();
    let turn = DQuat::from_rotation_z(0.7) * DQuat::from_rotation_x(-0.4);
    let mut arrays = cloud.into_arrays();
    let unit = 3.0;
    for (mean, rotation) in arrays.means.iter_mut().zip(&mut arrays.rotations) {
        *mean = (turn * mean.as_dvec3() / unit).as_vec3();
        *rotation = (turn * rotation.as_dquat()).as_quat();
    }
    arrays.log_scales.iter_mut().for_each(|s| *s -= unit.ln() as f32);
    let cloud = Cloud::new(arrays).unwrap();
    let settings = GroundSettings { up: turn * DVec3::Y, ..settings(GroundSource::Mesh) };
    let field = Ground::build(&cloud, &rest, &[&part], unit, &settings).unwrap().field();
    for k in 0..100 {
        let at = DVec3::new(f64::from(k % 10) * 0.2 - 0.9, 0.05, f64::from(k / 10) * 0.2 - 0.9);
        let (gap, normal) = field.nearest(turn * at).unwrap();
        assert!((gap - (0.05 - HEIGHT)).abs() < 0.025 && normal.dot(turn * DVec3::Y) > 0.7, "{at}: {gap} {normal}");
    }
}

#[test]
fn heights_follow_a_slope_and_gaps_are_filled_from_beside() {
    let u = DVec3::new(2.0, 0.6, 0.0);
    let gap = |p: DVec3| (p - DVec3::new(0.5, 0.15, 0.3)).length() > 0.15;
    let cloud = Sheets::default().sheet(DVec3::ZERO, u, DVec3::Z * 2.0, gap).cloud();
    let ids: Vec<u32> = (0..cloud.len() as u32).collect();
    let settings = GroundSettings { chunk: 1.0, ..settings(GroundSource::Heightfield) };
    let ground = Ground::build(&cloud, &ids, &[], 1.0, &settings).unwrap();
    assert!(ground.chunks().len() >= 16 && ground.name() == "heightfield");
    let mut field = ground.field();
    let exact = u.cross(DVec3::Z).normalize() * -1.0;
    for k in 0..400 {
        let (x, z) = (f64::from(k % 20) * 0.18 - 1.7, f64::from(k / 20) * 0.18 - 1.7);
        let at = DVec3::new(x, 0.3 * x + 0.1, z);
        let (gap, _) = field.nearest(at).unwrap();
        let wide = (at - DVec3::new(0.5, 0.25, 0.3)).length() < 0.4;
        assert!((gap - exact.dot(at).abs()).abs() < if wide { 0.1 } else { 0.03 }, "{at}: {gap}");
    }
    let mut out = Vec::new();
    field.contacts(&[DVec3::Y, DVec3::new(0.0, -0.1, 0.0), DVec3::NAN, DVec3::X * 90.0], 0.0, &mut out);
    assert!(out.len() == 1 && out[0].point == 1 && out[0].friction == field.friction, "{out:?}");
}

#[test]
fn distances_are_those_to_the_nearest_triangle() {
    let (cloud, rest, part) = room();
    let ground = Ground::build(&cloud, &rest, &[&part], 1.0, &settings(GroundSource::Mesh)).unwrap();
    let (field, triangles) = (ground.field(), triangles(&ground));
    let mut seed = 1u64;
    let mut next = || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 11) as f64 / (1u64 << 53) as f64
    };
    let (mut off, mut unknown) = (Vec::new(), 0);
    for _ in 0..2000 {
        let p = DVec3::new(4.4 * next() - 2.2, 1.8 * next() - 0.3, 4.4 * next() - 2.2);
        let slow = triangles.iter().map(|t| closest(p, t).distance(p)).fold(f64::INFINITY, f64::min);
        match field.nearest(p) {
            Some((gap, normal)) => {
                off.push((gap.abs() - slow).abs());
                assert!((normal.length() - 1.0).abs() < 1e-9);
            }
            None => unknown += usize::from(slow < 0.1),
        }
    }
    off.sort_by(f64::total_cmp);
    // Trilinear interpolation cuts edges off, and knows no way out midway between the sides of a wall.
    let (usual, worst) = (off[off.len() * 9 / 10], off[off.len() - 1]);
    assert!(off.len() > 300 && unknown * 50 < off.len(), "{unknown} of {}", off.len());
    assert!(usual < 0.0125 && worst < 0.05, "{usual} {worst}");
}

#[test]
fn nothing_but_a_floor_is_a_plane() {
    let cloud = Sheets::default().sheet(DVec3::Y * 0.2, DVec3::X * 2.0, DVec3::Z * 2.0, |_| true).cloud();
    let ids: Vec<u32> = (0..cloud.len() as u32).collect();
    for source in [GroundSource::Auto, GroundSource::Plane] {
        let ground = Ground::build(&cloud, &ids, &[], 2.0, &settings(source)).unwrap();
        assert_eq!((ground.name(), ground.chunks().len()), ("plane", 1));
        let (gap, normal) = ground.field().nearest(DVec3::new(50.0, 1.0, 3.0)).unwrap();
        assert!((gap - 0.6).abs() < 0.02 && normal.y > 0.999, "{gap} {normal}");
    }
    let (cloud, rest, _) = room();
    assert_eq!(Ground::build(&cloud, &rest, &[], 1.0, &settings(GroundSource::Auto)).unwrap().name(), "mesh");
}

#[test]
fn a_floor_is_filled_a_metre_deep_and_a_room_around() {
    let (cloud, rest, part) = room();
    let fill = |fill, source| GroundSettings { fill, ..settings(source) };
    let floor = Ground::build(&cloud, &rest, &[&part], 1.0, &fill(Fill::Floor, GroundSource::Voxels)).unwrap();
    let low = |ground: &Ground| {
        let lowest = |chunk: &GroundChunk| match &chunk.surface {
            GroundSurface::Voxels { origin, voxel, cells, .. } => {
                cells.iter().map(|c| origin.y + f64::from(c.y) * voxel).fold(f64::INFINITY, f64::min)
            }
            _ => f64::NAN,
        };
        ground.chunks().iter().map(lowest).fold(f64::INFINITY, f64::min)
    };
    assert!((low(&floor) + 1.0).abs() < 0.11, "{}", low(&floor));
    let open = Ground::build(&cloud, &rest, &[&part], 1.0, &fill(Fill::Exterior, GroundSource::Voxels)).unwrap();
    assert!(open.report().open && open.notes().count() == 1);
    // A closed room of 2 m.
    let cloud = Sheets::default().cuboid(DVec3::ZERO, DVec3::ONE).cloud();
    let ids: Vec<u32> = (0..cloud.len() as u32).collect();
    let room = Ground::build(&cloud, &ids, &[], 1.0, &fill(Fill::Exterior, GroundSource::Mesh)).unwrap();
    assert!(!room.report().open);
    let field = room.field();
    for axis in DVec3::AXES {
        for side in [-1.0, 1.0] {
            let gap = |d: f64| field.nearest(side * d * axis).map(|(gap, _)| gap);
            assert!((gap(0.9).unwrap() - 0.1).abs() < 0.025, "{axis} {side}: {:?}", gap(0.9));
            assert!(gap(1.1).unwrap() < -0.05, "{axis} {side}: {:?}", gap(1.1));
        }
    }
}

#[test]
fn bytes_give_the_same_ground_and_anything_else_an_error() {
    let (cloud, rest, part) = room();
    for source in [GroundSource::Plane, GroundSource::Heightfield, GroundSource::Mesh, GroundSource::Voxels] {
        let settings = GroundSettings { chunk: 2.0, voxel: 0.1, ..settings(source) };
        let ground = Ground::build(&cloud, &rest, &[&part], 1.0, &settings).unwrap();
        let bytes = ground.to_bytes();
        let back = Ground::from_bytes(&bytes).unwrap();
        assert!(back == ground && back.field() == ground.field());
        let mut seed = 7u64;
        for k in 0..300usize {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let mut bad = bytes.clone();
            let at = (seed >> 20) as usize % bad.len();
            if k % 2 == 0 {
                bad.truncate(at);
            } else {
                bad[at] ^= (seed >> 8) as u8 | 1;
            }
            // Nothing is said by the bytes that fill up between sections.
            assert!(Ground::from_bytes(&bad).is_err() || Ground::from_bytes(&bad).unwrap() == ground);
            // Behind the checksums, too: whatever is read can be asked.
            let mut file = crate::bake::BakeWriter::new();
            let mut payload = bytes[56..].to_vec();
            let at = (seed >> 24) as usize % payload.len().min(200);
            payload[at] ^= (seed >> 12) as u8;
            file.section(crate::bake::Tag(*b"GRND"), |sink| sink.bytes(&payload));
            let _ = Ground::from_bytes(&file.finish());
        }
    }
    assert!(Ground::from_bytes(&[]).is_err());
}

#[test]
fn keys_change_with_what_a_ground_is_made_from() {
    let (cloud, rest, part) = room();
    let standard = GroundSettings::default();
    let key = Ground::key(&cloud, &rest, &[&part], 1.0, &standard);
    assert_eq!(key, Ground::key(&cloud, &rest, &[&part], 1.0, &standard));
    let finer = GroundSettings { voxel: 0.04, ..standard.clone() };
    let others = [
        Ground::key(&cloud, &rest[1..], &[&part], 1.0, &standard),
        Ground::key(&cloud, &rest, &[], 1.0, &standard),
        Ground::key(&cloud, &rest, &[&part], 1.1, &standard),
        Ground::key(&cloud, &rest, &[&part], 1.0, &finer),
    ];
    assert!(others.iter().all(|other| *other != key));
}

#[test]
fn what_gives_no_ground_is_told() {
    let (cloud, rest, _) = room();
    let build = |cloud: &Cloud, ids: &[u32], scale, settings: &GroundSettings| {
        Ground::build(cloud, ids, &[], scale, settings).map(|ground| ground.name())
    };
    let standard = settings(GroundSource::Mesh);
    assert_eq!(build(&cloud, &[], 1.0, &standard), Err(GroundError::TooFewSplats { have: 0, of: 0, need: 50 }));
    for scale in [0.0, -1.0, f64::NAN, 1e12] {
        assert!(matches!(build(&cloud, &rest, scale, &standard), Err(GroundError::Scale { .. })));
    }
    let count = cloud.len();
    let missing = Err(GroundError::UnknownGaussian { id: count as u32, len: count });
    assert_eq!(build(&cloud, &[0, count as u32], 1.0, &standard), missing);
    let bad = [
        GroundSettings { voxel: 0.0, ..standard.clone() },
        GroundSettings { voxel: f64::NAN, ..standard.clone() },
        GroundSettings { cut: 1.0, ..standard.clone() },
        GroundSettings { chunk: -1.0, ..standard.clone() },
        GroundSettings { up: DVec3::ZERO, ..standard.clone() },
        GroundSettings { up: DVec3::NAN, ..standard.clone() },
        GroundSettings { most_voxels: 0, ..standard.clone() },
    ];
    for settings in bad {
        assert!(matches!(build(&cloud, &rest, 1.0, &settings), Err(GroundError::Setting { .. })));
    }
    let mut arrays = cloud.clone().into_arrays();
    arrays.means.iter_mut().for_each(|mean| mean.y = f32::NAN);
    let broken = Cloud::new(arrays).unwrap();
    assert!(matches!(build(&broken, &rest, 1.0, &standard), Err(GroundError::TooFewSplats { have: 0, .. })));
    let opaque = GroundSettings { cut: 0.9999, voxel: 0.002, ..standard.clone() };
    assert_eq!(build(&cloud, &rest[..60], 1.0, &opaque), Err(GroundError::EmptyOccupancy { cut: 0.9999 }));
    // Large for its voxels, a capture gets larger ones and says so.
    let small = GroundSettings { most_voxels: 2000, ..standard };
    let ground = Ground::build(&cloud, &rest, &[], 1.0, &small).unwrap();
    assert!(ground.report().doubled > 0 && ground.report().voxels <= 2000 && ground.notes().count() == 1);
}

#[test]
fn threads_change_no_bit_and_far_pieces_stay() {
    let (cloud, rest, part) = room();
    let settings = GroundSettings { chunk: 0.8, ..settings(GroundSource::Mesh) };
    let build = |removed: &[&[u32]]| Ground::build(&cloud, &rest, removed, 1.0, &settings).unwrap();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let closed = build(&[&part]);
    assert_eq!(one.install(|| build(&[&part])), closed);
    let open = build(&[]);
    let same = open.chunks().iter().filter(|chunk| closed.chunks().contains(chunk)).count();
    assert!(same > 4 && same < open.chunks().len(), "{same} of {}", open.chunks().len());
}

#[test]
fn the_plaza_without_its_parts_has_a_sound_floor() {
    let folder = std::env::var_os("SPLAT_SCENES")
        .map_or_else(|| concat!(env!("CARGO_MANIFEST_DIR"), "/../../target/scenes").into(), std::path::PathBuf::from)
        .join("plaza");
    if !folder.exists() {
        println!("skipped: needs the captures of ../shared/scenes");
        return;
    }
    let cloud = splat_io::read(folder.join("scene.ply")).unwrap().0;
    let labels = splat_io::npy::read_u8(folder.join("labels.npy")).unwrap();
    let of = |part: u8| -> Vec<u32> { (0..cloud.len() as u32).filter(|&id| labels[id as usize] == part).collect() };
    let parts: Vec<Vec<u32>> = (1..255).map(of).filter(|ids| !ids.is_empty()).collect();
    let removed: Vec<&[u32]> = parts.iter().map(Vec::as_slice).collect();
    let rest: Vec<u32> = (0..cloud.len() as u32).filter(|&id| matches!(labels[id as usize], 0 | 255)).collect();
    let selection = Selection::from_ids(cloud.len(), rest.iter().copied());
    // Captures are y-down.
    let floor = floor_plane(&cloud, Some(&selection), Vec3::NEG_Y, &FloorSettings::default()).unwrap();
    let up = floor.normal.as_dvec3().normalize();
    let settings = GroundSettings { up, ..settings(GroundSource::Mesh) };
    let ground = Ground::build(&cloud, &rest, &removed, 1.0, &settings).unwrap();
    let field = ground.field();
    let (mut on, mut all, mut below) = (0, 0, 0);
    for part in &parts {
        // Below each part, on a grid of 10 cm: from 10 cm above the plane the floor is felt within 2 voxels of it.
        let middle = part.iter().map(|&id| cloud.means()[id as usize].as_dvec3()).sum::<DVec3>() / part.len() as f64;
        let foot = middle - up * (up.dot(middle) - f64::from(floor.offset));
        let (u, v) = up.any_orthonormal_pair();
        for k in 0..49 {
            let at = foot + u * (f64::from(k % 7 - 3) * 0.1) + v * (f64::from(k / 7 - 3) * 0.1);
            all += 1;
            on += usize::from(field.nearest(at + up * 0.1).is_some_and(|(gap, _)| (gap - 0.1).abs() <= 0.1));
            below += usize::from(field.nearest(at - up * 0.1).is_some_and(|(gap, _)| gap < 0.0));
        }
    }
    println!("{on} and {below} of {all}, {:?}", ground.report());
    // Some parts stand on steps and on each other, where the floor's plane is not.
    assert!(on * 10 >= all * 6 && below * 10 >= all * 5, "{on} and {below} of {all}, {:?}", ground.report());
}
