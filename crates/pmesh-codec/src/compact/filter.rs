//! Linear predictors that learn from every vertex: recursive least squares.

/// What the diagonal of the covariance may be at most: without it, directions that are never met grow without bound.
const DIAGONAL_LIMIT: f64 = 3.0;
/// Memory: about so many samples.
const FORGETTING: f64 = 1.0 - 1.0 / 950.0;

/// Weights of `N` features and how sure they are.
#[derive(Clone, Debug)]
pub(super) struct Filter<const N: usize> {
    weights: [f64; N],
    covariance: [[f64; N]; N],
    noise: f64,
}

impl<const N: usize> Filter<N> {
    pub(super) fn new(weights: [f64; N], noise: f64) -> Self {
        let mut covariance = [[0.0; N]; N];
        (0..N).for_each(|i| covariance[i][i] = DIAGONAL_LIMIT);
        Self { weights, covariance, noise }
    }
    /// The prediction for features `x`.
    pub(super) fn predict(&self, x: &[f64; N]) -> f64 {
        self.weights.iter().zip(x).map(|(w, x)| w * x).sum()
    }
    /// Learns that the value at `x` was `error` more than predicted; `noise` times as much variance as usual was to be expected.
    pub(super) fn learn(&mut self, x: &[f64; N], error: f64, noise: f64) {
        let p = &mut self.covariance;
        let mut px = [0.0; N];
        for i in 0..N {
            px[i] = (0..N).map(|j| p[i][j] * x[j]).sum();
        }
        let total = self.noise * noise + px.iter().zip(x).map(|(a, b)| a * b).sum::<f64>();
        for i in 0..N {
            let gain = px[i] / total;
            self.weights[i] += gain * error;
            for j in 0..=i {
                p[i][j] = (p[i][j] - gain * px[j]) * (1.0 / FORGETTING);
                p[j][i] = p[i][j];
            }
        }
        for i in 0..N {
            if p[i][i] > DIAGONAL_LIMIT {
                let s = (DIAGONAL_LIMIT / p[i][i]).sqrt();
                for j in 0..N {
                    p[i][j] *= s;
                    p[j][i] *= s;
                }
            }
        }
    }
    /// Another level: what held may hold a little less.
    pub(super) fn loosen(&mut self) {
        (0..N).for_each(|i| self.covariance[i][i] += 0.003);
    }
}
