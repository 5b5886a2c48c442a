//! A hierarchy as a file of blocks: `.pmesh`, version 4. docs/FORMAT.md has every byte.

use crate::base::Base;
use crate::error::ProtocolError;
use crate::file_client::FileClient;
use crate::message::{Reply, read_reply};
use crate::model::Model;
use crate::pack::{BlockSizes, Packed, SPLITS_LIMIT, pack};
use crate::splits::Spent;
use pmesh_codec::pmesh::{SIGNATURE, VIEWS_VERSION as VERSION};
use pmesh_core::IndexedMesh;
use pmesh_core::hierarchy::{Bounds, Front, NONE, VertexHierarchy, View};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Signature, version, and length of all before the first block.
const PREAMBLE_BYTES: usize = 8 + 1 + 4;
/// Nobody guesses a checksum.
const FUZZING: bool = cfg!(fuzzing);
/// Bytes of where the blocks below one start.
const START_BYTES: usize = 6;
/// Most bytes before the first block.
const HEAD_LIMIT: u32 = 1 << 28;

/// True if a file begins as one that holds a hierarchy.
pub fn is_file(bytes: &[u8]) -> bool {
    bytes.starts_with(&SIGNATURE) && bytes.get(SIGNATURE.len()) == Some(&VERSION)
}

/// Packs a model into a file. Gives the bits of its splits by what they say, too. O(n log n). Errors: a hierarchy that is none.
pub fn write_file(model: &Model) -> Result<(Vec<u8>, Spent), ProtocolError> {
    write_file_of(model, BlockSizes::default())
}
/// The same in blocks of other sizes: smaller ones have less that a view does not need, larger ones are told with less.
pub fn write_file_of(model: &Model, sizes: BlockSizes) -> Result<(Vec<u8>, Spent), ProtocolError> {
    let (packed, spent) = pack(model, sizes)?;
    // Lengths from the last block to the first, since each names those below it; then where they start; then their bytes, from the last again.
    let entry = |length: u32, p: &Packed| [length, p.splits, p.roots].into_iter().map(varint_bytes).sum::<u32>() + 4;
    let below = |p: &Packed| p.child as usize..(p.child + p.children) as usize;
    let mut lengths = vec![0u32; packed.len()];
    for (i, p) in packed.iter().enumerate().rev() {
        let table: u32 = below(p).map(|c| entry(lengths[c], &packed[c])).sum();
        let start = if p.children > 0 { START_BYTES as u32 } else { 0 };
        lengths[i] = varint_bytes(p.children) + start + table + p.bytes.len() as u32;
    }
    let first = packed.first().map_or(0, |p| entry(lengths[0], p));
    let head = PREAMBLE_BYTES as u64 + 4 + model.base().len() as u64 + 1 + u64::from(first) + 4;
    let mut starts = vec![head; packed.len()];
    for i in 1..packed.len() {
        starts[i] = starts[i - 1] + u64::from(lengths[i - 1]);
    }
    let mut blocks: Vec<Vec<u8>> = vec![Vec::new(); packed.len()];
    let write_entry = |out: &mut Vec<u8>, i: usize, bytes: &[u8]| {
        [lengths[i], packed[i].splits, packed[i].roots].into_iter().for_each(|x| varint(out, x));
        out.extend(crc32fast::hash(bytes).to_le_bytes());
    };
    for (i, p) in packed.iter().enumerate().rev() {
        let mut out = Vec::with_capacity(lengths[i] as usize);
        varint(&mut out, p.children);
        if p.children > 0 {
            out.extend(&starts[p.child as usize].to_le_bytes()[..START_BYTES]);
        }
        below(p).for_each(|c| write_entry(&mut out, c, &blocks[c]));
        out.extend(&p.bytes);
        blocks[i] = out;
    }
    let mut out = SIGNATURE.to_vec();
    out.push(VERSION);
    out.extend((head as u32).to_le_bytes());
    out.extend((model.base().len() as u32).to_le_bytes());
    out.extend(model.base());
    out.push(u8::from(!packed.is_empty()));
    if !packed.is_empty() {
        write_entry(&mut out, 0, &blocks[0]);
    }
    out.extend(crc32fast::hash(&out).to_le_bytes());
    blocks.iter().for_each(|b| out.extend(b));
    Ok((out, spent))
}

fn varint(out: &mut Vec<u8>, mut x: u32) {
    while x >= 128 {
        out.push(x as u8 | 128);
        x >>= 7;
    }
    out.push(x as u8);
}
fn varint_bytes(x: u32) -> u32 {
    (32 - x.leading_zeros()).max(1).div_ceil(7)
}

/// A block, as the one above it names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Block {
    /// Its first byte in the file.
    pub(crate) start: u64,
    /// Its bytes.
    pub(crate) length: u32,
    /// Its splits.
    pub(crate) splits: u32,
    /// Nodes that it begins at.
    pub(crate) roots: u32,
    checksum: u32,
}

