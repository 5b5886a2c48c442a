//! Functions of floating point that give the same bits on every machine: sums, products, quotients and square roots only, which
//! IEEE 754 defines to the last bit; no library's `exp` or `ln`, which differ.

/// 1 / (1 + e^-x).
#[inline(always)]
pub(super) fn squash(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

/// ln(p / (1 - p)), to 0.01.
#[inline(always)]
pub(super) fn stretch(p: f32) -> f32 {
    (log2(p) - log2(1.0 - p)) * std::f32::consts::LN_2
}

/// log₂ x to 0.005, for normal positive x: a parabola between powers of two.
#[inline(always)]
pub(super) fn log2(x: f32) -> f32 {
    let bits = x.to_bits();
    let f = f32::from_bits(bits & 0x7f_ffff | 0x3f80_0000) - 1.0;
    ((bits >> 23) as i32 - 127) as f32 + f * (1.346_6 - 0.346_6 * f)
}

/// e^x to about seven digits, for |x| up to 80; beyond, what it is there.
#[inline(always)]
pub(super) fn exp(x: f32) -> f32 {
    let x = x.clamp(-80.0, 80.0);
    // x = k ln 2 + r, |r| ≤ ln 2 / 2.
    let scaled = x * std::f32::consts::LOG2_E;
    let k = (scaled + if scaled < 0.0 { -0.5 } else { 0.5 }) as i32;
    let r = x - k as f32 * 0.693_359_4 + k as f32 * 2.121_944_4e-4;
    // Taylor's series to r⁶.
    let series = 1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0));
    let e = 1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * series)));
    e * f32::from_bits(((k + 127) as u32) << 23)
}

/// ln x to about six digits, for normal positive x.
#[inline(always)]
pub(super) fn ln(x: f32) -> f32 {
    let bits = x.to_bits();
    // x = m 2^k, m between √½ and √2.
    let k = ((bits.wrapping_sub(0x3f35_04f3)) as i32) >> 23;
    let m = f32::from_bits(bits.wrapping_sub((k as u32) << 23));
    // ln m = 2 artanh((m - 1) / (m + 1)).
    let s = (m - 1.0) / (m + 1.0);
    let q = s * s;
    k as f32 * std::f32::consts::LN_2 + 2.0 * s * (1.0 + q * (1.0 / 3.0 + q * (0.2 + q * (1.0 / 7.0 + q * (1.0 / 9.0)))))
}

/// The angle whose cosine is `x`, to 7e-5 (Abramowitz & Stegun 4.4.45).
#[inline(always)]
pub(super) fn arccos(x: f32) -> f32 {
    let a = x.clamp(-1.0, 1.0);
    let m = a.abs();
    let y = (1.0 - m).sqrt() * (1.570_728_8 + m * (-0.212_114_4 + m * (0.074_261 - m * 0.018_729_3)));
    if a < 0.0 { std::f32::consts::PI - y } else { y }
}

/// The larger of two numbers: the first unless the second is larger. (The library's `max` leaves open which zero it gives, and is a
/// call in WebAssembly.)
#[inline(always)]
pub(super) fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}
/// The smaller of two numbers: the first unless the second is smaller.
#[inline(always)]
pub(super) fn smaller(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

/// Between `low` and `high`, the nearer of them if outside; `low` for what is not a number, whose bits differ between machines.
#[inline(always)]
pub(super) fn fit(x: f64, low: f64, high: f64) -> f64 {
    // In this order, so that a NaN fails.
    let above = if x > low { x } else { low };
    if above < high { above } else { high }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_what_the_library_says() {
        for i in -8000..8000 {
            let x = i as f32 * 0.01;
            assert!((exp(x) / x.exp() - 1.0).abs() < 1e-5, "exp {x}: {} {}", exp(x), x.exp());
            let y = x.exp();
            assert!((ln(y) - y.ln()).abs() < 1e-5 * (1.0 + x.abs()), "ln {y}");
            assert!((log2(y) - y.log2()).abs() < 0.01, "log2 {y}: {} {}", log2(y), y.log2());
            let c = i as f32 / 8000.0;
            assert!((arccos(c) - c.acos()).abs() < 1e-4, "arccos {c}");
        }
    }
}
