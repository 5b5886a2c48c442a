//! The compact stream: what goes in comes out, at any precision, with seams and without a hole on the way.

mod common;

use common::{ground, no_level_has_a_hole, soup};
use pmesh_build::compare::difference;
use pmesh_build::import::link_seams;
use pmesh_build::measure::deviation;
use pmesh_build::sample::{globe, marble, sample};
use pmesh_build::simplify::{BatchOptions, Profile, collapse_batches};
use pmesh_codec::Receiver;
use pmesh_codec::compact::{CompactStream, encode};
use pmesh_codec::pmesh::quantise;
use pmesh_core::{IndexedMesh, ProgressiveMultilevelMesh, reference};
use proptest::prelude::*;
use std::collections::HashSet;

const SMALL: BatchOptions = BatchOptions { base_vertices: 4, profile: Profile::Prefix };

fn taken_apart(mesh: &IndexedMesh, bits: Option<u8>, options: BatchOptions) -> CompactStream {
    CompactStream { mesh: mesh.clone(), ..collapse_batches(&quantise(mesh, bits), options, |_| ()) }
}

fn encoded(stream: &CompactStream, bits: Option<u8>) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode(stream, bits, &mut bytes).expect("it encodes");
    bytes
}

fn received(bytes: &[u8], piece: usize) -> ProgressiveMultilevelMesh {
    let mut receiver = Receiver::default();
    bytes.chunks(piece.min(bytes.len())).try_for_each(|b| receiver.push(b)).and_then(|()| receiver.finish()).expect("it decodes");
    receiver.mesh().check_invariants();
    receiver.into_mesh()
}

/// The file, decoded, checked against what went in, level by level.
fn round_trip(mesh: &IndexedMesh, bits: Option<u8>, options: BatchOptions) -> (Vec<u8>, ProgressiveMultilevelMesh) {
    let bytes = encoded(&taken_apart(mesh, bits, options), bits);
    let again = received(&bytes, usize::MAX);
    assert_eq!(difference(&again.finest_mesh(), &quantise(mesh, bits)), None);
    for level in 0..again.level_count() {
        assert_eq!(again.triangles_at(level), reference::triangles_at(&again, level), "level {level}");
        again.mesh_at(level.into()).expect("the level is there").check().expect("it is valid");
    }
    (bytes, again)
}

#[test]
fn every_sample_comes_back_exactly() {
    for name in ["marble", "tetrahedra", "knot", "part", "globe"] {
        let mesh = sample(name).expect("it is built in").mesh;
        for (bits, profile) in [(Some(12), Profile::Prefix), (Some(16), Profile::Size), (None, Profile::Prefix)] {
            let (bytes, again) = round_trip(&mesh, bits, BatchOptions { profile, ..Default::default() });
            println!("{name} {bits:?} {profile:?}: {} bytes, {} levels", bytes.len(), again.level_count());
            // Whatever was asked for before, coarse levels are coarse.
            let coarsest = again.mesh_at(f64::from(again.level_count() - 1)).expect("a level").vertices.len();
            assert!(coarsest < 2500 && (name == "globe" || coarsest < 130), "{name}: {coarsest}");
        }
    }
}

#[test]
fn a_precision_that_no_header_can_say_is_refused() {
    let mesh = sample("tetrahedra").expect("it is one").mesh;
    for bits in [0, 7, 17, 255] {
        let error = encode(&taken_apart(&mesh, None, SMALL), Some(bits), &mut Vec::new()).expect_err("it says so");
        assert!(error.to_string().contains("8 to 16"), "{error}");
    }
}

#[test]
fn both_sides_of_a_seam_go_and_come_together() {
    let mut mesh = globe(40).mesh;
    link_seams(&mut mesh);
    assert!(!mesh.position_of.is_empty());
    let (_, again) = round_trip(&mesh, Some(14), SMALL);
    no_level_has_a_hole(&again);
    let coarse = again.mesh_at(f64::from(again.level_count() - 1)).expect("a level");
    assert!(coarse.vertices.len() * 3 < mesh.vertices.len(), "{} of {}", coarse.vertices.len(), mesh.vertices.len());
}

