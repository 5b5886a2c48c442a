//! Scenes: FC01's Figure 5 (G.15, G.17), GV99's Figures 7 and 8, plain face sets, and what is wrong with some.

use pmesh_codec::scene::{Encoding, write};
use pmesh_codec::{Arrival, DecodeError, Receiver};
use pmesh_core::IndexedMesh;

const FIGURE_5: &str = include_str!("data/figure5-printed.wrl");

/// Figure 5 as it should have been printed; a missing -1 at the end of triIndex is allowed (C.8).
const REPAIRED: &str = "#VRML V2.0 utf8
Shape { geometry ProgIndexedTriSet {
  coord Coordinate { point [10 70 0, 20 20 0, 65 120 0, 80 20 0, 90 60 0, 110 120 0, 115 90 0, 120 10 0, 150 55 0] }
  coordIndex [4 5 2 -1 0 4 2 -1 4 6 5 -1 4 8 6 -1 3 8 4 -1 3 7 8 -1 1 3 4 -1 1 4 0]
  levels [
    ProgLOD { coord Coordinate { point [0 0 0] } triIndex [0 1] }
    ProgLOD { coord Coordinate { point [0 0 0, 0 0 0, 0 0 0] } triIndex [0 1 2 -1 3 4 5 -1 6 7 8] }
  ]
} }";

struct Read {
    receiver: Receiver,
    warnings: Vec<String>,
    elsewhere: Vec<String>,
    error: Option<DecodeError>,
}

fn read(text: &str) -> Read {
    let mut receiver = Receiver::default();
    let pieces = text.as_bytes().chunks(7);
    let error = { pieces }.try_for_each(|p| receiver.push(p)).and_then(|()| receiver.finish()).err();
    let mut out = Read { receiver, warnings: vec![], elsewhere: vec![], error };
    while let Some(arrival) = out.receiver.poll() {
        match arrival {
            Arrival::Warning(text) => out.warnings.push(text),
            Arrival::Elsewhere(urls) => out.elsewhere = urls,
            _ => {}
        }
    }
    out.receiver.mesh().check_invariants();
    out
}

fn counts(read: &Read) -> Vec<(u32, u32)> {
    let mesh = read.receiver.mesh();
    let levels = (0..mesh.level_count()).rev();
    levels.map(|l| (mesh.vertex_count(l).expect("it is there"), mesh.triangle_count(l).expect("it is there"))).collect()
}

/// A hexagon cut into a triangle and three ears: no fan about any vertex. Then a pair of its star's triangles gets a vertex.
const NO_FAN: &str = "#VRML V2.0 utf8
Shape { geometry ProgIndexedTriSet {
  coord Coordinate { point [0 0 0, 2 -1 0, 4 0 0, 4 2 0, 2 3 0, 0 2 0, 6 1 0] }
  coordIndex [0 1 2 -1 0 2 4 -1 2 3 4 -1 4 5 0 -1 2 6 3]
  levels [
    ProgLOD { triIndex [1 0 3 2] coord Coordinate { point [0 0 1] } }
    ProgLOD { triIndex [2 3] coord Coordinate { point [0 0 0] } }
  ]
} }";

#[test]
fn what_stands_after_levels_that_were_shown_is_an_error() {
    // Long enough to be looked at before its end.
    let filler = "# filler\n".repeat(3000);
    let late = REPAIRED.replace(
        "  ]\n} }",
        &format!("  ]\n{filler} color Color {{ color [1 0 0, 1 0 0, 1 0 0, 1 0 0, 1 0 0, 1 0 0, 1 0 0, 1 0 0, 1 0 0] }}\n}} }}"),
    );
    let read = read(&late);
    assert!(read.error.is_some_and(|e| e.to_string().contains("levels last")));
    assert_eq!(read.receiver.mesh().arrived_levels(), 2);
    let fine = REPAIRED.replace("  ]\n} }", &format!("  ]\n{filler}\n}} }}"));
    let read = self::read(&fine);
    assert_eq!((read.error.as_ref(), counts(&read)), (None, vec![(9, 8), (10, 10), (13, 16)]));
}

