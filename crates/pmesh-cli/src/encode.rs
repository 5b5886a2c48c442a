//! `pmesh encode`: a mesh to a stream.

mod compact;
mod views;
mod write;

use write::warn_of_positions_only;
pub use write::{gzip, write_stream};

use crate::error::{CliError, Result};
use crate::output::say;
use crate::progress::Progress;
use crate::{input, output};
use clap::ValueEnum;
use pmesh_build::import::Model;
use pmesh_build::picture::{self, ImageOption};
use pmesh_build::pipeline::{BuildOptions, LevelRule, Method, Steps, build};
use pmesh_build::simplify::{self, ForestOptions, PatchOptions, Placement, collapse_forests, remove_patches};
use pmesh_codec::Texture;
use pmesh_codec::patch::{self, PatchStream};
use pmesh_codec::pmesh::{LevelStream, quantise};
use pmesh_codec::scene::{self, Encoding};
use pmesh_codec::split;
use std::path::{Path, PathBuf};

/// Encode a mesh (OBJ, PLY, STL, OFF, glTF, GLB, VRML97, X3D) as a progressive stream, or convert a stream to another
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  pmesh encode statue.obj -o statue.pmesh\n  pmesh encode scan.ply -o scan.pmesh --bits 12 --growth 2\n  pmesh encode part.stl -o part.lod.gz --levels 8\n  pmesh encode bust.glb -o bust.pmesh --bits none   every float bit for bit\n  pmesh encode bust.glb -o bust.pmesh --profile fast   for fast links and slow processors\n  pmesh encode city.glb -o city.pmesh --profile views   for <p-mesh view-dependent>\n  pmesh encode chair.obj -o chair.slod              a level a vertex (SS97)\n  pmesh convert bust.pmesh -o bust.x3d              any stream to any other"
)]
pub struct Args {
    /// The mesh, or a stream, whose levels are kept where the output can hold them
    input: PathBuf,
    /// Where to write: .pmesh, .pits, .pfs, .slod, .lod, .lod.gz, .wrl, .x3dv or .x3d
    #[arg(short, long)]
    output: PathBuf,
    #[command(flatten)]
    how: How,
}

/// What `encode` and `sample` share
#[derive(clap::Args, Clone, Default)]
pub struct How {
    /// Kind of stream [default: as the output's name says]
    #[arg(long, value_enum)]
    stream: Option<Stream>,
    /// Bits a coordinate, 8 to 16, or "none" to keep every float; the grid's step is the longest side / (2^N - 1) [default: what a stream has that is converted; of a mesh 14
    /// for .pmesh, .pits and .pfs, none for the others]
    #[arg(long, value_parser = parse_bits)]
    bits: Option<Bits>,
    /// Number of levels, 1 to 63; a .slod has one a vertex
    #[arg(long, conflicts_with = "growth", value_parser = clap::value_parser!(u32).range(1..=63))]
    levels: Option<u32>,
    /// Factor by which triangles grow from level to level [default: 1.5]
    #[arg(long)]
    growth: Option<f64>,
    /// Triangles of the coarsest level, about; 0 leaves one vertex a component, or what a stream has to keep [default: 120 for a .pmesh, 60 with
    /// --profile fast, 1200 for .pits, 600 for .pfs]
    #[arg(long)]
    base: Option<usize>,
    /// What a .pmesh is to be best at [default: prefix; fast with --levels, --growth or --simplifier, and for a large model of which
    /// more than a quarter is not manifold; a stream that has levels keeps them, and with them its profile]
    #[arg(long, value_enum)]
    profile: Option<Profile>,
    /// How to simplify [default: half-edge, closest for .slod]
    #[arg(long, value_enum)]
    simplifier: Option<Simplifier>,
    /// A file a level (name-0.pits, name-1.pits …) and a scene (-o name.wrl, .x3dv or .x3d) that names them in levelsUrl
    #[arg(long)]
    split_levels: bool,
    /// The base-colour image: "wavelet" sharpens as it comes, a PNG bit for bit, a JPEG in as many bytes as it has; "lossless", bit
    /// for bit whatever it was; a size such as 30k; or "keep", the file as it is, which shows once it is whole [default: wavelet]
    #[arg(long, value_parser = parse_image)]
    image: Option<ImageOption>,
    /// Text format only: GV97's Surface Partition layout, all representatives after the coarsest level
    #[arg(long)]
    surface_partition: bool,
}