#[test]
fn surfaces_that_touch_refine_each_by_itself() {
    let mut mesh = sample("knot").expect("it is one").mesh;
    // The same again, inside out: every position twice, and no seam.
    let n = mesh.vertices.len() as u32;
    let copy = mesh.vertices.clone();
    mesh.vertices.extend_from(&copy);
    mesh.triangles.extend_from_within(..);
    let half = mesh.triangles.len() / 2;
    mesh.triangles[half..].iter_mut().for_each(|[a, b, c]| (*a, *b, *c) = (*a + n, *c + n, *b + n));
    link_seams(&mut mesh);
    assert_eq!(mesh.position_of.len(), n as usize);
    let (_, again) = round_trip(&mesh, Some(12), BatchOptions::default());
    let coarsest = again.mesh_at(f64::from(again.level_count() - 1)).expect("a level").vertices.len();
    assert!(coarsest < 300, "{coarsest} vertices in the base");
}

#[test]
fn levels_are_independent_sets_and_arcs_of_their_neighbours() {
    for name in ["knot", "part"] {
        let stream = taken_apart(&sample(name).expect("it is built in").mesh, Some(12), BatchOptions::default());
        assert!(stream.levels.len() > 5);
        for level in &stream.levels {
            let gone: HashSet<u32> = level.iter().map(|r| r.vertex).collect();
            assert_eq!(gone.len(), level.len());
            assert!(level.iter().all(|r| !gone.contains(&r.apex) && r.chain.iter().all(|v| !gone.contains(v))));
        }
    }
}

/// Hills of n × n vertices; the cells' diagonals run the other way where `turned` says so.
fn height_map(n: u32, turned: impl Fn(u32) -> bool) -> IndexedMesh {
    let height = |i: f32, j: f32| (i * 0.07).sin() * (j * 0.05).cos() * 20.0 + (i * 0.5).sin() * (j * 0.4).sin();
    let positions = (0..n * n).map(|v| [(v / n) as f32, (v % n) as f32, height((v / n) as f32, (v % n) as f32)]).collect();
    let cells = (0..(n - 1) * (n - 1)).map(|c| c / (n - 1) * n + c % (n - 1));
    let cell = |a| match turned(a) {
        false => [[a, a + n, a + n + 1], [a, a + n + 1, a + 1]],
        true => [[a, a + n, a + 1], [a + n, a + n + 1, a + 1]],
    };
    let vertices = pmesh_core::Vertices { positions, ..Default::default() };
    IndexedMesh { vertices, triangles: cells.flat_map(cell).collect(), ..Default::default() }
}

#[test]
fn a_height_map_costs_next_to_nothing_but_its_heights() {
    let mesh = height_map(150, |_| false);
    let stream = taken_apart(&mesh, Some(12), BatchOptions::default());
    let mut bytes = Vec::new();
    let report = encode(&stream, Some(12), &mut bytes).expect("it encodes");
    assert_eq!(difference(&received(&bytes, 999).finest_mesh(), &quantise(&mesh, Some(12))), None);
    let connectivity = (report.spent.flags + report.spent.ways) / f64::from(report.removed.0);
    assert!(connectivity < 1.0, "{connectivity} bits a vertex for the connectivity of a grid");
}

#[test]
fn the_profiles_keep_their_promises() {
    // Diagonals at random: no grid that could be halved.
    let mesh = height_map(100, |a| a.wrapping_mul(2_654_435_761) >> 31 == 1);
    let [prefix, size] = [Profile::Prefix, Profile::Size].map(|profile| {
        let options = BatchOptions { profile, ..Default::default() };
        let stream = taken_apart(&mesh, Some(12), options);
        let bytes = encoded(&stream, Some(12));
        let mut receiver = Receiver::default();
        receiver.push(&bytes[..3000]).expect("it decodes");
        (bytes.len(), deviation(&quantise(&mesh, Some(12)), &receiver.newest_mesh(), 20_000).rms)
    });
    assert!(size.0 < prefix.0, "{size:?} {prefix:?}");
    assert!(prefix.1 < size.1, "{size:?} {prefix:?}");
}

#[test]
fn any_cut_of_the_bytes_gives_the_same_levels() {
    let mesh = sample("part").expect("it is built in").mesh;
    let bytes = encoded(&taken_apart(&mesh, Some(12), BatchOptions::default()), Some(12));
    let whole = received(&bytes, usize::MAX);
    for piece in [1, 7, 1000] {
        let cut = received(&bytes, piece);
        for level in 0..whole.level_count() {
            assert_eq!(cut.triangles_at(level), whole.triangles_at(level));
        }
        assert_eq!(difference(&cut.finest_mesh(), &whole.finest_mesh()), None);
    }
}

