//! The kernel against a slow twin in f64, pixel by pixel, from buffers made by hand.

use splat_shaders::constants::{LARGEST_ALPHA, LEAST_TRANSMITTANCE, NO_ID, SMALLEST_ALPHA};

use super::super::project::Records;
use super::*;

/// 3 x 2 tiles, the last ones cut.
const SIZE: [u32; 2] = [41, 27];
const PIXELS: usize = (SIZE[0] * SIZE[1]) as usize;
const CHANNELS: usize = 5;
const MASKS: usize = 4;
const TAU: f32 = 0.5;
const THRESHOLD: f32 = 0.02;

#[derive(Clone, Copy, Debug)]
struct Splat {
    mean: [f32; 2],
    along: f32,
    shear: f32,
    across: f32,
    level: f32,
    z: f32,
    color: [f32; 3],
}

fn random(seed: u64) -> impl FnMut(f32, f32) -> f32 {
    let mut state = seed;
    move |low, high| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (state >> 40) as f32 / (1u64 << 24) as f32 * (high - low)
    }
}

/// Splats in order of depth.
fn splats(count: usize, opaque: f32) -> Vec<Splat> {
    let mut next = random(9);
    (0..count)
        .map(|i| Splat {
            mean: [next(-5.0, 46.0), next(-5.0, 32.0)],
            along: next(0.05, 0.8),
            shear: next(-1.0, 1.0),
            across: next(0.05, 0.8),
            level: next(-5.0, opaque),
            z: 1.0 + i as f32 * 0.01,
            // Multiples of 1/64: exact as half floats.
            color: [0, 1, 2].map(|_| (next(0.0, 64.0) as u32) as f32 / 64.0),
        })
        .collect()
}

/// What a pixel gets.
#[derive(Clone, Debug)]
struct Pixel {
    color: [f64; 4],
    median: f64,
    expected: f64,
    hit: u32,
    strongest: u32,
    features: [f64; CHANNELS],
    /// Weight of every splat.
    weights: Vec<f64>,
    /// A comparison was so close that rounding may decide it.
    doubt: bool,
}

fn blend_slow(splats: &[Splat], features: &[f32], at: [u32; 2], limit: f32) -> Pixel {
    let mut t = 1.0f64;
    let mut p = Pixel {
        color: [0.0; 4],
        median: f64::INFINITY,
        expected: 0.0,
        hit: NO_ID,
        strongest: NO_ID,
        features: [0.0; CHANNELS],
        weights: vec![0.0; splats.len()],
        doubt: false,
    };
    let mut largest = 0.0;
    for (slot, s) in splats.iter().enumerate() {
        if s.z >= limit {
            continue;
        }
        let [dx, dy] = [0, 1].map(|k| f64::from(at[k]) + 0.5 - f64::from(s.mean[k]));
        let (e, f) = (f64::from(s.along) * (dx - f64::from(s.shear) * dy), f64::from(s.across) * dy);
        let alpha = (f64::from(s.level) - e * e - f * f).exp2().min(LARGEST_ALPHA.into());
        p.doubt |= (alpha / f64::from(SMALLEST_ALPHA) - 1.0).abs() < 1e-4;
        if alpha < SMALLEST_ALPHA.into() {
            continue;
        }
        let after = t * (1.0 - alpha);
        p.doubt |= (after / f64::from(LEAST_TRANSMITTANCE) - 1.0).abs() < 1e-3;
        if after < LEAST_TRANSMITTANCE.into() {
            break;
        }
        let weight = alpha * t;
        p.doubt |= (after - 0.5).abs() < 1e-5 || (weight / largest - 1.0).abs() < 1e-4;
        for c in 0..3 {
            p.color[c] += weight * f64::from(s.color[c]);
        }
        for c in 0..CHANNELS {
            p.features[c] += weight * f64::from(features[slot * CHANNELS + c]);
        }
        p.expected += weight * f64::from(s.z);
        if t > 0.5 && after <= 0.5 {
            (p.median, p.hit) = (s.z.into(), slot as u32);
        }
        if weight > largest {
            (largest, p.strongest) = (weight, slot as u32);
        }
        p.weights[slot] = weight;
        t = after;
    }
    p.color[3] = 1.0 - t;
    p.expected = if 1.0 - t > 1e-3 { p.expected / (1.0 - t) } else { f64::INFINITY };
    p
}

