//! Conformance items that need builders: G.3, G.5, G.6, G.7, G.8, named after them.

use pmesh_build::arrange::arrange;
use pmesh_build::cluster::{Clustering, levels_from_clusterings};
use pmesh_build::import::Model;
use pmesh_build::pipeline::{BuildOptions, build};
use pmesh_build::rule::{Replay, replay};
use pmesh_build::sample::{knot, sample, sierpinski, sierpinski_steps};
use pmesh_build::simplify::Placement;
use pmesh_codec::text::{self, TextOptions};
use pmesh_core::forest::{NO_REPRESENTATIVE, ancestor_below};
use pmesh_core::{IndexedMesh, Level, ProgressiveMultilevelMesh, Vertices, reference};

fn mesh_of(levels: &[Level]) -> ProgressiveMultilevelMesh {
    let mut mesh = ProgressiveMultilevelMesh::new(levels[0].vertices.set());
    for level in levels {
        mesh.add_level(level).expect("it fits");
        mesh.check_invariants();
    }
    mesh
}

fn built(model: &Model, options: &BuildOptions) -> ProgressiveMultilevelMesh {
    mesh_of(&build(model, options, |_| ()).expect("it builds").levels)
}

fn vertices(positions: &[[f32; 3]]) -> Vertices {
    Vertices { positions: positions.to_vec(), ..Default::default() }
}

/// Representatives that the text format gives: those behind the triangles.
fn representatives_in_text(mesh: &ProgressiveMultilevelMesh) -> usize {
    let mut text = Vec::new();
    text::write(mesh, TextOptions::default(), &mut text).expect("it writes");
    let text = String::from_utf8(text).expect("text");
    let blocks = text.split('{').skip(2).step_by(2);
    let numbers = |line: &str| line.split(',').filter(|w| !w.trim().is_empty()).count();
    blocks.flat_map(|b| b.lines().skip(1).take_while(|l| !l.contains('}'))).map(|l| numbers(l) - 3).sum()
}

#[test]
fn g3_figures_6_and_13_are_made_from_clusterings_with_three_representatives_each() {
    // Figure 12: {1,7,8,9} first, then {0,4,5,6}.
    let p = [[-3., 3.], [3., 3.], [-3., -3.], [3., -3.], [-2.3, 3.], [-3., 2.3], [-2.3, 2.3], [2.3, 3.], [2.3, 2.3], [3., 2.3]];
    let p = p.map(|[x, y]: [f32; 2]| [x, y, 0.0]);
    let triangles =
        vec![[6, 2, 8], [3, 8, 2], [4, 6, 7], [5, 2, 6], [6, 4, 5], [4, 0, 5], [8, 3, 9], [9, 1, 8], [7, 8, 1], [8, 7, 6]];
    let finest = IndexedMesh { vertices: vertices(&p), triangles, position_of: vec![] };
    let steps = [
        Clustering { vertices: vertices(&p[..7]), map: vec![0, 1, 2, 3, 4, 5, 6, 1, 1, 1] },
        Clustering { vertices: vertices(&p[..4]), map: vec![0, 1, 2, 3, 0, 0, 0] },
    ];
    let mesh = mesh_of(&levels_from_clusterings(&finest, &steps).expect("it clusters"));
    let counts = |l| (mesh.vertex_count(l).expect("l"), mesh.triangle_count(l).expect("l"));
    assert_eq!([2, 1, 0].map(counts), [(4, 2), (7, 6), (10, 10)]);
    assert_eq!(representatives_in_text(&mesh), 3);
    let mesh = mesh_of(&levels_from_clusterings(&sierpinski(1), &sierpinski_steps(1)).expect("it clusters"));
    assert_eq!([1, 0].map(|l| mesh.triangle_count(l).expect("l")), [4, 16]);
    assert_eq!(representatives_in_text(&mesh), 3);
}

#[test]
fn the_model_of_figure_11_goes_from_64_triangles_over_16_to_4() {
    let mesh = mesh_of(&levels_from_clusterings(&sierpinski(2), &sierpinski_steps(2)).expect("it clusters"));
    assert_eq!([2, 1, 0].map(|l| mesh.triangle_count(l).expect("l")), [4, 16, 64]);
    for level in 0..3 {
        assert_eq!(mesh.triangles_at(level), reference::triangles_at(&mesh, level));
    }
}

/// The fixture of A.34.
fn grid16() -> (IndexedMesh, Vec<(u32, u32)>) {
    let mut mesh = IndexedMesh::default();
    mesh.vertices.positions = (0..16).map(|i| [(i % 4) as f32, (i / 4) as f32, 0.0]).collect();
    for row in 0..3 {
        for column in 0..3 {
            let a = 4 * row + column;
            mesh.triangles.extend([[a, a + 1, a + 5], [a, a + 5, a + 4]]);
        }
    }
    (mesh, vec![(5, 1), (3, 7), (10, 15), (9, 15), (6, 1), (4, 0), (13, 14), (14, 15), (2, 7)])
}

