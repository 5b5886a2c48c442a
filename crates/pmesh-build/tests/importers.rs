//! Every format and its quirks; and damaged files, which are errors that name the place, never a panic.

use pmesh_build::BuildError;
use pmesh_build::import::{Model, import};
use proptest::prelude::*;

fn read(name: &str, bytes: &[u8]) -> Model {
    import(name, bytes, &mut |_| None).unwrap_or_else(|e| panic!("{name}: {e}"))
}
fn fails(name: &str, bytes: &[u8]) -> String {
    import(name, bytes, &mut |_| None).err().unwrap_or_else(|| panic!("{name} is read")).to_string()
}

const OBJ: &str = "# a square, a triangle, and a vertex that nothing uses\nmtllib x.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 1 1 1\nv 9 9 9 0 0 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1 4/4/1\nf -5/2/1 -4/3/1 -3/1/1\nl 1 2\n";

#[test]
fn obj_polygons_wedges_negative_indices_colours_and_unused_vertices() {
    let model = read("a.obj", OBJ.as_bytes());
    let mesh = &model.mesh;
    assert_eq!(mesh.triangles.len(), 3);
    assert_eq!(mesh.triangles[..2], [[0, 1, 2], [0, 2, 3]]);
    // Five positions, and three wedges for the second face's other texture coordinates.
    assert_eq!(mesh.vertices.len(), 8);
    assert_eq!(mesh.position_of, [(5, 0), (6, 1), (7, 2)]);
    assert_eq!(mesh.vertices.attributes.texcoords[5], [1.0, 0.0]);
    assert_eq!(mesh.vertices.attributes.colors[1], [0.0, 1.0, 0.0, 1.0]);
    assert_eq!(mesh.vertices.positions[4], [9.0; 3]);
    assert_eq!(model.warnings.len(), 2, "{:?}", model.warnings);
    assert!(fails("a.obj", b"v 0 0 0\nv 1 0 0\nf 1 2 3\n").contains("line 3"));
    assert!(fails("a.obj", b"v 0 0\n").contains("line 1"));
    assert!(fails("a.obj", b"v 0 0 nan\n").contains("not finite"));
    assert!(fails("a.obj", b"# nothing\n").contains("no vertices"));
}