/// A texture of a format and its view.
fn texture(context: &Context, format: wgpu::TextureFormat) -> (wgpu::Texture, wgpu::TextureView) {
    let texture = context.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: SIZE[0], height: SIZE[1], depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::STORAGE_BINDING
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_DST
            | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    (texture, view)
}

/// The numbers of a texture, row by row.
fn numbers(context: &Context, texture: &wgpu::Texture, per_pixel: u32) -> Vec<f32> {
    let stride = (4 * per_pixel * SIZE[0]).next_multiple_of(256);
    let buffer = context.words("picture", (stride / 4 * SIZE[1]) as usize);
    let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(stride), rows_per_image: None };
    let to = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
    encoder.copy_texture_to_buffer(texture.as_image_copy(), to, texture.size());
    context.queue.submit([encoder.finish()]);
    let all = context.read::<f32>(&buffer, (stride / 4 * SIZE[1]) as usize).unwrap();
    all.chunks(stride as usize / 4).flat_map(|row| row[..(per_pixel * SIZE[0]) as usize].to_vec()).collect()
}

fn check(context: &Context, splats: &[Splat], limits: Option<&[f32]>) {
    let usage = wgpu::BufferUsages::empty();
    // 64ths as half floats, by hand: exact.
    let half = |v: f32| -> u32 { if v == 0.0 { 0 } else { (v.to_bits() >> 13) - (112 << 10) } };
    let of = |f: &dyn Fn(&Splat) -> [f32; 2]| splats.iter().map(f).collect::<Vec<_>>();
    let color: Vec<_> = splats.iter().map(|s| [half(s.color[0]) | half(s.color[1]) << 16, half(s.color[2])]).collect();
    let records = Records {
        mean: context.buffer_of("mean", &of(&|s| s.mean), usage),
        shape_a: context.buffer_of("a", &of(&|s| [s.along, s.shear]), usage),
        shape_b: context.buffer_of("b", &of(&|s| [s.across, s.level]), usage),
        color: context.buffer_of("color", &color, usage),
        z: context.buffer_of("z", &splats.iter().map(|s| s.z).collect::<Vec<_>>(), usage),
    };
    // Every tile lists every splat.
    let slots: Vec<u32> = (0..6).flat_map(|_| 0..splats.len() as u32).collect();
    let ranges: Vec<[u32; 2]> = (0..6).map(|k| [k, k + 1].map(|k| k * splats.len() as u32)).collect();
    let pair_slots = context.buffer_of("slots", &slots, usage);
    let tile_ranges = context.buffer_of("ranges", &ranges, usage);
    let mut next = random(4);
    let features: Vec<f32> = (0..splats.len() * CHANNELS).map(|_| next(-1.0, 1.0)).collect();
    let stride = PIXELS.next_multiple_of(4);
    let masks: Vec<u8> =
        (0..MASKS * stride).map(|i| if i / stride == 1 { 255 } else { next(0.0, 255.9) as u8 }).collect();

    let wide = context.options.precision == Precision::Full;
    let color_format = if wide { wgpu::TextureFormat::Rgba32Float } else { wgpu::TextureFormat::Rgba16Float };
    let (color_picture, color_view) = texture(context, color_format);
    let [(median, median_view), (expected, expected_view), (limit, limit_view)] =
        [0; 3].map(|_| texture(context, wgpu::TextureFormat::R32Float));
    if let Some(limits) = limits {
        context.queue.write_texture(
            limit.as_image_copy(),
            bytemuck::cast_slice(limits),
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * SIZE[0]), rows_per_image: None },
            limit.size(),
        );
    }
    let [hits, strongest] = ["hits", "strongest"].map(|label| context.words(label, PIXELS));
    let visible = context.words("visible", splats.len().div_ceil(32));
    let feature_values = context.buffer_of("features", &features, usage);
    let feature_picture = context.words("features", PIXELS * CHANNELS);
    let mask_values = context.buffer_of("masks", &masks, usage);
    let votes = context.words("votes", 2 * splats.len() * (1 + MASKS));
    let targets = Targets {
        color: Some(&color_view),
        median: Some(&median_view),
        expected: Some(&expected_view),
        hits: Some((&hits, TAU)),
        strongest: Some(&strongest),
        visible: Some((&visible, THRESHOLD)),
        features: Some((&feature_values, &feature_picture, CHANNELS as u32)),
        votes: Some((&mask_values, &votes, MASKS as u32)),
        limit: limits.map(|_| &limit_view),
    };
    let lists = Listed { records: &records, pair_slots: &pair_slots, tile_ranges: &tile_ranges };
    let blending = Blending { lists, size: SIZE, slots: splats.len() as u32, targets };
    let kernels = BlendKernels::default();
    let blender = Blender::new(context, &kernels, &blending).unwrap();
    // Two dispatches of channels, two of masks.
    assert_eq!(blender.steps.len(), 5);
    context.run(|pass| blender.encode(pass));

    let colors = wide.then(|| numbers(context, &color_picture, 4));
    let (median, expected) = (numbers(context, &median, 1), numbers(context, &expected, 1));
    let read = |buffer, len| context.read::<u32>(buffer, len).unwrap();
    let (hits, strongest) = (read(&hits, PIXELS), read(&strongest, PIXELS));
    let feature_picture = context.read::<f32>(&feature_picture, PIXELS * CHANNELS).unwrap();
    let mut slow_total = vec![0.0; splats.len()];
    let mut slow_inside = vec![[0.0; MASKS]; splats.len()];
    let mut most = vec![0.0f64; splats.len()];
    let mut doubtful = 0;
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            let p = (y * SIZE[0] + x) as usize;
            let slow = blend_slow(splats, &features, [x, y], limits.map_or(f32::INFINITY, |l| l[p]));
            for (slot, w) in slow.weights.iter().enumerate() {
                slow_total[slot] += w * 65536.0;
                most[slot] = most[slot].max(*w);
                for m in 0..MASKS {
                    slow_inside[slot][m] += w * 65536.0 * f64::from(masks[m * stride + p]);
                }
            }
            if slow.doubt {
                doubtful += 1;
                continue;
            }
            for c in 0..4 {
                if let Some(colors) = &colors {
                    assert!((f64::from(colors[4 * p + c]) - slow.color[c]).abs() < 1e-4, "({x}, {y}): {slow:?}");
                }
            }
            for c in 0..CHANNELS {
                assert!((f64::from(feature_picture[p * CHANNELS + c]) - slow.features[c]).abs() < 1e-4, "({x}, {y})");
            }
            assert_eq!((hits[p], strongest[p]), (slow.hit, slow.strongest), "({x}, {y})");
            assert_eq!(f64::from(median[p]), slow.median, "({x}, {y})");
            let near = (f64::from(expected[p]) - slow.expected).abs() < 1e-3;
            assert!(near || f64::from(expected[p]) == slow.expected, "({x}, {y}): {} {}", expected[p], slow.expected);
        }
    }
    assert!(doubtful * 20 < PIXELS, "{doubtful} pixels in doubt");
    let votes = read(&votes, 2 * splats.len() * (1 + MASKS));
    let sum = |k: usize| f64::from(votes[2 * k]) + f64::from(votes[2 * k + 1]) * 4_294_967_296.0;
    let bits = read(&visible, splats.len().div_ceil(32));
    // A doubtful pixel may differ by a whole weight.
    let slack = doubtful as f64 * 65536.0 * 2e-3;
    for slot in 0..splats.len() {
        let total = sum(slot);
        assert!((total - slow_total[slot]).abs() <= 1e-4 * slow_total[slot] + PIXELS as f64 + slack, "{slot}");
        for (m, slow) in slow_inside[slot].into_iter().enumerate() {
            let inside = sum((1 + m) * splats.len() + slot);
            assert!((inside - slow).abs() <= 1e-4 * slow + 255.0 * (PIXELS as f64 + slack), "{slot}, mask {m}");
        }
        assert_eq!(sum(2 * splats.len() + slot), 255.0 * total, "mask 1 is everywhere");
        let seen = bits[slot / 32] >> (slot % 32) & 1 == 1;
        let near = (most[slot] - f64::from(THRESHOLD)).abs() < 1e-3;
        assert!(near || seen == (most[slot] > f64::from(THRESHOLD)), "{slot}: {}", most[slot]);
    }
}