#[test]
fn g5_grid16_has_the_levels_blue_triangles_and_requirements_of_a34() {
    let (mesh, pairs) = grid16();
    let r = replay(&mesh, &pairs).expect("it replays");
    assert_eq!(r.collapses.iter().map(|c| c.level).collect::<Vec<_>>(), [1, 1, 2, 3, 4, 5, 4, 6, 5]);
    assert_eq!(r.top, 7);
    let blue: Vec<&[u32]> = r.collapses.iter().map(|c| &c.blue_triangles[..]).collect();
    let expected: [&[u32]; 9] = [&[0, 3], &[4], &[16, 17], &[9, 14], &[2, 8], &[1], &[15], &[12], &[5]];
    assert_eq!(blue, expected);
    let requires: Vec<&[u32]> = r.collapses.iter().map(|c| &c.requires[..]).collect();
    let expected: [&[u32]; 9] = [&[], &[], &[0], &[0, 2], &[0, 1, 2, 3], &[0, 2, 3, 4], &[2, 3], &[0, 2, 3, 4, 5, 6], &[0, 1, 4]];
    assert_eq!(requires, expected);
    assert_eq!(r.vertex_levels.iter().filter(|&&l| l == 7).count(), 7);
    assert_eq!(r.triangle_levels.iter().filter(|&&l| l == 7).count(), 5);
}

/// D.5: at every cut, each collapse that is still done has the star it was done on.
fn every_cut_is_consistent(mesh: &IndexedMesh, pairs: &[(u32, u32)], r: &Replay) {
    for cut in 1..=r.top {
        let done: Vec<usize> = (0..pairs.len()).filter(|&i| r.collapses[i].level < cut).collect();
        let replayed = replay(mesh, &done.iter().map(|&i| pairs[i]).collect::<Vec<_>>()).expect("it replays");
        for (again, &i) in replayed.collapses.iter().zip(&done) {
            assert_eq!((&again.star, &again.blue_triangles), (&r.collapses[i].star, &r.collapses[i].blue_triangles), "cut {cut}");
        }
    }
}

#[test]
fn g5_every_cut_by_level_is_consistent() {
    let (mesh, pairs) = grid16();
    every_cut_is_consistent(&mesh, &pairs, &replay(&mesh, &pairs).expect("it replays"));
    let model = Model { mesh: knot(40, 8), ..Default::default() };
    let simplified = pmesh_build::simplify::simplify(
        &model.mesh,
        pmesh_build::simplify::SimplifyOptions { target_triangles: 40, placement: Placement::Kept },
        |_| (),
    );
    let pairs = simplified.expect("it simplifies").pairs;
    every_cut_is_consistent(&model.mesh, &pairs, &replay(&model.mesh, &pairs).expect("it replays"));
}

#[test]
fn a_vertex_that_loses_its_last_triangle_with_the_red_one_knows_of_the_collapse() {
    // Two triangles that meet at vertex 0 alone. 2 -> 1 takes the first away, and with it 1 from the star of 0.
    let mut mesh = IndexedMesh { triangles: vec![[0, 1, 2], [0, 3, 4]], ..Default::default() };
    mesh.vertices.positions = (0..5).map(|i| [i as f32, (i * i) as f32, 0.0]).collect();
    let pairs = [(2, 1), (0, 3)];
    let r = replay(&mesh, &pairs).expect("it replays");
    assert_eq!((r.collapses[1].level, &r.collapses[1].requires[..]), (2, &[0][..]));
    every_cut_is_consistent(&mesh, &pairs, &r);
}

#[test]
fn g5_merged_levels_are_the_figure_5_totals() {
    let (mesh, pairs) = grid16();
    let r = replay(&mesh, &pairs).expect("it replays");
    // Figure 5's three levels hold 7, 13 and 16 vertices; GRID16 merges its seven at the same places.
    let forest = r.merged(&[2, 6]);
    let out = arrange(&mesh, &forest).expect("it arranges").mesh;
    let counts = |l| (out.vertex_count(l).expect("l"), out.triangle_count(l).expect("l"));
    assert_eq!([2, 1, 0].map(counts), [(7, 5), (13, 13), (16, 18)]);
    assert!(replay(&mesh, &[(5, 1), (5, 2)]).expect_err("5 is gone").to_string().contains("collapse 1"));
}

