//! Whether two meshes are the same: vertices with all bits of their attributes, triangles with their orientation, in any
//! order. What "lossless" is tested with.

use pmesh_core::{IndexedMesh, turned};

/// Vertices as bits, attributes included, sorted; and triangles over their ranks, lowest corner first, sorted.
type Canonical = (Vec<Vec<u32>>, Vec<[u32; 3]>);

fn vertex_bits(mesh: &IndexedMesh, v: usize) -> Vec<u32> {
    let a = &mesh.vertices.attributes;
    let mut bits: Vec<u32> = mesh.vertices.positions[v].iter().map(|f| f.to_bits()).collect();
    bits.extend(a.normals.get(v).into_iter().flatten().map(|f| f.to_bits()));
    bits.extend(a.colors.get(v).into_iter().flatten().map(|f| f.to_bits()));
    bits.extend(a.texcoords.get(v).into_iter().flatten().map(|f| f.to_bits()));
    bits
}

fn canonical(mesh: &IndexedMesh) -> Canonical {
    let vertices: Vec<_> = (0..mesh.vertices.len()).map(|v| vertex_bits(mesh, v)).collect();
    let mut order: Vec<u32> = (0..vertices.len() as u32).collect();
    order.sort_by(|&a, &b| vertices[a as usize].cmp(&vertices[b as usize]));
    // Equal vertices have one rank, since nothing tells them apart.
    let mut rank = vec![0u32; order.len()];
    let mut now = 0;
    for (i, &v) in order.iter().enumerate() {
        if i > 0 && vertices[order[i - 1] as usize] != vertices[v as usize] {
            now = i as u32;
        }
        rank[v as usize] = now;
    }
    let mut triangles: Vec<_> = mesh.triangles.iter().map(|t| turned(t.map(|v| rank[v as usize]))).collect();
    triangles.sort_unstable();
    let sorted = order.iter().map(|&v| vertices[v as usize].clone()).collect();
    (sorted, triangles)
}

/// What tells `a` from `b`, or `None` if they are the same. O(n log n).
pub fn difference(a: &IndexedMesh, b: &IndexedMesh) -> Option<String> {
    if a.vertices.len() != b.vertices.len() || a.triangles.len() != b.triangles.len() {
        let counts = |m: &IndexedMesh| (m.vertices.len(), m.triangles.len());
        return Some(format!("(vertices, triangles) {:?} against {:?}", counts(a), counts(b)));
    }
    let (a, b) = (canonical(a), canonical(b));
    if let Some(i) = (0..a.0.len()).find(|&i| a.0[i] != b.0[i]) {
        let floats = |bits: &[u32]| bits.iter().map(|&b| f32::from_bits(b)).collect::<Vec<_>>();
        return Some(format!("vertex {:?} against {:?}", floats(&a.0[i]), floats(&b.0[i])));
    }
    let i = (0..a.1.len()).find(|&i| a.1[i] != b.1[i])?;
    Some(format!("triangle {:?} against {:?}", a.1[i], b.1[i]))
}
