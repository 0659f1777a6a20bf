//! Splats of the shader against a slow twin in f64, written from the formulas.

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec2, DVec3, Quat, Vec3};
use splat_core::{Cloud, CloudArrays, Pose, Selection, Similarity, sh};

use super::super::context::GpuOptions;
use super::super::{GpuBits, GpuCloud, GpuIds, GpuTint};
use super::*;

/// What a Gaussian's splat should be.
#[derive(Clone, Copy, Debug)]
struct Slow {
    mean: DVec2,
    /// Covariance in px^2, low-pass included.
    a: f64,
    b: f64,
    c: f64,
    opacity: f64,
    z: f64,
    color: DVec3,
}

/// The slow twin: none where alpha is below 1/255 at every pixel centre of the picture's box or beyond the near plane.
fn project_slow(cloud: &Cloud, id: usize, transform: &Similarity, view: &View) -> Option<Slow> {
    let turn = DMat3::from_quat(DQuat::from_xyzw(
        transform.rotation.x.into(),
        transform.rotation.y.into(),
        transform.rotation.z.into(),
        transform.rotation.w.into(),
    ));
    let scale = f64::from(transform.scale);
    let world = turn * cloud.means()[id].as_dvec3() * scale + transform.translation.as_dvec3();
    let rotation = view.pose.world_from_view.as_dmat3().transpose();
    let p = rotation * (world - view.pose.position.as_dvec3());
    if !cloud.drawable(id) || !(p.z > f64::from(view.near)) {
        return None;
    }
    let q = cloud.rotation(id);
    let own = DMat3::from_quat(DQuat::from_xyzw(q.x.into(), q.y.into(), q.z.into(), q.w.into()).normalize());
    let axes = rotation * turn * own * DMat3::from_diagonal(cloud.log_scales()[id].as_dvec3().map(f64::exp) * scale);
    let cov3d = axes * axes.transpose();
    let i = &view.intrinsics;
    let (fx, fy) = (f64::from(i.fx), f64::from(i.fy));
    let center = DVec2::new(i.cx.into(), i.cy.into());
    let size = DVec2::new(view.width.into(), view.height.into());
    let parallel = view.projection == Projection::Orthographic;
    // Rows of the Jacobian.
    let (mean, jx, jy) = if parallel {
        (DVec2::new(fx * p.x, fy * p.y) + center, DVec3::X * fx, DVec3::Y * fy)
    } else {
        let margin = 0.3 * 0.5 * size;
        let low = -(center + margin) / DVec2::new(fx, fy);
        let high = (size - center + margin) / DVec2::new(fx, fy);
        let slope = (p.truncate() / p.z).clamp(low, high);
        (
            DVec2::new(fx * p.x / p.z, fy * p.y / p.z) + center,
            DVec3::new(fx / p.z, 0.0, -fx * slope.x / p.z),
            DVec3::new(0.0, fy / p.z, -fy * slope.y / p.z),
        )
    };
    let (a0, b, c0) = (jx.dot(cov3d * jx), jx.dot(cov3d * jy), jy.dot(cov3d * jy));
    let (a, c) = (a0 + 0.3, c0 + 0.3);
    let det = a * c - b * b;
    let mut opacity = 1.0 / (1.0 + (-f64::from(cloud.opacity_logits()[id])).exp());
    if cloud.source().antialiased {
        opacity *= ((a0 * c0 - b * b) / det).max(1e-30).sqrt();
    }
    if opacity < 1.0 / 255.0 {
        return None;
    }
    let k = 2.0 * (255.0 * opacity).ln();
    let half = DVec2::new((k * a).sqrt(), (k * c).sqrt()) + 0.01;
    let first = (mean - 0.5 - half).ceil().max(DVec2::ZERO);
    let last = (mean - 0.5 + half).floor().min(size - 1.0);
    if !(first.x <= last.x && first.y <= last.y) {
        return None;
    }
    let local = if parallel {
        turn.transpose() * view.forward().as_dvec3()
    } else {
        turn.transpose() * (world - view.pose.position.as_dvec3())
    };
    let color = sh::color(cloud.sh_degree(), cloud.sh_of(id), local.normalize().as_vec3());
    Some(Slow { mean, a, b, c, opacity, z: p.z, color: color.max(Vec3::ZERO).as_dvec3() })
}

