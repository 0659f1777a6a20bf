// Gaussians to splats, in place; those that no pixel sees get z = 0.
//
// In: a page of a cloud, of which `job` draws some; hidden bits, subset and tint where the flags say so; a bent cage (DEFORM).
// Out: by slot `mean` in pixels, `shape_a` (along, shear), `shape_b` (across, level), `color` (half floats red, green | blue, 0)
// and `z` (camera z, 0: culled; nothing else is written then).
// Groups of BLOCK threads, a thread per Gaussian. CPU twin: cpu/project.rs; slow twin: `project_slow` in gpu/project.rs.

struct Job {
    // Rows map the cloud's space to camera space; w: the cloud's origin in camera space.
    row_x: vec4<f32>,
    row_y: vec4<f32>,
    row_z: vec4<f32>,
    // In the cloud's space: the camera's centre, or (flag PARALLEL) the viewing direction.
    camera: vec3<f32>,
    near: f32,
    focal: vec2<f32>,
    center: vec2<f32>,
    // Least and largest x / z, then y / z, for which the projection is linearised.
    limits: vec4<f32>,
    // Of the picture, in pixels.
    size: vec2<f32>,
    flags: u32,
    sh_degree: u32,
    // Of the first thread.
    first_slot: u32,
    // Threads with a Gaussian.
    count: u32,
    // Position of the first thread's Gaussian: in the subset where there is one, else in the cloud.
    first: u32,
    // Id of the page's first Gaussian.
    page_first: u32,
}

@group(0) @binding(0) var<uniform> job: Job;
// Blocks of BLOCK Gaussians, each word of all of them together: word w of Gaussian i is at (i / BLOCK * WORDS + w) * BLOCK + i % BLOCK.
@group(0) @binding(1) var<storage, read> cloud: array<u32>;
// A bit per Gaussian of the cloud.
@group(0) @binding(2) var<storage, read> hidden: array<u32>;
// Ids, rising.
@group(0) @binding(3) var<storage, read> subset: array<u32>;
// Red, green, blue and strength per Gaussian of the cloud, a byte each.
@group(0) @binding(4) var<storage, read> tint: array<u32>;
@group(0) @binding(5) var<storage, read_write> mean: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> shape_a: array<vec2<f32>>;
@group(0) @binding(7) var<storage, read_write> shape_b: array<vec2<f32>>;
@group(0) @binding(8) var<storage, read_write> color: array<vec2<u32>>;
@group(0) @binding(9) var<storage, read_write> z: array<f32>;
//#if DEFORM
// A bent cage: its origin and the side of its cells; its cells along each axis; then four words a node, x fastest:
// displacement, and the columns of the deformation gradient; the fourth numbers are the quaternion of its rotation.
@group(0) @binding(10) var<storage, read> cage: array<vec4<f32>>;

struct Bent {
    position: vec3<f32>,
    // Columns of the gradient.
    x: vec3<f32>,
    y: vec3<f32>,
    z: vec3<f32>,
    // Of unit length.
    turn: vec4<f32>,
}

fn turned(q: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
    let t = 2.0 * cross(q.xyz, v);
    return v + q.w * t + cross(q.xyz, t);
}

// What happens at a point of the rest shape; the slow twin is `Deformation::at`.
fn bend(point: vec3<f32>) -> Bent {
    let origin = cage[0];
    let cells = cage[1].xyz;
    let at = (point - origin.xyz) / origin.w;
    let inside = clamp(at, vec3<f32>(0.0), cells);
    let cell = min(floor(inside), cells - 1.0);
    let b = inside - cell;
    let a = 1.0 - b;
    let n = vec2<u32>(cells.xy) + 1u;
    let corner = vec3<u32>(cell);
    let first = corner.x + n.x * (corner.y + n.y * corner.z);
    var moved = vec4<f32>(0.0);
    var x = vec4<f32>(0.0);
    var y = vec4<f32>(0.0);
    var z = vec4<f32>(0.0);
    for (var k = 0u; k < 8u; k++) {
        let up = vec3<bool>((k & 1u) != 0u, (k & 2u) != 0u, (k & 4u) != 0u);
        let w = select(a, b, up);
        let weight = w.x * w.y * w.z;
        let node = 2u + 4u * (first + (k & 1u) + n.x * ((k >> 1u & 1u) + n.y * (k >> 2u)));
        moved += weight * cage[node];
        x += weight * cage[node + 1u];
        y += weight * cage[node + 2u];
        z += weight * cage[node + 3u];
    }
    let q = vec4<f32>(moved.w, x.w, y.w, z.w);
    let square = dot(q, q);
    let turn = select(vec4<f32>(0.0, 0.0, 0.0, 1.0), q * inverseSqrt(max(square, 1e-12)), square > 1e-12);
    // Beyond the cage a point moves rigidly with the nearest point of it.
    let beyond = (at - inside) * origin.w;
    var position = point + moved.xyz;
    if any(beyond != vec3<f32>(0.0)) {
        position += turned(turn, beyond) - beyond;
    }
    return Bent(position, x.xyz, y.xyz, z.xyz, turn);
}
//#end

