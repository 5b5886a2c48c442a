//! Conformance item G.11 of forest splits (A.31), and what surrounds it.

mod common;

use common::{ground, soup};
use pmesh_build::compare::difference;
use pmesh_build::sample::sample;
use pmesh_build::simplify::{ForestOptions, collapse_forests};
use pmesh_codec::pmesh::quantise;
use pmesh_codec::split::{SplitStream, TREE_LIMIT, encode};
use pmesh_codec::{Arrival, Receiver};
use pmesh_core::{IndexedMesh, Vertices};
use proptest::prelude::*;
use std::collections::{HashMap, HashSet};

fn forests(mesh: &IndexedMesh, base_vertices: usize) -> SplitStream {
    collapse_forests(mesh, ForestOptions { base_vertices }, |_| ())
}

fn encoded(stream: &SplitStream, bits: Option<u8>) -> (Vec<u8>, pmesh_codec::split::SplitReport) {
    let mut bytes = Vec::new();
    let report = encode(stream, bits, &mut bytes).expect("it encodes");
    (bytes, report)
}

/// The finest mesh that comes out, and what each level showed.
fn received(bytes: &[u8], piece: usize) -> (IndexedMesh, Vec<IndexedMesh>) {
    let mut receiver = Receiver::default();
    bytes.chunks(piece.min(bytes.len())).try_for_each(|b| receiver.push(b)).and_then(|()| receiver.finish()).expect("it decodes");
    receiver.mesh().check_invariants();
    let count = receiver.mesh().level_count();
    let levels = (0..count).rev().map(|l| receiver.mesh().mesh_at(f64::from(l)).expect("a level")).collect();
    (receiver.mesh().finest_mesh(), levels)
}

fn level_of(stream: &SplitStream, level: u32) -> Vec<[u32; 3]> {
    let stands = stream.at_level(level);
    let all = stream.mesh.triangles.iter().map(|t| t.map(|v| stands[v as usize]));
    all.filter(|[a, b, c]| a != b && b != c && c != a).collect()
}

/// The triangles that a level brings, in the vertices of that level: edge to edge, they form trees (A.31).
fn assert_forest(stream: &SplitStream, level: u32) {
    let (fine, coarse) = (stream.at_level(level), stream.at_level(level - 1));
    let vanishes = |t: [u32; 3]| t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
    let at = |t: &[u32; 3], stands: &[u32]| t.map(|v| stands[v as usize]);
    let brought: Vec<_> = stream.mesh.triangles.iter().map(|t| at(t, &fine)).filter(|&t| !vanishes(t)).collect();
    let brought: Vec<_> = brought.into_iter().filter(|t| vanishes(at(t, &coarse))).collect();
    let edges: HashMap<(u32, u32), usize> =
        brought.iter().enumerate().flat_map(|(i, t)| [0, 1, 2].map(|k| ((t[k], t[(k + 1) % 3]), i))).collect();
    let mut parent: Vec<usize> = (0..brought.len()).collect();
    fn root(parent: &[usize], mut i: usize) -> usize {
        while parent[i] != i {
            i = parent[i];
        }
        i
    }
    for (&(a, b), &i) in edges.iter().filter(|e| e.0.0 < e.0.1) {
        if let Some(&j) = edges.get(&(b, a)) {
            let (i, j) = (root(&parent, i), root(&parent, j));
            assert_ne!(i, j, "level {level}: a cycle of triangles");
            parent[i] = j;
        }
    }
}

/// What level `level` of the decoded stream shows is what the clustering says, by position.
fn assert_levels(stream: &SplitStream, levels: &[IndexedMesh]) {
    assert_eq!(levels.len() as u32, stream.level_count());
    for (level, shown) in levels.iter().enumerate() {
        let set = |triangles: &[[u32; 3]], vertices: &Vertices| {
            let key = |v: u32| vertices.positions[v as usize].map(f32::to_bits);
            let mut all: Vec<_> = triangles.iter().map(|&t| turned_by(t, key)).collect();
            all.sort_unstable();
            all
        };
        let expected = level_of(stream, level as u32);
        assert_eq!(set(&shown.triangles, &shown.vertices), set(&expected, &stream.mesh.vertices), "level {level}");
    }
}
fn turned_by(t: [u32; 3], key: impl Fn(u32) -> [u32; 3]) -> [[u32; 3]; 3] {
    let k = t.map(key);
    let first = (0..3).min_by_key(|&i| k[i]).unwrap_or(0);
    [0, 1, 2].map(|i| k[(first + i) % 3])
}

