//! Globe, marble, knot and machined part.

use super::noise::{fractal, noise};
use crate::import::Model;
use pmesh_codec::Texture;
use pmesh_core::{IndexedMesh, Vertices};
use std::f64::consts::{PI, TAU};

/// A grid of `columns` × `rows` quads over a point for each (column, row); columns wrap if `closed`.
fn grid(columns: u32, rows: u32, closed: bool, mut point: impl FnMut(u32, u32) -> [f64; 3]) -> IndexedMesh {
    let width = if closed { columns } else { columns + 1 };
    let mut vertices = Vertices::default();
    for row in 0..=rows {
        for column in 0..width {
            vertices.positions.push(point(column, row).map(|x| x as f32));
        }
    }
    let mut triangles = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let v = |c: u32, r: u32| r * width + c % width;
            let [a, b, c, d] = [v(column, row), v(column + 1, row), v(column + 1, row + 1), v(column, row + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    IndexedMesh { vertices, triangles, position_of: Vec::new() }
}

fn direction(longitude: f64, latitude: f64) -> [f64; 3] {
    let (s, c) = longitude.sin_cos();
    let (z, r) = latitude.sin_cos();
    [c * r, z, -s * r]
}

fn relief(d: [f64; 3]) -> f64 {
    fractal(d.map(|x| x * 1.6 + 3.7), 7)
}

/// A globe of `size` rows and twice as many columns: land with fractal relief, sea flat, a painted texture. The poles are
/// one vertex each in position, one wedge a column; a seam runs from pole to pole.
pub fn globe(size: u32) -> Model {
    let columns = size * 2;
    let mut mesh = grid(columns, size, false, |c, r| {
        // Both ends of a row, and all of a pole, are one point to the bit.
        let longitude = TAU * f64::from(c % columns) / f64::from(columns);
        match r {
            0 => [0.0, 1.0 + 0.06 * relief([0.0, 1.0, 0.0]).max(0.0), 0.0],
            _ if r == size => [0.0, -1.0 - 0.06 * relief([0.0, -1.0, 0.0]).max(0.0), 0.0],
            _ => {
                let d = direction(longitude, PI / 2.0 - PI * f64::from(r) / f64::from(size));
                d.map(|x| x * (1.0 + 0.12 * relief(d).max(0.0)))
            }
        }
    });
    for r in 0..=size {
        for c in 0..=columns {
            mesh.vertices.attributes.texcoords.push([c as f32 / columns as f32, r as f32 / size as f32]);
        }
    }
    // Rows run downwards: turn the triangles outward, and drop those that a pole folds to a line.
    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    let p = &mesh.vertices.positions;
    mesh.triangles.retain(|&[a, b, c]| {
        let [a, b, c] = [a, b, c].map(|v| p[v as usize]);
        a != b && b != c && c != a
    });
    Model { mesh, texture: Some(paint_globe(1024, 512)), warnings: Vec::new() }
}

fn paint_globe(width: u32, height: u32) -> Texture {
    let image = image::RgbImage::from_fn(width, height, |x, y| {
        let longitude = TAU * (f64::from(x) + 0.5) / f64::from(width);
        let latitude = PI / 2.0 - PI * (f64::from(y) + 0.5) / f64::from(height);
        let d = direction(longitude, latitude);
        let h = relief(d);
        let cold = latitude.abs() / (PI / 2.0) + 0.15 * noise(d.map(|x| x * 6.0)) + h.max(0.0) * 0.25;
        let ramp = |stops: &[(f64, [f64; 3])], t: f64| {
            let i = stops.partition_point(|s| s.0 < t).clamp(1, stops.len() - 1);
            let ((t0, a), (t1, b)) = (stops[i - 1], stops[i]);
            let f = ((t - t0) / (t1 - t0)).clamp(0.0, 1.0);
            std::array::from_fn::<f64, 3, _>(|k| a[k] + (b[k] - a[k]) * f)
        };
        let color = if cold > 0.86 {
            [236.0, 242.0, 247.0]
        } else if h > 0.0 {
            ramp(
                &[
                    (0.0, [222., 205., 150.]),
                    (0.06, [104., 142., 74.]),
                    (0.35, [70., 104., 58.]),
                    (0.6, [128., 106., 84.]),
                    (0.9, [240., 240., 240.]),
                ],
                h,
            )
        } else {
            ramp(&[(-1.0, [12., 36., 84.]), (-0.25, [22., 68., 130.]), (0.0, [78., 152., 188.])], h)
        };
        image::Rgb(color.map(|c| c as u8))
    });
    let mut bytes = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 82);
    // Encoding into memory has no way to fail; an empty image would only leave the globe white.
    if image.write_with_encoder(encoder).is_err() {
        bytes.clear();
    }
    Texture { mime: "image/jpeg".into(), bytes }
}

/// A turned body, `columns` around and `rows` along (2 × both triangles), veined like marble by vertex colours.
pub fn marble(columns: u32, rows: u32) -> IndexedMesh {
    let profile =
        |t: f64| 0.32 + 0.26 * (PI * t).sin() + 0.09 * (TAU * 2.5 * t).sin() * (1.0 - t) + 0.03 * (TAU * 9.0 * t).sin() * t;
    let mut mesh = grid(columns, rows, true, |c, r| {
        let t = f64::from(r) / f64::from(rows);
        let (s, k) = (TAU * f64::from(c) / f64::from(columns)).sin_cos();
        let flute = 1.0 + 0.02 * (TAU * 12.0 * f64::from(c) / f64::from(columns)).cos() * (PI * t).sin();
        let radius = profile(t) * flute * if r == 0 || r == rows { 0.55 } else { 1.0 };
        [radius * k, 1.8 * t - 0.9, -radius * s]
    });
    for p in &mesh.vertices.positions {
        let p = p.map(f64::from);
        let vein = (6.0 * p[1] + 4.0 * p[0] + 3.2 * fractal(p.map(|x| x * 2.2), 5)).sin().abs();
        let dark = (1.0 - vein).powi(6) * 0.75 + 0.12 * fractal(p.map(|x| x * 5.0), 4).max(0.0);
        let shade = |base: f64, ink: f64| (base + (ink - base) * dark.clamp(0.0, 1.0)) as f32;
        // On the grid of eighth-bit colours, so that coding them loses nothing.
        let eighth = |x: f32| (x * 255.0).round() / 255.0;
        mesh.vertices.attributes.colors.push([
            eighth(shade(0.95, 0.22)),
            eighth(shade(0.93, 0.26)),
            eighth(shade(0.9, 0.32)),
            1.0,
        ]);
    }
    mesh
}

/// A trefoil tube, `along` × `around` quads.
pub fn knot(along: u32, around: u32) -> IndexedMesh {
    let curve = |t: f64| [(t).sin() + 2.0 * (2.0 * t).sin(), (t).cos() - 2.0 * (2.0 * t).cos(), -(3.0 * t).sin()];
    let mut mesh = grid(around, along, true, |c, r| {
        let t = TAU * f64::from(r % along) / f64::from(along);
        let (p, q) = (curve(t), curve(t + 1e-4));
        let tangent = unit(std::array::from_fn(|k| q[k] - p[k]));
        let side = unit(cross(tangent, [0.0, 0.0, 1.0]));
        let up = cross(side, tangent);
        let (s, k) = (TAU * f64::from(c) / f64::from(around)).sin_cos();
        let radius = 0.55 + 0.05 * (TAU * 30.0 * f64::from(r % along) / f64::from(along)).sin();
        std::array::from_fn(|i| p[i] + radius * (k * side[i] + s * up[i]))
    });
    // The last row is the first again.
    let last = along * around;
    mesh.triangles.iter_mut().flatten().filter(|v| **v >= last).for_each(|v| *v -= last);
    mesh.vertices.positions.truncate(last as usize);
    mesh
}

/// A flange with a hub and six bolt holes, cut from a height field with sharp steps: flat faces, right-angled edges.
pub fn part() -> IndexedMesh {
    let mut builder = PartBuilder::default();
    let segments = 96;
    // (inner radius, outer radius, bottom, top) of stacked rings, from the outside in.
    let profile: [[f64; 2]; 11] = [
        [0.30, -0.30],
        [1.0, -0.30],
        [1.0, -0.10],
        [0.95, -0.05],
        [0.55, -0.05],
        [0.55, 0.35],
        [0.50, 0.40],
        [0.38, 0.40],
        [0.30, 0.32],
        [0.30, 0.0],
        [0.30, -0.30],
    ];
    for pair in profile.windows(2) {
        let steps = (((pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1])) / 0.05).ceil().max(1.0) as u32;
        for s in 0..steps {
            let at = |s: u32| -> [f64; 2] {
                let f = f64::from(s) / f64::from(steps);
                std::array::from_fn(|k| pair[0][k] + (pair[1][k] - pair[0][k]) * f)
            };
            builder.ring(at(s), at(s + 1), segments);
        }
    }
    for bolt in 0..6 {
        let a = TAU * f64::from(bolt) / 6.0;
        builder.boss([0.77 * a.cos(), 0.77 * a.sin()], 0.11, -0.05, 0.06, 24);
    }
    builder.mesh
}