#[test]
fn off_with_and_without_counts_line_colours_and_normals() {
    let plain = read("a.off", b"OFF\n# c\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    assert_eq!(plain.mesh.triangles, [[0, 1, 2]]);
    let same_line = read("a.off", b"OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 255 0 0\n");
    assert_eq!(same_line.warnings.len(), 1);
    let colours = read("a.off", b"COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 0 255 0 255\n0 1 0 0 0 255 128\n3 0 1 2\n");
    assert_eq!(colours.mesh.vertices.attributes.colors[0], [1.0, 0.0, 0.0, 1.0]);
    let normals = read("a.off", b"NOFF\n3 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2\n");
    assert_eq!(normals.mesh.vertices.attributes.normals, [[0.0, 0.0, 1.0]; 3]);
    assert!(fails("a.off", b"OFF\n3 1 0\n0 0 0\n").contains("1 of 3 vertices"));
    assert!(fails("a.off", b"OFF\n1 1 0\n0 0 0\n3 0 0 7\n").contains("line 4"));
    assert!(fails("a.off", b"OFF\n16777217 1 0\n0 0 0\n").contains("1 of 16777217 vertices"));
    assert!(fails("a.off", b"OFF\n1e3 1 0\n0 0 0\n").contains("not a count"));
}

fn ply(format: &str, body: &[u8]) -> Vec<u8> {
    let header = format!(
        "ply\nformat {format} 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty float quality\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    );
    [header.as_bytes(), body].concat()
}

fn ply_body(float: fn(f32) -> [u8; 4], int: fn(i32) -> [u8; 4]) -> Vec<u8> {
    let mut body = Vec::new();
    for (p, c) in [([0.0, 0.0, 0.0], 255), ([1.0, 0.0, 0.5], 0), ([0.0, 1.0, 0.25], 51)] {
        body.extend(p.map(float).concat());
        body.extend([c, 0, 0]);
        body.extend(float(7.0));
    }
    body.push(3);
    body.extend([0, 1, 2].map(int).concat());
    body
}

#[test]
fn ply_in_all_three_encodings_is_the_same() {
    let ascii = ply("ascii", b"0 0 0 255 0 0 7\n1 0 0.5 0 0 0 7\n0 1 0.25 51 0 0 7\n3 0 1 2\n");
    let little = ply("binary_little_endian", &ply_body(f32::to_le_bytes, i32::to_le_bytes));
    let big = ply("binary_big_endian", &ply_body(f32::to_be_bytes, i32::to_be_bytes));
    let models = [ascii, little, big].map(|bytes| read("a.ply", &bytes));
    assert_eq!(models[0].mesh.triangles, [[0, 1, 2]]);
    assert_eq!(models[0].mesh.vertices.attributes.colors[2], [0.2, 0.0, 0.0, 1.0]);
    assert!(models[0].warnings[0].contains("quality"));
    assert_eq!(models[0].mesh, models[1].mesh);
    assert_eq!(models[0].mesh, models[2].mesh);
}

#[test]
fn ply_strips_turn_every_second_triangle() {
    let text = b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n9 0 1 2 3 -1 3 2 1 -1\n";
    assert_eq!(read("a.ply", text).mesh.triangles, [[0, 1, 2], [2, 1, 3], [3, 2, 1]]);
    assert!(fails("a.ply", b"ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\nend_header\n0\n").contains("ine"));
}

#[test]
fn stl_corners_at_one_point_are_one_vertex() {
    let ascii = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nfacet normal 0 0 1\nouter loop\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
    let model = read("a.stl", ascii);
    assert_eq!((model.mesh.vertices.len(), model.mesh.triangles.len()), (4, 2));
    let mut binary = vec![0u8; 80];
    binary.extend(2u32.to_le_bytes());
    for t in &model.mesh.triangles {
        binary.extend([0u8; 12]);
        t.iter().for_each(|&v| binary.extend(model.mesh.vertices.positions[v as usize].map(f32::to_le_bytes).concat()));
        binary.extend([0u8; 2]);
    }
    assert_eq!(read("a.stl", &binary).mesh, model.mesh);
    binary.truncate(150);
    assert!(fails("a.stl", &binary).contains("triangle 1"));
    let mut lying = vec![0u8; 80];
    lying.extend(u32::MAX.to_le_bytes());
    assert!(fails("a.stl", &lying).contains("triangle 0"));
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::new();
    for chunk in bytes.chunks(3) {
        let n = chunk.iter().fold(0u32, |n, &b| n << 8 | u32::from(b)) << (8 * (3 - chunk.len()));
        for i in 0..4 {
            out.push(if i <= chunk.len() { DIGITS[(n >> (18 - 6 * i) & 63) as usize] as char } else { '=' });
        }
    }
    out
}

/// A triangle with normals, used by two nodes: one moved by (10, 0, 0), its child mirrored in x.
fn gltf(view_length: usize) -> String {
    let mut buffer = Vec::new();
    for p in [[0f32, 0., 0.], [1., 0., 0.], [0., 1., 0.]] {
        buffer.extend(p.map(f32::to_le_bytes).concat());
    }
    for _ in 0..3 {
        buffer.extend([0f32, 0., 1.].map(f32::to_le_bytes).concat());
    }
    buffer.extend([0u16, 1, 2, 0].map(u16::to_le_bytes).concat());
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
        "nodes":[{{"mesh":0,"translation":[10,0,0],"children":[1]}},{{"mesh":0,"scale":[-1,1,1]}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[1,0,0,1]}}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"NORMAL":1}},"indices":2,"material":0}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},
        {{"bufferView":0,"byteOffset":36,"componentType":5126,"count":3,"type":"VEC3"}},
        {{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":{view_length}}},{{"buffer":0,"byteOffset":72,"byteLength":8}}],
        "buffers":[{{"byteLength":80,"uri":"data:application/octet-stream;base64,{}"}}]}}"#,
        base64(&buffer)
    )
}

