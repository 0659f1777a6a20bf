// Camera z of the meshes drawn before the splats, per pixel of the viewport: what hides a Gaussian.
//
// Input: the camera's depth (1 near, 0 nothing). Output: camera z, 3.4e38 where there is nothing. Of several samples the
// farthest counts: splats seen past a mesh's edge are drawn, and the composite tests each sample. Workgroup: 8x8 pixels.
// CPU twin: `read_back::limits`.

struct Limit {
    // Rows of the matrix from clip space to the view's camera space that give z and w.
    z_row: vec4<f32>,
    w_row: vec4<f32>,
    // Top left pixel of the viewport in the target, and its size.
    corner: vec2<i32>,
    size: vec2<i32>,
}

@group(0) @binding(0) var<uniform> limit: Limit;
#ifdef MULTISAMPLED
@group(0) @binding(1) var depth: texture_depth_multisampled_2d;
#else
@group(0) @binding(1) var depth: texture_depth_2d;
#endif
@group(0) @binding(2) var nearest: texture_storage_2d<r32float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let p = vec2<i32>(id.xy);
    if any(p >= limit.size) {
        return;
    }
    let at = p + limit.corner;
#ifdef MULTISAMPLED
    var d = 1.0;
    for (var sample = 0; sample < i32(textureNumSamples(depth)); sample++) {
        d = min(d, textureLoad(depth, at, sample));
    }
#else
    let d = textureLoad(depth, at, 0);
#endif
    var z = 3.4e38;
    if d > 0.0 {
        let ndc = (vec2<f32>(p) + 0.5) / vec2<f32>(limit.size) * vec2(2.0, -2.0) + vec2(-1.0, 1.0);
        let clip = vec4(ndc, d, 1.0);
        z = dot(limit.z_row, clip) / dot(limit.w_row, clip);
    }
    textureStore(nearest, p, vec4(z, 0.0, 0.0, 0.0));
}