fn parse_image(text: &str) -> std::result::Result<ImageOption, String> {
    let bytes = || {
        let (digits, factor) = match text.strip_suffix(['k', 'K']) {
            Some(digits) => (digits, 1000),
            None => (text, 1),
        };
        digits.parse::<usize>().ok().and_then(|n| n.checked_mul(factor)).filter(|&n| n > 0)
    };
    match text {
        "wavelet" => Ok(ImageOption::Wavelet),
        "lossless" => Ok(ImageOption::Lossless),
        "keep" => Ok(ImageOption::Keep),
        _ => bytes().map(ImageOption::Bytes).ok_or_else(|| "wavelet, lossless, keep, or a number of bytes such as 30k".into()),
    }
}

/// Bits a coordinate.
#[derive(Clone, Copy)]
struct Bits(Option<u8>);

fn parse_bits(text: &str) -> std::result::Result<Bits, String> {
    match text {
        "none" => Ok(Bits(None)),
        _ => match text.parse() {
            Ok(n @ 8..=16) => Ok(Bits(Some(n))),
            _ => Err("8 to 16, or none".into()),
        },
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Stream {
    /// Our own
    Pmesh,
    /// GV99's text; gzipped if the name ends in .gz
    Lod,
    /// SS97's packets, a level a vertex
    Slod,
    /// FC01's patches
    Patch,
    /// Forest splits (Taubin et al.): few levels, each nearly twice the one before
    Split,
    /// FC01's nodes as VRML97, X3D classic or X3D XML text, as the name's ending says
    Nodes,
}

/// What a `.pmesh` is to be best at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Profile {
    /// Far fewer bytes: of positions on a grid mostly a quarter to an eighth of fast's, about what the best single-rate files have, and on
    /// scans a good mesh after any part of them. What is not manifold, and a few vertices of each piece, come with the first level
    Prefix,
    /// As prefix, each level taking all that it can: on scans a percent or two fewer bytes in all, for coarser levels on the way
    Size,
    /// The fastest decoder, some six times as fast: whole sooner on links above some 20 Mbit/s and on slow processors. Refines what is not
    /// manifold, too
    Fast,
    /// A hierarchy in blocks, of which <p-mesh view-dependent> fetches what the camera sees, from any server of files. About twice as many
    /// bytes in all; positions only
    Views,
}

impl Stream {
    /// True if levels made otherwise are of no use to it.
    pub fn finds_its_own_levels(self) -> bool {
        matches!(self, Stream::Patch | Stream::Split | Stream::Nodes)
    }
    pub fn of(path: &Path, how: &How) -> Result<Stream> {
        let name = path.to_string_lossy().to_ascii_lowercase();
        let known = [
            (".pmesh", Stream::Pmesh),
            (".lod", Stream::Lod),
            (".lod.gz", Stream::Lod),
            (".slod", Stream::Slod),
            (".pits", Stream::Patch),
            (".pfs", Stream::Split),
            (".wrl", Stream::Nodes),
            (".x3dv", Stream::Nodes),
            (".x3d", Stream::Nodes),
        ];
        let named = known.iter().find(|k| name.ends_with(k.0)).map(|k| k.1);
        how.stream.or(named).ok_or_else(|| {
            CliError::Usage(format!(
                "{}: write .pmesh, .pits, .pfs, .slod, .lod, .lod.gz, .wrl, .x3dv or .x3d, or say which with --stream",
                path.display()
            ))
        })
    }
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Simplifier {
    /// Vertices stay where they are; smallest files
    HalfEdge,
    /// Clusters of closest representatives (SS97): any soup of triangles, by distance alone
    Closest,
    /// Coarse vertices move to where they fit best; better coarse levels, larger files (.pmesh only)
    Moving,
    /// Half-edge collapses, levels by the exact rule of the paper (independent collapses)
    Star,
}

pub fn run(args: &Args, quiet: bool) -> Result<()> {
    let place = |p: &Path| p.canonicalize().ok();
    if place(&args.output).is_some_and(|out| place(&args.input) == Some(out)) {
        return Err(CliError::Usage(format!(
            "{}: input and output are the same file: name another output",
            args.output.display()
        )));
    }
    let mut how = args.how.clone();
    let kind = Stream::of(&args.output, &args.how)?;
    if Stream::of(&args.output, &How::default()).is_ok_and(|named| named != kind) {
        eprintln!("warning: {}: the name says another stream than --stream, which is what is written", args.output.display());
    }
    if how.profile.is_some() && kind != Stream::Pmesh {
        eprintln!("warning: {}: --profile is for pmesh streams; it has no effect here", args.output.display());
    }
    let bytes = input::read(&args.input)?;
    let model = if input::is_stream(&args.input, &bytes) {
        let stream = input::decode_whole(&args.input, &bytes)?;
        stream.warn(&args.input);
        // What is exact stays exact, and what is on a grid stays on one as fine, unless something else is asked for.
        let views = input::views_head(&bytes);
        let bits = views.as_ref().map(|h| h.base.grid.position_bits).or(stream.receiver.info().map(|i| i.position_bits));
        how.bits = how.bits.or(bits.map(Bits));
        // And compact stays compact.
        let is_compact = stream.receiver.info().is_some_and(|i| i.format.starts_with("compact"));
        if is_compact && kind == Stream::Pmesh && args.how.asks_for_nothing() {
            output::write_bytes(&args.output, &bytes)?;
            return if quiet {
                Ok(())
            } else {
                say(&format!("{}: {} bytes, copied as they are", args.output.display(), bytes.len()))
            };
        }
        if how.profile.is_none() && kind == Stream::Pmesh && is_compact {
            how.profile = Some(Profile::Prefix);
        }
        // Patches, forests and what is compact are levels of their own kind.
        let compact = matches!(how.profile, Some(Profile::Prefix | Profile::Size | Profile::Views));
        let own_kind = kind.finds_its_own_levels() || (kind == Stream::Pmesh && compact);
        let levels = if own_kind || stream.is_plain_scene() || views.is_some() { None } else { kept_levels(&stream) };
        // A .pmesh has no table for a level a vertex: it gets levels of its own.
        match levels.filter(|l| kind != Stream::Pmesh || l.levels.len() < 64) {
            Some(levels) => {
                how.warn_of_kept_levels(&args.input);
                let texture = image(stream.texture, &args.input, &how);
                return write_stream(LevelStream { texture, ..levels }, &args.output, &how, quiet);
            }
            None if stream.receiver.mesh().arrived_levels() > 1 => {
                eprintln!("warning: {}: its levels cannot be kept; they are made anew from the finest", args.input.display());
            }
            None => {}
        }
        Model { mesh: stream.receiver.mesh().finest_mesh(), texture: stream.texture, ..Default::default() }
    } else {
        input::model(&args.input, &bytes)?
    };
    for warning in &model.warnings {
        eprintln!("warning: {}: {warning}", args.input.display());
    }
    encode_model(model, &args.input, &args.output, &how, quiet)
}

/// Writes patches, as bytes or as nodes, or forest splits.
fn write_refinements(model: Model, input: &Path, output: &Path, how: &How, quiet: bool) -> Result<()> {
    if how.levels.is_some() || how.growth.is_some() || how.simplifier.is_some() {
        eprintln!("warning: --levels, --growth and --simplifier have no effect here: this stream's levels are of its own kind");
    }
    let kind = Stream::of(output, how)?;
    let text = kind == Stream::Nodes && !how.split_levels;
    let bits = how.bits.unwrap_or(Bits(if text { None } else { Some(DEFAULT_BITS) })).0;
    let mut mesh = quantise(&model.mesh, bits);
    if mesh.vertices.is_empty() {
        return Err(CliError::build(input)(pmesh_build::BuildError::Empty));
    }
    // What the grid has rounded is what is taken apart; attributes keep their own grids.
    mesh.vertices.attributes = model.mesh.vertices.attributes.clone();
    let (patches, forests) = (PatchOptions::default().base_vertices, ForestOptions::default().base_vertices);
    let base_vertices = how.base.map_or(if kind == Stream::Split { forests } else { patches }, |t| t / 2);
    let total = mesh.vertices.len();
    let progress = Progress::new("removing vertices", quiet);
    let part = |left: usize| (total - left) as f64 / (total - base_vertices.min(total)).max(1) as f64;
    let (mut out, summary) = (Vec::new(), Summary { mesh: &mesh, output });
    let line = if kind == Stream::Split {
        let mut stream = collapse_forests(&mesh, ForestOptions { base_vertices }, |left| progress.set(part(left)));
        progress.done();
        stream.texture = model.texture;
        let report = split::encode(&stream, bits, &mut out).map_err(CliError::encode(output))?;
        let kept = report.keep_bits as f64 / f64::from(report.removed.0.max(1));
        let raw = report.raw_bits_per_triangle();
        let more = format!(
            "; before entropy coding {raw:.2} bits a new triangle, and {kept:.2} bits a removed vertex to say which copy keeps its number"
        );
        summary.line(stream.level_count(), out.len(), report.base, report.loose.0, report.removed, report.connectivity) + &more
    } else {
        let mut stream = remove_patches(&mesh, PatchOptions { base_vertices }, |left| progress.set(part(left)));
        progress.done();
        stream.texture = model.texture;
        if text {
            return write_nodes(&stream, output, quiet);
        }
        let report = patch::encode(&stream, bits, &mut out).map_err(CliError::encode(output))?;
        let levels = stream.levels.len() as u32 + 1;
        summary.line(levels, out.len(), report.base, report.loose.0, report.removed, report.connectivity)
    };
    if how.split_levels {
        split_levels(&out, output, quiet)?;
    } else {
        output::write_bytes(output, &out)?;
    }
    if quiet { Ok(()) } else { say(&line) }
}

/// What a stream of refinements is made of, in a line.
struct Summary<'a> {
    mesh: &'a pmesh_core::IndexedMesh,
    output: &'a Path,
}

impl Summary<'_> {
    fn line(
        &self,
        levels: u32,
        bytes: usize,
        base: (u32, u32, usize),
        loose: u32,
        removed: (u32, usize),
        connectivity: usize,
    ) -> String {
        let per = |bytes: usize| 8.0 * bytes as f64 / f64::from(removed.0.max(1));
        format!(
            "{}: {} levels, {} triangles, {bytes} bytes; base {} vertices in {} bytes; {} removed: {:.2} bits each for connectivity, {:.2} for displacements",
            self.output.display(),
            levels + u32::from(loose > 0),
            self.mesh.triangles.len(),
            base.0,
            base.2,
            removed.0,
            per(connectivity),
            per(removed.1 - connectivity)
        )
    }
}

