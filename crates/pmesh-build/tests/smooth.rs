//! Conformance items of smooth levels of detail (SS97): G.12, G.13, G.14, named after them.

use pmesh_build::compare::difference;
use pmesh_build::import::Model;
use pmesh_build::pipeline::{BuildOptions, Method, Steps, build};
use pmesh_build::sample::sample;
use pmesh_codec::slod::{SlodReport, encode};
use pmesh_codec::{Arrival, Receiver};
use pmesh_core::stepped::{ClusterSizes, SteppedLevel};
use pmesh_core::{IndexedMesh, ProgressiveMultilevelMesh, Vertices};
use proptest::prelude::*;

fn smooth(mesh: &IndexedMesh) -> ProgressiveMultilevelMesh {
    let options = BuildOptions { method: Method::Closest, steps: Steps::Single, ..Default::default() };
    let model = Model { mesh: mesh.clone(), ..Default::default() };
    let stream = build(&model, &options, |_| ()).expect("it builds");
    let mut out = ProgressiveMultilevelMesh::new(stream.attribute_set);
    stream.levels.iter().for_each(|l| drop(out.add_level(l).expect("it fits")));
    out
}

fn written(mesh: &ProgressiveMultilevelMesh) -> (Vec<u8>, SlodReport) {
    let mut bytes = Vec::new();
    let report = encode(mesh, &mut bytes).expect("it encodes");
    (bytes, report)
}

fn received(bytes: &[u8]) -> ProgressiveMultilevelMesh {
    let mut receiver = Receiver::default();
    receiver.push(bytes).and_then(|()| receiver.finish()).expect("it decodes");
    receiver.into_mesh()
}

/// Any triangles at all: duplicates, edges of many triangles, isolated and coincident vertices, two corners in one.
fn soup() -> impl Strategy<Value = IndexedMesh> {
    let position = (0i8..5, 0i8..5, 0i8..3).prop_map(|(x, y, z)| [f32::from(x), f32::from(y) * 0.3, f32::from(z)]);
    prop::collection::vec(position, 1..40).prop_flat_map(|positions| {
        let n = positions.len() as u32;
        let triangle = (0..n, 0..n, 0..n).prop_map(|(a, b, c)| [a, b, c]);
        prop::collection::vec(triangle, 0..80).prop_map(move |mut triangles| {
            triangles.retain(|[a, b, c]| !(a == b && b == c));
            IndexedMesh {
                vertices: Vertices { positions: positions.clone(), ..Default::default() },
                triangles,
                ..Default::default()
            }
        })
    })
}

proptest! {
    #[test]
    fn g12_the_packets_of_any_soup_give_every_triangle_once(mesh in soup()) {
        let (bytes, report) = written(&smooth(&mesh));
        prop_assert_eq!(difference(&received(&bytes).finest_mesh(), &mesh), None);
        let bits = u64::from(report.vertices) * 113 + report.update_bits + u64::from(report.triangles) * 18;
        prop_assert_eq!(report.field_bits, 16);
        prop_assert_eq!((report.vertices as usize, report.triangles as usize), (mesh.vertices.len(), mesh.triangles.len()));
        prop_assert_eq!(bytes.len() as u64, 38 + bits.div_ceil(8));
    }

    #[test]
    fn g13_finer_and_coarser_return_to_the_same_lists(mesh in soup(), walk in prop::collection::vec(0.0..1.0f64, 1..12)) {
        let mesh = received(&written(&smooth(&mesh)).0);
        let mut stepped = SteppedLevel::default();
        for x in walk {
            let level = (x * f64::from(mesh.level_count())) as u32;
            stepped.set_level(&mesh, level).expect("it has arrived");
            let shown = stepped.triangles().iter().copied().filter(|[a, b, c]| a != b && b != c && c != a);
            prop_assert_eq!(shown.collect::<Vec<_>>(), mesh.triangles_at(level).expect("it has arrived"));
        }
    }

    #[test]
    fn g14_a_lower_threshold_never_takes_vertices_away(mesh in soup(), thresholds in prop::collection::vec(0.0..6.0f32, 2..8)) {
        let mesh = received(&written(&smooth(&mesh)).0);
        let mut sizes = ClusterSizes::default();
        sizes.grow(&mesh);
        let mut thresholds = thresholds;
        thresholds.sort_by(f32::total_cmp);
        let counts: Vec<_> = thresholds.iter().map(|&t| sizes.vertices_for(t)).collect();
        prop_assert!(counts.windows(2).all(|w| w[0] >= w[1]));
        // By definition: the shortest prefix after which no split is larger.
        let p = &mesh.vertices().positions;
        let size = |v: usize| {
            let r = p[mesh.representatives()[v] as usize];
            (0..3).map(|k| (f64::from(p[v][k]) - f64::from(r[k])).powi(2)).sum::<f64>().sqrt() as f32
        };
        for (&t, &count) in thresholds.iter().zip(&counts) {
            let expected = (1..p.len()).rev().find(|&v| size(v) > t).map_or(1, |v| v as u32 + 1);
            prop_assert_eq!(count, expected);
        }
    }
}

