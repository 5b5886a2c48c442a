//! Conformance items of patch-coloured streams (FC01): G.16, G.18, named after them. G.15 is a unit test of the codec.

mod common;

use common::soup;
use pmesh_build::compare::difference;
use pmesh_build::sample::sample;
use pmesh_build::simplify::{ForestOptions, PatchOptions, collapse_forests, remove_patches};
use pmesh_codec::patch::{PatchStream, encode};
use pmesh_codec::pmesh::quantise;
use pmesh_codec::{Arrival, Receiver};
use pmesh_core::surface::{CanonicalOrder, NONE, Surface};
use pmesh_core::{IndexedMesh, turned};
use proptest::prelude::*;
use std::collections::{HashMap, HashSet};

fn taken_apart(mesh: &IndexedMesh, base_vertices: usize) -> PatchStream {
    remove_patches(mesh, PatchOptions { base_vertices }, |_| ())
}

fn received(bytes: &[u8], piece: usize) -> (IndexedMesh, u32) {
    let mut receiver = Receiver::default();
    bytes.chunks(piece).try_for_each(|b| receiver.push(b)).and_then(|()| receiver.finish()).expect("it decodes");
    receiver.mesh().check_invariants();
    (receiver.mesh().finest_mesh(), receiver.mesh().level_count())
}

/// The triangles of each level, coarsest first, in the numbering of the finest mesh.
fn levels(stream: &PatchStream) -> Vec<Vec<[u32; 3]>> {
    let mut now: Vec<[u32; 3]> = stream.base_triangles.iter().map(|&t| turned(t)).collect();
    let mut out = vec![now.clone()];
    for level in &stream.levels {
        let mut set: HashSet<[u32; 3]> = now.iter().copied().collect();
        for r in &level.removed {
            let rim: Vec<u32> = std::iter::once(r.apex).chain(r.chain.iter().copied()).collect();
            r.chain.windows(2).for_each(|w| assert!(set.remove(&turned([r.apex, w[0], w[1]]))));
            (0..rim.len()).for_each(|k| assert!(set.insert(turned([r.vertex, rim[k], rim[(k + 1) % rim.len()]]))));
        }
        now = set.into_iter().collect();
        out.push(now.clone());
    }
    out
}

#[test]
fn g16_patches_are_independent_coloured_apart_and_found_again() {
    for (name, base) in [("knot", 100), ("part", 0), ("marble", 2000)] {
        let mut mesh = quantise(&sample(name).expect("it is built in").mesh, Some(12));
        mesh.vertices.attributes = Default::default();
        mesh.position_of.clear();
        let stream = taken_apart(&mesh, base);
        assert!(stream.levels.len() > 2, "{name}");
        let all = levels(&stream);
        let mut raw = (0, 0);
        for (level, coarse) in stream.levels.iter().zip(&all) {
            // Independent: no removed vertex on another's rim.
            let gone: HashSet<u32> = level.removed.iter().map(|r| r.vertex).collect();
            assert!(level.removed.iter().all(|r| !gone.contains(&r.apex) && r.chain.iter().all(|v| !gone.contains(v))));
            // Coloured apart: triangles across an edge have one colour only if they are of one patch.
            let surface = Surface::new(coarse.clone(), mesh.vertices.len() as u32);
            let mut patch: HashMap<[u32; 3], (u8, u32)> = HashMap::new();
            for r in &level.removed {
                assert!((1..=3).contains(&r.color));
                r.chain
                    .windows(2)
                    .for_each(|w| assert!(patch.insert(turned([r.apex, w[0], w[1]]), (r.color, r.vertex)).is_none()));
            }
            for (c, &other) in surface.across.iter().enumerate().filter(|a| *a.1 != NONE) {
                let of = |c: usize| patch.get(&turned(surface.triangles[c / 3]));
                if let (Some(a), Some(b)) = (of(c), of(other as usize)) {
                    assert!(a.0 != b.0 || a.1 == b.1, "{name}: patches of {} and {}", a.1, b.1);
                }
            }
            raw.0 += 2 * coarse.len() as u64;
            raw.1 += level.removed.iter().map(|r| 2 * (r.chain.len() as u64 + 1 - 2)).sum::<u64>();
        }
        let mut bytes = Vec::new();
        let report = encode(&stream, Some(12), &mut bytes).expect("it encodes");
        // 2 bits a triangle, 2 (d - 2) a vertex of degree d.
        assert_eq!((report.color_bits, report.patch_bits), raw);
        // The patches that a decoder finds are the encoder's: the same mesh comes out, level by level as many triangles.
        for piece in [usize::MAX, 1, 777] {
            let (mesh_again, count) = received(&bytes, piece.min(bytes.len()));
            assert_eq!(difference(&mesh_again, &mesh), None, "{name}");
            assert_eq!(count as usize, all.len());
        }
    }
}

