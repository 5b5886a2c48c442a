//! An adaptive binary range coder, and numbers made of binary choices.
//!
//! A 32-bit range with carries, probabilities of 16 bits that learn at once from the first choices and slowly later. [`Coder`]
//! is one interface for both directions, so that a model is written once: an encoder is told the choice, a decoder says it. What
//! each choice runs through is inlined: the browser module is compiled
//! for size, which would make it a third as fast.

/// Choices after which a chance learns no slower.
const MEMORY: u32 = 250;

/// A probability that a choice is 0, in 1/65536: the mean of what was seen, later of what was seen last.
#[derive(Clone, Copy, Debug)]
pub struct Chance {
    zero: u16,
    seen: u8,
}

impl Default for Chance {
    fn default() -> Self {
        Self { zero: 1 << 15, seen: 0 }
    }
}

impl Chance {
    /// In 1/65536, never 0 or 65536.
    #[inline(always)]
    fn of_zero(self) -> u32 {
        u32::from(self.zero).clamp(64, 65536 - 64)
    }
    /// Choices it has learnt from, at most 250.
    #[inline(always)]
    fn confidence(self) -> u32 {
        u32::from(self.seen)
    }
    #[inline(always)]
    fn learn(&mut self, bit: bool) {
        // 1 / (seen + 1.6), in 1/65536.
        let rate = (10 << 16) / (10 * u32::from(self.seen) + 16);
        let zero = u32::from(self.zero);
        let target = if bit { 0 } else { u32::from(u16::MAX) };
        self.zero = if bit { zero - (((zero - target) * rate) >> 16) } else { zero + (((target - zero) * rate) >> 16) } as u16;
        self.seen += u8::from(u32::from(self.seen) < MEMORY);
    }
}

/// Zeros at the end of what an encoder gives that are not written, at most.
const ZEROS_LEFT_OUT: usize = 8;
/// Bytes that a decoder may read past the end: those, and what it looks ahead.
pub const OVERRUN: usize = ZEROS_LEFT_OUT + 8;

/// Inputs of a [`Mixer`].
pub const INPUTS: usize = 6;

/// Weighs the chances that several contexts give, and learns which to trust: logistic mixing, as in Mahoney's PAQ, in whole
/// numbers, so that every machine computes the same.
#[derive(Clone, Debug)]
pub struct Mixer {
    /// In 1/65536.
    weights: [i32; INPUTS],
}

impl Default for Mixer {
    fn default() -> Self {
        Self { weights: [(1 << 16) * 3 / (2 * INPUTS as i32); INPUTS] }
    }
}

/// ln(p / (1 - p)) in 1/256, for p in 1/4096: the inverse of [`squash`].
static STRETCH: [i16; 4096] = {
    let mut table = [0i16; 4096];
    let (mut x, mut p) = (-2047i32, 0usize);
    while x <= 2047 {
        let until = squash(x) as usize;
        while p <= until && p < 4096 {
            table[p] = x as i16;
            p += 1;
        }
        x += 1;
    }
    while p < 4096 {
        table[p] = 2047;
        p += 1;
    }
    table
};

/// 1 / (1 + e^-x) in 1/4096, for x in 1/256; between -2047 and 2047.
const fn squash(x: i32) -> i32 {
    // At -8, -7.5 … 8.
    const KNOTS: [i32; 33] = [
        1, 2, 4, 6, 10, 17, 27, 45, 74, 120, 194, 311, 488, 747, 1101, 1546, 2048, 2550, 2994, 3349, 3608, 3785, 3901, 3976,
        4022, 4050, 4068, 4079, 4085, 4089, 4092, 4093, 4094,
    ];
    if x >= 2047 {
        return 4095;
    }
    if x <= -2047 {
        return 1;
    }
    let (w, i) = (x & 127, ((x >> 7) + 16) as usize);
    (KNOTS[i] * (128 - w) + KNOTS[i + 1] * w + 64) >> 7
}

