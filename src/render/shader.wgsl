// Levels are selected here: each corner walks up the forest of representatives to its first ancestor inside the
// prefix of the finer level, then on to that of the coarser one, and stands between the two. Changing the level is one
// uniform write and a draw count.

struct View {
    clip_from_world: mat4x4<f32>,
    eye: vec4<f32>,
    base_color: vec4<f32>,
    // Vertices of the finer level, of the coarser, of the coarsest; texels a row.
    counts: vec4<u32>,
    flags: vec4<u32>,
    // Fraction, cosine of a crease.
    morph: vec4<f32>,
}

@group(0) @binding(0) var<uniform> view: View;
// x, y, z as float bits, colour as four bytes.
@group(0) @binding(1) var vertices: texture_2d<u32>;
// Parent and jump pointer.
@group(0) @binding(2) var forest: texture_2d<u32>;
// Octahedral normal, 16 bits a component; 0 is none.
@group(0) @binding(3) var normals: texture_2d<u32>;
// u and v as float bits.
@group(0) @binding(4) var texcoords: texture_2d<u32>;
@group(0) @binding(5) var image: texture_2d<f32>;
@group(0) @binding(6) var image_sampler: sampler;

const NO_REPRESENTATIVE: u32 = 0xffffffffu;
const GIVEN_NORMALS: u32 = 1u;
const IMAGE: u32 = 2u;
const REPRESENTATIVES: u32 = 4u;

fn texel(v: u32) -> vec2<i32> {
    return vec2<i32>(i32(v % view.counts.w), i32(v / view.counts.w));
}

// Jump pointers make the walk logarithmic in the depth; the bound is for what no check could have foreseen.
fn ancestor_below(start: u32, count: u32) -> u32 {
    var v = start;
    for (var i = 0u; i < 96u; i++) {
        if v < count {
            break;
        }
        let link = textureLoad(forest, texel(v), 0).xy;
        if link.x == NO_REPRESENTATIVE {
            break;
        }
        v = select(link.x, link.y, link.y >= count);
    }
    return v;
}

fn unpack_color(packed: u32) -> vec4<f32> {
    return vec4<f32>(f32(packed & 255u), f32((packed >> 8u) & 255u), f32((packed >> 16u) & 255u), f32(packed >> 24u)) / 255.0;
}

fn unpack_normal(packed: u32) -> vec3<f32> {
    let e = vec2<f32>(f32(packed & 65535u), f32(packed >> 16u)) / 32767.0 - 1.0;
    let z = 1.0 - abs(e.x) - abs(e.y);
    let fold = max(-z, 0.0);
    let folded = e - vec2<f32>(select(-fold, fold, e.x >= 0.0), select(-fold, fold, e.y >= 0.0));
    return normalize(vec3<f32>(folded, z));
}

struct Varying {
    @builtin(position) clip: vec4<f32>,
    @location(0) world: vec3<f32>,
    // Zero where the vertex has none.
    @location(1) normal: vec3<f32>,
    @location(2) color: vec4<f32>,
    @location(3) texcoord: vec2<f32>,
    @location(4) @interpolate(flat, either) root: u32,
}