fn encoding_of(output: &Path) -> Encoding {
    let extension = output.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    match extension.as_str() {
        "x3d" => Encoding::X3dXml,
        "x3dv" => Encoding::X3dClassic,
        _ => Encoding::Vrml97,
    }
}

fn write_nodes(stream: &PatchStream, output: &Path, quiet: bool) -> Result<()> {
    if stream.texture.is_some() {
        eprintln!("warning: {}: the image is left out: nodes hold texture coordinates only", output.display());
    }
    let mut text = Vec::new();
    let rounded = scene::write(stream, encoding_of(output), &mut text).map_err(CliError::encode(output))?;
    if rounded > 0 {
        eprintln!("warning: {}: {rounded} numbers, tiny beside their neighbours, come back rounded", output.display());
    }
    output::write_bytes(output, &text)?;
    if quiet {
        return Ok(());
    }
    say(&format!("{}: {} levels, {} bytes", output.display(), stream.levels.len() + 1, text.len()))
}

/// Cuts a `.pits` where its levels end; the pieces one after the other are the file.
fn split_levels(bytes: &[u8], output: &Path, quiet: bool) -> Result<()> {
    if Stream::of(output, &How::default())? != Stream::Nodes {
        return Err(CliError::Usage(format!("{}: --split-levels writes a scene: name a .wrl, .x3dv or .x3d", output.display())));
    }
    let table = input::decode_whole(output, bytes)?.receiver.info().and_then(|i| i.levels.clone()).unwrap_or_default();
    let (mut from, mut names) = (0, Vec::new());
    for (i, level) in table.iter().enumerate() {
        let end = if i + 1 == table.len() { bytes.len() } else { level.end_byte as usize };
        let stem = output.file_stem().unwrap_or_default().to_string_lossy();
        let name = format!("{stem}-{i}.pits");
        output::write_bytes(&output.with_file_name(&name), &bytes[from..end])?;
        from = end;
        names.push(name);
    }
    let mut text = Vec::new();
    scene::write_urls(&names, encoding_of(output), &mut text).map_err(CliError::encode(output))?;
    output::write_bytes(output, &text)?;
    if quiet {
        Ok(())
    } else {
        say(&format!("{}: names {} files, {} to {}", output.display(), names.len(), names[0], names[names.len() - 1]))
    }
}

