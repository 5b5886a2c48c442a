//! Any mesh, soups among them, through the compact stream and the plain one: the same mesh comes back.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pmesh_build::compare::difference;
use pmesh_build::import::{Model, link_seams};
use pmesh_build::pipeline::{BuildOptions, build};
use pmesh_build::simplify::{BatchOptions, Profile, collapse_batches};
use pmesh_codec::compact::{self, CompactStream};
use pmesh_codec::pmesh::{self, EncodeOptions, quantise};
use pmesh_codec::Receiver;
use pmesh_core::{IndexedMesh, Vertices};

/// Vertices: three bytes each; triangles: three bytes each, numbers of vertices.
fn mesh(bytes: &[u8], count: usize) -> IndexedMesh {
    let (positions, rest) = bytes.split_at(bytes.len().min(3 * count));
    let positions: Vec<[f32; 3]> = positions.chunks_exact(3).map(|p| [p[0].into(), p[1].into(), p[2].into()]).collect();
    let n = positions.len() as u32;
    let triangles = if n == 0 { Vec::new() } else { rest.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(|v| u32::from(v) % n)).collect() };
    let mut mesh = IndexedMesh { vertices: Vertices { positions, ..Default::default() }, triangles, ..Default::default() };
    link_seams(&mut mesh);
    mesh
}

fn received(bytes: &[u8]) -> IndexedMesh {
    let mut receiver = Receiver::default();
    receiver.push(bytes).and_then(|()| receiver.finish()).expect("what was written is read");
    receiver.mesh().check_invariants();
    receiver.mesh().finest_mesh()
}

fuzz_target!(|bytes: &[u8]| {
    let Some((&[count, how], bytes)) = bytes.split_first_chunk() else { return };
    let mesh = mesh(bytes, usize::from(count));
    let bits = (how & 1 != 0).then_some(8 + (how >> 4) % 9);
    let profile = if how & 2 != 0 { Profile::Size } else { Profile::Prefix };
    let options = BatchOptions { base_vertices: 4, profile };
    let stream = CompactStream { mesh: mesh.clone(), ..collapse_batches(&quantise(&mesh, bits), options, |_| ()) };
    let mut out = Vec::new();
    compact::encode(&stream, bits, &mut out).expect("it encodes");
    assert_eq!(difference(&received(&out), &quantise(&mesh, bits)), None);
    // Nothing to build from: said so, and no more.
    if how & 4 != 0 && !mesh.triangles.is_empty() {
        let model = Model { mesh: mesh.clone(), ..Default::default() };
        let levels = build(&model, &BuildOptions::default(), |_| ()).expect("it builds");
        let mut out = Vec::new();
        pmesh::encode(&levels, EncodeOptions { position_bits: bits }, &mut out).expect("it encodes");
        assert_eq!(difference(&received(&out), &quantise(&mesh, bits)), None);
    }
});
