//! Sections 3.1 and 3.2: the range decoder and integer models.

pub struct Range<'a> {
    bytes: &'a [u8],
    at: usize,
    taken_before: usize,
    range: u32,
    code: u32,
}

impl<'a> Range<'a> {
    pub fn start(bytes: &'a [u8]) -> Self {
        let mut out = Self { bytes, at: 0, taken_before: 0, range: 0xffff_ffff, code: 0 };
        (0..4).for_each(|_| out.next());
        out
    }
    fn next(&mut self) {
        let byte = self.bytes.get(self.at).copied().unwrap_or(0);
        self.at += 1;
        self.code = self.code << 8 | u32::from(byte);
    }
    /// Refuses what has read more than 16 bytes past the end.
    pub fn check(&self) -> Result<(), String> {
        if self.at > self.bytes.len() + 16 {
            return Err("3.1: more than 16 bytes past the end of a block".into());
        }
        Ok(())
    }
    /// A piece of 9.2 begins.
    pub fn piece_begins(&mut self) {
        self.taken_before = self.at;
    }
    /// A piece of 9.2 ends: it may have taken `reach` bytes.
    pub fn piece_ends(&self, reach: u32) -> Result<(), String> {
        if self.at - self.taken_before > reach as usize {
            return Err("9.2: a piece that takes more than reach".into());
        }
        self.check()
    }
    /// `zero`: the chance of the answer 0 in 1/65536, 1 to 65535.
    pub fn choose(&mut self, zero: u32) -> bool {
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
    pub fn even(&mut self) -> bool {
        self.choose(32768)
    }
    pub fn bit(&mut self, c: &mut Chance) -> bool {
        let b = self.choose(c.zero.clamp(64, 65472));
        let rate = 655_360 / (10 * c.seen + 16);
        if b {
            c.zero -= (c.zero * rate) >> 16;
        } else {
            c.zero += ((65535 - c.zero) * rate) >> 16;
        }
        if c.seen < 250 {
            c.seen += 1;
        }
        b
    }
    fn raw(&mut self, n: u32) -> u32 {
        let mut out = 0;
        for _ in 0..n {
            out = out << 1 | u32::from(self.even());
        }
        out
    }
    /// `cs`: 2^n chances.
    pub fn symbol(&mut self, n: u32, cs: &mut [Chance]) -> u32 {
        let mut node = 1;
        for _ in 0..n {
            node = node << 1 | u32::from(self.bit(&mut cs[node as usize]));
        }
        node - (1 << n)
    }
    pub fn number(&mut self, m: &mut Number) -> u32 {
        let length = self.symbol(6, &mut m.length).min(32);
        if length <= 1 {
            return length;
        }
        let low = length - 1;
        let n = low.min(2);
        let h = self.symbol(n, &mut m.high[length as usize]);
        1 << low | h << (low - n) | self.raw(low - n)
    }
    pub fn signed(&mut self, m: &mut Signed) -> i32 {
        let x = self.number(&mut m.number) as i32;
        if x == 0 {
            return 0;
        }
        if self.bit(&mut m.sign) { x.wrapping_neg() } else { x }
    }
}

#[derive(Clone, Copy)]
pub struct Chance {
    zero: u32,
    seen: u32,
}

impl Default for Chance {
    fn default() -> Self {
        Self { zero: 32768, seen: 0 }
    }
}

#[derive(Clone)]
pub struct Number {
    length: Vec<Chance>,
    high: Vec<[Chance; 4]>,
}

impl Default for Number {
    fn default() -> Self {
        Self { length: vec![Chance::default(); 64], high: vec![[Chance::default(); 4]; 64] }
    }
}

#[derive(Clone, Default)]
pub struct Signed {
    number: Number,
    sign: Chance,
}