fn has(flag: u32) -> bool {
    return (job.flags & flag) != 0u;
}

// By bits, since shaders may assume that there is no NaN.
fn finite(v: f32) -> bool {
    return (bitcast<u32>(v) & 0x7f800000u) != 0x7f800000u;
}

//#if PACKED
// mean; rotation: its three smaller parts in 15 bits each and which is the largest in 2; log scales in 20 bits each; logit
// in 21 bits; then pairs of coefficients as half floats.
const GEOMETRY: u32 = PACKED_GEOMETRY;

fn words_of(degree: u32) -> u32 {
    return GEOMETRY + (((degree + 1u) * (degree + 1u) + 1u) / 2u) * 3u;
}
//#else
// mean, rotation, log scales, logit, then coefficients.
const GEOMETRY: u32 = FULL_GEOMETRY;

fn words_of(degree: u32) -> u32 {
    return GEOMETRY + (degree + 1u) * (degree + 1u) * 3u;
}
//#end

// Where word 0 of a Gaussian of the page is.
fn words_at(i: u32) -> u32 {
    return i / BLOCK * words_of(job.sh_degree) * BLOCK + i % BLOCK;
}

fn word(at: u32, w: u32) -> u32 {
    return cloud[at + w * BLOCK];
}

fn number(at: u32, w: u32) -> f32 {
    return bitcast<f32>(word(at, w));
}

struct Geometry {
    // Of unit length.
    rotation: vec4<f32>,
    log_scale: vec3<f32>,
    logit: f32,
}

//#if PACKED
fn geometry(at: u32) -> Geometry {
    let w3 = word(at, 3u);
    let w4 = word(at, 4u);
    let w5 = word(at, 5u);
    let w6 = word(at, 6u);
    var g: Geometry;
    let small = SMALL_LEAST + SMALL_STEP * vec3<f32>(f32(w3 & 0x7fffu), f32(w3 >> 15u & 0x7fffu), f32(w4 & 0x7fffu));
    let large = sqrt(max(1.0 - dot(small, small), 0.0));
    switch w3 >> 30u {
        case 0u: { g.rotation = vec4<f32>(large, small); }
        case 1u: { g.rotation = vec4<f32>(small.x, large, small.yz); }
        case 2u: { g.rotation = vec4<f32>(small.xy, large, small.z); }
        default: { g.rotation = vec4<f32>(small, large); }
    }
    let scales = vec3<f32>(f32(w5 & 0xfffffu), f32(w6 & 0xfffffu), f32(w5 >> 20u | (w6 >> 20u & 0xffu) << 12u));
    g.log_scale = LOG_SCALE_LEAST + LOG_SCALE_STEP * scales;
    g.logit = LOGIT_LEAST + LOGIT_STEP * f32(w4 >> 15u | w6 >> 28u << 17u);
    return g;
}

// A coefficient of all channels and the next: k is even.
struct Pair {
    a: vec3<f32>,
    b: vec3<f32>,
}

fn pair(at: u32, k: u32) -> Pair {
    let w = GEOMETRY + k / 2u * 3u;
    let ab = unpack2x16float(word(at, w));
    let cd = unpack2x16float(word(at, w + 1u));
    let ef = unpack2x16float(word(at, w + 2u));
    return Pair(vec3<f32>(ab, cd.x), vec3<f32>(cd.y, ef));
}

fn last(at: u32, k: u32) -> vec3<f32> {
    return pair(at, k).a;
}
//#else
fn geometry(at: u32) -> Geometry {
    var g: Geometry;
    g.rotation = vec4<f32>(number(at, 3u), number(at, 4u), number(at, 5u), number(at, 6u));
    g.log_scale = vec3<f32>(number(at, 7u), number(at, 8u), number(at, 9u));
    g.logit = number(at, 10u);
    return g;
}

struct Pair {
    a: vec3<f32>,
    b: vec3<f32>,
}

fn last(at: u32, k: u32) -> vec3<f32> {
    let w = GEOMETRY + 3u * k;
    return vec3<f32>(number(at, w), number(at, w + 1u), number(at, w + 2u));
}

fn pair(at: u32, k: u32) -> Pair {
    return Pair(last(at, k), last(at, k + 1u));
}
//#end

