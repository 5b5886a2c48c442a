//! The frame of a file: the base, a block a level, loose vertices, the image, the header.

use super::base::{BaseCoder, BaseTruth};
use super::item_limit;
use super::rows::Rows;
use crate::pmesh::channels::{Channels, Quantisation};
use crate::pmesh::check_precision;
use crate::pmesh::header::{Block, BlockKind, Container, Header};
use crate::pmesh::texture;
use crate::range::Encoder;
use crate::{EncodeError, Texture};
use pmesh_core::surface::{NONE, Surface};
use pmesh_core::{IndexedMesh, Vertices};
use std::io::Write;

pub(crate) fn misfit(found: &'static str) -> EncodeError {
    let expected = "refinements that fit the mesh: build the levels anew";
    EncodeError::BadOption { what: "a level", got: found.into(), expected }
}

/// A file while it is written. A format codes its levels in between, refining `surface` and `rows` as a decoder will.
pub(crate) struct Writer {
    pub(crate) header: Header,
    channels: Channels,
    payloads: Vec<Vec<u8>>,
    /// For each vertex of the mesh the one whose position it shares, or [`NONE`].
    pub(crate) position_of: Vec<u32>,
    /// Vertices of no triangle.
    loose: Vec<u32>,
    /// Rows of all vertices, in the numbering of the mesh.
    pub(crate) source: Rows,
    pub(crate) surface: Surface,
    /// Rows as far as they are coded.
    pub(crate) rows: Rows,
    /// For each coded vertex its number in the mesh.
    pub(crate) vertex_order: Vec<u32>,
    /// For each coded triangle of the base its place among those given.
    pub(crate) triangle_order: Vec<u32>,
    /// Vertices, triangles and bytes of the base.
    pub(crate) base: (u32, u32, usize),
}

impl Writer {
    /// Codes the base of a mesh with its seams, so many bits of a coordinate left out. `in_levels` says which vertices come later.
    pub(crate) fn new(
        container: Container,
        (mesh, seams): (&IndexedMesh, &[(u32, u32)]),
        position_bits: Option<u8>,
        base_triangles: &[[u32; 3]],
        in_levels: impl Fn(u32) -> bool,
        error: Option<&f32>,
        shift: impl Fn(&Quantisation) -> u32,
    ) -> Result<Self, EncodeError> {
        check_precision(position_bits)?;
        let set = mesh.vertices.set();
        let grids = Quantisation::fit(&mesh.vertices, position_bits);
        let shift = shift(&grids);
        let channels = Channels::new(set, grids);
        let mut source = Rows { width: channels.count(), ..Default::default() };
        (0..mesh.vertices.len()).for_each(|i| channels.row(&mesh.vertices, i, &mut source.values));
        let mut used = vec![false; mesh.vertices.len()];
        base_triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
        let later: Vec<u32> = (0..used.len() as u32).filter(|&v| !used[v as usize]).collect();
        let loose = later.iter().copied().filter(|&v| !in_levels(v)).collect();
        let count = (used.len() - later.len()) as u32;
        let mut position_of = vec![NONE; mesh.vertices.len()];
        seams.iter().for_each(|&(v, p)| position_of[v as usize] = p);
        let has_seams = !seams.is_empty();
        let mut truth = BaseTruth::new(&source, base_triangles, &position_of);
        // Vertices of levels are not the base's, and those of no triangle come last.
        later.iter().for_each(|&v| truth.coded[v as usize] = NONE - 1);
        let mut base = BaseCoder::new(count, base_triangles.len() as u32, source.width);
        let mut rows = Rows { width: source.width, has_seams, shift, ..Default::default() };
        let mut coder = Encoder::new();
        while !base.step(&mut coder, &mut rows, Some(&mut truth), usize::MAX).map_err(misfit)? {}
        let payload = coder.finish();
        let (vertex_order, triangle_order) = (truth.vertex_order, truth.triangle_order);
        let header = Header { container, attribute_set: set, has_seams, grids, base_shift: shift as u8, ..Default::default() };
        let mut writer = Self {
            header,
            channels,
            payloads: Vec::new(),
            position_of,
            loose,
            surface: Surface::new(base.triangles, count),
            source,
            rows,
            vertex_order,
            triangle_order,
            base: (count, base_triangles.len() as u32, payload.len()),
        };
        writer.push(payload, (count, base_triangles.len() as u32), error);
        Ok(writer)
    }

