//! glTF 2.0 and GLB, by the gltf crate: all nodes and primitives with their transforms, normals, colours, texture
//! coordinates, and one base-colour image. Where primitives differ in image, images are baked into vertex colours.

use super::{Dropped, Model, Resolve};
use crate::BuildError;
use base64::Engine;
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;
use pmesh_codec::Texture;
use pmesh_core::normals::smooth_normals;
use pmesh_core::{IndexedMesh, Vertices};
use std::collections::HashMap;
use std::collections::hash_map::Entry;

type Matrix = [[f32; 4]; 4];

fn file(message: impl Into<String>) -> BuildError {
    BuildError::File { format: "glTF", message: message.into() }
}

pub(super) fn read(bytes: &[u8], resolve: &mut Resolve) -> Result<Model, BuildError> {
    check_attributes(bytes)?;
    let gltf::Gltf { document, blob } = gltf::Gltf::from_slice(bytes).map_err(|e| file(e.to_string()))?;
    let mut blob = blob;
    let mut buffers = Vec::new();
    for buffer in document.buffers() {
        let data = match buffer.source() {
            gltf::buffer::Source::Bin => blob.take().ok_or_else(|| file("the binary chunk is missing"))?,
            gltf::buffer::Source::Uri(uri) => load(uri, resolve)?,
        };
        if data.len() < buffer.length() {
            let message = format!("buffer {} has {} bytes, {} are announced", buffer.index(), data.len(), buffer.length());
            return Err(file(message));
        }
        buffers.push(data);
    }
    for view in document.views() {
        let end = view.offset().checked_add(view.length());
        if end.is_none_or(|end| end > buffers[view.buffer().index()].len()) {
            return Err(file(format!("buffer view {} ends past its buffer", view.index())));
        }
    }
    let size = bytes.len() + buffers.iter().map(Vec::len).sum::<usize>();
    let mut scene = Scene {
        buffers: &buffers,
        parts: Vec::new(),
        dropped: Dropped::default(),
        elements_left: size.saturating_mul(INSTANCING),
    };
    scene.note_document(&document);
    scene.walk(&document)?;
    scene.into_model(resolve)
}

/// The library's own validation panics on attributes that name accessors past the last: they are checked before it.
fn check_attributes(bytes: &[u8]) -> Result<(), BuildError> {
    let unchecked = gltf::Gltf::from_slice_without_validation(bytes).map_err(|e| file(e.to_string()))?;
    let json = unchecked.document.as_json();
    let primitives = json.meshes.iter().flat_map(|m| &m.primitives);
    match primitives.flat_map(|p| p.attributes.values()).find(|a| a.value() >= json.accessors.len()) {
        Some(a) => Err(file(format!("accessor {} does not exist", a.value()))),
        None => Ok(()),
    }
}

fn load(uri: &str, resolve: &mut Resolve) -> Result<Vec<u8>, BuildError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, text) = data.split_once(";base64,").ok_or_else(|| file("a data URI is not base64"))?;
        let engine = base64::engine::general_purpose::STANDARD;
        return engine.decode(text).map_err(|e| file(format!("a data URI: {e}")));
    }
    resolve(uri)
        .ok_or_else(|| file(format!("{uri:?}, which the model needs, is not to be had: put it beside the model, or use a GLB")))
}

/// The library's readers take the types of accessors on trust.
fn check_type(semantic: &gltf::Semantic, accessor: &gltf::Accessor) -> Result<(), BuildError> {
    use gltf::Semantic::{Colors, Normals, Positions, TexCoords};
    let (kind, shape) = (accessor.data_type(), accessor.dimensions());
    let normalised = matches!(kind, DataType::F32 | DataType::U8 | DataType::U16);
    let fits = match semantic {
        Positions | Normals => kind == DataType::F32 && shape == Dimensions::Vec3,
        Colors(0) => normalised && matches!(shape, Dimensions::Vec3 | Dimensions::Vec4),
        TexCoords(0) => normalised && shape == Dimensions::Vec2,
        _ => true,
    };
    if fits { Ok(()) } else { Err(file(format!("accessor {} is of a type that {semantic:?} cannot have", accessor.index()))) }
}

