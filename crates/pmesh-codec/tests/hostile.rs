//! Any cut of the input gives the same levels or the same error; no input panics, hangs or swells.

use pmesh_codec::pmesh::{EncodeOptions, LevelStream, encode};
use pmesh_codec::text::{self, TextOptions, TextVariant};
use pmesh_codec::{DecodeError, Place, Receiver};
use pmesh_core::{AttributeSet, CornerMove, IndexedMesh, Level, MovedVertices, ProgressiveMultilevelMesh, Vertices};
use proptest::prelude::*;
use std::io::Write;

/// A fan that grows by a vertex a level; colours, a seam, a move.
fn stream() -> LevelStream {
    let vertices = |p: &[[f32; 3]]| {
        let mut v = Vertices { positions: p.to_vec(), ..Default::default() };
        v.attributes.colors = p.iter().map(|p| [p[0].abs() % 1.0, 0.5, 0.25, 1.0]).collect();
        v
    };
    let coarse = Level {
        vertices: vertices(&[[0., 0., 0.], [4., 0., 0.], [0., 4., 0.], [0., 0., 0.]]),
        triangles: vec![[0, 1, 2]],
        position_of: vec![(3, 0)],
        ..Default::default()
    };
    let middle = Level {
        vertices: vertices(&[[3., 3., 0.]]),
        triangles: vec![[1, 4, 2]],
        representatives: vec![(4, 1)],
        moved: MovedVertices { ids: vec![2], values: vertices(&[[0., 4., 1.]]) },
        ..Default::default()
    };
    let fine = Level {
        vertices: vertices(&[[2., 1., 0.]]),
        triangles: vec![[0, 1, 5], [1, 4, 5], [4, 4, 1]],
        representatives: vec![(5, 1)],
        corner_moves: vec![CornerMove { triangle: 0, corner: 1, vertex: 5 }],
        ..Default::default()
    };
    let attribute_set = AttributeSet { colors: true, ..Default::default() };
    LevelStream { attribute_set, levels: vec![coarse, middle, fine], errors: vec![2.0, 1.0, 0.0], texture: None }
}

fn pmesh_file(bits: Option<u8>) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode(&stream(), EncodeOptions { position_bits: bits }, &mut bytes).expect("it encodes");
    bytes
}

fn text_file() -> Vec<u8> {
    include_bytes!("data/figure13.lod").to_vec()
}

fn slod_file() -> Vec<u8> {
    let mut receiver = Receiver::default();
    receiver.push(&text_file()).and_then(|()| receiver.finish()).expect("it reads");
    let mut bytes = Vec::new();
    pmesh_codec::slod::encode(receiver.mesh(), &mut bytes).expect("it encodes");
    bytes
}

/// A tetrahedron, a vertex on one of its sides, and one beside that.
fn patch_file() -> Vec<u8> {
    use pmesh_codec::patch::{PatchLevel, PatchStream, Removed, encode};
    let positions = vec![[0., 0., 0.], [4., 0., 0.], [0., 4., 0.], [0., 0., 4.], [1., 1., -1.], [1., 2., -2.]];
    let mesh = IndexedMesh { vertices: Vertices { positions, ..Default::default() }, ..Default::default() };
    let level =
        |vertex, apex, chain: &[u32]| PatchLevel { removed: vec![Removed { vertex, apex, chain: chain.to_vec(), color: 1 }] };
    let levels = vec![level(4, 0, &[2, 1]), level(5, 4, &[0, 2, 1])];
    let base_triangles = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let mut bytes = Vec::new();
    let stream = PatchStream { mesh, base_triangles, levels, errors: vec![2.0, 1.0, 0.0], texture: None };
    encode(&stream, None, &mut bytes).expect("it encodes");
    bytes
}

/// A square of nine cells, from which two vertices go one after the other.
fn split_file() -> Vec<u8> {
    use pmesh_codec::split::{SplitStream, encode};
    let positions = (0..16).map(|v| [(v % 4) as f32, (v / 4) as f32, 0.0]).collect();
    let cell = |c: u32| {
        let a = c / 3 * 4 + c % 3;
        [[a, a + 1, a + 5], [a, a + 5, a + 4]]
    };
    let vertices = Vertices { positions, ..Default::default() };
    let mesh = IndexedMesh { vertices, triangles: (0..9).flat_map(cell).collect(), ..Default::default() };
    let (mut parents, mut levels) = (vec![0; 16], vec![0; 16]);
    (parents[5], levels[5]) = (6, 2);
    (parents[9], levels[9]) = (10, 1);
    let mut bytes = Vec::new();
    let stream = SplitStream { mesh, parents, levels, errors: vec![2.0, 1.0, 0.0], texture: None };
    encode(&stream, None, &mut bytes).expect("it encodes");
    bytes
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(bytes).expect("memory");
    encoder.finish().expect("memory")
}