/// Numbers that a seed means for ever.
struct Random(u64);

impl Random {
    fn next(&mut self, low: f32, high: f32) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (self.0 >> 40) as f32 / (1u64 << 24) as f32 * (high - low)
    }

    fn vector(&mut self, low: f32, high: f32) -> Vec3 {
        Vec3::new(self.next(low, high), self.next(low, high), self.next(low, high))
    }

    fn rotation(&mut self) -> Quat {
        Quat::from_xyzw(self.next(-1.0, 1.0), self.next(-1.0, 1.0), self.next(-1.0, 1.0), self.next(0.1, 1.0))
    }
}

fn cloud(seed: u64, count: usize, sh_degree: u8) -> Cloud {
    let mut r = Random(seed);
    let mut a = CloudArrays { sh_degree, ..CloudArrays::default() };
    for _ in 0..count {
        a.means.push(r.vector(-2.0, 2.0));
        let size = r.next(-7.0, -1.0);
        a.log_scales.push(Vec3::splat(size) + r.vector(-2.0, 1.0));
        a.rotations.push(r.rotation());
        a.opacity_logits.push(r.next(-6.0, 6.0));
        for k in 0..3 * sh::coefficient_count(sh_degree) {
            a.sh.push(if k < 3 { r.next(-1.5, 2.0) } else { r.next(-0.3, 0.3) });
        }
    }
    Cloud::new(a).unwrap()
}

fn view(seed: u64) -> View {
    let mut r = Random(seed ^ 77);
    let eye = r.rotation().normalize() * Vec3::new(0.0, 0.0, 2.5);
    View::perspective(Pose::look_at(eye, r.vector(-0.2, 0.2), r.vector(-1.0, 1.0)), 0.9, 150, 100)
}

/// Splats as the shader wrote them.
struct Drawn {
    mean: Vec<[f32; 2]>,
    shape_a: Vec<[f32; 2]>,
    shape_b: Vec<[f32; 2]>,
    color: Vec<[u32; 2]>,
    z: Vec<f32>,
}

fn draw(context: &Context, instances: &[GpuInstance], view: &View) -> Drawn {
    let kernels = ProjectKernels::new(context).unwrap();
    let slots = instances.iter().map(GpuInstance::len).sum();
    let records = Records::new(context, slots);
    let projector = Projector::new(context, &kernels, &records, instances);
    projector.place(context, instances, view, true);
    context.run(|pass| projector.encode(&kernels, pass));
    Drawn {
        mean: context.read(&records.mean, slots).unwrap(),
        shape_a: context.read(&records.shape_a, slots).unwrap(),
        shape_b: context.read(&records.shape_b, slots).unwrap(),
        color: context.read(&records.color, slots).unwrap(),
        z: context.read(&records.z, slots).unwrap(),
    }
}

fn half(bits: u32) -> f64 {
    let (exponent, mantissa) = (bits >> 10 & 31, f64::from(bits & 1023));
    if exponent == 0 { mantissa / 16_777_216.0 } else { (1.0 + mantissa / 1024.0) * 2f64.powi(exponent as i32 - 15) }
}