#[derive(Default)]
struct PartBuilder {
    mesh: IndexedMesh,
    index: std::collections::HashMap<[i64; 3], u32>,
}

impl PartBuilder {
    /// The vertex at a point; points that agree to a millionth are one.
    fn vertex(&mut self, p: [f64; 3]) -> u32 {
        let key = p.map(|x| (x * 1e6).round() as i64);
        let positions = &mut self.mesh.vertices.positions;
        *self.index.entry(key).or_insert_with(|| {
            positions.push(p.map(|x| x as f32));
            positions.len() as u32 - 1
        })
    }
    fn quad(&mut self, corners: [[f64; 3]; 4]) {
        let [a, b, c, d] = corners.map(|p| self.vertex(p));
        for t in [[a, b, c], [a, c, d]] {
            if t[0] != t[1] && t[1] != t[2] && t[2] != t[0] {
                self.mesh.triangles.push(t);
            }
        }
    }
    /// A strip around the axis between two (radius, height) pairs.
    fn ring(&mut self, from: [f64; 2], to: [f64; 2], segments: u32) {
        for s in 0..segments {
            let at = |[r, h]: [f64; 2], s: u32| {
                let (y, x) = (TAU * f64::from(s % segments) / f64::from(segments)).sin_cos();
                [r * x, h, -r * y]
            };
            self.quad([at(from, s), at(from, s + 1), at(to, s + 1), at(to, s)].map(|p| p));
        }
    }
    /// A closed bolt head that sinks a little into the plate.
    fn boss(&mut self, [cx, cz]: [f64; 2], radius: f64, bottom: f64, top: f64, segments: u32) {
        let rings = [[0.0, bottom - 0.02], [radius, bottom - 0.02], [radius, top - 0.02], [radius - 0.02, top], [0.0, top]];
        for pair in rings.windows(2) {
            for s in 0..segments {
                let at = |[r, h]: [f64; 2], s: u32| {
                    let (y, x) = (TAU * f64::from(s % segments) / f64::from(segments)).sin_cos();
                    [cx + r * x, h, cz - r * y]
                };
                self.quad([at(pair[0], s), at(pair[0], s + 1), at(pair[1], s + 1), at(pair[1], s)]);
            }
        }
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
fn unit(v: [f64; 3]) -> [f64; 3] {
    let l = v.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    v.map(|x| x / l)
}