fn all_files() -> Vec<Vec<u8>> {
    vec![
        pmesh_file(Some(12)),
        pmesh_file(None),
        text_file(),
        gzip(&text_file()),
        gzip(&pmesh_file(None)),
        slod_file(),
        patch_file(),
        split_file(),
        compact_file(Some(12)),
        compact_file(None),
    ]
}

/// Hills of 8 × 8 vertices with texture coordinates, of which some at the boundary and inside come in two levels.
fn compact_file(bits: Option<u8>) -> Vec<u8> {
    use pmesh_codec::compact::{CompactStream, Removed, Side, encode};
    let cell = |c: u32| {
        let a = c / 7 * 8 + c % 7;
        [[a, a + 1, a + 9], [a, a + 9, a + 8]]
    };
    let mut mesh = IndexedMesh { triangles: (0..49).flat_map(cell).collect(), ..Default::default() };
    mesh.vertices.positions = (0..64).map(|v| [(v % 8) as f32, (v / 8) as f32, (v * v % 7) as f32 * 0.3]).collect();
    mesh.vertices.attributes.texcoords = (0..64).map(|v| [(v % 8) as f32 / 7.0, (v / 8) as f32 / 7.0]).collect();
    let inside = |vertex: u32| Removed {
        vertex,
        apex: vertex + 1,
        chain: vec![vertex + 9, vertex + 8, vertex - 1, vertex - 9, vertex - 8],
        side: Side::Inside,
    };
    let edge = Removed { vertex: 2, apex: 1, chain: vec![10, 11, 3], side: Side::Tail };
    let levels = vec![vec![inside(44)], vec![inside(18), inside(36), inside(22), edge]];
    let mut stands: Vec<u32> = (0..64).collect();
    levels.iter().flatten().for_each(|r: &Removed| stands[r.vertex as usize] = r.apex);
    let mut base: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(|v| stands[v as usize])).collect();
    base.retain(|[a, b, c]| a != b && b != c && c != a);
    let stream = CompactStream { mesh, base_triangles: base, levels, ..Default::default() };
    let mut bytes = Vec::new();
    encode(&stream, bits, &mut bytes).expect("it encodes");
    bytes
}

/// Levels and outcome of pushing `bytes` in pieces of the given lengths, over and over.
fn outcome(bytes: &[u8], pieces: &[usize]) -> (Vec<Vec<[u32; 3]>>, Option<String>) {
    let mut receiver = Receiver::default();
    let mut rest = bytes;
    let mut error = None;
    for &n in pieces.iter().cycle() {
        let (now, later) = rest.split_at(n.max(1).min(rest.len()));
        if let Err(e) = receiver.push(now) {
            error = Some(e);
            break;
        }
        rest = later;
        if rest.is_empty() {
            error = receiver.finish().err();
            break;
        }
    }
    while receiver.poll().is_some() {}
    let mesh = receiver.mesh();
    mesh.check_invariants();
    let levels = (mesh.finest_level()..mesh.level_count()).map(|l| mesh.triangles_at(l).expect("it has arrived"));
    // The place of a mesh error is where its push ended: the kind is what must agree.
    (levels.collect(), error.map(|e| e.code().to_string()))
}

#[test]
fn every_truncation_is_a_valid_mesh_and_says_that_it_is_truncated() {
    for file in all_files() {
        let (whole, error) = outcome(&file, &[file.len()]);
        assert_eq!(error, None);
        for n in 0..file.len() {
            let (levels, error) = outcome(&file[..n], &[n]);
            assert!(levels.len() <= whole.len());
            let coarse: Vec<_> = levels.iter().rev().collect();
            let expected: Vec<_> = whole.iter().rev().take(levels.len()).collect();
            if error.is_none() {
                // Only a text stream may end between levels.
                assert!(file.len() != pmesh_file(None).len(), "byte {n}");
            }
            // Coarser levels of a stream that is not whole may be numbered from another end, but they are the same.
            assert_eq!(coarse, expected, "byte {n}");
        }
    }
}

#[test]
fn any_cut_of_the_input_gives_the_same_levels() {
    for file in all_files() {
        let whole = outcome(&file, &[file.len()]);
        for pieces in [vec![1], vec![2], vec![7], vec![1, 100, 3], vec![16_384]] {
            assert_eq!(outcome(&file, &pieces), whole);
        }
    }
}

