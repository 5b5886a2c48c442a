//! G.7: memory against a plain indexed mesh, counted from the real allocations. Alone in its binary: the count is global.

use peak_alloc::PeakAlloc;
use pmesh_build::import::Model;
use pmesh_build::pipeline::{BuildOptions, build};
use pmesh_build::sample::{knot, sample};
use pmesh_build::simplify::{BatchOptions, Placement, collapse_batches};
use pmesh_codec::Receiver;
use pmesh_codec::compact;
use pmesh_codec::pmesh::{EncodeOptions, encode, quantise};
use pmesh_core::ProgressiveMultilevelMesh;

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

/// What a client has after the whole stream, and bytes allocated.
struct Received {
    mesh: ProgressiveMultilevelMesh,
    /// By the mesh.
    kept: usize,
    /// By the decoder beside the mesh, at the last byte.
    decoder: usize,
    /// By both, at most. An array that grows is counted twice for a moment.
    peak: usize,
}

fn received(model: &Model, placement: Placement) -> Received {
    let stream = build(model, &BuildOptions { placement, ..Default::default() }, |_| ()).expect("it builds");
    let mut bytes = Vec::new();
    encode(&stream, EncodeOptions { position_bits: None }, &mut bytes).expect("it encodes");
    drop(stream);
    decoded(&bytes)
}

fn decoded(bytes: &[u8]) -> Received {
    let before = ALLOCATED.current_usage();
    ALLOCATED.reset_peak_usage();
    let mut receiver = Receiver::default();
    for chunk in bytes.chunks(65_536) {
        receiver.push(chunk).expect("it decodes");
        while receiver.poll().is_some() {}
    }
    receiver.finish().expect("it is whole");
    let both = ALLOCATED.current_usage() - before;
    let peak = ALLOCATED.peak_usage() - before;
    let mut mesh = receiver.into_mesh();
    let decoder = both - (ALLOCATED.current_usage() - before);
    mesh.shrink_to_fit();
    Received { mesh, kept: ALLOCATED.current_usage() - before, decoder, peak }
}

/// A decoder of a compact stream has the surface, and what models know of each vertex.
fn compact_memory() {
    // Large enough for the models' own tables not to count.
    let stream = collapse_batches(&quantise(&knot(1500, 80), Some(12)), BatchOptions::default(), |_| ());
    let mut bytes = Vec::new();
    compact::encode(&stream, Some(12), &mut bytes).expect("it encodes");
    drop(stream);
    let Received { kept, decoder, peak, .. } = decoded(&bytes);
    let [decoder, peak] = [decoder, peak].map(|bytes| bytes as f64 / kept as f64);
    println!("compact: the decoder takes {decoder:.2} of the decoded mesh; {peak:.2} with the mesh, at most while loading");
    assert!(decoder <= 2.5, "{decoder}");
    assert!(peak <= 4.2, "{peak}");
}

#[test]
fn g7_memory_is_at_most_1_112_of_a_plain_mesh() {
    let model = sample("knot").expect("a sample");
    let plain = 12 * model.mesh.vertices.len() + 12 * model.mesh.triangles.len();
    let Received { mesh, kept: bytes, peak, .. } = received(&model, Placement::Kept);
    let ratio = |bytes: usize| bytes as f64 / plain as f64;
    println!(
        "{} vertices: {:.4} of a plain indexed mesh, {:.2} at most while loading",
        mesh.vertices().len(),
        ratio(bytes),
        ratio(peak)
    );
    assert_eq!(bytes + size_of_val(&mesh), mesh.memory_bytes(), "the structure knows its own size");
    assert!(ratio(mesh.memory_bytes()) <= 1.112, "{}", ratio(mesh.memory_bytes()));
    let temporary = ALLOCATED.current_usage();
    let triangles = mesh.triangles_at(mesh.level_count() / 2).expect("a level");
    drop(triangles);
    assert_eq!(ALLOCATED.current_usage(), temporary, "the path-compressed copy is temporary");
    let Received { mesh: moving, kept: bytes, .. } = received(&model, Placement::Optimal);
    let moves = moving.vertices().len() - model.mesh.vertices.len();
    println!("with {moves} moves: {:.4}", ratio(bytes));
    assert!(moves > 0);
    compact_memory();
}