/// A primitive where it stands in the scene.
struct Part<'a> {
    vertices: Vertices,
    triangles: Vec<[u32; 3]>,
    factor: [f32; 4],
    image: Option<gltf::Image<'a>>,
}

struct Scene<'a> {
    buffers: &'a [Vec<u8>],
    parts: Vec<Part<'a>>,
    dropped: Dropped,
    /// Vertices and indices that may still be read.
    elements_left: usize,
}

/// Vertices and indices that a byte of the file may become: nodes that share a mesh repeat it.
const INSTANCING: usize = 16;

impl<'a> Scene<'a> {
    fn note_document(&mut self, document: &gltf::Document) {
        let counts = [
            (document.animations().len(), "animations are not carried"),
            (document.skins().len(), "skins are not carried: the model stands in its bind pose"),
            (document.cameras().len(), "cameras are not carried"),
        ];
        for (count, what) in counts {
            (0..count).for_each(|_| self.dropped.note(what));
        }
        document.extensions_used().for_each(|e| self.dropped.note(format!("the extension {e} is not carried")));
    }

    fn walk(&mut self, document: &'a gltf::Document) -> Result<(), BuildError> {
        let identity = [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.], [0., 0., 0., 1.]];
        let scene = document.default_scene().or_else(|| document.scenes().next());
        let scene = scene.ok_or_else(|| file("there is no scene"))?;
        let mut stack: Vec<(gltf::Node, Matrix)> = scene.nodes().map(|n| (n, identity)).collect();
        let mut seen = vec![false; document.nodes().len()];
        while let Some((node, parent)) = stack.pop() {
            if std::mem::replace(&mut seen[node.index()], true) {
                return Err(file(format!("node {} has two parents", node.index())));
            }
            let matrix = multiply(&parent, &node.transform().matrix());
            if let Some(mesh) = node.mesh() {
                for primitive in mesh.primitives() {
                    self.primitive(&primitive, &matrix)?;
                }
            }
            stack.extend(node.children().map(|c| (c, matrix)));
        }
        Ok(())
    }

    fn check_accessor(&self, a: &gltf::Accessor) -> Result<(), BuildError> {
        let wrong = |what: &str| Err(file(format!("accessor {} {what}", a.index())));
        if a.sparse().is_some() {
            return wrong("is sparse, which is not read: re-export without sparse accessors");
        }
        let Some(view) = a.view() else {
            return wrong("has no buffer view (compressed by an extension?): decompress the model first");
        };
        let size = a.size();
        let stride = view.stride().unwrap_or(size);
        let last = a.count().checked_sub(1).and_then(|n| n.checked_mul(stride));
        let end = last.and_then(|l| l.checked_add(size)).and_then(|l| l.checked_add(a.offset()));
        if stride < size || end.is_none_or(|end| end > view.length()) {
            return wrong("ends past its buffer view");
        }
        Ok(())
    }

    fn spend(&mut self, elements: usize) -> Result<(), BuildError> {
        let left = self.elements_left.checked_sub(elements);
        self.elements_left =
            left.ok_or_else(|| file("its nodes repeat meshes too often for its size: export it with fewer instances"))?;
        Ok(())
    }

    fn primitive(&mut self, primitive: &gltf::Primitive<'a>, matrix: &Matrix) -> Result<(), BuildError> {
        let mode = primitive.mode();
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            self.dropped.note("points and lines are not carried");
            return Ok(());
        }
        if primitive.morph_targets().len() > 0 {
            self.dropped.note("morph targets are not carried");
        }
        for (semantic, accessor) in primitive.attributes() {
            self.check_accessor(&accessor)?;
            check_type(&semantic, &accessor)?;
            self.spend(accessor.count())?;
        }
        if let Some(indices) = primitive.indices() {
            self.check_accessor(&indices)?;
            self.spend(indices.count())?;
            let unsigned = matches!(indices.data_type(), DataType::U8 | DataType::U16 | DataType::U32);
            if !unsigned || indices.dimensions() != Dimensions::Scalar {
                return Err(file(format!("accessor {} does not hold indices", indices.index())));
            }
        }
        let buffers = self.buffers;
        let reader = primitive.reader(|b| buffers.get(b.index()).map(|d| &d[..]));
        let mut vertices = Vertices::default();
        let positions = reader.read_positions().ok_or_else(|| file("a primitive has no positions"))?;
        vertices.positions = positions.map(|p| transform(matrix, p, 1.0)).collect();
        let n = vertices.len() as u32;
        let order: Vec<u32> = match reader.read_indices() {
            Some(indices) => indices.into_u32().collect(),
            None => (0..n).collect(),
        };
        if let Some(i) = order.iter().find(|&&i| i >= n) {
            return Err(file(format!("index {i} refers past the {n} vertices of its primitive")));
        }
        let mut triangles = triangles(mode, &order);
        let (normal_matrix, mirrored) = cofactors(matrix);
        if mirrored {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        let a = &mut vertices.attributes;
        let normal = |v: [f32; 3]| unit(std::array::from_fn(|k| (0..3).map(|j| normal_matrix[j][k] * v[j]).sum()));
        a.normals = reader.read_normals().map(|it| it.map(normal).collect()).unwrap_or_default();
        a.texcoords = reader.read_tex_coords(0).map(|t| t.into_f32().collect()).unwrap_or_default();
        a.colors = reader.read_colors(0).map(|c| c.into_rgba_f32().collect()).unwrap_or_default();
        let material = primitive.material();
        let pbr = material.pbr_metallic_roughness();
        let texture = pbr.base_color_texture();
        if material.normal_texture().is_some()
            || pbr.metallic_roughness_texture().is_some()
            || material.emissive_texture().is_some()
        {
            self.dropped.note("of materials only base colours are carried");
        }
        if texture.as_ref().is_some_and(|t| t.tex_coord() != 0) {
            self.dropped.note("a texture that uses other than the first texture coordinates is not carried");
        }
        let image = texture.filter(|t| t.tex_coord() == 0 && !a.texcoords.is_empty()).map(|t| t.texture().source());
        self.parts.push(Part { vertices, triangles, factor: pbr.base_color_factor(), image });
        Ok(())
    }

    fn image_bytes(&self, image: &gltf::Image, resolve: &mut Resolve) -> Result<Texture, BuildError> {
        let (bytes, mime) = match image.source() {
            gltf::image::Source::View { view, mime_type } => {
                let at = view.offset();
                (self.buffers[view.buffer().index()][at..at + view.length()].to_vec(), mime_type.to_string())
            }
            gltf::image::Source::Uri { uri, .. } => (load(uri, resolve)?, String::new()),
        };
        let mime = match bytes[..] {
            [0x89, b'P', b'N', b'G', ..] => "image/png".to_string(),
            [0xff, 0xd8, ..] => "image/jpeg".to_string(),
            _ => return Err(file(format!("image {} ({mime}) is neither PNG nor JPEG", image.index()))),
        };
        Ok(Texture { mime, bytes })
    }

    fn into_model(mut self, resolve: &mut Resolve) -> Result<Model, BuildError> {
        let images: Vec<Option<usize>> = self.parts.iter().map(|p| p.image.as_ref().map(|i| i.index())).collect();
        let shared = images.first().copied().flatten().filter(|i| images.iter().all(|x| *x == Some(*i)));
        let texture = match (shared, self.parts.first().and_then(|p| p.image.clone())) {
            (Some(_), Some(image)) => match self.image_bytes(&image, resolve) {
                Ok(texture) => Some(texture),
                // A model is more than its image.
                Err(e) => {
                    self.dropped.note(format!("the base-colour image: {e}"));
                    None
                }
            },
            _ => None,
        };
        let mut parts = std::mem::take(&mut self.parts);
        if shared.is_none() && images.iter().any(Option::is_some) {
            self.dropped.note("several base-colour images: baked into vertex colours");
            let mut decoded = HashMap::new();
            for part in &mut parts {
                if let Some(image) = part.image.take() {
                    if let Entry::Vacant(slot) = decoded.entry(image.index()) {
                        slot.insert(crate::picture::decode(&self.image_bytes(&image, resolve)?)?);
                    }
                    bake(part, &decoded[&image.index()]);
                }
            }
        }
        Ok(Model { mesh: join(parts, texture.is_some()), texture, warnings: self.dropped.into_warnings() })
    }
}

