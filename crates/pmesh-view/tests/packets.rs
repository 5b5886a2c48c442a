//! Packets of any forest, manifold or not: what is written is what is read.

use pmesh_codec::pmesh::Quantisation;
use pmesh_core::Vertices;
use pmesh_core::hierarchy::{Bounds, Front, NONE, VertexHierarchy};
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

/// Collapses of vertices that lie anywhere, onto any other, cut anywhere else.
fn model(n: u32, bits: Option<u8>, r: &mut Random) -> Model {
    let positions: Vec<[f32; 3]> = (0..n).map(|_| [0, 1, 2].map(|_| r.below(4096) as f32)).collect();
    let mut alive: Vec<u32> = (0..n).collect();
    let mut collapses = Vec::new();
    while alive.len() > 3 && r.below(40) > 0 {
        let blue = alive.swap_remove(r.below(alive.len() as u32) as usize);
        let red = alive[r.below(alive.len() as u32) as usize];
        let others: Vec<u32> = alive.iter().copied().filter(|&v| v != red).collect();
        let first = r.below(others.len() as u32) as usize;
        let second = (first + 1 + r.below(others.len() as u32 - 1) as usize) % others.len();
        let cuts = match r.below(4) {
            0 => [NONE, others[second]],
            1 => [others[first], NONE],
            _ => [others[first], others[second]],
        };
        collapses.push((blue, red, cuts));
    }
    let mut hierarchy = VertexHierarchy::new(positions.clone(), &collapses, &[]).expect("a hierarchy");
    let bounds: Vec<Bounds> = hierarchy
        .nodes()
        .iter()
        .map(|node| {
            let mut byte = || r.below(256) as u8;
            let inner = Bounds { radius: byte() | 1, uniform: byte().max(1), sine: Bounds::NO_CONE, ..Default::default() };
            let cone =
                Bounds { directional: byte(), axis: [byte() as i8, byte() as i8], sine: byte() % Bounds::NO_CONE, ..inner };
            match (node.child == NONE, byte() % 2) {
                (true, _) => Bounds::default(),
                (false, 0) => inner,
                _ => cone,
            }
        })
        .collect();
    hierarchy.set_bounds(7000.0, |i| bounds[i as usize]).expect("bounds");
    let vertices = Vertices { positions, ..Default::default() };
    let mut grid = Quantisation::fit(&vertices, bits);
    // Whole numbers are on it.
    (grid.position_origin, grid.position_step) = ([0.0; 3], 1.0);
    Model::new(hierarchy, grid).expect("a model")
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]
    #[test]
    fn what_is_written_is_read(n in 4u32..150, seed: u64, exact: bool) {
        let mut r = Random(seed);
        let model = model(n, (!exact).then_some(12), &mut r);
        let h = model.hierarchy();
        let roots = h.root_count();
        let bounds: Vec<_> = h.nodes()[..roots as usize].iter().map(|n| n.bounds).collect();
        let mut front = Front::new((0..roots).map(|i| h.position(i)).collect(), &bounds, Vec::new(), h.unit()).expect("a front");
        let mut tags = ActiveTags::new(roots);
        let (mut writing, mut reading) = (SplitModels::default(), SplitModels::default());
        loop {
            let (mut leaves, mut splits) = (Vec::new(), Vec::new());
            // Some of what can be split, and some of what comes of that.
            for _ in 0..1 + r.below(3) {
                leaves.clear();
                tags.list(0, usize::MAX, &mut leaves);
                for &i in &leaves {
                    let child = h.nodes()[i as usize].child;
                    if child != NONE && r.below(3) == 0 {
                        tags.split(i, child);
                        splits.push(i);
                    }
                }
            }
            if splits.is_empty() && leaves.iter().all(|&i| h.nodes()[i as usize].child == NONE) {
                break;
            }
            let packet = write(&mut writing, &model, &tags, &splits);
            let total = h.nodes().len() as u64;
            prop_assert_eq!(read(&mut reading, &mut front, (model.grid(), total), &packet), Ok(splits.len() as u32));
            for &i in &splits {
                let split = split_of(&model, i);
                let known = front.node(front.find(split.id).expect("a node")).expect("known");
                let children = [known.child, known.child + 1].map(|c| front.node(c).expect("known"));
                prop_assert_eq!(known.cuts, split.cuts);
                prop_assert_eq!(children.map(|c| c.bounds), split.bounds);
                prop_assert_eq!(children[1].position, split.position);
                prop_assert_eq!(children[0].position, known.position);
            }
        }
        prop_assert_eq!(front.known(), h.nodes().len());
        prop_assert_eq!(front.leaves().count() as u64, tags.len());
        prop_assert_eq!(writing.spent.cuts > 0.0, front.known() > roots as usize);
    }
}
