//! Variable-length integers: seven bits a byte, low ones first; signed ones zigzagged. A reader over a slice.

/// Appends `value`.
pub(crate) fn put(out: &mut Vec<u8>, mut value: u32) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// 0, -1, 1, -2 … to 0, 1, 2, 3 …
pub(super) fn zigzag(value: i32) -> u32 {
    ((value << 1) ^ (value >> 31)) as u32
}

fn unzigzag(value: u32) -> i32 {
    (value >> 1) as i32 ^ -((value & 1) as i32)
}

/// Why a read did not succeed.
#[derive(Debug, PartialEq)]
pub(crate) enum ReadError {
    /// The slice ends: more bytes may complete it.
    End,
    /// No more bytes can make it valid.
    Bad(&'static str),
}

/// Reads from the front of a slice.
pub(crate) struct Reader<'a> {
    pub(crate) rest: &'a [u8],
}

impl<'a> Reader<'a> {
    pub(super) fn bytes(&mut self, count: usize) -> Result<&'a [u8], ReadError> {
        let (head, rest) = self.rest.split_at_checked(count).ok_or(ReadError::End)?;
        self.rest = rest;
        Ok(head)
    }
    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], ReadError> {
        let bytes = self.bytes(N)?;
        Ok(std::array::from_fn(|i| bytes[i]))
    }
    pub(super) fn u8(&mut self) -> Result<u8, ReadError> {
        Ok(self.array::<1>()?[0])
    }
    pub(crate) fn varint(&mut self) -> Result<u32, ReadError> {
        let mut value = 0u32;
        for shift in (0..32).step_by(7) {
            let byte = self.u8()?;
            let bits = u32::from(byte & 0x7f);
            if shift == 28 && bits > 15 {
                return Err(ReadError::Bad("a number exceeds 32 bits"));
            }
            value |= bits << shift;
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err(ReadError::Bad("a number exceeds 32 bits"))
    }
    pub(super) fn signed(&mut self) -> Result<i32, ReadError> {
        self.varint().map(unzigzag)
    }
}