// sum_k c_k Y_k(d) + 0.5; d of unit length. Signs and order are INRIA's.
fn harmonics(at: u32, d: vec3<f32>) -> vec3<f32> {
    let degree = job.sh_degree;
    if degree == 0u {
        return 0.5 + 0.28209479 * last(at, 0u);
    }
    let p0 = pair(at, 0u);
    let p2 = pair(at, 2u);
    var sum = 0.5 + 0.28209479 * p0.a;
    sum += (-0.48860252 * d.y) * p0.b + (0.48860252 * d.z) * p2.a + (-0.48860252 * d.x) * p2.b;
    if degree < 2u {
        return sum;
    }
    let x2 = d.x * d.x;
    let y2 = d.y * d.y;
    let z2 = d.z * d.z;
    let xy = d.x * d.y;
    let yz = d.y * d.z;
    let xz = d.x * d.z;
    let x2_y2 = x2 - y2;
    let p4 = pair(at, 4u);
    let p6 = pair(at, 6u);
    sum += (1.0925485 * xy) * p4.a + (-1.0925485 * yz) * p4.b;
    // On the unit sphere 2z2 - x2 - y2 = 3z2 - 1, and so on below.
    sum += (0.31539157 * (3.0 * z2 - 1.0)) * p6.a + (-1.0925485 * xz) * p6.b;
    if degree < 3u {
        return sum + (0.54627424 * x2_y2) * last(at, 8u);
    }
    let three_x2_y2 = 3.0 * x2 - y2;
    let x2_three_y2 = x2 - 3.0 * y2;
    let five = 5.0 * z2 - 1.0;
    let p8 = pair(at, 8u);
    let p10 = pair(at, 10u);
    let p12 = pair(at, 12u);
    let p14 = pair(at, 14u);
    sum += (0.54627424 * x2_y2) * p8.a + (-0.5900436 * d.y * three_x2_y2) * p8.b;
    sum += (2.8906114 * xy * d.z) * p10.a + (-0.4570458 * d.y * five) * p10.b;
    sum += (0.37317634 * d.z * (5.0 * z2 - 3.0)) * p12.a + (-0.4570458 * d.x * five) * p12.b;
    sum += (1.4453057 * d.z * x2_y2) * p14.a + (-0.5900436 * d.x * x2_three_y2) * p14.b;
    if degree < 4u {
        return sum;
    }
    let seven = 7.0 * z2 - 1.0;
    let seven_three = 7.0 * z2 - 3.0;
    let p16 = pair(at, 16u);
    let p18 = pair(at, 18u);
    let p20 = pair(at, 20u);
    let p22 = pair(at, 22u);
    sum += (2.503343 * xy * x2_y2) * p16.a + (-1.7701308 * yz * three_x2_y2) * p16.b;
    sum += (0.9461747 * xy * seven) * p18.a + (-0.66904654 * yz * seven_three) * p18.b;
    sum += (0.10578555 * (z2 * (35.0 * z2 - 30.0) + 3.0)) * p20.a + (-0.66904654 * xz * seven_three) * p20.b;
    sum += (0.47308735 * x2_y2 * seven) * p22.a + (-1.7701308 * xz * x2_three_y2) * p22.b;
    return sum + (0.6258357 * (x2 * x2_three_y2 - y2 * three_x2_y2)) * last(at, 24u);
}

// First and last pixel centre, in whole pixels, within the root of `square` of `mean`, a hundredth of a pixel larger.
fn bounds(mean: f32, square: f32, size: f32) -> vec2<f32> {
    let half = sqrt(max(square, 0.0)) + 0.01;
    let center = mean - 0.5;
    return vec2<f32>(max(ceil(center - half), 0.0), min(floor(center + half), size - 1.0));
}

@compute @workgroup_size(BLOCK)
fn project(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let n = folded(group) * BLOCK + thread;
    if n >= job.count {
        return;
    }
    let slot = job.first_slot + n;
    var id = job.first + n;
    if has(FLAG_SUBSET) {
        id = subset[id];
    }
    var depth = 0.0;
    if !(has(FLAG_HIDDEN) && (hidden[id / 32u] >> (id % 32u) & 1u) != 0u) {
        depth = draw(slot, id);
    }
    z[slot] = depth;
}

