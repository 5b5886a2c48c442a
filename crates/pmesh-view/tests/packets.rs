//! Packets of any splits of small surfaces, open or closed, with any bounds: what is written is what is read.

use pmesh_build::hierarchy::hierarchy;
use pmesh_build::simplify::{BatchOptions, collapse_batches};
use pmesh_codec::pmesh::{Quantisation, quantise};
use pmesh_core::hierarchy::{Bounds, Front, NONE, VertexHierarchy};
use pmesh_core::{IndexedMesh, Vertices};
use pmesh_view::splits::{SplitModels, read, split_of, write};
use pmesh_view::{ActiveTags, Model};
use proptest::prelude::*;

/// Numbers from a seed.
struct Random(u64);

impl Random {
    fn below(&mut self, n: u32) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) % u64::from(n.max(1))) as u32
    }
}

/// A grid of vertices that lie about where they should, with holes; a torus if it closes.
fn surface(columns: u32, rows: u32, closes: bool, r: &mut Random) -> IndexedMesh {
    let mut positions = Vec::new();
    for i in 0..columns * rows {
        let (u, v) = ((i % columns) as f32, (i / columns) as f32);
        let off = [0, 1, 2].map(|_| r.below(1000) as f32 / 2500.0);
        let at = if closes {
            let (a, b) = (u / columns as f32 * std::f32::consts::TAU, v / rows as f32 * std::f32::consts::TAU);
            let d = columns as f32 * (1.0 + 0.4 * b.cos());
            [d * a.cos(), d * a.sin(), columns as f32 * 0.4 * b.sin()]
        } else {
            [u, v, 0.0]
        };
        positions.push([at[0] + off[0], at[1] + off[1], at[2] + off[2]]);
    }
    let (wide, high) = if closes { (columns, rows) } else { (columns - 1, rows - 1) };
    let mut triangles = Vec::new();
    for i in 0..wide * high {
        let (u, v) = (i % wide, i / wide);
        let at = |du: u32, dv: u32| (v + dv) % rows * columns + (u + du) % columns;
        if r.below(40) > 0 {
            triangles.extend([[at(0, 0), at(1, 0), at(1, 1)], [at(0, 0), at(1, 1), at(0, 1)]]);
        }
    }
    IndexedMesh { vertices: Vertices { positions, ..Default::default() }, triangles, ..Default::default() }
}

/// Its hierarchy, with any bounds.
fn model(mesh: &IndexedMesh, bits: Option<u8>, r: &mut Random) -> Model {
    let grid = Quantisation::fit(&mesh.vertices, bits);
    let mesh = quantise(mesh, bits);
    let stream = collapse_batches(&mesh, BatchOptions::default(), |_| ());
    let mut hierarchy = hierarchy(&mesh, &stream).expect("a hierarchy");
    let mut bounds = |child: u32| {
        let mut byte = || r.below(256) as u8;
        let inner = Bounds { radius: byte() | 1, uniform: byte().max(1), angle: Bounds::NO_CONE, ..Default::default() };
        let directional = byte();
        let uniform = inner.uniform.max(Bounds::least_uniform(directional));
        let axis = [byte() % 21, byte() % 21].map(|a| a as i8 - 10);
        let cone = Bounds { uniform, directional, axis, angle: byte() % Bounds::NO_CONE, ..inner };
        match (child == NONE, byte() % 2) {
            (true, _) => Bounds::default(),
            (false, 0) => inner,
            _ => cone,
        }
    };
    let bounds: Vec<Bounds> = hierarchy.nodes().iter().map(|n| bounds(n.child)).collect();
    hierarchy.set_bounds(7000.0, |i| bounds[i as usize]).expect("bounds");
    Model::new(hierarchy, &mesh.triangles, grid).expect("a model")
}