#[test]
fn any_prefix_of_the_bytes_shows_all_its_splits() {
    let mesh = sample("part").expect("it is built in").mesh;
    let bytes = encoded(&taken_apart(&mesh, Some(12), BatchOptions::default()), Some(12));
    let mut streaming = Receiver::default();
    let (mut inside, mut most) = (0, 0);
    for (i, byte) in bytes.iter().enumerate() {
        streaming.push(&[*byte]).expect("it decodes");
        let shown = streaming.newest_mesh();
        assert!(shown.vertices.len() >= most, "fewer vertices after {} bytes", i + 1);
        inside += usize::from(shown.vertices.len() > most && streaming.shows_part());
        most = shown.vertices.len();
        if i % 97 == 0 {
            let mut at_once = Receiver::default();
            at_once.push(&bytes[..=i]).expect("it decodes");
            assert_eq!(difference(&at_once.newest_mesh(), &shown), None);
            // Every edge has a triangle on either side, or one: nothing is torn.
            let mut edges: Vec<[u32; 2]> = shown.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
            edges.sort_unstable();
            assert!(edges.windows(2).all(|e| e[0] != e[1]), "an edge is used twice after {} bytes", i + 1);
        }
    }
    assert!(inside > bytes.len() / 10, "{inside} of {} bytes brought vertices", bytes.len());
    assert!(!streaming.shows_part() && difference(&streaming.newest_mesh(), &quantise(&mesh, Some(12))).is_none());
}

#[test]
fn coarse_coordinates_have_few_bits_and_sharpen_until_none_is_missing() {
    for (name, profile) in [("marble", Profile::Prefix), ("globe", Profile::Prefix), ("marble", Profile::Size)] {
        let mesh = sample(name).expect("it is built in").mesh;
        let (_, again) = round_trip(&mesh, Some(14), BatchOptions { profile, ..Default::default() });
        let (whole, count) = (quantise(&mesh, Some(14)), again.level_count());
        let grid: HashSet<_> = whole.vertices.positions.iter().map(|p| p.map(f32::to_bits)).collect();
        let part_exact: Vec<f64> = (0..count)
            .rev()
            .map(|level| {
                let at = again.mesh_at(level.into()).expect("a level");
                let exact = at.vertices.positions.iter().filter(|p| grid.contains(&p.map(f32::to_bits))).count();
                // Both sides of a seam sharpen alike.
                let finest = again.finest_mesh();
                let seams: HashSet<_> = at.position_of.iter().copied().collect();
                let known = finest.position_of.iter().filter(|s| s.0 < at.vertices.len() as u32);
                assert!(known.clone().all(|s| seams.contains(s)), "{name}: an open seam at level {level}");
                exact as f64 / at.vertices.len() as f64
            })
            .collect();
        assert_eq!(part_exact[part_exact.len() - 1], 1.0);
        assert_eq!(part_exact[0] < 0.1, profile == Profile::Prefix, "{name} {profile:?}: {part_exact:?}");
        assert_eq!(again.has_moves(), profile == Profile::Prefix);
        let finest = again.vertices().len() as f64;
        assert!(finest < 1.6 * whole.vertices.len() as f64, "{name}: {finest} places");
    }
}

#[test]
fn what_the_components_take_is_the_whole_file() {
    for name in ["part", "globe", "knot"] {
        let mesh = sample(name).expect("it is built in").mesh;
        let bytes = encoded(&taken_apart(&mesh, Some(12), BatchOptions::default()), Some(12));
        let mut receiver = Receiver::default();
        receiver.push(&bytes).and_then(|()| receiver.finish()).expect("it decodes");
        let components = receiver.components();
        let sum: f64 = components.iter().map(|c| c.1).sum();
        assert!((sum - bytes.len() as f64).abs() < 1e-3, "{name}: {sum} of {}: {components:?}", bytes.len());
        let geometry = components.iter().find(|c| c.0 == "geometry").map_or(0.0, |c| c.1);
        assert!(geometry > 0.2 * sum, "{name}: {components:?}");
    }
}

#[test]
fn a_damaged_level_is_not_shown_once_that_is_known() {
    let mesh = sample("part").expect("it is built in").mesh;
    let bytes = encoded(&taken_apart(&mesh, Some(12), BatchOptions::default()), Some(12));
    for at in (0..bytes.len()).step_by(53) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x10;
        let mut receiver = Receiver::default();
        let pushed = damaged.chunks(17).try_for_each(|piece| receiver.push(piece));
        assert!(pushed.and_then(|()| receiver.finish()).is_err(), "byte {at} changed, and nobody noticed");
        assert_eq!(difference(&receiver.newest_mesh(), &receiver.mesh().finest_mesh()), None);
        receiver.mesh().check_invariants();
    }
}

