use splat_core::glam::{Quat, Vec3};
use splat_core::{Mask2d, SelectMode, Similarity};
use splat_raster::{Instance, Scene};
use splat_segment::project::{DepthTolerance, Footprint, Lift, lift, placed, project};

use crate::reference::Reference;
use crate::room::{self, BALL, BOX, Builder, camera, room};

#[test]
fn the_frustum_holds_exactly_the_means_whose_pixel_is_in_the_mask() {
    let room = room();
    let view = camera(0.1, 1.5, 3.4, room::SIZE);
    let mask = room.mask(&mut Reference::default(), &view, BALL);
    let got = lift(&mut Reference::default(), &room.scene, &view, &mask, Lift::Frustum(Footprint::Center)).unwrap();
    assert!(got.count() > 100);
    for i in 0..room.cloud.len() {
        let slow = view
            .project(room.cloud.means()[i])
            .is_some_and(|(p, _)| p.x >= 0.0 && p.y >= 0.0 && mask.contains(p.x.floor() as u32, p.y.floor() as u32));
        assert_eq!(got.contains(i), slow, "Gaussian {i}");
    }
}

#[test]
fn nothing_behind_the_camera_or_hidden_is_lifted() {
    let mut b = Builder::default();
    for z in [-3.0, 3.0, 4.0] {
        b.add(0, Vec3::new(0.0, 0.0, z), Vec3::splat(0.2), Quat::IDENTITY, 0.9, Vec3::ONE);
    }
    let room = b.build();
    let pose = splat_core::Pose::look_at(Vec3::ZERO, Vec3::Z, -Vec3::Y);
    let view = splat_core::View::perspective(pose, 0.9, 32, 32);
    let full = Mask2d::from_fn(32, 32, |_, _| true);
    let mut scene = Scene::of(room.cloud.clone());
    scene.instances[0].hidden = Some(splat_core::Selection::from_ids(3, [2]).into());
    for how in [
        Lift::Frustum(Footprint::Center),
        Lift::Frustum(Footprint::Ellipse),
        Lift::Frustum(Footprint::Weight(0.5)),
        Lift::Depth(Footprint::Center, DepthTolerance::default()),
        Lift::Surface(0.5),
    ] {
        let got = lift(&mut Reference::default(), &scene, &view, &full, how).unwrap();
        assert_eq!(got.ids(), [1], "{how:?}");
    }
}

#[test]
fn the_ellipse_reaches_where_the_mean_does_not() {
    let room = room();
    let view = camera(0.3, 1.2, 3.0, room::SIZE);
    let mask = room.mask(&mut Reference::default(), &view, BOX);
    let mut r = Reference::default();
    let center = lift(&mut r, &room.scene, &view, &mask, Lift::Frustum(Footprint::Center)).unwrap();
    let ellipse = lift(&mut r, &room.scene, &view, &mask, Lift::Frustum(Footprint::Ellipse)).unwrap();
    let mut both = ellipse.clone();
    both.apply(SelectMode::Intersect, &center);
    assert_eq!(both, center, "a mean inside is an ellipse inside");
    assert!(ellipse.count() > center.count());
    // Against every pixel of the picture.
    for i in 0..room.cloud.len() {
        let (mean, cov) = placed(&room.scene.instances[0], i);
        let Some(p) = project(&view, mean, cov) else { continue };
        let [a, b, c] = p.cov.map(f64::from);
        let det = a * c - b * b;
        let own = p.center.floor();
        let (mut slow, mut close) = (false, false);
        for y in 0..view.height {
            for x in (0..view.width).filter(|&x| mask.contains(x, y)) {
                let (dx, dy) = (f64::from(x) + 0.5 - f64::from(p.center.x), f64::from(y) + 0.5 - f64::from(p.center.y));
                let q = (c * dx * dx - 2.0 * b * dx * dy + a * dy * dy) / det;
                slow |= q <= 1.0 || (own.x == x as f32 && own.y == y as f32);
                // On the very edge of the ellipse rounding decides.
                close |= (q - 1.0).abs() < 1e-3;
            }
        }
        assert!(close || ellipse.contains(i) == slow, "Gaussian {i}: {slow}");
    }
}

#[test]
fn depth_projection_takes_the_near_surface_at_any_scale() {
    let room = room();
    for scale in [0.001, 1.0, 1000.0] {
        let transform = Similarity { scale, ..Similarity::IDENTITY };
        let scene = Scene { instances: vec![Instance { transform, ..Instance::new(room.cloud.clone()) }] };
        let mut view = camera(0.0, 0.8, 3.4, room::SIZE);
        view.pose.position *= scale;
        view.near *= scale;
        let mask = Mask2d::from_fn(80, 60, |_, _| true);
        let mut r = Reference::default();
        let how = Lift::Depth(Footprint::Center, DepthTolerance::default());
        let near = lift(&mut r, &scene, &view, &mask, how).unwrap();
        // The camera is at z < 0: of the ball's Gaussians those turned to it lie at smaller z than its middle.
        let side = |front: bool| {
            let of: Vec<usize> = (0..room.cloud.len())
                .filter(|&i| room.labels[i] == BALL && (room.cloud.means()[i].z < 0.0) == front)
                .filter(|&i| room.cloud.means()[i].z.abs() > 0.3)
                .collect();
            of.iter().filter(|&&i| near.contains(i)).count() as f64 / of.len() as f64
        };
        assert!(side(true) > 0.9, "scale {scale}: front {}", side(true));
        assert!(side(false) < 0.05, "scale {scale}: back {}", side(false));
    }
}

#[test]
fn the_surface_is_what_is_hit_first_in_the_mask() {
    let room = room();
    let view = camera(0.0, 0.8, 3.4, room::SIZE);
    let mut r = Reference::default();
    let mask = room.mask(&mut r, &view, BALL);
    let got = lift(&mut r, &room.scene, &view, &mask, Lift::Surface(0.5)).unwrap();
    let ball = got.iter().filter(|&i| room.labels[i] == BALL).count();
    assert!(got.count() > 50 && ball as f64 > 0.95 * got.count() as f64);
    let weight = lift(&mut r, &room.scene, &view, &mask, Lift::Frustum(Footprint::Weight(0.5))).unwrap();
    assert!(weight.iter().all(|i| room.labels[i] == BALL || room.cloud.means()[i].y.abs() < 0.05));
}