fn plain(name: &str, bits: Option<u8>) -> IndexedMesh {
    let mut mesh = quantise(&sample(name).expect("it is built in").mesh, bits);
    mesh.vertices.attributes = Default::default();
    mesh.position_of.clear();
    mesh
}

#[test]
fn g11_a_split_costs_three_and_a_half_bits_a_triangle_and_reads_as_a_clustering() {
    for (name, base) in [("knot", 100), ("marble", 200), ("part", 0), ("lace", 0)] {
        // A fifth of lace's vertices lie on the boundary.
        let lace = || field(101, |i, j| (i as f32 * 0.3).sin() * (j as f32 * 0.2).cos(), |i, j| i % 5 == 2 && j % 5 == 2);
        let mesh = if name == "lace" { quantise(&lace(), Some(12)) } else { plain(name, Some(12)) };
        let stream = forests(&mesh, base);
        assert!(stream.level_count() > 3, "{name}");
        (1..stream.level_count()).for_each(|l| assert_forest(&stream, l));
        let (bytes, report) = encoded(&stream, Some(12));
        for s in &report.splits {
            // A bit an edge, two bits a triangle; a closed mesh has three edges for two triangles.
            assert!(2 * s.bits <= 3 * u64::from(s.coarse_triangles) + 4 * u64::from(s.new_triangles), "{name}: {s:?}");
            assert!(s.new_triangles <= s.coarse_triangles, "{name}: a split cannot more than double");
        }
        let mean = report.raw_bits_per_triangle();
        println!("{name}: {mean:.2} bits a new triangle, {} splits", report.splits.len());
        assert!(mean <= 3.5, "{name}: {mean} bits a new triangle");
        for piece in [usize::MAX, 1, 777] {
            let (again, levels) = received(&bytes, piece);
            assert_eq!(difference(&again, &mesh), None, "{name}");
            assert_levels(&stream, &levels);
        }
    }
}

/// n × n vertices, cells left out where `hole` says so.
fn field(n: u32, height: impl Fn(u32, u32) -> f32, hole: impl Fn(u32, u32) -> bool) -> IndexedMesh {
    let at = |i: u32, j: u32| i * n + j;
    let positions = (0..n * n).map(|v| [(v / n) as f32, (v % n) as f32, height(v / n, v % n)]).collect();
    let cells = (0..(n - 1) * (n - 1)).map(|v| (v / (n - 1), v % (n - 1))).filter(|&(i, j)| !hole(i, j));
    let cell = |(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]];
    let triangles = cells.flat_map(cell).collect();
    IndexedMesh { vertices: Vertices { positions, ..Default::default() }, triangles, ..Default::default() }
}

#[test]
fn trees_are_no_larger_than_a_decoder_does_in_one_go() {
    // A flat mesh, where every collapse costs nothing and one tree would swallow all.
    let mesh = field(80, |_, _| 0.0, |_, _| false);
    let stream = forests(&mesh, 0);
    let level = stream.level_count() - 1;
    let (fine, coarse) = (stream.at_level(level), stream.at_level(level - 1));
    let mut edges: HashSet<(u32, u32)> = HashSet::new();
    for t in &mesh.triangles {
        let (f, c) = (t.map(|v| fine[v as usize]), t.map(|v| coarse[v as usize]));
        let gone = |t: [u32; 3]| t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
        if gone(c) && !gone(f) {
            let pairs = [0, 1, 2].map(|k| (c[k].min(c[(k + 1) % 3]), c[k].max(c[(k + 1) % 3])));
            edges.extend(pairs.iter().filter(|e| e.0 != e.1));
        }
    }
    let mut parent: Vec<usize> = (0..mesh.vertices.len()).collect();
    let mut size = vec![0u32; parent.len()];
    for &(a, b) in &edges {
        let [mut a, mut b] = [a as usize, b as usize];
        while parent[a] != a {
            a = parent[a];
        }
        while parent[b] != b {
            b = parent[b];
        }
        assert_ne!(a, b, "marked edges make a cycle");
        parent[b] = a;
        size[a] += size[b] + 1;
    }
    let largest = size.iter().max().copied().unwrap_or(0);
    assert!((TREE_LIMIT / 2..=TREE_LIMIT).contains(&largest), "{largest}");
    assert_eq!(difference(&received(&encoded(&stream, None).0, 100).0, &mesh), None);
}