#[test]
fn every_output_is_that_of_the_slow_twin() {
    for precision in [Precision::Packed, Precision::Full] {
        let options = super::super::GpuOptions { precision, ..Default::default() };
        let Some(context) = Context::for_test_with(options) else { return };
        let mut next = random(2);
        let limits: Vec<f32> = (0..PIXELS).map(|_| next(1.0, 5.0)).collect();
        // Faint ones: several batches; opaque ones: pixels end early.
        for (count, opaque) in [(1, 0.0), (40, 0.0), (600, -3.0), (300, 0.0)] {
            let splats = splats(count, opaque);
            check(&context, &splats, None);
            check(&context, &splats, Some(&limits));
        }
    }
}

#[test]
fn sums_beyond_32_bits_carry() {
    let Some(context) = Context::for_test() else { return };
    // Many dispatches into the same sums: as if the picture were large.
    let splat = Splat { along: 1e-4, across: 1e-4, mean: [20.0, 13.0], level: -0.02, ..splats(1, 0.0)[0] };
    let usage = wgpu::BufferUsages::empty();
    let records = Records {
        mean: context.buffer_of("mean", &[splat.mean], usage),
        shape_a: context.buffer_of("a", &[[splat.along, 0.0]], usage),
        shape_b: context.buffer_of("b", &[[splat.across, splat.level]], usage),
        color: context.words("color", 2),
        z: context.words("z", 1),
    };
    let pair_slots = context.words("slots", 6);
    let tile_ranges = context.buffer_of("ranges", &[0u32, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6], usage);
    let masks = context.buffer_of("masks", &[255u8; PIXELS.next_multiple_of(4)], usage);
    let votes = context.words("votes", 4);
    let lists = Listed { records: &records, pair_slots: &pair_slots, tile_ranges: &tile_ranges };
    let targets = Targets { votes: Some((&masks, &votes, 1)), ..Targets::default() };
    let blending = Blending { lists, size: SIZE, slots: 1, targets };
    let kernels = BlendKernels::default();
    let blender = Blender::new(&context, &kernels, &blending).unwrap();
    let sum = |words: &[u32]| u64::from(words[0]) | u64::from(words[1]) << 32;
    context.run(|pass| blender.encode(pass));
    let once = context.read::<u32>(&votes, 4).unwrap();
    assert!(sum(&once) > 60_000_000, "{once:?}");
    for _ in 0..99 {
        context.run(|pass| blender.encode(pass));
    }
    let all = context.read::<u32>(&votes, 4).unwrap();
    assert_eq!([sum(&all), sum(&all[2..])], [100 * sum(&once), 100 * sum(&once[2..])]);
    assert!(all[1] > 0 && all[3] > 100, "{all:?}");
}
