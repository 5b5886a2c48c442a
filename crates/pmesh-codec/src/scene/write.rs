//! A patch stream as nodes: `ProgIndexedTriSet` with a `ProgLOD` a level, in VRML97, X3D's classic encoding or its XML.
//!
//! Positions come back bit for bit (-0 as 0): a correction is what is missing from the mean of the rim, with all digits of an `f64`.

use super::prog::{joined, mean, rim_of};
use crate::EncodeError;
use crate::patch::PatchStream;
use pmesh_core::Vertices;
use pmesh_core::surface::{CanonicalOrder, Fan, NONE, Surface};
use std::io::Write;

/// How nodes are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// `#VRML V2.0 utf8`, with PROTOs, so that other browsers show the base mesh.
    Vrml97,
    /// `#X3D V3.3 utf8`.
    X3dClassic,
    /// X3D's XML.
    X3dXml,
}

/// As FC01's Figure 4, its index fields typed as they must be; a browser that knows only IndexedFaceSet shows the base.
const PROTOS: &str = "PROTO ProgLOD [ field MFInt32 triIndex [] field SFNode coord NULL field SFNode color NULL
  field SFNode normal NULL field SFNode texCoord NULL ] { Group {} }
PROTO ProgIndexedTriSet [ field SFBool ccw TRUE field SFBool colorPerVertex TRUE field SFFloat creaseAngle 0
  field SFBool normalPerVertex TRUE field SFBool solid TRUE exposedField SFNode coord NULL exposedField SFNode color NULL
  exposedField SFNode normal NULL exposedField SFNode texCoord NULL field MFInt32 coordIndex [] field MFInt32 colorIndex []
  field MFInt32 normalIndex [] field MFInt32 texCoordIndex [] exposedField MFNode levels [] exposedField MFString levelsUrl [] ]
{ IndexedFaceSet { ccw IS ccw colorPerVertex IS colorPerVertex creaseAngle IS creaseAngle normalPerVertex IS normalPerVertex
  solid IS solid coord IS coord color IS color normal IS normal texCoord IS texCoord coordIndex IS coordIndex } }
";

