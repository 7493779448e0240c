//! Least squares within bounds: Levenberg–Marquardt with an active set.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A least-squares problem.
pub trait Problem: Sync {
    /// What [`jacobian`](Self::jacobian) needs from [`residuals`](Self::residuals) at the same place.
    type Evaluation: Send;

    /// Residuals at `place`, or nothing where the problem has none.
    fn residuals(&self, place: &[f64]) -> Option<(Vec<f64>, Self::Evaluation)>;
    /// Derivatives of the residuals there, one column per variable.
    fn jacobian(&self, place: &[f64], evaluation: &Self::Evaluation) -> Vec<Vec<f64>>;
    /// Lower and upper bound of every variable.
    fn bounds(&self) -> &[(f64, f64)];
    /// How far variable `index` may move in one step.
    fn longest(&self, index: usize) -> f64 {
        let _ = index;
        LONGEST
    }
    /// Whether to stop early and keep the best so far.
    fn interrupted(&self) -> bool {
        false
    }
}

/// Where a search ended.
#[derive(Clone, Debug)]
pub struct Minimum {
    /// The best place.
    pub place: Vec<f64>,
    /// Half the sum of squared residuals there.
    pub cost: f64,
    /// Jᵀ J there.
    pub normal: DMatrix<f64>,
    /// Residual evaluations.
    pub evaluations: usize,
    /// Jacobian evaluations.
    pub iterations: usize,
    /// Whether nothing was left to gain, as opposed to the iterations running out.
    pub converged: bool,
}

/// When a search ends.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Jacobian evaluations at the most.
    pub iterations: usize,
    /// Relative decrease of the cost below which nothing is left to gain.
    pub decrease: f64,
}

/// Logarithms and orders move no further in one step.
pub const LONGEST: f64 = 3.0;

/// The minimum that is reached from `start`, or nothing if the problem has no value there.
pub fn minimise<P: Problem>(problem: &P, start: &[f64], limits: Limits) -> Option<Minimum> {
    let bounds = problem.bounds();
    let n = start.len();
    let mut place: Vec<f64> = start.iter().zip(bounds).map(|(x, (low, high))| x.clamp(*low, *high)).collect();
    let (mut residuals, mut evaluation) = problem.residuals(&place)?;
    let mut cost = half_square(&residuals);
    let mut best = Minimum {
        place: place.clone(),
        cost,
        normal: DMatrix::zeros(n, n),
        evaluations: 1,
        iterations: 0,
        converged: false,
    };
    let mut scale = DVector::<f64>::zeros(n);
    let (mut damping, mut growth) = (1e-3, 2.0);
    let mut small = 0;
    best.converged = n == 0;
    while n > 0 && best.iterations < limits.iterations && !problem.interrupted() {
        let jacobian = problem.jacobian(&place, &evaluation);
        best.iterations += 1;
        let (normal, gradient) = normal_equations(&jacobian, &residuals);
        best.normal.copy_from(&normal);
        for i in 0..n {
            scale[i] = f64::max(scale[i], normal[(i, i)]).max(f64::MIN_POSITIVE);
        }
        let free: Vec<usize> = (0..n)
            .filter(|&i| {
                !(place[i] <= bounds[i].0 && gradient[i] > 0.0 || place[i] >= bounds[i].1 && gradient[i] < 0.0)
            })
            .collect();
        if free.iter().all(|&i| gradient[i].abs() <= 1e-10 * (2.0 * cost * normal[(i, i)]).sqrt()) {
            best.converged = true;
            break;
        }
        // Shorten the step until it gains.
        let mut accepted = false;
        for _ in 0..30 {
            let reach: Vec<(f64, f64)> = (0..n)
                .map(|i| {
                    let longest = problem.longest(i);
                    ((bounds[i].0 - place[i]).max(-longest), (bounds[i].1 - place[i]).min(longest))
                })
                .collect();
            let Some(moved) = bounded_step(&normal, &gradient, &scale, damping, &free, &reach) else {
                damping *= growth;
                growth *= 2.0;
                continue;
            };
            let trial: Vec<f64> = (0..n).map(|i| (place[i] + moved[i]).clamp(bounds[i].0, bounds[i].1)).collect();
            let predicted = -(gradient.dot(&moved) + 0.5 * moved.dot(&(&normal * &moved)));
            best.evaluations += 1;
            let gain = problem.residuals(&trial).and_then(|(new_residuals, new_evaluation)| {
                let new_cost = half_square(&new_residuals);
                (new_cost.is_finite() && new_cost < cost).then_some((new_residuals, new_evaluation, new_cost))
            });
            if let Some((new_residuals, new_evaluation, new_cost)) = gain {
                let ratio = (cost - new_cost) / predicted.max(f64::MIN_POSITIVE);
                let decrease = (cost - new_cost) / cost;
                (place, residuals, evaluation, cost) = (trial, new_residuals, new_evaluation, new_cost);
                // Nielsen's rule.
                damping = (damping * f64::max(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0).powi(3))).max(1e-15);
                growth = 2.0;
                accepted = true;
                small = if decrease < limits.decrease { small + 1 } else { 0 };
                break;
            }
            damping *= growth;
            growth *= 2.0;
        }
        best.place.clone_from(&place);
        best.cost = cost;
        if !accepted || small >= 2 || cost == 0.0 {
            best.converged = true;
            break;
        }
    }
    Some(best)
}

