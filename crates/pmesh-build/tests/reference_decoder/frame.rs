//! Sections 2.1, 2.2, 2.3 and 2.4: the header and its table.

pub struct Entry {
    pub length: usize,
    pub kind: u8,
    pub crc: u32,
    /// Where `crc` is in the file.
    pub crc_at: usize,
    pub nv: usize,
    pub nt: usize,
}

#[derive(Default)]
pub struct Header {
    pub length: usize,
    pub normals: bool,
    pub colors: bool,
    pub texcoords: bool,
    pub seams: bool,
    pub position_bits: u8,
    pub normal_bits: u8,
    pub color_bits: u8,
    pub texcoord_bits: u8,
    pub base_shift: u32,
    pub origin: [f32; 3],
    pub step: f64,
    pub texcoord_origin: [f32; 2],
    pub texcoord_step: f64,
    pub table: Vec<Entry>,
}

pub struct Bytes<'a> {
    pub bytes: &'a [u8],
    pub at: usize,
}

impl Bytes<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let part = self.bytes.get(self.at..self.at + N).ok_or("2.1: a field ends behind its part of the file")?;
        self.at += N;
        part.try_into().map_err(|_| "2.1: a field".into())
    }
    fn u8(&mut self) -> Result<u8, String> {
        Ok(self.take::<1>()?[0])
    }
    fn u16(&mut self) -> Result<u32, String> {
        Ok(u16::from_le_bytes(self.take()?).into())
    }
    fn f32(&mut self) -> Result<f32, String> {
        finite(f32::from_le_bytes(self.take()?))
    }
    fn step(&mut self) -> Result<f64, String> {
        let step = f64::from_le_bytes(self.take()?);
        if step.is_finite() && step > 0.0 { Ok(step) } else { Err("2.1: a step that is not finite and positive".into()) }
    }
    pub fn varint(&mut self) -> Result<u32, String> {
        let mut out = 0;
        for i in 0..5 {
            let byte = self.u8()?;
            if i == 4 && byte > 15 {
                return Err("1.1: a varint that is too long".into());
            }
            out |= u32::from(byte & 0x7f) << (7 * i);
            if byte & 0x80 == 0 {
                break;
            }
        }
        Ok(out)
    }
    fn bits(&mut self, there: bool, low: u8, high: u8) -> Result<u8, String> {
        let bits = if there { self.u8()? } else { 0 };
        if bits == 0 || (low..=high).contains(&bits) { Ok(bits) } else { Err(format!("2.1: {bits} bits")) }
    }
}

fn finite(x: f32) -> Result<f32, String> {
    if x.is_finite() { Ok(x) } else { Err("2.1: a float that is not finite".into()) }
}

/// CRC-32 of IEEE 802.3.
pub fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 };
        }
    }
    !crc
}

impl Header {
    pub fn read(file: &[u8]) -> Result<Self, String> {
        let mut b = Bytes { bytes: file, at: 0 };
        if b.take()? != [0x89, 0x50, 0x4d, 0x53, 0x48, 0x0d, 0x0a, 0x1a] {
            return Err("2.1: another signature".into());
        }
        if b.u8()? != 1 {
            return Err("2.1: another version".into());
        }
        let length = b.u16()? as usize;
        if !(15..=4096).contains(&length) {
            return Err("2.1: the length of the header".into());
        }
        let all = file.get(..length).ok_or("2.1: the file ends in the header")?;
        let (fields, checksum) = all.split_at(length - 4);
        if crc32(fields).to_le_bytes() != checksum {
            return Err("2.1: the checksum of the header".into());
        }
        b.bytes = fields;
        let flags = b.u8()?;
        if flags > 15 {
            return Err("2.1: unknown flags".into());
        }
        let mut h = Self { length, ..Default::default() };
        [h.normals, h.colors, h.texcoords, h.seams] = [1, 2, 4, 8].map(|flag| flags & flag != 0);
        h.position_bits = b.bits(true, 8, 16)?;
        h.normal_bits = b.bits(h.normals, 4, 16)?;
        h.color_bits = b.bits(h.colors, 1, 16)?;
        h.texcoord_bits = b.bits(h.texcoords, 4, 20)?;
        let _file_id: [u8; 4] = b.take()?;
        if h.position_bits > 0 {
            h.base_shift = b.u8()?.into();
            if h.base_shift > 8 {
                return Err("2.1: base_shift".into());
            }
            h.origin = [b.f32()?, b.f32()?, b.f32()?];
            h.step = b.step()?;
            let _extent = [b.varint()?, b.varint()?, b.varint()?];
        } else {
            let _corners = [b.f32()?, b.f32()?, b.f32()?, b.f32()?, b.f32()?, b.f32()?];
        }
        if h.texcoord_bits > 0 {
            h.texcoord_origin = [b.f32()?, b.f32()?];
            h.texcoord_step = b.step()?;
        }
        let count = b.u8()?;
        if count > 64 {
            return Err("2.1: more than 64 entries".into());
        }
        for _ in 0..count {
            h.table.push(entry(&mut b)?);
        }
        if b.at != fields.len() {
            return Err("2.1: the fields end before the header does".into());
        }
        h.check_table()?;
        Ok(h)
    }

    fn check_table(&self) -> Result<(), String> {
        let blocks: Vec<&Entry> = self.table.iter().filter(|e| e.kind == 0).collect();
        if blocks.is_empty() {
            return Err("2.1: no entry of kind 0".into());
        }
        let sums = blocks.iter().fold((0u64, 0u64), |s, e| (s.0 + e.nv as u64, s.1 + e.nt as u64));
        if sums.0.max(sums.1) >= 1 << 30 {
            return Err("2.2: 2^30 vertices or triangles".into());
        }
        for (i, e) in blocks.iter().enumerate() {
            if e.nv.max(e.nt) as u64 > 64 * (e.length as u64 + 64) {
                return Err("2.2: more vertices or triangles than so short a block can hold".into());
            }
            let loose = e.nt == 0 && i + 1 == blocks.len();
            if i > 0 && !loose && !(e.nv <= e.nt && e.nt <= 2 * e.nv) {
                return Err("2.3: a level of too few or too many triangles".into());
            }
        }
        Ok(())
    }

    /// Integers of a row (2.4).
    pub fn width(&self) -> usize {
        let normal = if !self.normals {
            0
        } else if self.normal_bits == 0 {
            3
        } else {
            2
        };
        3 + normal + if self.colors { 4 } else { 0 } + if self.texcoords { 2 } else { 0 }
    }
}

fn entry(b: &mut Bytes) -> Result<Entry, String> {
    let (length, kind, crc_at) = (b.varint()? as usize, b.u8()?, b.at);
    let mut e = Entry { length, kind, crc: b.u16()?, crc_at, nv: 0, nt: 0 };
    if e.kind > 2 {
        return Err("2.2: an unknown kind of block".into());
    }
    if e.kind == 0 {
        e.nv = b.varint()? as usize;
        let f = b.varint()?;
        let d = i64::from(f >> 1) ^ -i64::from(f & 1);
        let nt = 2 * e.nv as i64 - d;
        if !(0..1 << 32).contains(&nt) {
            return Err("2.2: the number of new triangles".into());
        }
        e.nt = nt as usize;
        finite(f32::from_bits(b.u16()? << 16))?;
    }
    Ok(e)
}