impl Block {
    /// The blocks below it, and the bytes of its splits. Errors: bytes that are not those that were packed.
    pub(crate) fn open<'a>(&self, bytes: &'a [u8]) -> Result<(Vec<Block>, &'a [u8]), ProtocolError> {
        if bytes.len() != self.length as usize || (crc32fast::hash(bytes) != self.checksum && !FUZZING) {
            return Err(ProtocolError::Damaged { at: self.start });
        }
        let mut r = Table { bytes, at: 0 };
        let count = r.varint()?;
        // Seven bytes each at least.
        if count as usize > bytes.len() / 7 {
            return r.error("so many blocks below one");
        }
        let mut start = 0;
        for k in 0..if count > 0 { START_BYTES } else { 0 } {
            start |= u64::from(r.byte()?) << (8 * k);
        }
        let below = (0..count).map(|_| r.block(&mut start)).collect::<Result<Vec<_>, _>>()?;
        // Each is behind this one, so that none is above itself.
        if below.first().is_some_and(|b| b.start < self.start + u64::from(self.length)) {
            return r.error("a block below one that is before it");
        }
        Ok((below, &bytes[r.at..]))
    }
}

/// What stands before the first block.
#[derive(Clone, Debug, PartialEq)]
pub struct Head {
    /// The base mesh.
    pub base: Base,
    /// Bytes before the first block.
    pub length: u64,
    pub(crate) first: Option<Block>,
}

impl Head {
    /// Reads the beginning of a file: `Ok(Err(n))` if `n` bytes are needed. Errors: another file, or a damaged one.
    pub fn read(bytes: &[u8]) -> Result<Result<Self, u64>, ProtocolError> {
        let known = SIGNATURE.len().min(bytes.len());
        if bytes[..known] != SIGNATURE[..known] || bytes.get(SIGNATURE.len()).is_some_and(|&v| v != VERSION) {
            let what =
                "no .pmesh for views: leave out view-dependent, or make one by pmesh encode MESH -o FILE.pmesh --profile views";
            return Err(ProtocolError::Syntax { at: 0, what });
        }
        let Some(&[a, b, c, d]) = bytes.get(SIGNATURE.len() + 1..PREAMBLE_BYTES) else { return Ok(Err(PREAMBLE_BYTES as u64)) };
        let length = u32::from_le_bytes([a, b, c, d]);
        if length > HEAD_LIMIT || (length as usize) < PREAMBLE_BYTES + 9 {
            return Err(ProtocolError::Syntax { at: SIGNATURE.len() + 1, what: "a head of such a length" });
        }
        let Some(head) = bytes.get(..length as usize) else { return Ok(Err(length.into())) };
        let (body, checksum) = head.split_at(head.len() - 4);
        if crc32fast::hash(body).to_le_bytes() != checksum && !FUZZING {
            return Err(ProtocolError::Damaged { at: 0 });
        }
        let mut r = Table { bytes: body, at: PREAMBLE_BYTES };
        let size = r.four()? as usize;
        let Some(base) = body.get(r.at..r.at.saturating_add(size)) else { return r.error("a base mesh past the end") };
        let Reply::Base(base) = read_reply(base)? else { return r.error("no base mesh") };
        r.at += size;
        let first = match r.byte()? {
            0 => None,
            1 => Some(r.block(&mut length.into())?),
            _ => return r.error("neither blocks nor none"),
        };
        if r.at != body.len() {
            return r.error("bytes after the head's end");
        }
        Ok(Ok(Self { base, length: length.into(), first }))
    }
}

struct Table<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Table<'_> {
    fn error<T>(&self, what: &'static str) -> Result<T, ProtocolError> {
        Err(ProtocolError::Syntax { at: self.at, what })
    }
    fn byte(&mut self) -> Result<u8, ProtocolError> {
        let Some(&byte) = self.bytes.get(self.at) else { return self.error("it ends too early") };
        self.at += 1;
        Ok(byte)
    }
    /// A block that starts there; moves on to the next.
    fn block(&mut self, start: &mut u64) -> Result<Block, ProtocolError> {
        let (length, splits, roots) = (self.varint()?, self.varint()?, self.varint()?);
        let block = Block { start: *start, length, splits, roots, checksum: self.four()? };
        if splits > SPLITS_LIMIT || splits == 0 || roots == 0 || length == 0 {
            return self.error("a block that cannot be");
        }
        *start += u64::from(length);
        Ok(block)
    }
    fn four(&mut self) -> Result<u32, ProtocolError> {
        Ok(u32::from_le_bytes([self.byte()?, self.byte()?, self.byte()?, self.byte()?]))
    }
    fn varint(&mut self) -> Result<u32, ProtocolError> {
        let mut x = 0u64;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            x |= u64::from(byte & 127) << shift;
            if byte < 128 {
                return u32::try_from(x).or_else(|_| self.error("a number of more than 32 bits"));
            }
        }
        self.error("a number that does not end")
    }
}

