//! Models, a way about them, and meshes as sorted triangles.
#![allow(dead_code)] // each test uses its part

use pmesh_build::hierarchy::hierarchy;
use pmesh_build::sample::sample;
use pmesh_build::simplify::{BatchOptions, collapse_batches};
use pmesh_codec::pmesh::{Quantisation, quantise};
use pmesh_core::IndexedMesh;
use pmesh_core::hierarchy::View;
use pmesh_view::{Client, Model};
use std::sync::{Arc, OnceLock};

pub const BITS: u8 = 12;

pub fn plain(mesh: IndexedMesh) -> IndexedMesh {
    let mut plain = IndexedMesh { triangles: mesh.triangles, ..Default::default() };
    plain.vertices.positions = mesh.vertices.positions;
    plain
}
pub fn model_of(mesh: &IndexedMesh, bits: Option<u8>) -> Arc<Model> {
    let grid = Quantisation::fit(&mesh.vertices, bits);
    let mesh = quantise(mesh, bits);
    let stream = collapse_batches(&mesh, BatchOptions::default(), |_| ());
    Arc::new(Model::new(hierarchy(&mesh, &stream).expect("a hierarchy"), &mesh.triangles, grid).expect("on its grid"))
}
pub fn part() -> (IndexedMesh, Arc<Model>) {
    static PART: OnceLock<(IndexedMesh, Arc<Model>)> = OnceLock::new();
    let make = || {
        let mesh = quantise(&plain(sample("part").expect("a sample").mesh), Some(BITS));
        let model = model_of(&mesh, Some(BITS));
        (mesh, model)
    };
    PART.get_or_init(make).clone()
}

/// Some way about a model, and back, twice: the paper's lap.
pub fn lap(model: &Model, steps: u32) -> Vec<View> {
    let positions: Vec<_> = (0..model.hierarchy().nodes().len() as u32).map(|i| model.hierarchy().position(i)).collect();
    let bound = |f: fn(f32, f32) -> f32, from: f32| [0, 1, 2].map(|k| positions.iter().map(|p| p[k]).fold(from, f));
    let (low, high) = (bound(f32::min, f32::INFINITY), bound(f32::max, f32::NEG_INFINITY));
    let centre = [0, 1, 2].map(|k| (low[k] + high[k]) / 2.0);
    let size = (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max);
    let at = |i: u32| {
        let a = i as f32 / steps as f32 * std::f32::consts::TAU;
        let d = size * (1.2 + 0.9 * a.cos());
        let eye = [centre[0] + d * a.sin(), centre[1] + 0.3 * size, centre[2] + d * a.cos()];
        View::look_at(eye, centre, [0.0, 1.0, 0.0], [0.4, 1.5, 0.002]).expect("a view")
    };
    (0..steps).map(at).collect()
}

/// A sample and its hierarchy.
pub fn of_sample(name: &str) -> (IndexedMesh, Arc<Model>) {
    let mesh = quantise(&plain(sample(name).expect("a sample").mesh), Some(BITS));
    let model = model_of(&mesh, Some(BITS));
    (mesh, model)
}
/// Puts right checksums into a file of blocks, as far as it can be read: block after block from the last, since each has those of the ones below it.
pub fn mend(file: &mut [u8]) {
    let four = |file: &[u8], at: usize| file.get(at..at + 4).map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])) as usize;
    let head = four(file, 9);
    if head < 30 || head > file.len() {
        return;
    }
    let varint = |file: &[u8], at: &mut usize| {
        let mut x = 0u64;
        for shift in 0..5 {
            let byte = file.get(*at).copied().unwrap_or(0);
            *at += 1;
            x |= u64::from(byte & 127) << (7 * shift);
            if byte < 128 {
                break;
            }
        }
        x as usize
    };
    // Start and length of each block, and where its checksum stands.
    let mut found = Vec::new();
    let mut at = 18 + four(file, 13).min(head);
    let length = varint(file, &mut at);
    (0..2).for_each(|_| _ = varint(file, &mut at));
    found.push((head, length, at));
    let mut i = 0;
    while i < found.len() && found.len() < 1000 {
        let mut at = found[i].0;
        i += 1;
        let children = varint(file, &mut at).min(1000);
        let mut start = (0..6).map(|k| (file.get(at + k).copied().unwrap_or(0) as usize) << (8 * k)).sum::<usize>();
        at += 6;
        for _ in 0..children {
            let length = varint(file, &mut at);
            (0..2).for_each(|_| _ = varint(file, &mut at));
            found.push((start, length, at));
            at += 4;
            start += length;
        }
    }
    for (start, length, at) in found.into_iter().rev() {
        let Some(bytes) = file.get(start..start.saturating_add(length)) else { continue };
        let checksum = crc32fast::hash(bytes).to_le_bytes();
        if let Some(place) = file.get_mut(at..at + 4) {
            place.copy_from_slice(&checksum);
        }
    }
    let checksum = crc32fast::hash(&file[..head - 4]).to_le_bytes();
    file[head - 4..head].copy_from_slice(&checksum);
}

pub fn sorted(triangles: impl Iterator<Item = [[u32; 3]; 3]>) -> Vec<[[u32; 3]; 3]> {
    let mut all: Vec<_> = triangles.map(|[a, b, c]| [a, b, c].min([b, c, a]).min([c, a, b])).collect();
    all.sort_unstable();
    all
}
pub fn shown(client: &Client) -> Vec<[[u32; 3]; 3]> {
    let front = client.front();
    let at = |v: u32| front.positions()[v as usize].map(f32::to_bits);
    sorted(front.mesh().shown().iter().filter_map(|&t| front.mesh().triangle(t)).map(|t| t.map(at)))
}
pub fn of(mesh: &IndexedMesh) -> Vec<[[u32; 3]; 3]> {
    sorted(mesh.triangles.iter().map(|t| t.map(|v| mesh.vertices.positions[v as usize].map(f32::to_bits))))
}