#[test]
fn g6_set_level_from_any_level_to_any_other_equals_a_fresh_build_and_leaves_the_forest_alone() {
    let model = Model { mesh: knot(60, 10), ..Default::default() };
    let levels = build(&model, &BuildOptions::default(), |_| ()).expect("it builds").levels;
    let mut mesh = mesh_of(&levels);
    let before = mesh.representatives().to_vec();
    let count = mesh.level_count();
    for from in 0..count {
        for to in 0..count {
            mesh.set_level(from.into()).expect("a number");
            mesh.set_level(to.into()).expect("a number");
            assert_eq!(mesh.level(), f64::from(to));
            let fresh = mesh_of(&levels[..(count - to) as usize]);
            let mut expected = fresh.triangles_at(0).expect("its finest");
            let mut got = mesh.triangles_at(to).expect("the level");
            expected.sort_unstable();
            got.sort_unstable();
            assert_eq!(got, expected, "{from} to {to}");
            assert_eq!(mesh.prefix().triangle_count, fresh.prefix().triangle_count);
        }
    }
    assert_eq!(mesh.representatives(), before);
}

#[test]
fn g6_a_level_that_was_asked_for_is_kept_until_it_arrives() {
    let model = Model { mesh: knot(60, 10), ..Default::default() };
    let levels = build(&model, &BuildOptions::default(), |_| ()).expect("it builds").levels;
    let count = levels.len() as u32;
    let mut mesh = ProgressiveMultilevelMesh::new(Default::default());
    mesh.declare_level_count(count);
    mesh.set_level(2.5).expect("a number");
    for (step, level) in levels.iter().enumerate() {
        mesh.add_level(level).expect("it fits");
        assert_eq!(mesh.level(), 2.5f64.max(f64::from(count - 1 - step as u32)));
    }
    assert!(mesh.set_level(f64::NAN).is_err());
    mesh.set_level(f64::INFINITY).expect("the coarsest");
    assert_eq!(mesh.level(), f64::from(count - 1));
    mesh.follow_newest();
    assert_eq!(mesh.level(), 0.0);
}

#[test]
fn g7_moving_reds_return_bit_for_bit() {
    let model = sample("part").expect("a sample");
    let mesh = built(&model, &BuildOptions { placement: Placement::Optimal, ..Default::default() });
    let mut expected: Vec<_> = model.mesh.vertices.positions.iter().map(|p| p.map(f32::to_bits)).collect();
    let mut got: Vec<_> = mesh.finest_mesh().vertices.positions.iter().map(|p| p.map(f32::to_bits)).collect();
    expected.sort_unstable();
    got.sort_unstable();
    assert_eq!(got, expected);
    let coarse = mesh.mesh_at(f64::from(mesh.level_count() - 1)).expect("the coarsest");
    let stays = |p: &[f32; 3]| expected.binary_search(&p.map(f32::to_bits)).is_ok();
    assert!(!coarse.vertices.positions.iter().all(stays), "coarse vertices stand where they fit best");
}

#[test]
fn g8_geomorphs_begin_at_the_coarser_level_end_at_the_finer_and_are_linear_between() {
    for placement in [Placement::Kept, Placement::Optimal] {
        let model = Model { mesh: knot(60, 10), ..Default::default() };
        let mesh = built(&model, &BuildOptions { placement, ..Default::default() });
        for level in 0..mesh.level_count() - 1 {
            let x = f64::from(level);
            let corners = |t: f64| -> Vec<[f32; 3]> {
                let end = mesh.triangle_count(level).expect("a level") as usize;
                let all = mesh.triangles()[..end].iter().flatten();
                all.map(|&v| reference::corner_position(&mesh, v, x + t).expect("a level")).collect()
            };
            let (fine, half) = (corners(0.0), corners(0.5));
            let coarse_count = mesh.vertex_end(level + 1).expect("a level");
            let ends: Vec<[f32; 3]> = mesh.triangles()[..fine.len() / 3]
                .iter()
                .flatten()
                .map(|&v| mesh.vertices().positions[ancestor_below(mesh.representatives(), v, coarse_count) as usize])
                .collect();
            for ((f, c), h) in fine.iter().zip(&ends).zip(&half) {
                for k in 0..3 {
                    assert!((h[k] - (f[k] + c[k]) / 2.0).abs() < 1e-5);
                }
            }
            assert!(
                mesh.representatives().iter().filter(|&&p| p == NO_REPRESENTATIVE).count() as u32
                    <= mesh.vertex_end(mesh.level_count() - 1).expect("coarsest")
            );
            // The fast path draws the same.
            let morphed = mesh.mesh_at(x + 0.5).expect("a fraction");
            assert_eq!(morphed.triangles.len(), mesh.triangles_at(level).expect("a level").len());
        }
    }
}