/// Splits a node of a front, and first what stands in its way.
fn split(h: &VertexHierarchy, tags: &mut ActiveTags, i: u32, splits: &mut Vec<u32>) {
    loop {
        let node = &h.nodes()[i as usize];
        let active = |c: u32| if c == NONE { None } else { h.active_ancestor(c, |n| tags.contains(n)) };
        match node.cuts.map(active) {
            [Some(a), Some(b)] if a == b => split(h, tags, a, splits),
            _ => {
                splits.push(i);
                return tags.split(i, node.child);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(150) })]
    #[test]
    fn what_is_written_is_read(columns in 3u32..16, rows in 3u32..16, closes: bool, seed: u64, exact: bool) {
        let mut r = Random(seed);
        let mesh = surface(columns, rows, closes, &mut r);
        let model = model(&mesh, (!exact).then_some(12), &mut r);
        let h = model.hierarchy();
        let roots = h.root_count();
        let bounds: Vec<_> = h.nodes()[..roots as usize].iter().map(|n| n.bounds).collect();
        let positions = (0..roots).map(|i| h.position(i)).collect();
        let mut front = Front::new(positions, &bounds, h.base_triangles().to_vec(), h.unit()).expect("a front");
        front.follow_cuts();
        let mut tags = ActiveTags::new(roots);
        let (mut writing, mut reading) = (SplitModels::default(), SplitModels::default());
        loop {
            let (mut leaves, mut splits) = (Vec::new(), Vec::new());
            // Some of what can be split, and some of what comes of that.
            for _ in 0..1 + r.below(3) {
                leaves.clear();
                tags.list(0, usize::MAX, &mut leaves);
                for &i in &leaves {
                    if h.nodes()[i as usize].child != NONE && r.below(3) == 0 && tags.contains(i) {
                        split(h, &mut tags, i, &mut splits);
                    }
                }
            }
            if splits.is_empty() && leaves.iter().all(|&i| h.nodes()[i as usize].child == NONE) {
                break;
            }
            let packet = write(&mut writing, &model, &tags, &splits).expect("they can be split");
            let total = h.nodes().len() as u64;
            prop_assert_eq!(read(&mut reading, &mut front, (model.grid(), total), &packet), Ok(splits.len() as u32));
            for &i in &splits {
                let split = split_of(&model, i);
                let known = front.node(front.find(split.id).expect("a node")).expect("known");
                let children = [known.child, known.child + 1].map(|c| front.node(c).expect("known"));
                for (own, all) in known.cuts.into_iter().zip(split.cuts) {
                    prop_assert_eq!(own.is_some(), all.is_some());
                    // As far as it is known.
                    let Some((own, all)) = own.zip(all) else { continue };
                    prop_assert!(own.is_above(all));
                    prop_assert_eq!(front.find(own).and_then(|n| front.node(n)).map(|n| n.child), Some(NONE));
                }
                prop_assert_eq!(children.map(|c| c.bounds), split.bounds);
                prop_assert_eq!(children[1].position, split.position);
                prop_assert_eq!(children[0].position, known.position);
            }
            // Sometimes it forgets what is not shown: nothing here, where everything is or is on its way; and the order in which it learns is another.
            if r.below(4) == 0 {
                while front.refine(&pmesh_core::hierarchy::View::everything(), u32::MAX).expect("a hierarchy").splits > 0 {}
                front.forget_below();
                (writing, reading) = Default::default();
            }
        }
        prop_assert_eq!(front.known(), h.nodes().len());
        prop_assert_eq!(front.leaves().count() as u64, tags.len());
        while front.refine(&pmesh_core::hierarchy::View::everything(), u32::MAX).expect("a hierarchy").splits > 0 {}
        let corners = |t: [u32; 3], at: &dyn Fn(u32) -> [u32; 3]| {
            let [a, b, c] = t.map(at);
            [a, b, c].min([b, c, a]).min([c, a, b])
        };
        let row = |p: [f32; 3]| p.map(f32::to_bits);
        let shown = front.mesh().shown().iter().filter_map(|&t| front.mesh().triangle(t));
        let mut shown: Vec<_> = shown.map(|t| corners(t, &|v| row(front.positions()[v as usize]))).collect();
        let finest = quantise(&mesh, (!exact).then_some(12));
        let mut all: Vec<_> = finest.triangles.iter().map(|&t| corners(t, &|v| row(finest.vertices.positions[v as usize]))).collect();
        shown.sort_unstable();
        all.sort_unstable();
        prop_assert_eq!(shown, all);
        let name = |i: u32| h.id(i).expect("a node");
        for (i, node) in h.nodes().iter().enumerate().filter(|(_, n)| n.child != NONE) {
            let known = front.find(name(i as u32)).and_then(|k| front.node(k)).expect("known");
            prop_assert_eq!(known.cuts, node.cuts.map(|c| (c != NONE).then(|| name(c))));
        }
    }
}

#[test]
fn triangles_that_are_there_twice_are_no_trouble_and_leaves_have_no_bounds() {
    let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let triangles = [[0, 1, 2], [1, 2, 0], [0, 0, 1]];
    let bare = || VertexHierarchy::new(positions.clone(), &[], &triangles).expect("a hierarchy");
    let with = |bounds: Bounds| {
        let mut hierarchy = bare();
        hierarchy.set_bounds(1.0, |_| bounds).expect("bounds");
        Model::new(hierarchy, &triangles, Quantisation::default())
    };
    assert!(with(Bounds::default()).is_ok());
    assert!(with(Bounds { angle: Bounds::NO_CONE, ..Default::default() }).is_err());
}
