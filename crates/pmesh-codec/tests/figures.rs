//! The figures of GV99 as fixtures: items G.1, G.2, G.4 of the requirements, and D.7.

use pmesh_codec::text::{self, TextDecoder, TextOptions, TextVariant};
use pmesh_codec::{Arrival, Receiver};
use pmesh_core::{ProgressiveMultilevelMesh, reference};

const FIGURE_6: &str = include_str!("data/figure6.lod");
const FIGURE_6_PRINTED: &str = include_str!("data/figure6-as-printed.lod");
const FIGURE_13: &str = include_str!("data/figure13.lod");

fn read(text: &str) -> (ProgressiveMultilevelMesh, Vec<String>) {
    let mut receiver = Receiver::default();
    receiver.push(text.as_bytes()).expect("it reads");
    receiver.finish().expect("it is whole");
    let warnings = std::iter::from_fn(|| receiver.poll()).filter_map(|a| match a {
        Arrival::Warning(text) => Some(text),
        _ => None,
    });
    let warnings = warnings.collect();
    (receiver.into_mesh(), warnings)
}

fn area_2d(mesh: &ProgressiveMultilevelMesh, t: [u32; 3]) -> f64 {
    let [a, b, c] = t.map(|v| mesh.vertices().positions[v as usize].map(f64::from));
    ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs() / 2.0
}