/// Multiplies vertex colours by the image's colour at each vertex.
fn bake(part: &mut Part, image: &image::RgbaImage) {
    let (w, h) = image.dimensions();
    let a = &mut part.vertices.attributes;
    a.colors.resize(a.texcoords.len(), [1.0; 4]);
    for (color, [u, v]) in a.colors.iter_mut().zip(&a.texcoords) {
        let at = |t: f32, size: u32| ((t.rem_euclid(1.0) * size as f32) as u32).min(size - 1);
        let texel = image.get_pixel(at(*u, w), at(*v, h));
        // Colours are linear until `join`.
        (0..4).for_each(|k| color[k] *= if k < 3 { to_linear(f32::from(texel[k]) / 255.0) } else { f32::from(texel[k]) / 255.0 });
    }
    a.texcoords.clear();
}

fn to_linear(x: f32) -> f32 {
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}
fn to_srgb(x: f32) -> f32 {
    if x >= 1.0 {
        1.0
    } else if x <= 0.003_130_8 {
        x * 12.92
    } else {
        1.055 * x.powf(1.0 / 2.4) - 0.055
    }
}

/// One mesh of all parts; an attribute that some part has, all have.
fn join(parts: Vec<Part>, keep_texcoords: bool) -> IndexedMesh {
    let any = |f: fn(&Part) -> bool| parts.iter().any(f);
    let normals = any(|p| !p.vertices.attributes.normals.is_empty());
    let colors = any(|p| !p.vertices.attributes.colors.is_empty() || p.factor != [1.0; 4]);
    let texcoords = keep_texcoords || any(|p| !p.vertices.attributes.texcoords.is_empty());
    let mut mesh = IndexedMesh::default();
    for mut part in parts {
        let n = part.vertices.len();
        let first = mesh.vertices.len() as u32;
        let a = &mut part.vertices.attributes;
        if normals && a.normals.is_empty() {
            a.normals = smooth_normals(&part.vertices.positions, &part.triangles, &[]);
        }
        a.texcoords.resize(if texcoords { n } else { 0 }, [0.0; 2]);
        a.colors.resize(if colors { n } else { 0 }, [1.0; 4]);
        for color in &mut a.colors {
            let c: [f32; 4] = std::array::from_fn(|k| (color[k] * part.factor[k]).clamp(0.0, 1.0));
            *color = [to_srgb(c[0]), to_srgb(c[1]), to_srgb(c[2]), c[3]];
        }
        mesh.vertices.extend_from(&part.vertices);
        mesh.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    mesh
}

fn triangles(mode: Mode, order: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => {
            let turn = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
            order.windows(3).enumerate().map(turn).collect()
        }
        Mode::TriangleFan => (2..order.len()).map(|i| [order[0], order[i - 1], order[i]]).collect(),
        _ => order.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    }
}