    /// For each vertex of the mesh its coded number, or [`NONE`].
    pub(crate) fn coded(&self) -> Vec<u32> {
        let mut coded = vec![NONE; self.position_of.len()];
        self.vertex_order.iter().enumerate().for_each(|(new, &old)| coded[old as usize] = new as u32);
        coded
    }

    /// A level of `count` vertices.
    pub(crate) fn level(&mut self, count: u32, payload: Vec<u8>, error: Option<&f32>) {
        self.level_of(count, 2 * count, payload, error);
    }

    /// A level of `count` vertices and `triangles` triangles.
    pub(crate) fn level_of(&mut self, count: u32, triangles: u32, payload: Vec<u8>, error: Option<&f32>) {
        self.push(payload, (count, triangles), error);
    }

    fn push(&mut self, mut payload: Vec<u8>, new: (u32, u32), error: Option<&f32>) {
        // What packs better than a decoder believes is filled up.
        while item_limit(payload.len() as u32) < u64::from(new.0.max(new.1)) {
            payload.resize(payload.len() + (payload.len() / 2).max(64), 0);
        }
        self.header.blocks.push(Block {
            kind: BlockKind::Level,
            byte_count: payload.len() as u32,
            checksum: 0,
            new_vertices: new.0,
            new_triangles: new.1,
            error: error.copied().unwrap_or(0.0),
        });
        self.payloads.push(payload);
    }

    /// Loose vertices, the image, and the whole file to `out`. Gives the loose vertices and their bytes.
    pub(crate) fn finish(mut self, texture: Option<&Texture>, out: &mut impl Write) -> Result<(u32, usize), EncodeError> {
        let mut loose = (self.loose.len() as u32, 0);
        if loose.0 > 0 {
            let mut truth = BaseTruth::new(&self.source, &[], &self.position_of);
            // All but the loose ones are coded.
            truth.coded.fill(NONE - 1);
            let coded = self.coded();
            self.vertex_order.iter().for_each(|&v| truth.know(v, coded[v as usize]));
            self.loose.iter().for_each(|&v| truth.coded[v as usize] = NONE);
            let mut coder = Encoder::new();
            let mut rest = BaseCoder::new(self.rows.count() + loose.0, 0, self.rows.width);
            while !rest.step(&mut coder, &mut self.rows, Some(&mut truth), usize::MAX).map_err(misfit)? {}
            let payload = coder.finish();
            loose.1 = payload.len();
            self.push(payload, (loose.0, 0), Some(&0.0));
        }
        if let Some(texture) = texture {
            texture::insert(texture, &mut self.header.blocks, &mut self.payloads)?;
        }
        if self.header.blocks.len() > crate::pmesh::BLOCK_LIMIT {
            let (got, expected) = (self.header.blocks.len().to_string(), "at most 64 levels, the texture counted");
            return Err(EncodeError::BadOption { what: "the number of levels", got, expected });
        }
        let mut vertices = Vertices::default();
        (0..self.rows.count()).for_each(|v| self.channels.push(self.rows.row(v), self.rows.shift, &mut vertices));
        self.header.bounds = IndexedMesh { vertices, ..Default::default() }.bounds();
        let total: u64 = self.payloads.iter().map(|p| p.len() as u64).sum();
        let container = self.header.container;
        self.header.blocks.iter_mut().zip(&self.payloads).for_each(|(b, p)| b.checksum = container.checksum(p));
        let content = u64::from(crc32fast::hash(&self.header.to_bytes()));
        self.header.file_id = if container == Container::Compact { content } else { content << 32 | (total & 0xffff_ffff) };
        out.write_all(&self.header.to_bytes())?;
        self.payloads.iter().try_for_each(|p| out.write_all(p))?;
        Ok(loose)
    }
}