/// A node's lists: (field, node, its field, numbers).
type Lists = Vec<(&'static str, &'static str, &'static str, String)>;

/// Writes a stream; gives the numbers that come back rounded: those smaller than about 2^-29 of their neighbours, which a sum
/// in double precision cannot hold. The image is not written. O(n), a pass a level. Errors: patches that do not fit the mesh, or a failing writer.
pub fn write(stream: &PatchStream, encoding: Encoding, out: &mut impl Write) -> Result<usize, EncodeError> {
    let misfit = || EncodeError::Unsupported { what: "a patch that does not fit the mesh", way_out: "build the levels anew" };
    let mesh = &stream.mesh;
    let mut coded = vec![NONE; mesh.vertices.len()];
    stream.levels.iter().flat_map(|l| &l.removed).for_each(|r| coded[r.vertex as usize] = 0);
    let base: Vec<u32> = (0..coded.len() as u32).filter(|&v| coded[v as usize] == NONE).collect();
    base.iter().enumerate().for_each(|(new, &old)| coded[old as usize] = new as u32);
    let mut all = mesh.vertices.select(base.iter().copied());
    let triangles: Vec<[u32; 3]> = stream.base_triangles.iter().map(|t| t.map(|v| coded[v as usize])).collect();
    let index = |runs: &mut dyn Iterator<Item = Vec<u32>>| {
        runs.map(|r| r.iter().map(u32::to_string).chain(["-1".into()]).collect::<Vec<_>>().join(" "))
            .collect::<Vec<_>>()
            .join(" ")
    };
    let mut rounded = 0;
    let mut text = Text { encoding, out };
    text.begin(&index(&mut triangles.iter().map(|t| t.to_vec())), &lists(&all))?;
    let mut surface = Surface::new(triangles, base.len() as u32);
    for (i, level) in stream.levels.iter().enumerate() {
        let order = if i == 0 { (0..surface.triangles.len() as u32).collect() } else { CanonicalOrder::of(&surface) };
        let mut number = vec![NONE; order.len()];
        order.iter().enumerate().for_each(|(n, &t)| number[t as usize] = n as u32);
        let places = surface.places();
        let mut patches = Vec::with_capacity(level.removed.len());
        for r in &level.removed {
            let mut region = r.patch(&coded, &places).ok_or_else(misfit)?;
            region.sort_unstable_by_key(|&t| number[t as usize]);
            let fan = surface.fan(&region).ok_or_else(misfit)?;
            patches.push((number[region[0] as usize], r.vertex, region, fan));
        }
        // In the order of their first triangles.
        patches.sort_unstable_by_key(|p| p.0);
        let mut corrections = Corrections::default();
        for (_, old, _, fan) in &patches {
            corrections.add(&all, &mesh.vertices, *old, fan);
            coded[*old as usize] = surface.insert(fan);
            all.push_from(&mesh.vertices, *old as usize);
        }
        rounded += corrections.rounded;
        let regions = &mut patches.iter().map(|p| p.2.iter().map(|&t| number[t as usize]).collect());
        text.level(&index(regions), &corrections.lists())?;
    }
    text.end()?;
    Ok(rounded)
}

/// Writes a scene whose levels are in files of their own, the base's first (C.9).
pub fn write_urls(urls: &[String], encoding: Encoding, out: &mut impl Write) -> Result<(), EncodeError> {
    let quoted: Vec<String> = urls.iter().map(|u| format!("\"{}\"", percent_encoded(u))).collect();
    let mut text = Text { encoding, out };
    text.opening(&match encoding {
        Encoding::X3dXml => format!(" levelsUrl='{}'/></Shape></Scene></X3D>", quoted.join(" ")),
        _ => format!("levelsUrl [ {} ] }} }}", quoted.join(" ")),
    })
}

/// A file's name as a URL: nothing in it that XML, VRML or a URL would take for something else.
fn percent_encoded(name: &str) -> String {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b"-._~/".contains(&b);
    name.bytes().map(|b| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") }).collect()
}

fn wide<const N: usize>(values: &[[f32; N]]) -> impl Iterator<Item = f64> {
    // Adding zero makes -0 and 0 one, as corrections do.
    values.iter().flatten().map(|&x| f64::from(x) + 0.0)
}

fn lists(v: &Vertices) -> Lists {
    let a = &v.attributes;
    let mut out = vec![("coord", "Coordinate", "point", joined(wide(&v.positions), 3))];
    if !a.colors.is_empty() {
        out.push(("color", "ColorRGBA", "color", joined(wide(&a.colors), 4)));
    }
    if !a.normals.is_empty() {
        out.push(("normal", "Normal", "vector", joined(wide(&a.normals), 3)));
    }
    if !a.texcoords.is_empty() {
        out.push(("texCoord", "TextureCoordinate", "point", joined(wide(&a.texcoords), 2)));
    }
    out
}

/// What is missing from the means, patch by patch.
#[derive(Default)]
struct Corrections {
    positions: Vec<f64>,
    colors: Vec<f64>,
    normals: Vec<f64>,
    texcoords: Vec<f64>,
    rounded: usize,
}

impl Corrections {
    fn add(&mut self, known: &Vertices, truth: &Vertices, old: u32, fan: &Fan) {
        fn missing<const N: usize>(known: &[[f32; N]], truth: &[[f32; N]], old: u32, fan: &Fan, out: &mut Vec<f64>) -> usize {
            let Some(own) = truth.get(old as usize) else { return 0 };
            let mean = mean(known, &rim_of(fan));
            let missing: [f64; N] = std::array::from_fn(|k| f64::from(own[k]) - mean[k]);
            out.extend(missing);
            (0..N).filter(|&k| (mean[k] + missing[k]) as f32 != own[k]).count()
        }
        let (a, t) = (&known.attributes, &truth.attributes);
        let mut rounded = missing(&known.positions, &truth.positions, old, fan, &mut self.positions);
        rounded += missing(&a.colors, &t.colors, old, fan, &mut self.colors);
        rounded += missing(&a.normals, &t.normals, old, fan, &mut self.normals);
        rounded += missing(&a.texcoords, &t.texcoords, old, fan, &mut self.texcoords);
        self.rounded += rounded;
    }
    fn lists(self) -> Lists {
        let all = [
            ("coord", "Coordinate", "point", self.positions, 3),
            ("color", "ColorRGBA", "color", self.colors, 4),
            ("normal", "Normal", "vector", self.normals, 3),
            ("texCoord", "TextureCoordinate", "point", self.texcoords, 2),
        ];
        let there = all.into_iter().filter(|l| !l.3.is_empty());
        there.map(|(field, node, inner, numbers, width)| (field, node, inner, joined(numbers, width))).collect()
    }
}

struct Text<'a, W: Write> {
    encoding: Encoding,
    out: &'a mut W,
}

impl<W: Write> Text<'_, W> {
    fn opening(&mut self, rest: &str) -> Result<(), EncodeError> {
        let head = match self.encoding {
            Encoding::Vrml97 => format!("#VRML V2.0 utf8\n{PROTOS}Shape {{ geometry ProgIndexedTriSet {{\n"),
            Encoding::X3dClassic => "#X3D V3.3 utf8\nPROFILE Interchange\nShape { geometry ProgIndexedTriSet {\n".into(),
            Encoding::X3dXml => {
                let head =
                    "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<X3D profile=\"Interchange\" version=\"3.3\"><Scene><Shape>";
                format!("{head}\n<ProgIndexedTriSet")
            }
        };
        Ok(writeln!(self.out, "{head}{rest}")?)
    }
    fn begin(&mut self, index: &str, lists: &Lists) -> Result<(), EncodeError> {
        self.opening(&if self.encoding == Encoding::X3dXml { format!(" coordIndex=\"{index}\">") } else { String::new() })?;
        self.lists(lists)?;
        if self.encoding != Encoding::X3dXml {
            write!(self.out, "coordIndex [ {index} ]\nlevels [\n")?;
        }
        Ok(())
    }
    fn level(&mut self, index: &str, lists: &Lists) -> Result<(), EncodeError> {
        if self.encoding == Encoding::X3dXml {
            writeln!(self.out, "<ProgLOD triIndex=\"{index}\">")?;
            self.lists(lists)?;
            writeln!(self.out, "</ProgLOD>")?;
        } else {
            writeln!(self.out, "ProgLOD {{")?;
            self.lists(lists)?;
            writeln!(self.out, "triIndex [ {index} ] }}")?;
        }
        Ok(())
    }
    fn lists(&mut self, lists: &Lists) -> Result<(), EncodeError> {
        for (field, node, inner, numbers) in lists {
            match self.encoding {
                Encoding::X3dXml => writeln!(self.out, "<{node} {inner}=\"{numbers}\"/>")?,
                // VRML97 has no ColorRGBA; the name is read by what follows it.
                _ => writeln!(self.out, "{field} {node} {{ {inner} [ {numbers} ] }}")?,
            }
        }
        Ok(())
    }
    fn end(&mut self) -> Result<(), EncodeError> {
        let closing = match self.encoding {
            Encoding::X3dXml => "</ProgIndexedTriSet></Shape></Scene></X3D>\n",
            _ => "] } }\n",
        };
        Ok(self.out.write_all(closing.as_bytes())?)
    }
}