impl Mixer {
    /// The mixed chance of 0 in 1/65536, and what went in.
    #[inline(always)]
    fn mix(&self, chances: &[&mut Chance; INPUTS]) -> (u32, [i32; INPUTS]) {
        let stretched = std::array::from_fn(|i| {
            let s = i32::from(STRETCH[(chances[i].of_zero() >> 4) as usize]);
            // What has hardly been met says little.
            s * chances[i].confidence().min(8) as i32 / 8
        });
        let sum: i64 = stretched.iter().zip(&self.weights).map(|(&s, &w): (&i32, _)| i64::from(s) * i64::from(w)).sum();
        let p = squash((sum >> 16).clamp(-2047, 2047) as i32);
        ((p.clamp(8, 4088) as u32) << 4, stretched)
    }
    #[inline(always)]
    fn learn(&mut self, zero: u32, stretched: &[i32; INPUTS], bit: bool) {
        let error = if bit { 0 } else { 4095 } - (zero >> 4) as i32;
        for (w, s) in self.weights.iter_mut().zip(stretched) {
            *w = (*w + ((s * error) >> 8)).clamp(-(1 << 20), 1 << 20);
        }
    }
}

/// Codes binary choices.
pub trait Coder {
    /// True for an encoder: what only encoders do is left out of decoders by it.
    const ENCODES: bool;
    /// True for what only counts.
    const COUNTS: bool = false;

    /// One choice, 0 with a chance of `zero` / 65536. A decoder ignores `bit`; both give what it is.
    fn choose(&mut self, zero: u32, bit: bool) -> bool;

    /// Whole bytes so far: what a decoder has read, at the same place for an encoder.
    fn byte_position(&self) -> usize;

    /// True if `count` bytes more can be read, or none is to come.
    fn has(&self, _count: usize) -> bool {
        true
    }

    /// True if more was read than there is: the bytes do not hold what they say.
    fn ran_out(&self) -> bool {
        false
    }

    /// Bits so far, fractions counted.
    fn position(&self) -> f64;

    /// One choice, by a chance that learns from it.
    #[inline(always)]
    fn bit(&mut self, chance: &mut Chance, bit: bool) -> bool {
        let bit = self.choose(chance.of_zero(), bit);
        chance.learn(bit);
        bit
    }

    /// One choice, by several chances mixed; all learn from it.
    #[inline(always)]
    fn mixed(&mut self, mixer: &mut Mixer, chances: [&mut Chance; INPUTS], bit: bool) -> bool {
        let (zero, stretched) = mixer.mix(&chances);
        let bit = self.choose(zero, bit);
        mixer.learn(zero, &stretched, bit);
        chances.into_iter().for_each(|c| c.learn(bit));
        bit
    }

    /// `count` choices of equal chance, as a number.
    fn raw(&mut self, count: u32, value: u32) -> u32 {
        (0..count).rev().fold(0, |out, i| out << 1 | u32::from(self.bit(&mut Chance::default(), value >> i & 1 != 0)))
    }

    /// A number below 2^`chances.len().ilog2()`, by a tree of chances.
    fn symbol(&mut self, chances: &mut [Chance], value: u32) -> u32 {
        let bits = chances.len().ilog2();
        let mut node = 1;
        for i in (0..bits).rev() {
            let bit = self.bit(&mut chances[node as usize], value >> i & 1 != 0);
            node = node << 1 | u32::from(bit);
        }
        node - (1 << bits)
    }

    /// A number of any size: its length by chances of its own, then its bits, the highest of them by chances too.
    fn number(&mut self, model: &mut NumberModel, value: u32) -> u32 {
        let length = self.symbol(&mut model.length, 32 - value.leading_zeros()).min(32);
        if length <= 1 {
            return length;
        }
        let low = length - 1;
        let learnt = low.min(2);
        let high = self.symbol(&mut model.high[length as usize][..1 << learnt], (value >> (low - learnt)) & ((1 << learnt) - 1));
        let rest = self.raw(low - learnt, value & ((1 << (low - learnt)) - 1));
        1 << low | high << (low - learnt) | rest
    }

    /// A signed number.
    fn signed(&mut self, model: &mut SignedModel, value: i32) -> i32 {
        let magnitude = self.number(&mut model.magnitude, value.unsigned_abs()) as i32;
        if magnitude == 0 {
            return 0;
        }
        if self.bit(&mut model.sign, value < 0) { magnitude.wrapping_neg() } else { magnitude }
    }
}

