// Puts drawn splats over a camera's picture, and their depth into its depth.
//
// Inputs: the splats' picture (premultiplied, sRGB-encoded) and depth (camera z), both of the viewport's size; a copy of
// what was drawn before, where it is not the clear colour alone. Output: the camera's colour target, in its own space.
// Blending is in display space, as in training: `splats + T * encode(background)`, decoded once.

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput
#import bevy_render::color_operations::{srgb_to_linear, linear_to_srgb, oklab_to_linear_rgb, linear_rgb_to_oklab}

struct Composite {
    // Rows of the matrix from the view's camera space to clip space that give depth and w.
    depth_row: vec4<f32>,
    w_row: vec4<f32>,
    // fx, fy, cx, cy.
    intrinsics: vec4<f32>,
    // sRGB-encoded, straight alpha.
    background: vec4<f32>,
    outline: vec4<f32>,
    // Top left pixel of the viewport in the target.
    corner: vec2<i32>,
    size: vec2<i32>,
    outline_width: i32,
    perspective: u32,
}

@group(0) @binding(0) var<uniform> composite: Composite;
@group(0) @binding(1) var splats: texture_2d<f32>;
@group(0) @binding(2) var splat_depth: texture_2d<f32>;
@group(0) @binding(3) var backdrop: texture_2d<f32>;
// Selected weight per pixel, row by row.
@group(0) @binding(4) var<storage, read> selected: array<f32>;

fn encode(color: vec3<f32>) -> vec3<f32> {
#ifdef SPACE_LINEAR
    return linear_to_srgb(color);
#else ifdef SPACE_OKLAB
    return linear_to_srgb(oklab_to_linear_rgb(color));
#else
    return color;
#endif
}

fn decode(color: vec3<f32>) -> vec3<f32> {
#ifdef SPACE_LINEAR
    return srgb_to_linear(color);
#else ifdef SPACE_OKLAB
    return linear_rgb_to_oklab(srgb_to_linear(color));
#else
    return color;
#endif
}

// Selected weight beside a pixel: how much of the outline it gets.
fn outline_at(p: vec2<i32>) -> f32 {
    let size = composite.size;
    if selected[p.y * size.x + p.x] >= 0.5 {
        return 0.0;
    }
    let reach = composite.outline_width;
    for (var y = -reach; y <= reach; y++) {
        for (var x = -reach; x <= reach; x++) {
            let near = clamp(p + vec2(x, y), vec2(0), size - 1);
            if x * x + y * y <= reach * reach && selected[near.y * size.x + near.x] >= 0.5 {
                return composite.outline.a;
            }
        }
    }
    return 0.0;
}

// The splats' pixel, the outline over it.
fn drawn(p: vec2<i32>) -> vec4<f32> {
    let color = textureLoad(splats, p, 0);
#ifdef OUTLINE
    let line = outline_at(p);
    return mix(color, vec4(composite.outline.rgb, 1.0), line);
#else
    return color;
#endif
}

fn over(color: vec4<f32>, p: vec2<i32>) -> vec4<f32> {
#ifdef FIXED_FUNCTION
    return color;
#else
#ifdef READ_BACKDROP
    let behind = textureLoad(backdrop, p, 0);
    let back = vec4(encode(behind.rgb), behind.a);
#else
    let back = composite.background;
#endif
    let rest = (1.0 - color.a) * back.a;
    let alpha = color.a + rest;
    return vec4(decode((color.rgb + rest * back.rgb) / max(alpha, 1e-6)), alpha);
#endif
}

// Bevy's depth of the splats at a pixel, or `none` where they do not become half opaque.
fn depth_at(p: vec2<i32>, none: f32) -> f32 {
    let z = textureLoad(splat_depth, p, 0).x;
    if !(z < 1e37) {
        return none;
    }
    let slope = (vec2<f32>(p) + 0.5 - composite.intrinsics.zw) / composite.intrinsics.xy;
    let point = vec4(slope * select(1.0, z, composite.perspective != 0u), z, 1.0);
    return clamp(dot(composite.depth_row, point) / dot(composite.w_row, point), 0.0, 1.0);
}

@fragment
fn color(in: FullscreenVertexOutput) -> @location(0) vec4<f32> {
    let p = vec2<i32>(in.position.xy) - composite.corner;
    let color = drawn(p);
    if color.a <= 0.0 {
        discard;
    }
    return over(color, p);
}

struct Tested {
    @location(0) color: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

// For several samples a pixel: those at which a mesh is nearer keep the mesh.
@fragment
fn color_tested(in: FullscreenVertexOutput) -> Tested {
    let p = vec2<i32>(in.position.xy) - composite.corner;
    let color = drawn(p);
    if color.a <= 0.0 {
        discard;
    }
    return Tested(over(color, p), depth_at(p, 1.0));
}

@fragment
fn depth(in: FullscreenVertexOutput) -> @builtin(frag_depth) f32 {
    let p = vec2<i32>(in.position.xy) - composite.corner;
    let depth = depth_at(p, -1.0);
    if depth < 0.0 {
        discard;
    }
    return depth;
}