fn morphed(index: u32) -> Varying {
    let fine = ancestor_below(index, view.counts.x);
    let coarse = ancestor_below(fine, view.counts.y);
    let t = view.morph.x;
    var out: Varying;
    let a = textureLoad(vertices, texel(fine), 0);
    let b = textureLoad(vertices, texel(coarse), 0);
    out.world = mix(bitcast<vec3<f32>>(a.xyz), bitcast<vec3<f32>>(b.xyz), t);
    out.color = mix(unpack_color(a.w), unpack_color(b.w), t);
    let na = textureLoad(normals, texel(fine), 0).x;
    let nb = textureLoad(normals, texel(coarse), 0).x;
    out.normal = vec3<f32>(0.0);
    if na != 0u && nb != 0u {
        out.normal = mix(unpack_normal(na), unpack_normal(nb), t);
    }
    out.texcoord = vec2<f32>(0.0);
    if (view.flags.x & IMAGE) != 0u {
        let ta = textureLoad(texcoords, texel(fine), 0).xy;
        let tb = textureLoad(texcoords, texel(coarse), 0).xy;
        out.texcoord = mix(bitcast<vec2<f32>>(ta), bitcast<vec2<f32>>(tb), t);
    }
    out.root = 0u;
    if (view.flags.x & REPRESENTATIVES) != 0u {
        out.root = ancestor_below(coarse, view.counts.z);
    }
    out.clip = view.clip_from_world * vec4<f32>(out.world, 1.0);
    return out;
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> Varying {
    return morphed(index);
}

// Lines stand a little in front of the faces they bound.
@vertex
fn line_vertex(@builtin(vertex_index) index: u32) -> Varying {
    var out = morphed(index);
    out.clip.z -= 0.0004 * out.clip.w;
    return out;
}

fn hash_color(id: u32) -> vec3<f32> {
    var h = id * 2654435761u;
    h = (h ^ (h >> 15u)) * 2246822519u;
    h = h ^ (h >> 13u);
    return vec3<f32>(f32(h & 255u), f32((h >> 8u) & 255u), f32((h >> 16u) & 255u)) / 255.0 * 0.7 + 0.25;
}

fn shade(normal: vec3<f32>, to_eye: vec3<f32>, albedo: vec3<f32>) -> vec3<f32> {
    // A key light over the viewer's left shoulder, a fill from the right, sky and ground.
    let right = normalize(cross(vec3<f32>(0.0, 1.0, 0.0), to_eye) + vec3<f32>(1e-6, 0.0, 0.0));
    let up = cross(to_eye, right);
    let key = normalize(to_eye - 0.75 * right + 0.85 * up);
    let fill = normalize(0.4 * to_eye + right + 0.1 * up);
    let sky = mix(vec3<f32>(0.22, 0.20, 0.19), vec3<f32>(0.40, 0.43, 0.48), normal.y * 0.5 + 0.5);
    let light = sky + vec3<f32>(0.68, 0.66, 0.62) * max(dot(normal, key), 0.0) + vec3<f32>(0.12, 0.13, 0.16) * max(dot(normal, fill), 0.0);
    let shine = pow(max(dot(normal, normalize(key + to_eye)), 0.0), 48.0) * 0.12;
    return albedo * light + vec3<f32>(shine);
}

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    // Derivatives first: they are undefined after branches that differ from pixel to pixel.
    let across = cross(dpdx(in.world), dpdy(in.world));
    let sampled = textureSample(image, image_sampler, in.texcoord);
    let to_eye = normalize(view.eye.xyz - in.world);
    var face = normalize(across + vec3<f32>(0.0, 0.0, 1e-30));
    face = select(-face, face, dot(face, to_eye) >= 0.0);
    var normal = face;
    if dot(in.normal, in.normal) > 1e-6 {
        var smooth_normal = normalize(in.normal);
        // Both sides are lit.
        smooth_normal = select(-smooth_normal, smooth_normal, dot(smooth_normal, face) >= 0.0);
        // Softly, since the smooth normal varies within a face and the other does not.
        let along = smoothstep(view.morph.y - 0.15, view.morph.y + 0.15, dot(smooth_normal, face));
        let smoothness = select(along, 1.0, (view.flags.x & GIVEN_NORMALS) != 0u);
        normal = normalize(mix(face, smooth_normal, smoothness));
    }
    var albedo = in.color.rgb * view.base_color.rgb;
    if (view.flags.x & IMAGE) != 0u {
        albedo *= sampled.rgb;
    }
    if (view.flags.x & REPRESENTATIVES) != 0u {
        albedo = hash_color(in.root);
    }
    return vec4<f32>(shade(normal, to_eye, albedo), 1.0);
}

@fragment
fn line_fragment(in: Varying) -> @location(0) vec4<f32> {
    return vec4<f32>(0.02, 0.05, 0.09, 1.0);
}
