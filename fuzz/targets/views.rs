//! Anything as a file for views, as what a server says, and as what a client says.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pmesh_build::hierarchy::hierarchy;
use pmesh_build::sample::knot;
use pmesh_build::simplify::{BatchOptions, collapse_batches};
use pmesh_codec::pmesh::{Quantisation, quantise};
use pmesh_core::IndexedMesh;
use pmesh_core::hierarchy::View;
use pmesh_view::message::Packets;
use pmesh_view::{Client, Model, Session, read_model, read_whole};
use std::sync::{Arc, OnceLock};

fn model() -> Arc<Model> {
    static MODEL: OnceLock<Arc<Model>> = OnceLock::new();
    let make = || {
        let sample = knot(24, 9);
        let mut mesh = IndexedMesh { triangles: sample.triangles, ..Default::default() };
        mesh.vertices.positions = sample.vertices.positions;
        let grid = Quantisation::fit(&mesh.vertices, Some(10));
        let mesh = quantise(&mesh, Some(10));
        let stream = collapse_batches(&mesh, BatchOptions::default(), |_| ());
        Arc::new(Model::new(hierarchy(&mesh, &stream).expect("a hierarchy"), &mesh.triangles, grid).expect("on its grid"))
    };
    MODEL.get_or_init(make).clone()
}

/// Messages, each behind its length.
fn messages(mut rest: &[u8]) -> Vec<&[u8]> {
    let mut out = Vec::new();
    while let Some((&length, tail)) = rest.split_first() {
        let (message, tail) = tail.split_at(usize::from(length).min(tail.len()));
        out.push(message);
        rest = tail;
    }
    out
}

fuzz_target!(|data: &[u8]| {
    let Some((&kind, rest)) = data.split_first() else { return };
    let near = View::look_at([0.0, 0.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0], [0.4, 1.5, 0.001]).expect("a view");
    let client = match kind % 6 {
        0 => {
            if let Ok(mesh) = read_whole(rest) {
                let count = mesh.vertices.len() as u32;
                assert!(mesh.triangles.iter().flatten().all(|&v| v < count));
            }
            let _ = read_model(rest);
            return;
        }
        1 => {
            let first = Client::new("m").poll().expect("a hello");
            let mut session = Session::open(&first, |_| Some(model())).expect("it opens");
            for message in messages(rest) {
                if session.receive(message).is_err() {
                    return;
                }
                for _ in 0..20 {
                    let _ = session.work(100, 1000);
                }
            }
            return;
        }
        2 => Client::new("m"),
        3 => Client::new("m").with_packets(Packets::Plain),
        4 => Client::new("m").with_packets(Packets::CutsOnly),
        _ => Client::new("m").by_names(),
    };
    let mut client = client;
    client.receive(model().base()).expect("the base mesh");
    for message in messages(rest) {
        if client.receive(message).is_err() {
            return;
        }
        for view in [near, View::everything()] {
            if client.refine(&view, 1000).is_err() {
                return;
            }
        }
        let _ = client.poll();
    }
    client.front().mesh().check_invariants();
});
