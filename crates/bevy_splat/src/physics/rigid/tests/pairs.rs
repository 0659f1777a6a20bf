//! Every pair of colliders that is relied on meets: parry panics for pairs it does not know.

use super::*;

const SHAPES: [RigidShape; 6] = [
    RigidShape::Box,
    RigidShape::Ball,
    RigidShape::Capsule,
    RigidShape::Hull,
    RigidShape::Decomposition,
    RigidShape::Voxels,
];

#[test]
fn every_shape_lies_on_every_kind_of_ground() {
    for source in [GroundKind::Plane, GroundKind::Heightfield, GroundKind::Mesh, GroundKind::Voxels] {
        let mut app = app();
        let floor = Shells::default().plate(Vec3::ZERO, Vec3::Z * 3.0, Vec3::X * 3.0, 0.06);
        let capture = spawn(&mut app, &floor, Transform::IDENTITY);
        app.world_mut()
            .entity_mut(capture)
            .insert((StaticCapture { source, ..default() }, PartMaterial::from(dull(0.5, 0.4))));
        let shells = Shells::default().cuboid(Vec3::ZERO, Vec3::splat(0.2), 0.03);
        let parts: Vec<Entity> = (0..SHAPES.len())
            .map(|k| {
                let at = Transform::from_xyz((k as f32 - 2.5) * 0.9, 0.4, 0.0);
                let part = spawn(&mut app, &shells, at);
                let rigid = RigidPart { shape: SHAPES[k], voxels: 32, ..default() };
                app.world_mut().entity_mut(part).insert((rigid, PartMaterial::from(dull(0.5, 0.4))));
                part
            })
            .collect();
        settle(&mut app);
        run(&mut app, 1.5);
        for (part, shape) in parts.into_iter().zip(SHAPES) {
            let PartBody::Rigid { shape: got, .. } = report(&app, part).body else { panic!() };
            assert!(got == shape.name(), "{shape:?} became a {got}");
            let low = bottom(&app, part);
            assert!(low.abs() < 0.06, "{shape:?} on {source:?}: {low}");
        }
    }
}

#[test]
fn every_shape_lies_on_every_other() {
    let mut app = app();
    floor(&mut app, dull(0.5, 0.4));
    let shells = Shells::default().cuboid(Vec3::ZERO, Vec3::splat(0.2), 0.03);
    let mut pairs = Vec::new();
    for (row, below) in SHAPES.into_iter().enumerate() {
        for (column, above) in SHAPES.into_iter().enumerate() {
            let mut part = |shape, y| {
                let at = Transform::from_xyz(column as f32 * 0.9, y, row as f32 * 0.9);
                let part = spawn(&mut app, &shells, at);
                let rigid = RigidPart { shape, voxels: 24, ..default() };
                app.world_mut().entity_mut(part).insert((rigid, PartMaterial::from(dull(0.5, 0.4))));
                part
            };
            pairs.push((below, above, part(below, 0.22), part(above, 0.7)));
        }
    }
    settle(&mut app);
    let mut met = vec![false; pairs.len()];
    for _ in 0..(0.6 * RATE) as usize {
        app.update();
        let graph = app.world().resource::<ContactGraph>();
        for (met, (_, _, below, above)) in met.iter_mut().zip(&pairs) {
            *met |= graph.get(*below, *above).is_some_and(|(_, pair)| pair.is_touching());
        }
    }
    for (met, (below, above, lower, upper)) in met.iter().zip(&pairs) {
        assert!(*met, "{above:?} and {below:?} never met");
        // Round things may have rolled off; none is inside another.
        let (low, high) = (place(&app, *lower).translation, place(&app, *upper).translation);
        assert!(low.is_finite() && high.is_finite());
        assert!(low.distance(high) > 0.3, "{above:?} sank into {below:?}: {low} {high}");
    }
}