#[test]
fn gltf_nodes_stand_where_their_transforms_put_them() {
    let model = read("a.gltf", gltf(72).as_bytes());
    let mesh = &model.mesh;
    assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (6, 2));
    assert_eq!(mesh.vertices.positions[1], [11.0, 0.0, 0.0]);
    assert_eq!(mesh.vertices.positions[4], [9.0, 0.0, 0.0]);
    assert_eq!(mesh.triangles[1], [3, 5, 4], "a mirrored node turns its triangles");
    assert_eq!(mesh.vertices.attributes.normals, [[0.0, 0.0, 1.0]; 6]);
    assert_eq!(mesh.vertices.attributes.colors[0], [1.0, 0.0, 0.0, 1.0]);
    assert!(fails("a.gltf", gltf(71).as_bytes()).contains("accessor 1"));
    assert!(fails("a.gltf", gltf(7200).as_bytes()).contains("buffer view 0"));
    assert!(fails("a.gltf", gltf(72).replace("data:application/octet-stream;base64,", "x.bin?").as_bytes()).contains("x.bin"));
    assert!(fails("a.gltf", gltf(72).replace("\"count\":3", "\"count\":4000000000").as_bytes()).contains("accessor"));
    assert!(fails("a.gltf", gltf(72).replace("\"NORMAL\":1", "\"COLOR_0\":2").as_bytes()).contains("accessor 2"));
    let many = (0..40).map(|i| format!("{{\"mesh\":0,\"children\":[{}]}},", i + 1)).collect::<String>();
    let nodes = format!("\"nodes\":[{many}{{\"mesh\":0}}],\"unused\":[");
    assert_eq!(read("a.gltf", gltf(72).replace("\"nodes\":[{", &format!("{nodes}{{")).as_bytes()).mesh.triangles.len(), 41);
    // This one made the library's validation panic.
    assert!(fails("a.gltf", gltf(72).replace("\"POSITION\":0", "\"POSITION\":77").as_bytes()).contains("accessor 77"));
    assert!(fails("a.gltf", gltf(72).replace("\"children\":[1]", "\"children\":[1,0]").as_bytes()).contains("parents"));
}

#[test]
fn an_unknown_format_is_named_with_what_is_read() {
    let error = import("a.xyz", b"hello", &mut |_| None).expect_err("unknown");
    assert!(matches!(error, BuildError::UnknownFormat { .. }));
    assert!(error.to_string().contains("OBJ, PLY, STL, OFF, glTF and GLB"));
}

fn corpus() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("a.obj", OBJ.as_bytes().to_vec()),
        ("a.off", b"COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 0 255 0 255\n0 1 0 0 0 255 128\n3 0 1 2\n".to_vec()),
        ("a.ply", ply("ascii", b"0 0 0 255 0 0 7\n1 0 0.5 0 0 0 7\n0 1 0.25 51 0 0 7\n3 0 1 2\n")),
        ("a.ply", ply("binary_little_endian", &ply_body(f32::to_le_bytes, i32::to_le_bytes))),
        (
            "a.stl",
            b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n"
                .to_vec(),
        ),
        ("a.gltf", gltf(72).into_bytes()),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(5000))]
    #[test]
    fn damaged_files_never_panic(
        which in 0usize..6,
        changes in prop::collection::vec((any::<prop::sample::Index>(), prop::sample::select(b"0123456789-.eE{}[]\",: \n\xff\x00#/".to_vec())), 0..8),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let (name, mut bytes) = corpus().swap_remove(which);
        for (i, byte) in changes {
            let i = i.index(bytes.len());
            bytes[i] = byte;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        if let Ok(model) = import(name, &bytes, &mut |_| None) {
            prop_assert!(model.mesh.check().is_ok());
        }
    }
}