/// The levels of a stream, but for its image; `None` where vertices move or triangles are replaced between them. Where they only sharpen, they have
/// all bits from the start.
fn kept_levels(stream: &input::Stream) -> Option<LevelStream> {
    let mesh = stream.receiver.mesh();
    let sharpens = stream.receiver.info().is_some_and(|i| i.shows_parts);
    let levels = if sharpens { mesh.settled_levels()? } else { mesh.to_levels()? };
    let table = stream.receiver.info().and_then(|i| i.levels.clone());
    let errors = table.map_or(vec![0.0; levels.len()], |t| t.iter().map(|l| l.error).collect());
    Some(LevelStream { attribute_set: mesh.attribute_set(), levels, errors, texture: None })
}

/// Bits a coordinate of a `.pmesh`, if nothing else is asked for: no grid is seen at any screen's size.
const DEFAULT_BITS: u8 = 14;

impl How {
    /// The compact profile that is asked for, or taken because nothing else is.
    fn compact(&self) -> Option<simplify::Profile> {
        match self.profile {
            Some(Profile::Prefix) => Some(simplify::Profile::Prefix),
            Some(Profile::Size) => Some(simplify::Profile::Size),
            Some(Profile::Fast | Profile::Views) => None,
            None if self.levels.is_some() || self.growth.is_some() || self.simplifier.is_some() => None,
            None => Some(simplify::Profile::Prefix),
        }
    }
    /// No option says how levels, coordinates or images are to be.
    fn asks_for_nothing(&self) -> bool {
        let counts = [self.levels.is_some(), self.growth.is_some(), self.base.is_some(), self.simplifier.is_some()];
        !counts.contains(&true) && self.profile.is_none() && self.bits.is_none() && self.image.is_none()
    }
    /// Says which options have no effect where the levels are there already.
    pub fn warn_of_kept_levels(&self, path: &Path) {
        let given = [
            (self.levels.is_some(), "--levels"),
            (self.growth.is_some(), "--growth"),
            (self.base.is_some(), "--base"),
            (self.simplifier.is_some(), "--simplifier"),
            (matches!(self.profile, Some(Profile::Prefix | Profile::Size)), "--profile"),
        ];
        for (_, name) in given.iter().filter(|g| g.0) {
            eprintln!(
                "warning: {}: it has levels already, which are kept; {name} has no effect (decode it to a mesh to make others)",
                path.display()
            );
        }
    }
    /// Says which options have no effect where a mesh is written as it is.
    pub fn warn_of_plain_mesh(&self, path: &Path) {
        self.warn_of_kept_levels(path);
        if self.bits.is_some() {
            eprintln!("warning: {}: a mesh is written with every float; --bits has no effect", path.display());
        }
    }
}