/// Chances of a number's length and highest bits.
#[derive(Clone, Debug)]
pub struct NumberModel {
    length: [Chance; 64],
    high: [[Chance; 4]; 64],
}

impl Default for NumberModel {
    fn default() -> Self {
        Self { length: [Chance::default(); 64], high: [[Chance::default(); 4]; 64] }
    }
}

/// Chances of a signed number.
#[derive(Clone, Debug, Default)]
pub struct SignedModel {
    magnitude: NumberModel,
    sign: Chance,
}

/// A range's logarithm, between powers of two as a straight line: the same on every machine.
#[inline(always)]
fn log2(range: u32) -> f64 {
    let whole = range.ilog2();
    f64::from(whole) + f64::from(range) / f64::from(1u32 << whole) - 1.0
}

/// Writes choices to bytes.
pub struct Encoder {
    low: u64,
    range: u32,
    cache: u8,
    pending: u64,
    bytes: Vec<u8>,
}

impl Default for Encoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Encoder {
    /// At the first byte.
    pub fn new() -> Self {
        // The byte before the first, to which nothing is ever carried.
        Self { low: 0, range: u32::MAX, cache: 0, pending: 1, bytes: Vec::new() }
    }
    fn shift(&mut self) {
        if self.low < 0xff00_0000 || self.low > 0xffff_ffff {
            let carry = (self.low >> 32) as u8;
            self.bytes.push(self.cache.wrapping_add(carry));
            let fill = 0xffu8.wrapping_add(carry);
            (1..self.pending).for_each(|_| self.bytes.push(fill));
            self.pending = 0;
            self.cache = (self.low >> 24) as u8;
        }
        self.pending += 1;
        self.low = self.low << 8 & 0xffff_ffff;
    }
    /// Bytes so far, but for a few that are held back.
    pub fn byte_count(&self) -> usize {
        self.bytes.len()
    }
    /// Ends the bytes. Zeros at the end are left out: a decoder reads zeros past the end. Not more than a few: a decoder that
    /// reads far past the end takes the stream for one that does not hold what it says.
    pub fn finish(mut self) -> Vec<u8> {
        // Of the numbers that say the same, the one that ends in most zeros.
        let last = self.low + u64::from(self.range) - 1;
        self.low = (0..32).rev().map(|k| last >> k << k).find(|&x| x >= self.low).unwrap_or(last);
        (0..5).for_each(|_| self.shift());
        let zeros = self.bytes.iter().rev().take(ZEROS_LEFT_OUT).take_while(|&&b| b == 0).count();
        self.bytes.truncate(self.bytes.len() - zeros);
        self.bytes.split_off(1.min(self.bytes.len()))
    }
}

impl Coder for Encoder {
    const ENCODES: bool = true;

    fn byte_position(&self) -> usize {
        // The byte before the first is counted, not what is read ahead.
        self.bytes.len() + self.pending as usize - 1 + LOOK_AHEAD
    }

    fn position(&self) -> f64 {
        8.0 * (self.bytes.len() as f64 + self.pending as f64) - log2(self.range)
    }
    fn choose(&mut self, zero: u32, bit: bool) -> bool {
        let bound = (self.range >> 16) * zero;
        if bit {
            self.low += u64::from(bound);
            self.range -= bound;
        } else {
            self.range = bound;
        }
        while self.range < 1 << 24 {
            self.range <<= 8;
            self.shift();
        }
        bit
    }
}

/// Bytes that a decoder reads before the first choice.
pub const LOOK_AHEAD: usize = 4;

/// Reads choices from bytes; past the end there are zeros. The bytes may arrive while it reads.
pub struct RangeDecoder {
    bytes: Vec<u8>,
    at: usize,
    range: u32,
    code: u32,
    /// No byte is to come.
    whole: bool,
}

