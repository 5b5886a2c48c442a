//! Bits, most significant first.

/// Appends bits to bytes.
#[derive(Default)]
pub(super) struct BitWriter {
    pub(super) bytes: Vec<u8>,
    /// Bits used of the last byte, 0 to 7; 0 if it is full.
    used: u32,
}

impl BitWriter {
    /// Appends the lowest `count` bits of `value`.
    pub(super) fn put(&mut self, value: u32, count: u32) {
        for i in (0..count).rev() {
            if self.used == 0 {
                self.bytes.push(0);
            }
            if let Some(last) = self.bytes.last_mut() {
                *last |= ((value >> i & 1) as u8) << (7 - self.used);
            }
            self.used = (self.used + 1) % 8;
        }
    }
}

/// Bytes that have arrived and a place among their bits.
#[derive(Default)]
pub(super) struct BitQueue {
    bytes: Vec<u8>,
    /// Next bit, from the first of `bytes`.
    at: usize,
}

impl BitQueue {
    pub(super) fn extend(&mut self, bytes: &[u8]) {
        // What has been read goes once it is the larger half.
        if self.at / 8 > self.bytes.len() / 2 {
            self.bytes.drain(..self.at / 8);
            self.at %= 8;
        }
        self.bytes.extend_from_slice(bytes);
    }
    /// Bits that can be read.
    pub(super) fn len(&self) -> usize {
        self.bytes.len() * 8 - self.at
    }
    /// Reads up to 32 bits, which must be there; others read as zero.
    pub(super) fn take(&mut self, count: u32) -> u32 {
        let value = self.peek(0, count);
        self.at += count as usize;
        value
    }
    /// Bits further on, without reading them.
    pub(super) fn peek(&self, skip: usize, count: u32) -> u32 {
        let bit = |i: usize| self.bytes.get(i / 8).map_or(0, |b| u32::from(b >> (7 - i % 8) & 1));
        (0..count as usize).fold(0, |value, i| value << 1 | bit(self.at + skip + i))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_put_is_taken(fields in prop::collection::vec((any::<u32>(), 1u32..=32), 0..200), cut in 1usize..9) {
            let mut writer = BitWriter::default();
            fields.iter().for_each(|&(value, count)| writer.put(value, count));
            let mut queue = BitQueue::default();
            let mut chunks = writer.bytes.chunks(cut);
            for &(value, count) in &fields {
                while queue.len() < count as usize {
                    queue.extend(chunks.next().expect("all bits are there"));
                }
                prop_assert_eq!(queue.take(count), value & (u32::MAX >> (32 - count)));
            }
            prop_assert!(queue.len() < 8 * cut);
        }
    }
}