#[test]
fn g13_every_packet_boundary_is_a_valid_model() {
    let mesh = sample("tetrahedra").expect("it is built in").mesh;
    let (bytes, _) = written(&smooth(&mesh));
    let whole = received(&bytes);
    let mut receiver = Receiver::default();
    let mut levels = 0;
    for byte in &bytes {
        receiver.push(&[*byte]).expect("it decodes");
        while let Some(arrival) = receiver.poll() {
            levels += u32::from(matches!(arrival, Arrival::Level { .. }));
        }
        receiver.mesh().check_invariants();
        if levels > 0 {
            let level = whole.level_count() - levels;
            assert_eq!(receiver.mesh().triangles_at(level), whole.triangles_at(level));
        }
    }
    assert_eq!(levels as usize, mesh.vertices.len());
}

#[test]
fn a_model_of_more_than_32768_vertices_takes_wide_fields_and_any_stream_becomes_smooth() {
    let options = BuildOptions { steps: Steps::Count(5), ..Default::default() };
    let model = sample("globe").expect("it is built in");
    let stream = build(&model, &options, |_| ()).expect("it builds");
    let mut mesh = ProgressiveMultilevelMesh::new(stream.attribute_set);
    stream.levels.iter().for_each(|l| drop(mesh.add_level(l).expect("it fits")));
    let (bytes, report) = written(&mesh);
    assert!(report.vertices > 32_768 && report.field_bits == 32);
    let mut positions = mesh.finest_mesh();
    positions.vertices.attributes = Default::default();
    positions.position_of.clear();
    assert_eq!(difference(&received(&bytes).finest_mesh(), &positions), None);
}

/// B.17: near the eye fine, elsewhere coarse; where everything is wanted the whole mesh, where nothing is, nothing.
#[test]
fn variable_resolution_is_fine_only_where_it_is_wanted() {
    let mesh = smooth(&sample("knot").expect("it is built in").mesh);
    let all = mesh.triangles_where(|_| true).len();
    assert_eq!((all, mesh.triangles_where(|_| false).len()), (mesh.triangle_count(0).expect("a level") as usize, 0));
    let p = &mesh.vertices().positions;
    let parents = mesh.representatives();
    let size = |v: u32| {
        let (a, b) = (p[v as usize], p[parents[v as usize] as usize]);
        (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f32>().sqrt()
    };
    let eye = p[0];
    let projected = |v: u32| {
        let distance = (0..3).map(|k| (p[v as usize][k] - eye[k]).powi(2)).sum::<f32>().sqrt();
        size(v) / distance.max(1e-3)
    };
    let some = mesh.triangles_where(|v| projected(v) > 0.05);
    assert!(some.len() > 50 && some.len() < all / 2, "{} of {all}", some.len());
    let length = |t: &[u32; 3]| (0..3).map(|k| (p[t[0] as usize][k] - p[t[1] as usize][k]).powi(2)).sum::<f32>().sqrt();
    let near = |t: &&[u32; 3]| (0..3).map(|k| (p[t[0] as usize][k] - eye[k]).powi(2)).sum::<f32>().sqrt() < 0.3;
    let mean = |t: &[&[u32; 3]]| t.iter().map(|t| length(t)).sum::<f32>() / t.len() as f32;
    let (close, far): (Vec<_>, Vec<_>) = some.iter().partition(near);
    assert!(!close.is_empty() && mean(&close) * 1.5 < mean(&far), "{} against {}", mean(&close), mean(&far));
}