#[test]
fn materials_colour_shapes_without_colours_of_their_own() {
    let shape = |appearance: &str, more: &str| {
        format!(
            "Shape {{ {appearance} geometry IndexedFaceSet {{ coord Coordinate {{ point [0 0 0, 1 0 0, 0 1 0] }} coordIndex [0 1 2] {more} }} }}\n"
        )
    };
    let red = shape("appearance Appearance { material DEF M Material { diffuseColor 1 0 0 transparency 0.5 } }", "");
    let own = shape("appearance Appearance { material USE M }", "color Color { color [0 1 0, 0 1 0, 0 1 0] }");
    let text = format!("#VRML V2.0 utf8\n{red}{own}{}", shape("", ""));
    let read = read(&text);
    assert_eq!(read.error, None);
    let mesh = read.receiver.mesh().finest_mesh();
    let colors = &mesh.vertices.attributes.colors;
    assert_eq!([colors[0], colors[3], colors[6]], [[1.0, 0.0, 0.0, 0.5], [0.0, 1.0, 0.0, 1.0], [1.0; 4]]);
    let old = self::read("#VRML V1.0 ascii\nSeparator { }");
    assert!(old.error.is_some_and(|e| e.to_string().contains("VRML97")));
}

#[test]
fn a_patch_that_is_no_fan_replaces_its_triangles() {
    let read = read(NO_FAN);
    assert_eq!((read.error.as_ref(), &read.warnings[..]), (None, &[][..]));
    assert_eq!(counts(&read), [(7, 5), (8, 7), (9, 9)]);
    let mesh = read.receiver.mesh();
    let sorted = |level: u32| {
        let mut all: Vec<[u32; 3]> = mesh.triangles_at(level).expect("a level").into_iter().map(pmesh_core::turned).collect();
        all.sort_unstable();
        all
    };
    assert_eq!(sorted(2), [[0, 1, 2], [0, 2, 4], [0, 4, 5], [2, 3, 4], [2, 6, 3]]);
    assert_eq!(sorted(1), [[0, 1, 7], [0, 7, 5], [1, 2, 7], [2, 3, 7], [2, 6, 3], [3, 4, 7], [4, 5, 7]]);
    for level in 0..3 {
        assert_eq!(mesh.triangles_at(level), pmesh_core::reference::triangles_at(mesh, level));
        // The surface keeps its area, seen from above: nothing overlaps, nothing is missing.
        let shown = mesh.mesh_at(level.into()).expect("a level");
        let p = |v: u32| shown.vertices.positions[v as usize];
        let area = |[a, b, c]: [u32; 3]| (p(b)[0] - p(a)[0]) * (p(c)[1] - p(a)[1]) - (p(b)[1] - p(a)[1]) * (p(c)[0] - p(a)[0]);
        let areas: Vec<f32> = shown.triangles.iter().map(|&t| area(t)).collect();
        assert!(areas.iter().all(|&a| a > 0.0) && (areas.iter().sum::<f32>() - 28.0).abs() < 1e-4, "{level}: {areas:?}");
    }
    assert_eq!(mesh.finest_mesh().triangles.len(), 9);
    assert!(mesh.has_retired() && mesh.to_levels().is_none());
}

#[test]
fn g15_figure_5_as_printed_and_as_repaired_gives_its_three_levels() {
    for (text, warned) in [(FIGURE_5, true), (REPAIRED, false)] {
        let read = read(text);
        assert_eq!(read.error, None);
        assert_eq!(!read.warnings.is_empty(), warned, "{:?}", read.warnings);
        assert_eq!(counts(&read), [(9, 8), (10, 10), (13, 16)]);
        let finest = read.receiver.mesh().finest_mesh();
        let expected = [[68.75, 92.5, 0.0], [50.75, 72.5, 0.0], [91.0, 49.0, 0.0], [89.75, 96.5, 0.0]];
        assert_eq!(finest.vertices.positions[9..], expected);
        // Consistently oriented, none of them flat or turned over.
        let p = &finest.vertices.positions;
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| p[v as usize]);
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        assert!(finest.triangles.iter().all(|t| area(t) > 0.0));
    }
    let printed = read(FIGURE_5);
    assert!(printed.warnings.iter().any(|w| w.contains("2 of 8 triangles")), "{:?}", printed.warnings);
}

#[test]
fn g17_levels_url_takes_the_place_of_what_is_inline() {
    let text = REPAIRED.replace("  levels [", "  levelsUrl [\"a-0.pits\" \"a-1.pits\"]\n  levels [");
    let read = read(&text);
    assert_eq!((read.error, read.elsewhere), (None, vec!["a-0.pits".into(), "a-1.pits".into()]));
    assert_eq!(read.receiver.mesh().arrived_levels(), 0);
}