/// Holds one splat against the twin; `grain`: how much coarser the cloud is kept than f32.
fn compare(slot: usize, drawn: &Drawn, slow: Option<Slow>, grain: f64) {
    let Some(slow) = slow else {
        // At the edge of what is drawn, rounding may keep a splat that no pixel counts.
        let reach = f64::from(drawn.shape_b[slot][1]) + f64::from(splat_shaders::constants::LEVELS);
        assert!(drawn.z[slot] == 0.0 || reach < 1e-3 + grain, "slot {slot} is drawn: z {}", drawn.z[slot]);
        return;
    };
    let far = slow.opacity * 255.0;
    if drawn.z[slot] == 0.0 {
        assert!(far < 1.0 + 1e-3 + grain, "slot {slot} is missing: {slow:?}");
        return;
    }
    let close = |what: &str, found: f64, expected: f64, bound: f64| {
        assert!((found - expected).abs() <= bound, "slot {slot}: {what} is {found}, not {expected}: {slow:?}");
    };
    close("z", drawn.z[slot].into(), slow.z, 1e-5 * slow.z);
    let size = slow.mean.abs().max_element();
    close("x", drawn.mean[slot][0].into(), slow.mean.x, 1e-4 + 1e-5 * size);
    close("y", drawn.mean[slot][1].into(), slow.mean.y, 1e-4 + 1e-5 * size);
    // Conic factors back to the conic, times the covariance: the identity.
    let [along, shear] = drawn.shape_a[slot].map(f64::from);
    let [across, level] = drawn.shape_b[slot].map(f64::from);
    let h = 0.5 * std::f64::consts::LOG2_E;
    let (ca, cb) = (along * along / h, -along * along * shear / h);
    let cc = (along * along * shear * shear + across * across) / h;
    let unit = [
        (ca * slow.a + cb * slow.b, 1.0),
        (cb * slow.b + cc * slow.c, 1.0),
        ((ca * slow.b + cb * slow.c) * (slow.a / slow.c).sqrt(), 0.0),
    ];
    let long = slow.a.max(slow.c).powi(2) / (slow.a * slow.c - slow.b * slow.b).max(1e-9);
    for (found, expected) in unit {
        close("conic times covariance", found, expected, (1e-4 + grain) * (1.0 + long.sqrt()));
    }
    close("opacity", level.exp2(), slow.opacity, 1e-5 + 0.1 * grain + 1e-2 * grain * slow.opacity);
    let color = [drawn.color[slot][0] & 0xffff, drawn.color[slot][0] >> 16, drawn.color[slot][1]].map(half);
    for (found, expected) in color.into_iter().zip(slow.color.to_array()) {
        close("colour", found, expected, 1.5e-3 * expected.max(1.0) + grain);
    }
}

fn grain(precision: Precision) -> f64 {
    match precision {
        Precision::Packed => 1e-3,
        Precision::Full => 0.0,
    }
}

#[test]
fn splats_are_those_of_the_slow_twin_at_every_degree_and_precision() {
    for precision in [Precision::Packed, Precision::Full] {
        let Some(context) = Context::for_test_with(GpuOptions { precision, ..GpuOptions::default() }) else { return };
        for sh_degree in 0..=4 {
            for seed in 1..4 {
                let mut arrays = cloud(seed, 700, sh_degree).into_arrays();
                arrays.source.antialiased = seed == 2;
                let cloud = Cloud::new(arrays).unwrap();
                let mut view = view(seed);
                if seed == 3 {
                    view.projection = Projection::Orthographic;
                    (view.intrinsics.fx, view.intrinsics.fy) = (50.0, 60.0);
                }
                let gpu = Arc::new(GpuCloud::with_pages(&context, &cloud, 128 << 20).unwrap());
                let transform = Similarity {
                    rotation: Quat::from_rotation_y(0.3 * seed as f32),
                    scale: 1.3,
                    translation: Vec3::new(0.1, -0.2, 0.05),
                };
                let drawn = draw(&context, &[GpuInstance { transform, ..GpuInstance::new(gpu) }], &view);
                let mut visible = 0;
                for id in 0..cloud.len() {
                    let slow = project_slow(&cloud, id, &transform, &view);
                    visible += usize::from(slow.is_some());
                    compare(id, &drawn, slow, grain(precision));
                }
                assert!(visible > 100, "seed {seed}: {visible} visible");
            }
        }
    }
}