/// Encodes `model` as the stream that `output` names, as `how` says.
pub fn encode_model(mut model: Model, input: &Path, output: &Path, how: &How, quiet: bool) -> Result<()> {
    model.texture = image(model.texture, input, how);
    let kind = Stream::of(output, how)?;
    if how.split_levels && !kind.finds_its_own_levels() {
        eprintln!("warning: {}: --split-levels is for scenes (.wrl, .x3dv, .x3d); it has no effect here", output.display());
    }
    if kind == Stream::Pmesh && how.profile == Some(Profile::Views) {
        return views::write(&model, input, output, how, quiet);
    }
    match (kind, how.compact()) {
        (Stream::Patch | Stream::Split | Stream::Nodes, _) => return write_refinements(model, input, output, how, quiet),
        (Stream::Pmesh, Some(profile)) => match compact::take_apart(model, profile, input, how, quiet)? {
            Ok(stream) => return compact::write(&stream, output, how, quiet),
            Err(back) => model = back,
        },
        _ => {}
    }
    write_stream(simplified(&model, input, how, kind, quiet)?, output, how, quiet)
}

/// The base-colour image as it is asked for.
fn image(texture: Option<Texture>, path: &Path, how: &How) -> Option<Texture> {
    let Some(texture) = texture else {
        if how.image.is_some() {
            eprintln!("warning: {}: it has no base-colour image; --image has no effect", path.display());
        }
        return None;
    };
    match picture::convert(texture, how.image.unwrap_or_default()) {
        Ok((texture, warning)) => {
            warning.into_iter().for_each(|w| eprintln!("warning: {}: {w}", path.display()));
            Some(texture)
        }
        // A model is more than its image.
        Err(e) => {
            eprintln!("warning: {}: {e}; the model is written without it", path.display());
            None
        }
    }
}

