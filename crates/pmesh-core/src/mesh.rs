//! Plain arrays: vertices with their attributes, and an indexed mesh. No levels here.

use crate::MeshError;

/// Which attributes a vertex carries beside its position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AttributeSet {
    /// Unit normals, three floats.
    pub normals: bool,
    /// Colours, red green blue alpha, each 0 to 1, linear or not as the source had them.
    pub colors: bool,
    /// Texture coordinates, two floats, as the source had them: with a glTF's image, v is 0 at its top row.
    pub texcoords: bool,
}

/// The attribute arrays; each is empty or as long as the positions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Attributes {
    /// Unit normals.
    pub normals: Vec<[f32; 3]>,
    /// Red, green, blue, alpha.
    pub colors: Vec<[f32; 4]>,
    /// Texture coordinates.
    pub texcoords: Vec<[f32; 2]>,
}

/// Vertices as parallel arrays. A vertex is a *wedge*: where an attribute jumps across a seam, several stand at one position.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vertices {
    /// Positions in model units.
    pub positions: Vec<[f32; 3]>,
    /// Attributes, all geomorphed as positions are.
    pub attributes: Attributes,
}

impl Vertices {
    /// Number of vertices.
    pub fn len(&self) -> usize {
        self.positions.len()
    }
    /// True if there is no vertex.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }
    /// The attributes that are present.
    pub fn set(&self) -> AttributeSet {
        let a = &self.attributes;
        AttributeSet { normals: !a.normals.is_empty(), colors: !a.colors.is_empty(), texcoords: !a.texcoords.is_empty() }
    }
    /// Appends vertex `i` of `from`, which has the same attributes.
    pub fn push_from(&mut self, from: &Vertices, i: usize) {
        let (a, b) = (&mut self.attributes, &from.attributes);
        self.positions.push(from.positions[i]);
        a.normals.extend(b.normals.get(i));
        a.colors.extend(b.colors.get(i));
        a.texcoords.extend(b.texcoords.get(i));
    }
    /// Appends all of `from`, which has the same attributes.
    pub fn extend_from(&mut self, from: &Vertices) {
        let (a, b) = (&mut self.attributes, &from.attributes);
        extend(&mut self.positions, &from.positions);
        extend(&mut a.normals, &b.normals);
        extend(&mut a.colors, &b.colors);
        extend(&mut a.texcoords, &b.texcoords);
    }
    /// Room for so many more in the arrays that are there.
    pub(crate) fn reserve(&mut self, more: usize) {
        fn reserve<T>(values: &mut Vec<T>, more: usize) {
            if !values.is_empty() {
                values.reserve_exact(more);
            }
        }
        reserve(&mut self.positions, more);
        reserve(&mut self.attributes.normals, more);
        reserve(&mut self.attributes.colors, more);
        reserve(&mut self.attributes.texcoords, more);
    }
    /// Vertices `ids` of this, in that order. O(ids).
    pub fn select(&self, ids: impl IntoIterator<Item = u32>) -> Vertices {
        let mut out = Vertices::default();
        ids.into_iter().for_each(|i| out.push_from(self, i as usize));
        out
    }
    /// True if vertices `i` and `j` agree bit for bit in position and attributes.
    pub fn same(&self, i: usize, other: &Vertices, j: usize) -> bool {
        fn eq<const N: usize>(a: &[[f32; N]], i: usize, b: &[[f32; N]], j: usize) -> bool {
            a.get(i).map(|x| x.map(f32::to_bits)) == b.get(j).map(|x| x.map(f32::to_bits))
        }
        let (a, b) = (&self.attributes, &other.attributes);
        eq(&self.positions, i, &other.positions, j)
            && eq(&a.normals, i, &b.normals, j)
            && eq(&a.colors, i, &b.colors, j)
            && eq(&a.texcoords, i, &b.texcoords, j)
    }
    /// Gives back what growing by doubling reserved.
    pub fn shrink_to_fit(&mut self) {
        self.positions.shrink_to_fit();
        self.attributes.normals.shrink_to_fit();
        self.attributes.colors.shrink_to_fit();
        self.attributes.texcoords.shrink_to_fit();
    }
    /// Bytes allocated.
    pub fn memory_bytes(&self) -> usize {
        let a = &self.attributes;
        self.positions.capacity() * 12 + a.normals.capacity() * 12 + a.colors.capacity() * 16 + a.texcoords.capacity() * 8
    }

