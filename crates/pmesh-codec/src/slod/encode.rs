//! Any mesh of levels as a sequence of single splits, and those as packets.

use super::bits::BitWriter;
use super::{HEADER_BYTES, NARROW_LIMIT, SIGNATURE, VERSION, VERTEX_LIMIT};
use crate::EncodeError;
use crate::corners::Corners;
use pmesh_core::ProgressiveMultilevelMesh;
use pmesh_core::forest::NO_REPRESENTATIVE;
use std::io::Write;

/// What was written, in SS97's terms.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SlodReport {
    /// new_vertex packets.
    pub vertices: u32,
    /// new_triangle packets.
    pub triangles: u32,
    /// Bits of all update lists: the sum of N.
    pub update_bits: u64,
    /// Bits a node or vertex field.
    pub field_bits: u32,
    /// Triangles with one vertex at all three corners, which no packet can say; left out.
    pub points: u32,
}

/// One vertex and what appears with it.
#[derive(Default)]
struct Split {
    /// Triangles that appear, corners as they are then, in stream order.
    triangles: Vec<[u32; 3]>,
    /// Triangles, by stream order, a corner of which moves to the vertex.
    moves: Vec<u32>,
}

/// Writes `mesh`, all its levels resolved into single splits; positions only. O(corners × depth of the forest).
/// Errors: vertices that move between levels, no vertex, more than 2^28 of them, or a failing writer.
pub fn encode(mesh: &ProgressiveMultilevelMesh, out: &mut impl Write) -> Result<SlodReport, EncodeError> {
    let n = mesh.vertices().len() as u32;
    if mesh.has_moves() {
        let way_out = "decode the stream to a mesh and encode that";
        return Err(EncodeError::Unsupported { what: "a vertex that moves between levels", way_out });
    }
    if n == 0 || n > VERTEX_LIMIT {
        let expected = "1 to 2^28";
        return Err(EncodeError::BadOption { what: "the number of vertices", got: n.to_string(), expected });
    }
    let field_bits = if n <= NARROW_LIMIT { 16 } else { 32 };
    // One tree: what has no representative joins the first vertex.
    let parents: Vec<u32> = mesh.representatives().iter().map(|&p| if p == NO_REPRESENTATIVE { 0 } else { p }).collect();
    let (splits, points) = splits(mesh.triangles(), &parents);
    let triangles = splits.iter().map(|s| s.triangles.len() as u32).sum();
    let mut report = SlodReport { vertices: n, triangles, field_bits, points, ..Default::default() };
    let mut bits = BitWriter::default();
    let mut corners = Corners::default();
    // Node that a vertex stands for now.
    let mut node_of = vec![0u32; n as usize];
    let (mut around, mut candidates) = (Vec::new(), Vec::new());
    for (v, split) in splits.iter().enumerate() {
        let v = v as u32;
        let parent = parents[v as usize];
        corners.begin_level();
        corners.add_vertex();
        bits.put(0, 1);
        bits.put(if v == 0 { u32::MAX } else { node_of[parent as usize] }, field_bits);
        mesh.vertices().positions[v as usize].iter().for_each(|x| bits.put(x.to_bits(), 32));
        if v > 0 {
            corners.of(parent, &mut around);
            candidates.clear();
            candidates.extend(around.iter().map(|c| c / 3));
            candidates.dedup();
            let moves = |t: u32| split.moves.binary_search(&t).is_ok();
            candidates.iter().for_each(|&t| bits.put(u32::from(moves(t)), 1));
            report.update_bits += candidates.len() as u64;
            corners.split(parent, v, &around, |i| moves(around[i] / 3));
            (node_of[parent as usize], node_of[v as usize]) = (2 * v - 1, 2 * v);
        }
        for t in &split.triangles {
            let (third, orientation) = third_and_orientation(*t, v, parent);
            bits.put(1, 1);
            bits.put(third, field_bits);
            bits.put(orientation, 1);
            corners.add_triangle(packet_order(v, parent, third, orientation));
        }
    }
    let (low, high) = mesh.finest_mesh().bounds();
    let mut header = Vec::with_capacity(HEADER_BYTES);
    header.extend_from_slice(&SIGNATURE);
    header.extend([VERSION, field_bits as u8]);
    header.extend(n.to_le_bytes().into_iter().chain(triangles.to_le_bytes()));
    low.into_iter().chain(high).for_each(|x| header.extend(x.to_le_bytes()));
    out.write_all(&header)?;
    out.write_all(&bits.bytes)?;
    Ok(report)
}

/// A triangle's corners as the packet lists them.
pub(super) fn packet_order(new: u32, parent: u32, third: u32, orientation: u32) -> [u32; 3] {
    if orientation == 0 { [new, parent, third] } else { [parent, new, third] }
}

fn third_and_orientation(t: [u32; 3], new: u32, parent: u32) -> (u32, u32) {
    let turn = |r: usize| (t[r], t[(r + 1) % 3], t[(r + 2) % 3]);
    for r in 0..3 {
        match turn(r) {
            (a, b, third) if (a, b) == (new, parent) => return (third, 0),
            (a, b, third) if (a, b) == (parent, new) => return (third, 1),
            _ => {}
        }
    }
    unreachable!("a triangle appears when one of its edges does")
}

/// Vertex with whose arrival `a` and `b` stop being one; `None` if they are one vertex.
fn parted_by(parents: &[u32], mut a: u32, mut b: u32) -> Option<u32> {
    let mut last = [None, None];
    while a != b {
        if a > b {
            last[0] = Some(a);
            a = parents[a as usize];
        } else {
            last[1] = Some(b);
            b = parents[b as usize];
        }
    }
    last.into_iter().flatten().min()
}

/// What appears with each vertex, and the number of triangles that are points.
fn splits(triangles: &[[u32; 3]], parents: &[u32]) -> (Vec<Split>, u32) {
    let mut splits: Vec<Split> = parents.iter().map(|_| Split::default()).collect();
    let appears =
        |&[a, b, c]: &[u32; 3]| [(a, b), (b, c), (c, a)].into_iter().filter_map(|(a, b)| parted_by(parents, a, b)).max();
    let mut order: Vec<(u32, u32)> = triangles.iter().enumerate().filter_map(|(i, t)| Some((appears(t)?, i as u32))).collect();
    order.sort_unstable();
    for (stream, &(v, i)) in order.iter().enumerate() {
        let corners = triangles[i as usize].map(|mut corner| {
            while corner > v {
                let moves = &mut splits[corner as usize].moves;
                // Two corners of a triangle may move together.
                if moves.last() != Some(&(stream as u32)) {
                    moves.push(stream as u32);
                }
                corner = parents[corner as usize];
            }
            corner
        });
        splits[v as usize].triangles.push(corners);
    }
    (splits, triangles.len() as u32 - order.len() as u32)
}