#[test]
fn g18_the_first_picture_takes_5_kilobytes() {
    for name in ["knot", "marble", "part"] {
        let model = sample(name).expect("it is built in");
        let stream = remove_patches(&quantise(&model.mesh, Some(12)), PatchOptions::default(), |_| ());
        let mut bytes = Vec::new();
        encode(&stream, Some(12), &mut bytes).expect("it encodes");
        let mut receiver = Receiver::default();
        receiver.push(&bytes[..bytes.len().min(5 * 1024)]).expect("it decodes");
        let first = std::iter::from_fn(|| receiver.poll()).any(|a| matches!(a, Arrival::Level { .. }));
        assert!(first, "{name}: no picture after 5 KB of {}", bytes.len());
    }
}

#[test]
fn levels_of_nodes_show_before_the_scene_is_whole() {
    use pmesh_codec::scene::{Encoding, write};
    let mesh = quantise(&sample("part").expect("it is built in").mesh, Some(12));
    let stream = taken_apart(&mesh, 300);
    for encoding in [Encoding::Vrml97, Encoding::X3dClassic, Encoding::X3dXml] {
        let mut text = Vec::new();
        write(&stream, encoding, &mut text).expect("it writes");
        let (mut whole, mut cut) = (Receiver::default(), Receiver::default());
        whole.push(&text).and_then(|()| whole.finish()).expect("it reads");
        let mut shown = Vec::new();
        for piece in text.chunks(777) {
            cut.push(piece).expect("it reads");
            let bytes = cut.bytes();
            shown.extend(std::iter::from_fn(|| cut.poll()).filter(|a| matches!(a, Arrival::Level { .. })).map(|_| bytes));
        }
        cut.finish().expect("it reads");
        assert!(shown.len() > 5 && shown[0] < text.len() as u64 / 4, "{encoding:?}: {shown:?} of {}", text.len());
        assert_eq!(difference(&cut.mesh().finest_mesh(), &whole.mesh().finest_mesh()), None);
        assert_eq!(cut.mesh().arrived_levels() as usize, stream.levels.len() + 1);
    }
}

#[test]
fn every_attribute_and_both_sides_of_a_seam_survive() {
    let model = sample("globe").expect("it is built in");
    for bits in [Some(12), None] {
        let mesh = quantise(&model.mesh, bits);
        let mut stream = taken_apart(&mesh, 1000);
        stream.texture = model.texture.clone();
        let mut bytes = Vec::new();
        encode(&stream, bits, &mut bytes).expect("it encodes");
        assert_eq!(difference(&received(&bytes, bytes.len()).0, &mesh), None);
    }
}

proptest! {
    #[test]
    fn any_soup_comes_back(mesh in soup(), bits in prop::option::of(8u8..=16)) {
        let mesh = quantise(&mesh, bits);
        let mut bytes = Vec::new();
        encode(&taken_apart(&mesh, 0), bits, &mut bytes).expect("it encodes");
        prop_assert_eq!(difference(&received(&bytes, 50).0, &mesh), None);
    }

    /// A decoder that is given any bytes in a valid frame ends with an error or a valid mesh.
    #[test]
    fn no_block_makes_it_panic_or_swell(noise in prop::collection::vec(any::<u8>(), 1..300), at in 0usize..3, kind in 0usize..3) {
        use pmesh_codec::pmesh::header::{Block, BlockKind, Container, Header};
        let mut mesh = quantise(&sample("tetrahedra").expect("it is built in").mesh, Some(12));
        mesh.position_of.clear();
        let mut good = Vec::new();
        encode(&taken_apart(&mesh, 0), Some(12), &mut good).expect("it encodes");
        let block = |payload: &[u8], v: u32, t: u32| Block {
            kind: BlockKind::Level, byte_count: payload.len() as u32, checksum: crc32(payload) & if kind == 2 { 0xffff } else { u32::MAX }, new_vertices: v, new_triangles: t, error: 0.0,
        };
        let counts = [(40, 60), (noise.len() as u32 * 30, noise.len() as u32 * 60), (3, 6)][at];
        let blocks = vec![block(&noise, counts.0, counts.1), block(&noise, 7, 14)];
        let grids = pmesh_codec::pmesh::Quantisation { position_bits: Some(12), position_step: 1.0, ..Default::default() };
        let header = Header { container: [Container::Patches, Container::Forest, Container::Compact][kind], grids, bounds: ([0.0; 3], [1.0; 3]), blocks, has_seams: at == 2, ..Default::default() };
        let file = [header.to_bytes(), noise.clone(), noise].concat();
        let mut receiver = Receiver::default();
        let _ = receiver.push(&file).and_then(|()| receiver.finish());
        receiver.mesh().check_invariants();
        prop_assert!(receiver.mesh().vertices().len() < 10_000);
    }
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes
        .iter()
        .fold(!0u32, |crc, &b| (0..8).fold(crc ^ u32::from(b), |c, _| if c & 1 != 0 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 }))
}