#[test]
fn any_flipped_byte_of_a_pmesh_file_is_noticed() {
    let file = pmesh_file(Some(12));
    for i in 0..file.len() {
        for bit in [0x01, 0x80, 0xff] {
            let mut bad = file.clone();
            bad[i] ^= bit;
            let (levels, error) = outcome(&bad, &[bad.len()]);
            assert!(error.is_some(), "byte {i}");
            assert!(levels.len() <= 3);
            assert_eq!(outcome(&bad, &[1]).0.len(), levels.len(), "byte {i}");
        }
    }
}

fn error_of(bytes: &[u8]) -> DecodeError {
    let mut receiver = Receiver::default();
    receiver.push(bytes).and_then(|()| receiver.finish()).expect_err("it is bad")
}

#[test]
fn errors_name_the_place_and_the_way_out() {
    assert!(matches!(error_of(b"<!doctype html>"), DecodeError::UnknownFormat { .. }));
    assert!(error_of(b"ply\nformat ascii").to_string().contains("pmesh encode"));
    let mut newer = pmesh_file(None);
    newer[8] = 9;
    assert_eq!(error_of(&newer), DecodeError::NewerVersion { format: ".pmesh", found: 9, known: 4 });
    let half = pmesh_file(None);
    assert!(matches!(error_of(&half[..half.len() - 3]), DecodeError::Truncated { levels: 2, .. }));
    let place_of = |text: &str| match error_of(text.as_bytes()) {
        DecodeError::Syntax { place, .. } => place,
        other => panic!("{text}: {other}"),
    };
    assert_eq!(place_of("{0,0,0\n,1,0,0,0,1,0}\n{0,1,x}"), Place::Line(3));
    assert_eq!(place_of("{0,0,0,1,0,0,0,1,0}\n{0,1\n}"), Place::Line(3));
    assert_eq!(place_of("{0,0,0,1,0,0,0,1,0}{0,1,5,7}"), Place::Line(1));
    assert_eq!(place_of("#a\n{0,0,0,1,0,0,0,1,0}{0,1,-2}"), Place::Line(2));
    assert_eq!(place_of("{0,0,1e999}"), Place::Line(1));
}

#[test]
fn a_representative_cycle_or_a_missing_vertex_is_refused() {
    // Text: a representative has a lower index, so a cycle cannot be written; a vertex that never gets one can.
    assert!(matches!(error_of(b"#surface partition\n{0,0,0,1,0,0,0,1,0}{0,1,9}{-1}"), DecodeError::Mesh { .. }));
    let mut mesh = ProgressiveMultilevelMesh::new(Default::default());
    let level = |representatives| Level {
        vertices: Vertices { positions: vec![[0.0; 3]; 3], ..Default::default() },
        representatives,
        ..Default::default()
    };
    for bad in [vec![(0, 0)], vec![(1, 2), (2, 1)], vec![(2, 1)], vec![(5, 6), (6, 5)], vec![(4, 4)], vec![(7, 1), (7, 2)]] {
        assert!(mesh.add_level(&level(bad.clone())).is_err(), "{bad:?}");
        mesh.check_invariants();
        assert_eq!(mesh.vertices().len(), 0, "a refused level changes nothing");
        assert!(!mesh.has_pending_vertices());
    }
    mesh.add_level(&level(vec![])).expect("it is valid");
}

#[test]
fn counts_that_lie_allocate_nothing() {
    let mut header = pmesh_codec::pmesh::header::Header { bounds: ([0.0; 3], [1.0; 3]), ..Default::default() };
    header.blocks.push(pmesh_codec::pmesh::header::Block {
        kind: pmesh_codec::pmesh::header::BlockKind::Level,
        byte_count: u32::MAX,
        checksum: 0,
        new_vertices: 1 << 29,
        new_triangles: 1 << 29,
        error: 0.0,
    });
    let mut receiver = Receiver::default();
    receiver.push(&header.to_bytes()).expect("the header itself is fine");
    assert!(receiver.mesh().memory_bytes() < 4096);
}