/// A number for a mesh, the same wherever it is decoded: FNV-1a over positions, then indices.
fn fingerprint(mesh: &IndexedMesh) -> u64 {
    let numbers = mesh.vertices.positions.iter().flatten().map(|x| x.to_bits()).chain(mesh.triangles.iter().flatten().copied());
    numbers.fold(0xcbf2_9ce4_8422_2325, |h, x| (h ^ u64::from(x)).wrapping_mul(0x0100_0000_01b3))
}

/// A file of this version, written byte for byte again; tests/wasm decodes the same one in browsers to the same number.
/// `PMESH_UPDATE=1` writes it anew.
#[test]
fn the_golden_file_is_written_and_read_the_same_everywhere() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../pmesh-codec/tests/data/version1-part.pmesh");
    let mesh = sample("part").expect("it is built in").mesh.positions_only();
    let bytes = encoded(&taken_apart(&mesh, Some(12), BatchOptions::default()), Some(12));
    if std::env::var_os("PMESH_UPDATE").is_some() {
        std::fs::write(&path, &bytes).expect("it can be written");
    }
    assert!(std::fs::read(&path).expect("it is there") == bytes, "the file is written differently");
    let again = received(&bytes, 100).mesh_at(0.0).expect("it is whole");
    assert_eq!(fingerprint(&again), 0x40b6_297e_34b9_7dbe, "{:#x}: change it in tests/wasm/model.rs too", fingerprint(&again));
}

/// Files with attributes and seams, on a grid and exact: what they hold stays what it is. (Their meshes come from sines, which differ between
/// machines, so they are not written again.)
#[test]
fn golden_files_with_attributes_are_read_as_ever() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../pmesh-codec/tests/data");
    let files: [(&str, _, _, u64); 2] = [
        ("version1-globe.pmesh", globe(12).mesh, Some(12), 0x17d9_2d35_3882_7a93),
        ("version1-exact.pmesh", marble(24, 16), None, 0x93ca_8922_9b4b_b310),
    ];
    for (name, mesh, bits, expected) in files {
        if std::env::var_os("PMESH_UPDATE").is_some() {
            std::fs::write(folder.join(name), encoded(&taken_apart(&mesh, bits, SMALL), bits)).expect("it can be written");
        }
        let bytes = std::fs::read(folder.join(name)).expect("it is there");
        let again = received(&bytes, 100).mesh_at(0.0).expect("it is whole");
        let a = &again.vertices.attributes;
        let [n, t] = [a.normals.as_flattened(), a.texcoords.as_flattened()];
        let more = n.iter().chain(t).chain(a.colors.as_flattened()).map(|x| x.to_bits());
        let seams = again.position_of.iter().flat_map(|&(v, p)| [v, p]);
        let all = more.chain(seams).fold(fingerprint(&again), |h, x| (h ^ u64::from(x)).wrapping_mul(0x0100_0000_01b3));
        assert_eq!(all, expected, "{name}: {all:#x}");
    }
}

/// Some vertices of a mesh told apart by a colour: seams anywhere.
fn with_seams(mut mesh: IndexedMesh, sheets: &[u8]) -> IndexedMesh {
    let n = mesh.vertices.len() as u32;
    let copies = mesh.vertices.clone();
    let color = |c: u8, n: u32| vec![[f32::from(c), 0.0, 0.0, 1.0]; n as usize];
    mesh.vertices.attributes.colors = color(0, n);
    let mut more = copies;
    more.attributes.colors = color(1, n);
    mesh.vertices.extend_from(&more);
    for (i, t) in mesh.triangles.iter_mut().enumerate() {
        if sheets.get(i % sheets.len().max(1)).is_some_and(|s| *s == 0) {
            *t = t.map(|v| v + n);
        }
    }
    mesh.position_of.clear();
    link_seams(&mut mesh);
    mesh
}

proptest! {
    #[test]
    fn any_soup_comes_back(mesh in soup(), bits in prop::option::of(8u8..=16)) {
        round_trip(&mesh, bits, SMALL);
    }

    #[test]
    fn any_ground_comes_back(mesh in ground(), sheets in prop::collection::vec(0u8..6, 1..40), size: bool) {
        let profile = if size { Profile::Size } else { Profile::Prefix };
        round_trip(&mesh, None, BatchOptions { profile, ..SMALL });
        round_trip(&with_seams(mesh, &sheets), Some(12), BatchOptions { profile, ..SMALL });
    }
}