// Writes the splat of a Gaussian; its depth, or 0 where no pixel sees it.
fn draw(slot: u32, id: u32) -> f32 {
    let at = words_at(id - job.page_first);
    // Gaussians that cannot be drawn were marked when the cloud was copied here.
    if word(at, 0u) == DEAD {
        return 0.0;
    }
    let rest = vec3<f32>(number(at, 0u), number(at, 1u), number(at, 2u));
//#if DEFORM
    let bent = bend(rest);
    let m = bent.position;
//#else
    let m = rest;
//#end
    let x = dot(job.row_x.xyz, m) + job.row_x.w;
    let y = dot(job.row_y.xyz, m) + job.row_y.w;
    let depth = dot(job.row_z.xyz, m) + job.row_z.w;
    if !(depth > job.near) || !finite(x) || !finite(y) || !finite(depth) {
        return 0.0;
    }
    let g = geometry(at);

    // Where the mean is, and the projection linearised there.
    let parallel = has(FLAG_PARALLEL);
    let scale = select(1.0 / depth, 1.0, parallel);
    let p = vec2<f32>(x, y) * scale;
    let uv = job.focal * p + job.center;
    let slope = select(clamp(p, job.limits.xz, job.limits.yw), vec2<f32>(0.0), parallel);
    var j0 = job.focal.x * scale * (job.row_x.xyz - slope.x * job.row_z.xyz);
    var j1 = job.focal.y * scale * (job.row_y.xyz - slope.y * job.row_z.xyz);
//#if DEFORM
    // A row times F S F^T is one times F, seen by the Gaussian at rest.
    j0 = vec3<f32>(dot(bent.x, j0), dot(bent.y, j0), dot(bent.z, j0));
    j1 = vec3<f32>(dot(bent.x, j1), dot(bent.y, j1), dot(bent.z, j1));
//#end

    // Both rows of the Jacobian in the Gaussian's own axes, times its scales: the covariance is their products.
    let q = g.rotation;
    let q2 = q.xyz + q.xyz;
    let squares = q.xyz * q2;
    let xy = q.x * q2.y;
    let xz = q.x * q2.z;
    let yz = q.y * q2.z;
    let w = q.w * q2;
    let axis_x = vec3<f32>(1.0 - (squares.y + squares.z), xy + w.z, xz - w.y);
    let axis_y = vec3<f32>(xy - w.z, 1.0 - (squares.x + squares.z), yz + w.x);
    let axis_z = vec3<f32>(xz + w.y, yz - w.x, 1.0 - (squares.x + squares.y));
    let sigma = exp2(min(g.log_scale * LOG2_E, vec3<f32>(40.0)));
    var p0 = sigma * vec3<f32>(dot(axis_x, j0), dot(axis_y, j0), dot(axis_z, j0));
    var p1 = sigma * vec3<f32>(dot(axis_x, j1), dot(axis_y, j1), dot(axis_z, j1));
    let shrink = sqrt(min(1.0, LARGEST_VARIANCE / max(max(dot(p0, p0), dot(p1, p1)), 1.0)));
    p0 *= shrink;
    p1 *= shrink;
    let a0 = dot(p0, p0);
    let b = dot(p0, p1);
    let c0 = dot(p1, p1);
    // Lagrange's identity: a c - b^2 without the cancellation.
    let normal = cross(p0, p1);
    let det0 = dot(normal, normal);
    let a = a0 + LOW_PASS;
    let c = c0 + LOW_PASS;
    let det = LOW_PASS * (a0 + c0) + LOW_PASS * LOW_PASS + det0;
    if !(det > 0.0) || !finite(det) {
        return 0.0;
    }

    // log2 of the opacity, compensated for the low-pass where the file was trained so.
    var level = -log2(1.0 + exp2(min(-g.logit * LOG2_E, 127.0)));
    if has(FLAG_ANTIALIASED) {
        level += 0.5 * log2(max(det0 / det, 1e-30));
    }
    let reach = level + LEVELS;
    if !(reach >= 0.0) {
        return 0.0;
    }

    // The box of the ellipse on which alpha is 1/255.
    let k = reach * (2.0 * LN_2);
    let across = bounds(uv.x, k * a, job.size.x);
    let down = bounds(uv.y, k * c, job.size.y);
    if !(across.y >= across.x) || !(down.y >= down.x) {
        return 0.0;
    }

    mean[slot] = uv;
    shape_a[slot] = vec2<f32>(sqrt(0.5 * LOG2_E * (c / det)), b / c);
    shape_b[slot] = vec2<f32>(sqrt(0.5 * LOG2_E / c), level);
    if has(FLAG_COLOR) {
        var seen = job.camera;
        if !parallel {
            let d = m - job.camera;
            seen = d * inverseSqrt(max(dot(d, d), 1e-30));
        }
//#if DEFORM
        seen = turned(vec4<f32>(-bent.turn.xyz, bent.turn.w), seen);
//#end
        var rgb = clamp(harmonics(at, seen), vec3<f32>(0.0), vec3<f32>(BRIGHTEST));
        if has(FLAG_TINT) {
            let over = unpack4x8unorm(tint[id]);
            rgb = mix(rgb, over.rgb, over.a);
        }
        color[slot] = vec2<u32>(pack2x16float(rgb.rg), pack2x16float(vec2<f32>(rgb.b, 0.0)));
    }
    return depth;
}