#[test]
fn a_deflate_bomb_is_refused() {
    let bomb = vec![0u8; 8 << 20];
    let mut deflate = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::best());
    deflate.write_all(&bomb).expect("memory");
    let payload = deflate.finish().expect("memory");
    let mut header = pmesh_codec::pmesh::header::Header { bounds: ([0.0; 3], [1.0; 3]), ..Default::default() };
    header.blocks.push(pmesh_codec::pmesh::header::Block {
        kind: pmesh_codec::pmesh::header::BlockKind::Level,
        byte_count: payload.len() as u32,
        checksum: crc32fast::hash(&payload),
        new_vertices: 1 << 29,
        new_triangles: 1 << 29,
        error: 0.0,
    });
    let mut file = header.to_bytes();
    file.extend(&payload);
    let mut receiver = Receiver::default();
    let error = receiver.push(&file).expect_err("a bomb");
    assert!(error.to_string().contains("inflates"), "{error}");
    // 50 inflated bytes a compressed one, 5 a vertex at least, 16 in memory; vectors double.
    assert!(receiver.mesh().memory_bytes() < 50 / 5 * 16 * 2 * file.len());
}

/// Files that were written once and stay readable for ever; `PMESH_UPDATE=1` writes them anew for a new version.
#[test]
fn golden_files_decode_and_are_written_byte_for_byte() {
    for (name, bits) in [("version0-12bit.pmesh", Some(12)), ("version0-exact.pmesh", None)] {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name);
        if std::env::var_os("PMESH_UPDATE").is_some() {
            std::fs::write(&path, pmesh_file(bits)).expect("it can be written");
        }
        let golden = std::fs::read(&path).expect("it is there");
        assert_eq!(pmesh_file(bits), golden, "{name}");
        let (levels, error) = outcome(&golden, &[13]);
        assert_eq!((levels.len(), error), (3, None));
    }
}

#[test]
fn attributes_moves_and_seams_survive() {
    for bits in [Some(12), None] {
        let file = pmesh_file(bits);
        let mut receiver = Receiver::default();
        receiver.push(&file).expect("it decodes");
        let mesh = receiver.mesh();
        let finest = mesh.finest_mesh();
        assert_eq!(finest.vertices.len(), 6);
        assert_eq!(finest.triangles.len(), 5);
        assert_eq!(finest.position_of, [(3, 0)]);
        assert!((finest.vertices.positions[2][2] - 1.0).abs() < 0.01, "the move arrived");
        assert_eq!(mesh.mesh_at(2.0).expect("coarsest").vertices.positions[2][2], 0.0);
        let half = mesh.mesh_at(1.5).expect("a fraction").vertices.positions[2][2];
        assert!((half - 0.5).abs() < 0.01, "moves morph too: {half}");
    }
}

#[test]
fn a_long_chain_of_missing_vertices_is_limited() {
    let mut text = String::from("#surface partition\n{0,0,0,1,0,0,0,1,0}{0,1,9000}{");
    (3..9001).for_each(|v| text += &format!("{} ", v - 1));
    text += "}";
    assert!(matches!(error_of(text.as_bytes()), DecodeError::Mesh { .. }));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn damaged_files_never_panic(which in any::<prop::sample::Index>(), at in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6), cut in any::<prop::sample::Index>()) {
        let mut all = all_files();
        let mut file = all.swap_remove(which.index(all.len()));
        for (i, byte) in at {
            let i = i.index(file.len());
            file[i] = byte;
        }
        file.truncate(cut.index(file.len()) + 1);
        outcome(&file, &[5, 1, 40]);
    }
    #[test]
    fn noise_after_a_valid_header_never_panics(noise in prop::collection::vec(any::<u8>(), 0..600)) {
        let header = pmesh_codec::pmesh::header::Header {
            blocks: vec![pmesh_codec::pmesh::header::Block {
                kind: pmesh_codec::pmesh::header::BlockKind::Level,
                byte_count: noise.len() as u32,
                checksum: crc32fast::hash(&noise),
                new_vertices: 5,
                new_triangles: 9,
                error: 1.0,
            }],
            ..Default::default()
        };
        let mut file = header.to_bytes();
        let mut deflate = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::fast());
        deflate.write_all(&noise).expect("memory");
        file.extend(deflate.finish().expect("memory"));
        outcome(&file, &[9]);
    }
    #[test]
    fn text_of_any_kind_never_panics(text in "[#{}0-9,. \\-\n]{0,300}", partition in any::<bool>()) {
        let variant = if partition { TextVariant::SurfacePartition } else { TextVariant::Interleaved };
        let options = TextOptions { dimension: None, variant };
        let mut receiver = Receiver::new(Box::new(text::TextDecoder::new(options)));
        if receiver.push(text.as_bytes()).is_ok() {
            // Whether it is whole is not the question here.
            let _ = receiver.finish();
        }
        receiver.mesh().check_invariants();
    }
}
