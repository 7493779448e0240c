//! Least squares within bounds: Levenberg–Marquardt with an active set.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A least-squares problem.
pub trait Problem: Sync {
    /// Data that [`jacobian`](Self::jacobian) needs from [`residuals`](Self::residuals) at the same values.
    type Evaluation: Send;

    /// Residuals at `values` of the variables; none where the problem is not defined.
    fn residuals(&self, values: &[f64]) -> Option<(Vec<f64>, Self::Evaluation)>;
    /// Derivatives of the residuals there, one column per variable.
    fn jacobian(&self, values: &[f64], evaluation: &Self::Evaluation) -> Vec<Vec<f64>>;
    /// Lower and upper bound of every variable.
    fn bounds(&self) -> &[(f64, f64)];
    /// Longest step of variable `index`.
    fn longest(&self, index: usize) -> f64 {
        let _ = index;
        MAX_STEP
    }
    /// Cost below which nothing is left to be explained.
    fn negligible(&self) -> f64 {
        0.0
    }
    /// Cost that is worth going on for: a search that does not approach it ends.
    fn worthwhile(&self) -> f64 {
        f64::INFINITY
    }
    /// Whether to stop early and keep the best so far.
    fn interrupted(&self) -> bool {
        false
    }
}

/// Result of a search.
#[derive(Clone, Debug)]
pub struct Minimum {
    /// Values of the variables.
    pub values: Vec<f64>,
    /// Half the sum of squared residuals there.
    pub cost: f64,
    /// Jᵀ J there.
    pub normal: DMatrix<f64>,
    /// Jᵀ r before the last step.
    pub gradient: DVector<f64>,
    /// Whether it converged; false if the iterations ran out.
    pub converged: bool,
}

impl Minimum {
    /// Share of the cost by which a step of Gauss and Newton over the variables `free` would decrease it, in directions whose singular values
    /// are above the share `rank` of the largest.
    pub fn left(&self, free: &[usize], rank: f64) -> f64 {
        let (scaled, lengths) = unit_diagonal(&self.normal, free);
        if self.cost <= 0.0 || free.is_empty() || !scaled.iter().all(|value| value.is_finite()) {
            return 0.0;
        }
        let gradient = DVector::from_fn(free.len(), |i, _| self.gradient[free[i]] / lengths[i]);
        let eigen = scaled.symmetric_eigen();
        let least = rank * rank * eigen.eigenvalues.max();
        let directions = eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter());
        let known = directions.filter(|(value, _)| **value > least);
        0.5 * known.map(|(value, vector)| vector.dot(&gradient).powi(2) / value).sum::<f64>() / self.cost
    }
}

/// The rows and columns `free` of Jᵀ J with unit diagonal, and the lengths that were divided out.
pub(crate) fn unit_diagonal(normal: &DMatrix<f64>, free: &[usize]) -> (DMatrix<f64>, Vec<f64>) {
    let lengths: Vec<f64> = free.iter().map(|&i| normal[(i, i)].sqrt().max(f64::MIN_POSITIVE)).collect();
    let scaled = |i: usize, j: usize| normal[(free[i], free[j])] / (lengths[i] * lengths[j]);
    (DMatrix::from_fn(free.len(), free.len(), scaled), lengths)
}

/// The inverse of the matrix whose lengths were divided out; none where it is singular.
pub(crate) fn inverse(unit_diagonal: DMatrix<f64>, lengths: &[f64]) -> Option<DMatrix<f64>> {
    let inverse = unit_diagonal.cholesky()?.inverse();
    Some(DMatrix::from_fn(lengths.len(), lengths.len(), |i, j| inverse[(i, j)] / (lengths[i] * lengths[j])))
}

/// Stopping criteria of a search.
#[derive(Clone, Copy, Debug)]
pub struct StoppingCriteria {
    /// Largest number of Jacobian evaluations.
    pub iterations: usize,
    /// Relative decrease of the cost per step below which the search has converged.
    pub decrease: f64,
}

/// Longest step of a logarithm or an order.
pub const MAX_STEP: f64 = 3.0;

/// Trials of one step, with increasing damping, before the search has converged.
const MAX_TRIALS: usize = 30;

/// Steps within which a search must be able to reach a cost that is worthwhile, if each decreases it as the last one did.
const HORIZON: i32 = 40;