impl RangeDecoder {
    /// All bytes are there.
    pub fn new(bytes: Vec<u8>) -> Self {
        let mut decoder = Self { bytes, at: 0, range: u32::MAX, code: 0, whole: true };
        (0..LOOK_AHEAD).for_each(|_| decoder.next());
        decoder
    }
    /// More bytes are to come; [`LOOK_AHEAD`] must be there.
    pub fn with_first(bytes: Vec<u8>) -> Self {
        Self { whole: false, ..Self::new(bytes) }
    }
    /// Takes the next bytes; `whole` says that they are the last.
    pub fn feed(&mut self, bytes: &[u8], whole: bool) {
        self.bytes.extend_from_slice(bytes);
        self.whole = whole;
    }
    /// True once no byte is to come.
    pub fn is_whole(&self) -> bool {
        self.whole
    }
    #[inline(always)]
    fn next(&mut self) {
        self.code = self.code << 8 | u32::from(self.bytes.get(self.at).copied().unwrap_or(0));
        self.at += 1;
    }
    /// Bytes read past the end: more than a few mean that the stream does not hold what it says.
    pub fn overrun(&self) -> usize {
        self.at.saturating_sub(self.bytes.len())
    }
}

impl Coder for RangeDecoder {
    const ENCODES: bool = false;

    fn byte_position(&self) -> usize {
        self.at
    }
    fn position(&self) -> f64 {
        8.0 * self.at as f64 - log2(self.range)
    }
    fn ran_out(&self) -> bool {
        self.overrun() > OVERRUN
    }
    fn has(&self, count: usize) -> bool {
        self.whole || self.bytes.len() - self.at.min(self.bytes.len()) >= count
    }

    #[inline(always)]
    fn choose(&mut self, zero: u32, _: bool) -> bool {
        let bound = (self.range >> 16) * zero;
        let bit = self.code >= bound;
        if bit {
            self.code -= bound;
            self.range -= bound;
        } else {
            self.range = bound;
        }
        while self.range < 1 << 24 {
            self.range <<= 8;
            self.next();
        }
        bit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn code(coder: &mut impl Coder, numbers: &[(u32, i32)]) -> Vec<(u32, i32)> {
        let (mut a, mut b, mut tree) = (NumberModel::default(), SignedModel::default(), [Chance::default(); 8]);
        let one = |&(n, s): &(u32, i32)| {
            coder.symbol(&mut tree, n & 7);
            coder.raw(5, n);
            (coder.number(&mut a, n), coder.signed(&mut b, s))
        };
        numbers.iter().map(one).collect()
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(raw in prop::collection::vec((any::<u32>(), any::<i32>(), 0u32..32), 0..300)) {
            let numbers: Vec<_> = raw.into_iter().map(|(n, s, shift)| (n >> shift, s >> shift)).collect();
            let mut encoder = Encoder::new();
            code(&mut encoder, &numbers);
            let mut decoder = RangeDecoder::new(encoder.finish());
            prop_assert_eq!(code(&mut decoder, &numbers.iter().map(|_| (0, 0)).collect::<Vec<_>>()), numbers);
            prop_assert!(decoder.overrun() <= 8);
        }
    }

    #[test]
    fn what_is_all_zeros_is_not_taken_for_cut_off() {
        for count in [0, 10, 1000, 100_000] {
            let mut encoder = Encoder::new();
            let (mut fair, mut known) = (Chance::default(), Chance::default());
            (0..count).for_each(|_| assert_eq!((encoder.raw(20, 0), encoder.bit(&mut fair, false)), (0, false)));
            encoder.bit(&mut known, true);
            (0..count).for_each(|_| assert_eq!(encoder.raw(8, 0), 0));
            let mut decoder = RangeDecoder::new(encoder.finish());
            let (mut fair, mut known) = (Chance::default(), Chance::default());
            (0..count).for_each(|_| assert_eq!((decoder.raw(20, 0), decoder.bit(&mut fair, true)), (0, false)));
            assert!(decoder.bit(&mut known, false));
            (0..count).for_each(|_| assert_eq!(decoder.raw(8, 0), 0));
            assert!(decoder.overrun() <= OVERRUN, "{} bytes past the end after {count}", decoder.overrun());
        }
    }

    #[test]
    fn a_rare_choice_costs_little() {
        let mut encoder = Encoder::new();
        let mut chance = Chance::default();
        (0..100_000).for_each(|i| assert_eq!(encoder.bit(&mut chance, i % 100 == 0), i % 100 == 0));
        // The entropy is 8,079 bits.
        let bits = encoder.finish().len() * 8;
        assert!(bits < 8_600, "{bits}");
    }
}
