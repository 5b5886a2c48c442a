//! A reference decoder of the compact stream, written from docs/FORMAT-COMPACT.md alone: slow, plain, and the oracle for the
//! fast one. Here: section 2.3, which block is what, and 9.1, what is refused.

mod base;
mod choose;
mod floats;
mod frame;
mod learn;
mod level;
mod mixer;
mod output;
mod place;
mod predict;
mod range;
mod surface;
mod ways;

pub use frame::crc32;
pub use output::Decoded;

/// "Nothing there" of corners and vertices (1.1).
const NONE: usize = 0xffff_ffff;

/// What all blocks add to (2.4, 6.2): rows, triangles, seams, and `first[v]`, the first vertex at the position of `v`.
struct Mesh {
    width: usize,
    with_seams: bool,
    shift: u32,
    rows: Vec<Vec<i32>>,
    triangles: Vec<[usize; 3]>,
    seams: Vec<(usize, usize)>,
    first: Vec<usize>,
    representatives: Vec<(usize, usize)>,
}

impl Mesh {
    /// Vertices so far.
    fn count(&self) -> usize {
        self.rows.len()
    }
    fn value(&self, v: usize, k: usize) -> i32 {
        self.rows[v][k]
    }
    /// The position of a row as f64 (7).
    fn place(&self, v: usize) -> [f64; 3] {
        [0, 1, 2].map(|k| f64::from(self.rows[v][k]))
    }
    /// The position of a row as f32 (6.3, 6.8).
    fn position(&self, v: usize) -> [f32; 3] {
        [0, 1, 2].map(|k| self.rows[v][k] as f32)
    }
    fn push(&mut self, row: Vec<i32>) {
        self.first.push(self.rows.len());
        self.rows.push(row);
    }
    fn seam(&mut self, v: usize, earlier: usize) {
        self.seams.push((v, earlier));
        self.first[v] = self.first[earlier];
    }
}

/// Of each block: place of its checksum in the file, start, end.
pub type Checksum = (usize, usize, usize);

/// Where the checksums of blocks are, and the length of the header.
pub fn checksums(bytes: &[u8]) -> Result<(Vec<Checksum>, usize), String> {
    let header = frame::Header::read(bytes)?;
    let (mut at, mut out) = (header.length, Vec::new());
    for entry in &header.table {
        out.push((entry.crc_at, at, at + entry.length));
        at += entry.length;
    }
    Ok((out, header.length))
}

/// Decodes at most `blocks` blocks of kind 0. If all of them are asked for, the file must end where the last block does.
pub fn decode(bytes: &[u8], blocks: usize) -> Result<Decoded, String> {
    decode_with(bytes, blocks, |_| ())
}

/// As `decode`, and `each` sees what there is after each block of kind 0.
pub fn decode_with(bytes: &[u8], blocks: usize, mut each: impl FnMut(&Decoded)) -> Result<Decoded, String> {
    let header = frame::Header::read(bytes)?;
    let mut mesh = Mesh {
        width: header.width(),
        with_seams: header.seams,
        shift: header.base_shift,
        rows: Vec::new(),
        triangles: Vec::new(),
        seams: Vec::new(),
        first: Vec::new(),
        representatives: Vec::new(),
    };
    let last = header.table.iter().rposition(|entry| entry.kind == 0);
    let mut levels: Option<level::Levels> = None;
    let mut at = header.length;
    let mut done = 0;
    for (i, entry) in header.table.iter().enumerate() {
        if entry.kind == 0 && done == blocks {
            return Ok(output::output(&header, &mesh));
        }
        let end = at.checked_add(entry.length).ok_or("2.2: a block too long")?;
        let block = bytes.get(at..end).ok_or("9.1: the file ends before its last block does")?;
        at = end;
        if frame::crc32(block) & 0xffff != entry.crc {
            return Err(format!("9.1: the CRC-32 of block {i} is another"));
        }
        match entry.kind {
            0 if done == 0 => base::read(&mut mesh, block, entry.nv, entry.nt)?,
            0 if entry.nt == 0 && Some(i) == last => {
                let all = mesh.count() + entry.nv;
                base::read(&mut mesh, block, all, 0)?;
            }
            0 => {
                if levels.is_none() {
                    levels = Some(level::Levels::new(&mesh));
                }
                if let Some(levels) = &mut levels {
                    levels.level(&mut mesh, block, entry.nv)?;
                }
            }
            1 if block.first().is_none_or(|&format| format > 1) => return Err("2.3: an image of no known format".into()),
            _ => {}
        }
        if entry.kind == 0 {
            done += 1;
            let there = output::output(&header, &mesh);
            if !there.is_finite() {
                return Err(format!("9.1: a float of block {i} that is not finite"));
            }
            each(&there);
        }
    }
    if at != bytes.len() {
        return Err("2.2: bytes after the last block".into());
    }
    Ok(output::output(&header, &mesh))
}