/// Column-major, as glTF's.
fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|c| std::array::from_fn(|r| (0..4).map(|k| a[k][r] * b[c][k]).sum()))
}
fn transform(m: &Matrix, p: [f32; 3], w: f32) -> [f32; 3] {
    std::array::from_fn(|r| m[0][r] * p[0] + m[1][r] * p[1] + m[2][r] * p[2] + m[3][r] * w)
}
/// The matrix that turns normals (up to length), by columns, and whether the transform mirrors.
fn cofactors(m: &Matrix) -> ([[f32; 3]; 3], bool) {
    let c = |i: usize| [m[i][0], m[i][1], m[i][2]];
    let cross = |a: [f32; 3], b: [f32; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let columns = [cross(c(1), c(2)), cross(c(2), c(0)), cross(c(0), c(1))];
    let determinant: f32 = (0..3).map(|k| c(0)[k] * columns[0][k]).sum();
    let sign = if determinant < 0.0 { -1.0 } else { 1.0 };
    (columns.map(|col| col.map(|x| x * sign)), determinant < 0.0)
}
fn unit(n: [f32; 3]) -> [f32; 3] {
    let l = n.iter().map(|x| x * x).sum::<f32>().sqrt();
    if l > 0.0 && l.is_finite() { n.map(|x| x / l) } else { [0.0, 0.0, 1.0] }
}