fn simplified(model: &Model, path: &Path, how: &How, kind: Stream, quiet: bool) -> Result<LevelStream> {
    let mut bare = None;
    if matches!(kind, Stream::Slod | Stream::Lod) && (!model.mesh.position_of.is_empty() || model.texture.is_some()) {
        warn_of_positions_only(path);
        bare = Some(Model { mesh: model.mesh.positions_only(), ..Default::default() });
    }
    let model = bare.as_ref().unwrap_or(model);
    let default = BuildOptions::default();
    let smooth = kind == Stream::Slod;
    let closest = how.simplifier.map_or(smooth, |s| s == Simplifier::Closest);
    if smooth && (how.levels.is_some() || how.growth.is_some()) {
        return Err(CliError::Usage("a .slod has a level a vertex: leave out --levels and --growth".into()));
    }
    let options = BuildOptions {
        method: if closest { Method::Closest } else { Method::Quadric },
        base_triangles: how.base.unwrap_or(default.base_triangles),
        placement: if matches!(how.simplifier, Some(Simplifier::Moving)) { Placement::Optimal } else { Placement::Kept },
        rule: if matches!(how.simplifier, Some(Simplifier::Star)) { LevelRule::Star } else { LevelRule::Cost },
        steps: match (how.levels, how.growth) {
            _ if smooth => Steps::Single,
            (Some(n), _) => Steps::Count(n),
            (_, Some(f)) => Steps::Growth(f),
            _ => default.steps,
        },
    };
    let progress = Progress::new("simplifying", quiet);
    let stream = build(model, &options, |part| progress.set(part)).map_err(CliError::build(path))?;
    progress.done();
    Ok(stream)
}