    /// Checks lengths against `set` and that all is finite; `first` is the index of the first vertex, for the message.
    pub fn check(&self, set: AttributeSet, first: u32) -> Result<(), MeshError> {
        let n = self.len();
        let a = &self.attributes;
        let lengths = [
            ("normals", set.normals, a.normals.len()),
            ("colors", set.colors, a.colors.len()),
            ("texcoords", set.texcoords, a.texcoords.len()),
        ];
        for (array, present, got) in lengths {
            let expected = if present { n } else { 0 };
            if got != expected {
                return Err(MeshError::AttributeLength { array, expected, got });
            }
        }
        fn first_bad<const N: usize>(values: &[[f32; N]]) -> Option<usize> {
            values.iter().position(|v| !v.iter().all(|x| x.is_finite()))
        }
        let bad = [first_bad(&self.positions), first_bad(&a.normals), first_bad(&a.colors), first_bad(&a.texcoords)];
        match bad.into_iter().flatten().min() {
            Some(i) => Err(MeshError::NotFinite { vertex: first + i as u32 }),
            None => Ok(()),
        }
    }
}

/// An indexed triangle mesh: what importers give and what a level looks like when it is asked for as arrays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IndexedMesh {
    /// The vertices.
    pub vertices: Vertices,
    /// Triples of vertex indices.
    pub triangles: Vec<[u32; 3]>,
    /// Seams: (vertex, earlier vertex at the same position), ascending by vertex. Sparse.
    pub position_of: Vec<(u32, u32)>,
}

impl IndexedMesh {
    /// Checks indices, attribute lengths and finiteness. O(n).
    pub fn check(&self) -> Result<(), MeshError> {
        self.vertices.check(self.vertices.set(), 0)?;
        let n = self.vertices.len() as u32;
        for (t, tri) in self.triangles.iter().enumerate() {
            if let Some(&vertex) = tri.iter().find(|&&v| v >= n) {
                return Err(MeshError::MissingVertex { triangle: t as u32, vertex });
            }
        }
        for &(vertex, position_of) in &self.position_of {
            let p = &self.vertices.positions;
            if vertex >= n || position_of >= vertex || p[vertex as usize] != p[position_of as usize] {
                return Err(MeshError::BadSharedPosition { vertex, position_of });
            }
        }
        Ok(())
    }
    /// Positions and triangles alone: vertices that shared a position across a seam, and differed in attributes only, are one.
    /// O(n).
    pub fn positions_only(&self) -> Self {
        let mut place: Vec<u32> = Vec::with_capacity(self.vertices.len());
        let mut seams = self.position_of.iter().peekable();
        let mut positions = Vec::new();
        for (v, p) in self.vertices.positions.iter().enumerate() {
            match seams.next_if(|s| s.0 as usize == v) {
                Some(&(_, other)) => place.push(place[other as usize]),
                None => {
                    place.push(positions.len() as u32);
                    positions.push(*p);
                }
            }
        }
        let triangles = self.triangles.iter().map(|t| t.map(|v| place[v as usize])).collect();
        Self { vertices: Vertices { positions, ..Default::default() }, triangles, position_of: Vec::new() }
    }
    /// Smallest and largest corner of the bounding box, or zeros for an empty mesh.
    pub fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        bounds(&self.vertices.positions)
    }
}

/// Appends, with room for a quarter more where there is none: doubling would leave a third of the memory unused.
pub(crate) fn extend<T: Copy>(to: &mut Vec<T>, from: &[T]) {
    if to.capacity() - to.len() < from.len() {
        to.reserve_exact(from.len().max(to.len() / 4));
    }
    to.extend_from_slice(from);
}

/// The triangle turned to the lexicographically lowest of its three turns; orientation is kept.
pub fn turned([a, b, c]: [u32; 3]) -> [u32; 3] {
    [a, b, c].min([b, c, a]).min([c, a, b])
}

fn bounds(positions: &[[f32; 3]]) -> ([f32; 3], [f32; 3]) {
    let Some(&first) = positions.first() else { return ([0.0; 3], [0.0; 3]) };
    positions
        .iter()
        .fold((first, first), |(lo, hi), p| (std::array::from_fn(|k| lo[k].min(p[k])), std::array::from_fn(|k| hi[k].max(p[k]))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_attributes_both_sides_of_a_seam_are_one_vertex() {
        let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0; 3], [0.0, 1.0, 0.0], [0.0; 3]];
        let texcoords = (0..5).map(|i| [i as f32, 0.0]).collect();
        let vertices = Vertices { positions, attributes: Attributes { texcoords, ..Default::default() } };
        let mesh = IndexedMesh { vertices, triangles: vec![[0, 1, 3], [2, 3, 1], [4, 1, 3]], position_of: vec![(2, 0), (4, 2)] };
        mesh.check().expect("it is valid");
        let bare = mesh.positions_only();
        assert_eq!(bare.vertices.positions, [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        assert_eq!(bare.triangles, [[0, 1, 2], [0, 2, 1], [0, 1, 2]]);
        assert!(bare.position_of.is_empty() && bare.vertices.set() == Default::default());
    }
}
