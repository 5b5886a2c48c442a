//! What decodes at the last level is the input, exactly; every level and every prefix is a valid mesh.

mod common;

use common::no_level_has_a_hole;
use pmesh_build::compare::difference;
use pmesh_build::import::Model;
use pmesh_build::pipeline::{BuildOptions, LevelRule, Steps, build};
use pmesh_build::sample::sample;
use pmesh_build::simplify::Placement;
use pmesh_codec::Receiver;
use pmesh_codec::pmesh::{EncodeOptions, encode, quantise};
use pmesh_core::{IndexedMesh, ProgressiveMultilevelMesh, reference};

fn decode(bytes: &[u8]) -> ProgressiveMultilevelMesh {
    let mut receiver = Receiver::default();
    receiver.push(bytes).expect("it decodes");
    receiver.finish().expect("it is whole");
    receiver.into_mesh()
}

fn round_trip(model: &Model, bits: Option<u8>, options: &BuildOptions) -> Vec<u8> {
    let stream = build(model, options, |_| ()).expect("it builds");
    let mut bytes = Vec::new();
    encode(&stream, EncodeOptions { position_bits: bits }, &mut bytes).expect("it encodes");
    let mesh = decode(&bytes);
    mesh.check_invariants();
    assert_eq!(difference(&mesh.finest_mesh(), &quantise(&model.mesh, bits)), None);
    for level in 0..mesh.level_count() {
        assert_eq!(mesh.triangles_at(level), reference::triangles_at(&mesh, level), "level {level}");
        mesh.mesh_at(level.into()).expect("the level is there").check().expect("it is valid");
    }
    bytes
}

#[test]
fn every_sample_comes_back_exactly() {
    for name in ["marble", "tetrahedra", "knot", "part"] {
        let model = sample(name).expect("a sample");
        round_trip(&model, Some(12), &BuildOptions::default());
        round_trip(&model, None, &BuildOptions::default());
    }
}

#[test]
fn no_level_of_a_closed_mesh_has_a_hole_seams_and_vanishing_components_included() {
    let mut model = pmesh_build::sample::globe(40);
    // Small globes around the large one, which vanish early.
    let (vertices, triangles) = (model.mesh.vertices.clone(), model.mesh.triangles.clone());
    for i in 0..6 {
        let first = model.mesh.vertices.len() as u32;
        let mut small = vertices.clone();
        for p in &mut small.positions {
            *p = [p[0] * 0.05 + 2.0, p[1] * 0.05 + i as f32, p[2] * 0.05];
        }
        model.mesh.vertices.extend_from(&small);
        model.mesh.triangles.extend(triangles.iter().map(|t| t.map(|v| v + first)));
    }
    pmesh_build::import::link_seams(&mut model.mesh);
    for steps in [Steps::Growth(1.5), Steps::Growth(1.1), Steps::Count(3)] {
        let bytes = round_trip(&model, None, &BuildOptions { steps, ..Default::default() });
        no_level_has_a_hole(&decode(&bytes));
    }
    let star = BuildOptions { rule: LevelRule::Star, steps: Steps::Count(12), ..Default::default() };
    no_level_has_a_hole(&decode(&round_trip(&model, None, &star)));
    let mut moving = pmesh_build::sample::globe(30);
    pmesh_build::import::link_seams(&mut moving.mesh);
    let options = BuildOptions { placement: Placement::Optimal, ..Default::default() };
    round_trip(&moving, None, &options);
}

#[test]
fn moving_vertices_return_bit_for_bit() {
    let model = sample("part").expect("a sample");
    let options = BuildOptions { placement: Placement::Optimal, ..Default::default() };
    round_trip(&model, None, &options);
    round_trip(&model, Some(14), &options);
}

#[test]
fn the_star_rule_comes_back_exactly() {
    let model = sample("part").expect("a sample");
    round_trip(&model, Some(12), &BuildOptions { rule: LevelRule::Star, steps: Steps::Count(9), ..Default::default() });
}

#[test]
fn isolated_duplicate_and_degenerate_input_is_kept() {
    let mut model = sample("part").expect("a sample");
    let mesh = &mut model.mesh;
    for i in 0..50 {
        mesh.vertices.positions.push([i as f32, 0.0, 2.0]);
        let t = mesh.triangles[i * 7];
        mesh.triangles.push(t);
        mesh.triangles.push([t[1], t[2], t[0]]);
        mesh.triangles.push([t[0], t[0], t[1]]);
        mesh.triangles.push([t[2], t[1], t[0]]);
    }
    pmesh_build::import::link_seams(mesh);
    round_trip(&model, Some(12), &BuildOptions::default());
}

#[test]
fn soups_and_tiny_meshes_come_back_exactly() {
    let mut soup = IndexedMesh::default();
    let mut state = 1u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 16) as f32 / 65536.0
    };
    for _ in 0..300 {
        soup.vertices.positions.push([random(), random(), random()]);
    }
    for _ in 0..900 {
        soup.triangles.push(std::array::from_fn(|_| (random() * 300.0) as u32));
    }
    let model = |mesh| Model { mesh, ..Default::default() };
    for base in [0, 1, 60] {
        let options = BuildOptions { base_triangles: base, ..Default::default() };
        round_trip(&model(soup.clone()), Some(10), &options);
        let mut one = soup.clone();
        one.triangles.truncate(1);
        round_trip(&model(one.clone()), None, &options);
        one.triangles.clear();
        round_trip(&model(one), Some(16), &options);
    }
}

/// Real meshes, where they lie beside the project.
#[test]
fn real_meshes_come_back_exactly() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/models");
    for name in ["suzanne.obj", "teapot.obj", "pirate.obj", "spot.obj", "cow.obj", "fandisk.obj", "rgb_nefertiti.off"] {
        let Ok(bytes) = std::fs::read(folder.join(name)) else { continue };
        let model = pmesh_build::import::import(name, &bytes, &mut |_| None).expect(name);
        let options = BuildOptions::default();
        for bits in [Some(12), None] {
            round_trip(&model, bits, &options);
        }
    }
}