#[test]
fn every_attribute_and_both_sides_of_a_seam_survive() {
    let model = sample("globe").expect("it is built in");
    for bits in [Some(12), None] {
        let mesh = quantise(&model.mesh, bits);
        let mut stream = forests(&mesh, 1000);
        stream.texture = model.texture.clone();
        assert_eq!(difference(&received(&encoded(&stream, bits).0, usize::MAX).0, &mesh), None);
    }
}

#[test]
fn the_first_picture_takes_5_kilobytes() {
    for name in ["knot", "marble", "part"] {
        let mesh = plain(name, Some(12));
        let (bytes, _) = encoded(&collapse_forests(&mesh, ForestOptions::default(), |_| ()), Some(12));
        let mut receiver = Receiver::default();
        receiver.push(&bytes[..bytes.len().min(5 * 1024)]).expect("it decodes");
        let first = std::iter::from_fn(|| receiver.poll()).any(|a| matches!(a, Arrival::Level { .. }));
        assert!(first, "{name}: no picture after 5 KB of {}", bytes.len());
    }
}

#[test]
fn what_is_no_forest_is_refused() {
    let mesh = plain("knot", Some(12));
    let good = forests(&mesh, 100);
    let refused = |stream: &SplitStream| encode(stream, Some(12), &mut Vec::new()).is_err();
    assert!(!refused(&good));
    // A parent of a later level, one that is no neighbour, and all batches in one.
    let mut bad = good.clone();
    bad.levels.iter_mut().for_each(|l| *l = 3 - (*l).min(3));
    assert!(refused(&bad));
    let mut bad = good.clone();
    let last = good.level_count() - 1;
    let (gone, far) = (good.levels.iter().position(|&l| l == last), good.levels.iter().rposition(|&l| l == 0));
    bad.parents[gone.expect("a vertex")] = far.expect("a vertex") as u32;
    assert!(refused(&bad));
    let mut bad = good.clone();
    bad.levels.iter_mut().for_each(|l| *l = (*l).min(1));
    bad.parents = good.at_level(0);
    assert!(refused(&bad));
}

proptest! {
    #[test]
    fn g11_random_forests_come_back_level_by_level(mesh in ground()) {
        let stream = forests(&mesh, 0);
        (1..stream.level_count()).for_each(|l| assert_forest(&stream, l));
        let (bytes, report) = encoded(&stream, None);
        for s in &report.splits {
            // Edges with boundaries: each triangle has three, no more.
            prop_assert!(s.bits <= 3 * u64::from(s.coarse_triangles) + 2 * u64::from(s.new_triangles));
        }
        let (again, levels) = received(&bytes, 50);
        prop_assert_eq!(difference(&again, &mesh), None);
        if report.loose.0 == 0 {
            assert_levels(&stream, &levels);
        }
    }

    #[test]
    fn any_soup_comes_back(mesh in soup(), bits in prop::option::of(8u8..=16)) {
        let mesh = quantise(&mesh, bits);
        prop_assert_eq!(difference(&received(&encoded(&forests(&mesh, 0), bits).0, 50).0, &mesh), None);
    }

    /// Any parents and levels: refused, or what comes out is what went in.
    #[test]
    fn no_clustering_makes_the_encoder_lie(mesh in ground(), parents in prop::collection::vec(0u32..200, 200), levels in prop::collection::vec(0u32..4, 200)) {
        let n = mesh.vertices.len();
        let parents = parents.iter().map(|p| p % n as u32).take(n).collect();
        let stream = SplitStream { mesh: mesh.clone(), parents, levels: levels[..n].to_vec(), ..Default::default() };
        let mut bytes = Vec::new();
        if encode(&stream, None, &mut bytes).is_ok() {
            prop_assert_eq!(difference(&received(&bytes, 50).0, &mesh), None);
        }
    }
}