#[test]
fn figures_7_and_8_of_gv99_name_another_stream() {
    let figure_7 = "#VRML V2.0 utf8
PROTO MultiLevelProgIfs [ field SFString urlData \"\"   field SFBool debug FALSE ]
{ DEF ifs IndexedFaceSet { coordIndex []  coord Coordinate { point [ ] } }
  DEF script Script { url \"ProgIfs.class\"  directOutput TRUE  mustEvaluate TRUE
    field SFString urlData IS urlData   field SFNode ifs USE ifs   eventIn SFBool update   eventOut SFBool isReady }
  ROUTE script.isReady TO script.update }
";
    let use_of_it = "Shape { geometry MultiLevelProgIfs { urlData \"horse.lod.gz\" } }";
    let figure_8 = "#VRML V2.0 utf8\nEXTERNPROTO MultiLevelProgIfs [ field SFString urlData ] [\"ProgIfs.wrl\"]\n".to_string();
    for text in [figure_8 + use_of_it, figure_7.to_string() + use_of_it] {
        let read = read(&text);
        assert_eq!((read.error, read.elsewhere), (None, vec!["horse.lod.gz".into()]));
    }
}

#[test]
fn plain_scenes_are_one_mesh_with_transforms_colours_and_polygons() {
    let vrml = "#VRML V2.0 utf8
DEF square Shape { geometry IndexedFaceSet {
  coord DEF c Coordinate { point [0 0 0, 1 0 0, 1 1 0, 0 1 0] }
  coordIndex [0 1 2 3 -1] color Color { color [1 0 0, 0 1 0] } colorPerVertex FALSE colorIndex [1] } }
Transform { translation 10 0 0 rotation 0 0 1 1.5707963267948966 scale 2 2 2 children [ USE square ] }";
    let x3d = "<?xml version='1.0'?><!DOCTYPE X3D PUBLIC 'ISO//Web3D//DTD X3D 3.3//EN' 'http://www.web3d.org/x3d.dtd'>
<X3D><Scene><Shape DEF='square'><IndexedFaceSet coordIndex='0 1 2 3 -1' colorPerVertex='false' colorIndex='1'>
<Coordinate point='0 0 0, 1 0 0, 1 1 0, 0 1 0'/><Color color='1 0 0 0 1 0'/></IndexedFaceSet></Shape>
<Transform translation='10 0 0' rotation='0 0 1 1.5707963267948966' scale='2 2 2'><Shape USE='square'/></Transform></Scene></X3D>";
    for text in [vrml, x3d] {
        let read = read(text);
        assert_eq!((&read.error, read.warnings.len()), (&None, 0), "{text}");
        let mesh = read.receiver.mesh().finest_mesh();
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (8, 4));
        assert_eq!(mesh.vertices.attributes.colors, [[0.0, 1.0, 0.0, 1.0]; 8]);
        let corner = mesh.vertices.positions[6];
        let off = (0..3).map(|k| (corner[k] - [8.0, 2.0, 0.0][k]).abs()).fold(0.0, f32::max);
        assert!(off < 1e-6, "{corner:?}");
    }
}