fn volume(mesh: &ProgressiveMultilevelMesh, level: u32) -> f64 {
    let p = |v: u32| mesh.vertices().positions[v as usize].map(f64::from);
    let signed = |[a, b, c]: [[f64; 3]; 3]| {
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    mesh.triangles_at(level).expect("the level").iter().map(|t| signed(t.map(p)) / 6.0).sum()
}

/// Turned so that the lowest corner leads.
fn turned(mut t: [u32; 3]) -> [u32; 3] {
    while t[0] != *t.iter().min().expect("three") {
        t.rotate_left(1);
    }
    t
}
fn sorted(mut triangles: Vec<[u32; 3]>) -> Vec<[u32; 3]> {
    triangles.iter_mut().for_each(|t| *t = turned(*t));
    triangles.sort_unstable();
    triangles
}

#[test]
fn g1_figure_6_resolves_to_the_levels_of_a22() {
    let (mesh, warnings) = read(FIGURE_6);
    assert!(warnings.is_empty());
    let counts = |l| (mesh.vertex_count(l).expect("l"), mesh.triangle_count(l).expect("l"));
    assert_eq!([2, 1, 0].map(counts), [(4, 2), (7, 6), (10, 10)]);
    assert_eq!(sorted(mesh.triangles_at(2).expect("2")), sorted(vec![[0, 2, 1], [3, 1, 2]]));
    let level_1 = vec![[6, 2, 1], [3, 1, 2], [4, 6, 1], [5, 2, 6], [6, 4, 5], [4, 0, 5]];
    assert_eq!(sorted(mesh.triangles_at(1).expect("1")), sorted(level_1));
    let finest: Vec<[u32; 3]> =
        vec![[6, 2, 8], [3, 8, 2], [4, 6, 7], [5, 2, 6], [6, 4, 5], [4, 0, 5], [8, 3, 9], [9, 1, 8], [7, 8, 1], [8, 7, 6]];
    assert_eq!(sorted(mesh.triangles_at(0).expect("0")), sorted(finest));
    let parents: Vec<_> = [6, 8, 7].iter().map(|&v: &usize| mesh.representatives()[v]).collect();
    assert_eq!(parents, [0, 1, 1]);
    let named = mesh.representatives().iter().filter(|&&p| p != u32::MAX).count();
    assert_eq!(named, 3);
    for level in 0..3 {
        let areas: Vec<f64> = mesh.triangles_at(level).expect("level").iter().map(|&t| area_2d(&mesh, t)).collect();
        assert!((areas.iter().sum::<f64>() - 36.0).abs() < 1e-5, "level {level}");
        assert!(areas.iter().all(|&a| a > 1e-6));
        assert_eq!(mesh.triangles_at(level), reference::triangles_at(&mesh, level));
    }
}

#[test]
fn g1_figure_6_as_printed_is_read_with_a_warning_and_has_triangles_without_area() {
    let (mesh, warnings) = read(FIGURE_6_PRINTED);
    assert_eq!(warnings.len(), 1, "the full stop: {warnings:?}");
    let flat = |level| mesh.triangles_at(level).expect("level").iter().filter(|&&t| area_2d(&mesh, t) < 1e-6).count();
    assert_eq!([flat(1), flat(0)], [1, 2]);
    let (repaired, _) = read(FIGURE_6);
    let area = |level| repaired.triangles_at(level).expect("level").iter().map(|&t| area_2d(&repaired, t)).fold(9.0, f64::min);
    assert!(area(1) > 1e-6 && area(0) > 1e-6);
}

#[test]
fn g2_figure_13_has_the_volumes_and_fans_of_a24() {
    let (mesh, _) = read(FIGURE_13);
    assert_eq!([1, 0].map(|l| mesh.triangle_count(l).expect("l")), [4, 16]);
    assert_eq!(sorted(mesh.triangles_at(1).expect("1")), sorted(vec![[0, 1, 2], [2, 1, 3], [3, 0, 2], [1, 0, 3]]));
    assert!((volume(&mesh, 1) - 8.0 / 3.0).abs() < 1e-9);
    assert!((volume(&mesh, 0) - 4.0 / 3.0).abs() < 1e-9);
    let triangles = mesh.triangles_at(0).expect("0");
    for v in 4..10 {
        assert_eq!(fans(&triangles, v), 2, "vertex {v}");
    }
    assert_eq!(mesh.representatives().iter().filter(|&&p| p != u32::MAX).count(), 3);
}

/// Edge-connected groups of the triangles around a vertex.
fn fans(triangles: &[[u32; 3]], v: u32) -> usize {
    let mut groups: Vec<Vec<u32>> =
        triangles.iter().filter(|t| t.contains(&v)).map(|t| t.iter().copied().filter(|&x| x != v).collect()).collect();
    let mut i = 0;
    while i < groups.len() {
        match (i + 1..groups.len()).find(|&j| groups[j].iter().any(|x| groups[i].contains(x))) {
            Some(j) => {
                let other = groups.swap_remove(j);
                groups[i].extend(other);
                i = 0;
            }
            None => i += 1,
        }
    }
    groups.len()
}

#[test]
fn g2_the_dimension_follows_from_the_first_vertex_block() {
    let flat = |text| read(text).0.vertices().positions.iter().all(|p| p[2] == 0.0);
    assert!(flat(FIGURE_6));
    assert!(!flat(FIGURE_13));
    let options = TextOptions { dimension: Some(2), ..Default::default() };
    let mut receiver = Receiver::new(Box::new(TextDecoder::new(options)));
    receiver.push(b"{1,2,3,4,5,6}{0,1,2}").expect("it reads");
    assert_eq!(receiver.mesh().vertices().positions, [[1., 2., 0.], [3., 4., 0.], [5., 6., 0.]]);
}

/// Three levels; the triangle (0, 1, 4) is there from the coarsest on, 4 standing for 3 standing for 2.
const CHAIN: &str = "{0,0,0, 1,0,0, 0,1,0} {0,1,4,3,2} {0,2,0} {2,0,3} {0,3,0} {3,1,4}";

#[test]
fn g4_a_chain_of_representatives_is_given_where_the_parent_is_missing() {
    let (mesh, _) = read(CHAIN);
    let resolved = |l| mesh.triangles_at(l).expect("level")[0];
    assert_eq!([2, 1, 0].map(resolved), [[0, 1, 2], [0, 1, 3], [0, 1, 4]]);
    let mut text = Vec::new();
    text::write(&mesh, TextOptions::default(), &mut text).expect("it writes");
    let text = String::from_utf8(text).expect("text");
    assert!(text.contains("0, 1, 4, 3, 2"), "{text}");
}

#[test]
fn what_is_written_reads_back_as_it_was_in_both_variants() {
    for figure in [FIGURE_6, FIGURE_13, CHAIN] {
        let (mesh, _) = read(figure);
        for variant in [TextVariant::Interleaved, TextVariant::SurfacePartition] {
            let mut text = Vec::new();
            text::write(&mesh, TextOptions { dimension: None, variant }, &mut text).expect("it writes");
            let (again, _) = read(&String::from_utf8(text).expect("text"));
            assert_eq!(again.vertices(), mesh.vertices());
            assert_eq!(again.representatives(), mesh.representatives());
            for level in 0..mesh.level_count() {
                assert_eq!(again.triangles_at(level), mesh.triangles_at(level), "{variant:?} level {level}");
            }
        }
    }
}

#[test]
fn g1_a_geomorph_of_figure_6_keeps_the_square_where_representatives_are_known() {
    // With its three representatives Figure 6 folds just below level 2 (A.10): 36.489 in all.
    let (mesh, _) = read(FIGURE_6);
    let morphed = mesh.mesh_at(1.999_999).expect("a fraction");
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| morphed.vertices.positions[v as usize].map(f64::from));
        ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs() / 2.0
    };
    let sum: f64 = morphed.triangles.iter().map(area).sum();
    assert!((sum - 36.489).abs() < 0.01, "{sum}");
}
