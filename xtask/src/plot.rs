//! Plots as SVG.

use std::fmt::Write;

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 440.0;
const MARGIN: f64 = 56.0;
/// Told apart without colour, too: the first is the thickest.
const COLORS: [&str; 4] = ["#0b62a4", "#c4501b", "#3a7d34", "#6d4b9a"];

/// A named line of (x, y).
pub struct Curve<'a> {
    pub name: &'a str,
    pub points: &'a [(f64, f64)],
}

/// Lines on logarithmic axes. Points that are not positive are left out: a logarithm has no place for them.
pub fn log_plot(title: &str, curves: &[Curve]) -> String {
    let positive = |p: &&(f64, f64)| p.0 > 0.0 && p.1 > 0.0;
    let all = || curves.iter().flat_map(|c| c.points.iter().filter(positive));
    let range = |of: fn(&(f64, f64)) -> f64| {
        let (low, high) = all().map(of).fold((f64::INFINITY, 0.0f64), |r, x| (r.0.min(x), r.1.max(x)));
        (low.log10(), high.log10().max(low.log10() + 0.1))
    };
    let (xs, ys) = (range(|p| p.0), range(|p| p.1));
    let part = |v: f64, (low, high): (f64, f64)| (v.log10() - low) / (high - low);
    let x = |v: f64| MARGIN + part(v, xs) * (WIDTH - 2.0 * MARGIN);
    let y = |v: f64| HEIGHT - MARGIN - part(v, ys) * (HEIGHT - 2.0 * MARGIN);
    let mut out = begin(title);
    for v in ticks(xs) {
        let at = x(v);
        let _ = writeln!(out, "<path d=\"M{at:.1} {MARGIN}V{:.1}\" stroke=\"#ddd\"/>", HEIGHT - MARGIN);
        let _ =
            writeln!(out, "<text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>", HEIGHT - MARGIN + 18.0, short(v));
    }
    for v in ticks(ys) {
        let at = y(v);
        let _ = writeln!(out, "<path d=\"M{MARGIN} {at:.1}H{:.1}\" stroke=\"#ddd\"/>", WIDTH - MARGIN);
        let _ = writeln!(out, "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>", MARGIN - 6.0, at + 4.0, short(v));
    }
    for (i, curve) in curves.iter().enumerate() {
        let color = COLORS[i % COLORS.len()];
        let points: Vec<String> = curve.points.iter().filter(positive).map(|p| format!("{:.1},{:.1}", x(p.0), y(p.1))).collect();
        let width = if i == 0 { 2.5 } else { 1.5 };
        let line = points.join(" ");
        let _ = writeln!(out, "<polyline points=\"{line}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"{width}\"/>");
        key(&mut out, i, curve.name);
    }
    out + "</svg>\n"
}

/// Groups of bars beside each other, from 0, with a line at 1. Each series has a value a group.
pub fn bar_plot(title: &str, groups: &[String], series: &[(&str, Vec<f64>)]) -> String {
    let top = series.iter().flat_map(|s| &s.1).fold(1.0f64, |t, &v| t.max(v)) * 1.25;
    let (width, height) = (WIDTH - 2.0 * MARGIN, HEIGHT - 2.5 * MARGIN);
    let bottom = MARGIN + height;
    let mut out = begin(title);
    let group = width / groups.len().max(1) as f64;
    let bar = 0.8 * group / series.len().max(1) as f64;
    for (i, (name, values)) in series.iter().enumerate() {
        let color = COLORS[i % COLORS.len()];
        for (g, v) in values.iter().enumerate() {
            let (x, tall) = (MARGIN + group * (g as f64 + 0.1) + bar * i as f64, height * v / top);
            let _ = writeln!(out, "<path d=\"M{x:.1} {bottom}h{bar:.1}v{:.1}h{:.1}z\" fill=\"{color}\"/>", -tall, -bar);
        }
        key(&mut out, i, name);
    }
    for (g, name) in groups.iter().enumerate() {
        let (x, y) = (MARGIN + group * (g as f64 + 0.6), bottom + 10.0);
        let _ = writeln!(out, "<text transform=\"translate({x:.1} {y:.1}) rotate(-40)\" text-anchor=\"end\">{name}</text>");
    }
    let one = bottom - height / top;
    let _ = writeln!(out, "<path d=\"M{MARGIN} {one:.1}h{width}\" stroke=\"#000\"/>");
    let _ = writeln!(out, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">1</text>", MARGIN - 6.0, one + 4.0);
    out + "</svg>\n"
}

fn begin(title: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fff\"/>\n<text x=\"{MARGIN}\" y=\"24\" font-size=\"14\">{title}</text>\n"
    )
}

/// The name of series `i`, in its colour.
fn key(out: &mut String, i: usize, name: &str) {
    let (x, y, color) = (WIDTH - MARGIN - 8.0, MARGIN + 18.0 * (i as f64 + 1.0), COLORS[i % COLORS.len()]);
    let _ = writeln!(out, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"end\" fill=\"{color}\">{name}</text>");
}

/// 1, 2 and 5 times powers of ten within a range of logarithms.
fn ticks((low, high): (f64, f64)) -> Vec<f64> {
    let powers = low.floor() as i32..=high.ceil() as i32;
    let all = powers.flat_map(|p| [1.0, 2.0, 5.0].map(|m| m * 10f64.powi(p)));
    all.filter(|v| (low - 1e-9..=high + 1e-9).contains(&v.log10())).collect()
}

fn short(v: f64) -> String {
    if v >= 1e6 {
        format!("{}M", v / 1e6)
    } else if v >= 1e3 {
        format!("{}k", v / 1e3)
    } else {
        format!("{}", (v * 1e6).round() / 1e6)
    }
}