/// All that these bytes hold of a file, and why that is not all of it.
fn read_all(bytes: &[u8]) -> Result<(FileClient, Option<ProtocolError>), ProtocolError> {
    let mut client = FileClient::default();
    client.receive(0, bytes)?;
    if client.viewer().is_empty() {
        return Err(ProtocolError::Syntax { at: bytes.len(), what: "it ends before the base mesh is whole" });
    }
    let cut = ProtocolError::Syntax { at: bytes.len(), what: "the file ends too early, in the middle of a block" };
    let (mut block, mut error) = (0, None);
    while block < client.block_count() {
        let (start, length) = client.place(block);
        let place = usize::try_from(start).ok().and_then(|from| bytes.get(from..from.checked_add(length as usize)?));
        match place {
            Some(bytes) => {
                client.keep(block, bytes);
                // What lies below one that is damaged is not known.
                match client.load(block) {
                    Ok(true) => {}
                    Ok(false) => error = error.or_else(|| Some(cut.clone())),
                    Err(e) => error = error.or(Some(e)),
                }
            }
            None => error = error.or_else(|| Some(cut.clone())),
        }
        block += 1;
    }
    Ok((client, error))
}
/// The same, that must be whole.
fn read_every(bytes: &[u8]) -> Result<FileClient, ProtocolError> {
    match read_all(bytes)? {
        (client, None) => Ok(client),
        (_, Some(error)) => Err(error),
    }
}
fn mesh_of(mut client: FileClient) -> Result<IndexedMesh, ProtocolError> {
    while client.refine(&View::everything(), u32::MAX)?.splits > 0 {}
    let front = client.viewer().front();
    // Those that are there: of a part of a file some vertices wait for others.
    let mut number = vec![NONE; front.positions().len()];
    let mut mesh = IndexedMesh::default();
    for t in front.mesh().shown().iter().filter_map(|&t| front.mesh().triangle(t)) {
        mesh.triangles.push(t.map(|v| {
            if number[v as usize] == NONE {
                number[v as usize] = mesh.vertices.positions.len() as u32;
                mesh.vertices.positions.push(front.positions()[v as usize]);
            }
            number[v as usize]
        }));
    }
    Ok(mesh)
}

/// All of a file as a mesh: positions and triangles. O(n). Errors: a damaged file.
pub fn read_whole(bytes: &[u8]) -> Result<IndexedMesh, ProtocolError> {
    mesh_of(read_every(bytes)?)
}
/// What can be read of a file that is cut or damaged, as [`read_whole`]. Errors: less than its base mesh.
pub fn read_part(bytes: &[u8]) -> Result<IndexedMesh, ProtocolError> {
    mesh_of(read_all(bytes)?.0)
}

/// All of a file as what a server has. O(n · depth). Errors: a damaged file.
pub fn read_model(bytes: &[u8]) -> Result<Model, ProtocolError> {
    let mut client = read_every(bytes)?;
    let base = triangles(client.viewer().front());
    while client.refine(&View::everything(), u32::MAX)?.splits > 0 {}
    let viewer = client.viewer();
    let front = viewer.front();
    let roots = front.root_count();
    let node = |i: u32| front.node(i).ok_or(ProtocolError::Unexpected("a node that is not there"));
    let vertex_of_child = |child: u32| roots + (child - roots) / 2;
    // About as they were collapsed, the last first: what is farthest off splits first.
    let mut order: Vec<u32> = (0..roots).collect();
    let mut splits = Vec::new();
    let rank = |i: u32| node(i).map(|n| (n.bounds.uniform.max(n.bounds.directional), n.bounds.radius, Reverse(i), n.child));
    let mut next = order.iter().map(|&i| rank(i)).collect::<Result<BinaryHeap<_>, _>>()?;
    while let Some((_, _, Reverse(i), child)) = next.pop() {
        if child != NONE {
            splits.push((i, child));
            order.extend([child, child + 1]);
            next.extend([rank(child)?, rank(child + 1)?]);
        }
    }
    // Of each node the vertex that it stands at: a first child stands where its parent does.
    let mut vertex: Vec<u32> = (0..front.known() as u32).collect();
    for &(i, child) in &splits {
        (vertex[child as usize], vertex[child as usize + 1]) = (vertex[i as usize], vertex_of_child(child));
    }
    let mut collapses = Vec::with_capacity(splits.len());
    for &(i, child) in splits.iter().rev() {
        let mut cuts = [NONE; 2];
        for (cut, id) in cuts.iter_mut().zip(node(i)?.cuts) {
            if let Some(id) = id {
                let leaf = front.find(id).filter(|&n| front.node(n).is_some_and(|k| k.child == NONE));
                *cut = vertex[leaf.ok_or(ProtocolError::Unexpected("a cut that is no leaf"))? as usize];
            }
        }
        collapses.push((vertex_of_child(child), vertex[i as usize], cuts));
    }
    let mut hierarchy = VertexHierarchy::new(front.positions().to_vec(), &collapses, &base)?;
    let bounds: Vec<Bounds> = order.iter().map(|&i| node(i).map(|n| n.bounds)).collect::<Result<_, _>>()?;
    hierarchy.set_bounds(front.unit(), |i| bounds.get(i as usize).copied().unwrap_or_default())?;
    Model::new(hierarchy, &triangles(front), viewer.grid)
}
fn triangles(front: &Front) -> Vec<[u32; 3]> {
    front.mesh().shown().iter().filter_map(|&t| front.mesh().triangle(t)).collect()
}