#[test]
fn slots_count_through_instances_pages_subsets_and_hidden_ones() {
    let Some(context) = Context::for_test() else { return };
    let (first, second) = (cloud(5, 1500, 1), cloud(6, 600, 0));
    // Pages of 512 Gaussians: 7 + 6 words each.
    let upload = |cloud: &Cloud| Arc::new(GpuCloud::with_pages(&context, cloud, 4 * 13 * 512 + 100).unwrap());
    let (gpu_first, gpu_second) = (upload(&first), upload(&second));
    assert_eq!(gpu_first.pages.len(), 3);
    let gpu = super::super::Gpu::from_context(context.clone()).unwrap();
    let hidden = Selection::from_fn(first.len(), |i| i % 3 == 0);
    let ids: Arc<[u32]> = (0..1500).filter(|i| i % 7 == 1 && !(500..1100).contains(i)).collect();
    let tint: Vec<[u8; 4]> = (0..second.len()).map(|i| [255, 0, 0, if i % 2 == 0 { 255 } else { 0 }]).collect();
    let instances = [
        GpuInstance { hidden: Some(Arc::new(GpuBits::new(&gpu, &hidden))), ..GpuInstance::new(gpu_first.clone()) },
        GpuInstance { tint: Some(Arc::new(GpuTint::new(&gpu, &tint))), ..GpuInstance::new(gpu_second) },
        GpuInstance { subset: Some(Arc::new(GpuIds::new(&gpu, ids.clone()))), ..GpuInstance::new(gpu_first) },
    ];
    let view = view(9);
    let drawn = draw(&context, &instances, &view);
    let slow = |cloud: &Cloud, id: usize| project_slow(cloud, id, &Similarity::IDENTITY, &view);
    let mut slot = 0;
    for id in 0..first.len() {
        compare(slot, &drawn, slow(&first, id).filter(|_| !hidden.contains(id)), 2e-3);
        slot += 1;
    }
    for id in 0..second.len() {
        let mut expected = slow(&second, id);
        if let Some(slow) = expected.as_mut().filter(|_| id % 2 == 0) {
            slow.color = DVec3::X;
        }
        compare(slot, &drawn, expected, 2e-3);
        slot += 1;
    }
    for id in ids.iter() {
        compare(slot, &drawn, slow(&first, *id as usize), 2e-3);
        slot += 1;
    }
    assert_eq!(slot, drawn.z.len());
}

#[test]
fn what_is_not_finite_is_not_drawn_and_what_is_huge_is_finite() {
    for precision in [Precision::Packed, Precision::Full] {
        let Some(context) = Context::for_test_with(GpuOptions { precision, ..GpuOptions::default() }) else { return };
        let mut arrays = cloud(3, 300, 2).into_arrays();
        for (i, bad) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().enumerate() {
            arrays.means[10 + i].y = bad;
            arrays.log_scales[20 + i].z = bad;
            arrays.rotations[30 + i].w = bad;
            arrays.sh[(40 + i) * 27] = bad;
        }
        arrays.opacity_logits[50] = f32::NAN;
        arrays.opacity_logits[51] = f32::NEG_INFINITY;
        arrays.log_scales[60] = Vec3::splat(1e6f32.ln());
        arrays.log_scales[61] = Vec3::splat(1e30);
        arrays.log_scales[62] = Vec3::splat(-1e30);
        arrays.means[63] = Vec3::splat(3e38);
        arrays.rotations[64] = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0);
        for i in 60..63 {
            (arrays.means[i], arrays.opacity_logits[i]) = (Vec3::ZERO, 0.0);
        }
        let cloud = Cloud::new(arrays).unwrap();
        let gpu = Arc::new(GpuCloud::with_pages(&context, &cloud, 128 << 20).unwrap());
        let drawn = draw(&context, &[GpuInstance::new(gpu)], &view(3));
        for i in [10, 11, 12, 20, 21, 22, 30, 31, 32, 50, 51, 63] {
            assert_eq!(drawn.z[i], 0.0, "{precision:?}, {i}");
        }
        assert!((60..63).all(|i| drawn.z[i] > 0.0));
        for i in (0..cloud.len()).filter(|i| drawn.z[*i] > 0.0) {
            let numbers = [drawn.mean[i], drawn.shape_a[i], drawn.shape_b[i]].concat();
            assert!(numbers.iter().all(|v| v.is_finite()), "{precision:?}, {i}: {numbers:?}");
            let color = [drawn.color[i][0] & 0xffff, drawn.color[i][0] >> 16, drawn.color[i][1]];
            assert!(color.iter().all(|bits| *bits < 0x7c00), "{precision:?}, {i}: {color:x?}");
        }
    }
}

#[test]
fn nothing_is_projected_of_nothing() {
    let Some(context) = Context::for_test() else { return };
    let empty = Arc::new(GpuCloud::with_pages(&context, &Cloud::default(), 1 << 20).unwrap());
    assert!(empty.is_empty());
    for instances in [vec![], vec![GpuInstance::new(empty)]] {
        assert!(draw(&context, &instances, &view(1)).z.is_empty());
    }
}