/// The canonical order lists every triangle once, whatever the mesh.
#[test]
fn the_canonical_order_is_a_permutation() {
    let mesh = sample("tetrahedra").expect("it is built in").mesh;
    let mut order = CanonicalOrder::of(&Surface::new(mesh.triangles.clone(), mesh.vertices.len() as u32));
    order.sort_unstable();
    assert_eq!(order, (0..mesh.triangles.len() as u32).collect::<Vec<_>>());
}

/// F.1: whatever stream a mesh went through, it comes out as it went in.
#[test]
fn every_stream_converts_to_every_other() {
    use pmesh_build::import::Model;
    use pmesh_build::pipeline::{BuildOptions, Method, Steps, build};
    use pmesh_codec::pmesh::EncodeOptions;
    use pmesh_codec::scene::{Encoding, write};
    use pmesh_codec::text::{self, TextOptions};
    use pmesh_core::ProgressiveMultilevelMesh;
    type Writer = fn(&IndexedMesh) -> Vec<u8>;
    fn levels(mesh: &IndexedMesh, method: Method, steps: Steps) -> (pmesh_codec::pmesh::LevelStream, ProgressiveMultilevelMesh) {
        let model = Model { mesh: mesh.clone(), ..Default::default() };
        let stream = build(&model, &BuildOptions { method, steps, ..Default::default() }, |_| ()).expect("it builds");
        let mut out = ProgressiveMultilevelMesh::new(Default::default());
        stream.levels.iter().for_each(|l| assert_eq!(out.add_level(l).map(drop), Ok(())));
        (stream, out)
    }
    fn bytes<E: std::fmt::Debug>(f: impl FnOnce(&mut Vec<u8>) -> Result<(), E>) -> Vec<u8> {
        let mut out = Vec::new();
        f(&mut out).expect("it writes");
        out
    }
    let writers: [(&str, Writer); 6] = [
        ("pmesh", |m| {
            let (stream, _) = levels(m, Method::Quadric, Steps::Growth(1.5));
            bytes(|out| pmesh_codec::pmesh::encode(&stream, EncodeOptions { position_bits: None }, out))
        }),
        ("lod", |m| bytes(|out| text::write(&levels(m, Method::Quadric, Steps::Count(6)).1, TextOptions::default(), out))),
        ("slod", |m| {
            let (_, mesh) = levels(m, Method::Closest, Steps::Single);
            bytes(|out| pmesh_codec::slod::encode(&mesh, out).map(drop))
        }),
        ("pits", |m| bytes(|out| encode(&taken_apart(m, 20), None, out).map(drop))),
        ("pfs", |m| {
            let stream = collapse_forests(m, ForestOptions { base_vertices: 20 }, |_| ());
            bytes(|out| pmesh_codec::split::encode(&stream, None, out).map(drop))
        }),
        ("x3d", |m| bytes(|out| write(&taken_apart(m, 20), Encoding::X3dXml, out).map(drop))),
    ];
    for name in ["knot", "tetrahedra", "part"] {
        let mut mesh = quantise(&sample(name).expect("it is built in").mesh, Some(14));
        mesh.vertices.attributes = Default::default();
        mesh.vertices.positions.iter_mut().flatten().for_each(|x| *x += 0.0);
        mesh.position_of.clear();
        for (from, first) in &writers {
            let middle = received(&first(&mesh), 4096).0;
            assert_eq!(difference(&middle, &mesh), None, "{name} by {from}");
            for (to, second) in writers.iter().filter(|w| w.0 != *from) {
                assert_eq!(difference(&received(&second(&middle), 4096).0, &mesh), None, "{name}: {from} to {to}");
            }
        }
    }
}
