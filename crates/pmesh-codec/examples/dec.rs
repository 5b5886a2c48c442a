#![allow(missing_docs)]
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let n: usize = a[2].parse().unwrap();
    let bytes = std::fs::read(&a[1]).unwrap();
    let mut best = f64::MAX;
    let mut count = 0;
    for _ in 0..n {
        let t = std::time::Instant::now();
        let mut d = pmesh_codec::compact::decoder();
        use pmesh_codec::Decoder;
        d.push(&bytes).unwrap();
        count = 0;
        while d.work().unwrap() { while let Some(e) = d.poll() { if let pmesh_codec::Event::Part(p) = e { count += p.vertices.len(); } } }
        best = best.min(t.elapsed().as_secs_f64());
    }
    println!("{count} {:.3} us/vertex", best * 1e6 / count as f64);
}