#[test]
fn what_is_wrong_is_an_error_with_its_line_and_what_is_whole_stays() {
    let cut = &REPAIRED[..REPAIRED.len() - 30];
    let read_cut = read(cut);
    assert_eq!(counts(&read_cut), [(9, 8), (10, 10)]);
    assert!(read_cut.error.expect("it is cut").to_string().contains("line 7"));
    for (from, to, what) in [
        ("triIndex [0 1]", "triIndex [0 9]", "past"),
        ("triIndex [0 1]", "triIndex [0 5]", "make no patch"),
        ("triIndex [0 1 2 -1 3 4 5 -1 6 7 8]", "triIndex [0 1 2 -1 2 4 5 -1 6 7 8]", "patch 1"),
        ("point [0 0 0]", "point [0 0 0, 1 1 1]", "corrections"),
        ("1 4 0]", "1 4 77]", "index 77"),
        ("coordIndex [4 5 2 -1", "coordIndex [4 5 2 1 -1", "corners"),
    ] {
        let read = read(&REPAIRED.replacen(from, to, 1));
        let error = read.error.unwrap_or_else(|| panic!("{to}")).to_string();
        assert!(error.contains(what) && error.contains("line"), "{error}");
    }
    assert!(read("#VRML V2.0 utf8\nShape { geometry Sphere {} }").warnings[0].contains("Sphere"));
    let face = |points: &str, index: &str| {
        format!(
            "#VRML V2.0 utf8\nShape {{ geometry IndexedFaceSet {{ coord Coordinate {{ point [{points}] }} coordIndex [{index}] }} }}"
        )
    };
    for (points, index, what) in [
        ("0 0 0 1 0 0 0 1", "0 1 2", "no points of three"),
        ("0 0 0 x 1 0 0 0 1 0", "0 1 2", "\"x\" stands"),
        ("0 0 0 1 0 0 0 1 0", "0 1 1.5", "no index"),
        ("0 0 0 1 0 0 0 1 0", "0 1 4294967298", "no index"),
    ] {
        let error = read(&face(points, index)).error.expect(what).to_string();
        assert!(error.contains(what), "{error}");
    }
    // Hexadecimal, a byte order mark, lines that end as on old machines, a script that names its own node.
    let odd = format!("\u{feff}{}", face("0 0 0 1 0 0 0 1 0", "0x0 0x1 0x2 -1"))
        .replace("Shape", "DEF K Script { field SFNode x USE K }\nShape");
    let odd = read(&odd.replace('\n', "\r"));
    assert_eq!((odd.error, odd.receiver.mesh().triangles().len()), (None, 1));
    let proto = face("0 0 0 1 0 0 0 1 0", "0 1 2").replacen("Shape", "PROTO P [] { Group {} }\nP {}\nShape", 1);
    assert!(read(&proto).warnings[0].contains("P is a PROTO"));
    let entity = |e: &str| {
        format!(
            "<X3D><Scene><Shape><IndexedFaceSet coordIndex='0 1 {e}'><Coordinate point='0 0 0 1 0 0 0 1 0'/></IndexedFaceSet></Shape></Scene></X3D>"
        )
    };
    assert_eq!(read(&entity("&#50; -1")).error, None);
    assert!(read(&entity("&a;")).error.expect("unknown").to_string().contains("entity"));
    let many = format!(
        "Group {{ children [ DEF A Shape {{ geometry IndexedFaceSet {{ coordIndex [{}] }} }} {} ] }}",
        "0 ".repeat(10_000),
        "USE A ".repeat(10_000)
    );
    assert!(read(&format!("#VRML V2.0 utf8\n{many}")).error.expect("too many").to_string().contains("copies"));
    let deep = format!("#VRML V2.0 utf8\n{}", "Group { children [ ".repeat(100_000));
    assert!(read(&deep).error.expect("too deep").to_string().contains("deeper"));
    let copies = (0..60).fold("#VRML V2.0 utf8\nDEF a0 Group {}\n".to_string(), |s, i| {
        s + &format!("DEF a{} Group {{ children [ USE a{i} USE a{i} ] }}\n", i + 1)
    });
    assert!(read(&copies).error.expect("too many").to_string().contains("copies"));
    let lol = (0..60).fold("<X3D><Scene><Group DEF='a0'/>".to_string(), |s, i| {
        s + &format!("<Group DEF='a{}'><Group USE='a{i}'/><Group USE='a{i}'/></Group>", i + 1)
    });
    assert!(read(&(lol + "</Scene></X3D>")).error.expect("too many").to_string().contains("copies"));
}

#[test]
fn a_patch_stream_written_as_nodes_comes_back_bit_for_bit() {
    use pmesh_codec::patch::{PatchLevel, PatchStream, Removed};
    let third = 1.0 / 3.0;
    let positions = vec![[0., 0., 0.], [4., third, 0.], [0., 4., 0.1], [0., 0., 4.], [1., 1., -third], [1.1, 2., -2.7]];
    let vertices = pmesh_core::Vertices {
        attributes: pmesh_core::Attributes {
            colors: positions.iter().map(|p: &[f32; 3]| [p[0] / 5.0, 0.3, 0.7, 1.0]).collect(),
            ..Default::default()
        },
        positions,
    };
    let mesh = IndexedMesh { vertices, ..Default::default() };
    let level =
        |vertex, apex, chain: &[u32]| PatchLevel { removed: vec![Removed { vertex, apex, chain: chain.to_vec(), color: 1 }] };
    let levels = vec![level(4, 0, &[2, 1]), level(5, 4, &[0, 2, 1])];
    let base_triangles = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let stream = PatchStream { mesh: mesh.clone(), base_triangles, levels, errors: vec![], texture: None };
    for encoding in [Encoding::Vrml97, Encoding::X3dClassic, Encoding::X3dXml] {
        let mut text = Vec::new();
        write(&stream, encoding, &mut text).expect("it writes");
        let read = read(std::str::from_utf8(&text).expect("text"));
        assert_eq!((&read.error, read.warnings.len()), (&None, 0), "{encoding:?} {:?}", read.warnings);
        assert_eq!(counts(&read), [(4, 4), (5, 6), (6, 8)]);
        let again = read.receiver.mesh().finest_mesh();
        assert_eq!(again.vertices.positions, mesh.vertices.positions);
        let colors = &again.vertices.attributes.colors;
        assert_eq!(colors, &mesh.vertices.attributes.colors);
    }
}