/// Half the sum of squares.
pub fn half_square(residuals: &[f64]) -> f64 {
    0.5 * dot(residuals, residuals)
}

/// Jᵀ J and Jᵀ r.
pub fn normal_equations(jacobian: &[Vec<f64>], residuals: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
    let n = jacobian.len();
    let rows: Vec<Vec<f64>> =
        (0..n).into_par_iter().map(|i| (0..=i).map(|j| dot(&jacobian[i], &jacobian[j])).collect()).collect();
    let normal = DMatrix::from_fn(n, n, |i, j| if i >= j { rows[i][j] } else { rows[j][i] });
    let gradient = DVector::from_iterator(n, jacobian.iter().map(|column| dot(column, residuals)));
    (normal, gradient)
}

/// The step that minimises the damped quadratic model over the free variables within `limits`: variables that would
/// leave are put on their limit, and the others solved again.
fn bounded_step(
    normal: &DMatrix<f64>,
    gradient: &DVector<f64>,
    scale: &DVector<f64>,
    damping: f64,
    free: &[usize],
    limits: &[(f64, f64)],
) -> Option<DVector<f64>> {
    let mut free = free.to_vec();
    let mut step = DVector::zeros(normal.nrows());
    while !free.is_empty() {
        let matrix = DMatrix::from_fn(free.len(), free.len(), |i, j| {
            let (a, b) = (free[i], free[j]);
            normal[(a, b)] + if i == j { damping * scale[a] } else { 0.0 }
        });
        // Variables on their limits push the others.
        let pushed = normal * &step;
        let right = DVector::from_fn(free.len(), |i, _| -gradient[free[i]] - pushed[free[i]]);
        let solution = matrix.cholesky()?.solve(&right);
        if !solution.iter().all(|value| value.is_finite()) {
            return None;
        }
        let leaves = |i: usize, value: f64| value < limits[i].0 || value > limits[i].1;
        let leaving = free.iter().zip(&solution).filter(|&(&i, &value)| leaves(i, value)).count();
        for (&i, &value) in free.iter().zip(&solution) {
            if leaving == 0 || leaves(i, value) {
                step[i] = value.clamp(limits[i].0, limits[i].1);
            }
        }
        if leaving == 0 {
            break;
        }
        free = free.iter().zip(&solution).filter(|&(&i, &value)| !leaves(i, value)).map(|(&i, _)| i).collect();
    }
    Some(step)
}

/// The scalar product, in lanes that the processor adds side by side.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 8;
    let mut sums = [0.0; LANES];
    let (a_lanes, a_rest) = a.as_chunks::<LANES>();
    let (b_lanes, b_rest) = b.as_chunks::<LANES>();
    for (x, y) in a_lanes.iter().zip(b_lanes) {
        for lane in 0..LANES {
            sums[lane] += x[lane] * y[lane];
        }
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum::<f64>()
}