/// The minimum that is reached from `start`; none if the problem has no value there.
pub fn minimise<P: Problem>(problem: &P, start: &[f64], stopping: StoppingCriteria) -> Option<Minimum> {
    let mut search = Search::new(problem, start)?;
    let n = start.len();
    let (mut normal, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
    let mut converged = n == 0;
    let mut iterations = 0;
    // Steps in a row that hardly decreased the cost.
    let mut small_steps = 0;
    let mut hopeless = false;
    while !converged && !hopeless && iterations < stopping.iterations && !problem.interrupted() {
        let jacobian = problem.jacobian(&search.values, &search.evaluation);
        iterations += 1;
        (normal, gradient) = normal_equations(&jacobian, &search.residuals);
        let free = search.free(&gradient);
        let stationary = |&i: &usize| gradient[i].abs() <= 1e-10 * (2.0 * search.cost * normal[(i, i)]).sqrt();
        if free.iter().all(stationary) {
            converged = true;
            break;
        }
        match search.step(&normal, &gradient, &free) {
            Some(decrease) => {
                small_steps = if decrease < stopping.decrease { small_steps + 1 } else { 0 };
                hopeless = search.cost * (1.0 - decrease).powi(HORIZON) > problem.worthwhile();
            }
            None => converged = true,
        }
        converged |= small_steps >= 2 || search.cost <= problem.negligible();
    }
    Some(Minimum { values: search.values, cost: search.cost, normal, gradient, converged })
}

struct Search<'a, P: Problem> {
    problem: &'a P,
    values: Vec<f64>,
    residuals: Vec<f64>,
    evaluation: P::Evaluation,
    cost: f64,
    /// Largest diagonal of Jᵀ J so far, which scales the damping.
    scale: DVector<f64>,
    damping: f64,
    /// Factor of the damping after a step that does not decrease the cost.
    growth: f64,
}

impl<'a, P: Problem> Search<'a, P> {
    fn new(problem: &'a P, start: &[f64]) -> Option<Self> {
        let bounds = problem.bounds();
        let values: Vec<f64> = start.iter().zip(bounds).map(|(x, (low, high))| x.clamp(*low, *high)).collect();
        let (residuals, evaluation) = problem.residuals(&values)?;
        let cost = half_square(&residuals);
        let scale = DVector::zeros(start.len());
        Some(Self { problem, values, residuals, evaluation, cost, scale, damping: 1e-3, growth: 2.0 })
    }

    /// Variables that the gradient does not push out of their bounds.
    fn free(&self, gradient: &DVector<f64>) -> Vec<usize> {
        let pushed_out = |i: usize| {
            let (low, high) = self.problem.bounds()[i];
            self.values[i] <= low && gradient[i] > 0.0 || self.values[i] >= high && gradient[i] < 0.0
        };
        (0..self.values.len()).filter(|&i| !pushed_out(i)).collect()
    }

    /// Takes a step, with more damping until the cost decreases: the relative decrease, or none if no step decreases it.
    fn step(&mut self, normal: &DMatrix<f64>, gradient: &DVector<f64>, free: &[usize]) -> Option<f64> {
        for i in 0..self.values.len() {
            self.scale[i] = f64::max(self.scale[i], normal[(i, i)]).max(f64::MIN_POSITIVE);
        }
        let bounds = self.problem.bounds();
        let limits: Vec<(f64, f64)> = (0..self.values.len())
            .map(|i| {
                let longest = self.problem.longest(i);
                ((bounds[i].0 - self.values[i]).max(-longest), (bounds[i].1 - self.values[i]).min(longest))
            })
            .collect();
        for _ in 0..MAX_TRIALS {
            if let Some(step) = bounded_step(normal, gradient, &self.scale, self.damping, free, &limits) {
                let predicted = -(gradient.dot(&step) + 0.5 * step.dot(&(normal * &step)));
                if let Some(decrease) = self.try_step(&step, predicted) {
                    return Some(decrease);
                }
            }
            self.damping *= self.growth;
            self.growth *= 2.0;
        }
        None
    }

    /// Takes `step` if it decreases the cost; `predicted` is the decrease of the quadratic model.
    fn try_step(&mut self, step: &DVector<f64>, predicted: f64) -> Option<f64> {
        let bounds = self.problem.bounds();
        let trial: Vec<f64> =
            (0..self.values.len()).map(|i| (self.values[i] + step[i]).clamp(bounds[i].0, bounds[i].1)).collect();
        let (residuals, evaluation) = self.problem.residuals(&trial)?;
        let cost = half_square(&residuals);
        if !(cost.is_finite() && cost < self.cost) {
            return None;
        }
        let ratio = (self.cost - cost) / predicted.max(f64::MIN_POSITIVE);
        let decrease = (self.cost - cost) / self.cost;
        (self.values, self.residuals, self.evaluation, self.cost) = (trial, residuals, evaluation, cost);
        // Nielsen's rule.
        self.damping = (self.damping * f64::max(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0).powi(3))).max(1e-15);
        self.growth = 2.0;
        Some(decrease)
    }
}

/// Half the sum of squares.
pub fn half_square(residuals: &[f64]) -> f64 {
    0.5 * dot(residuals, residuals)
}

/// Jᵀ J and Jᵀ r.
fn normal_equations(jacobian: &[Vec<f64>], residuals: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
    let n = jacobian.len();
    let rows: Vec<Vec<f64>> =
        (0..n).into_par_iter().map(|i| (0..=i).map(|j| dot(&jacobian[i], &jacobian[j])).collect()).collect();
    let normal = DMatrix::from_fn(n, n, |i, j| if i >= j { rows[i][j] } else { rows[j][i] });
    let gradient = DVector::from_iterator(n, jacobian.iter().map(|column| dot(column, residuals)));
    (normal, gradient)
}

/// The step that minimises the damped quadratic model over the free variables within `limits`: variables that would leave
/// them are set to their limit, and the others are solved again.
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
        // The step of variables on their limits changes the gradient of the others.
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

/// The scalar product, in lanes that the compiler vectorises.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
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
