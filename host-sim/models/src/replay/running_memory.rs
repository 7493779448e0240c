//! Full memory step by step, for films whose answer is implicit in every step.

use host_fft::Planner;

/// Steps whose increments are summed one by one.
const BLOCK: usize = 64;

/// The force of a memory that takes its increments one after the other and forgets none.
///
/// With g_j the force that is left j steps after a unit step, the force after increment Δy_k is Σ_{j=0..k} g_j Δy_{k−j}. The sum over the past
/// is taken in blocks that double: a block of L increments that is complete adds its part to the next L sums, by a Fourier transform.
pub struct RunningMemory {
    /// g, N/m.
    relaxation: Vec<f64>,
    /// m.
    increments: Vec<f64>,
    /// Force that complete blocks leave in the steps to come, N.
    past_n: Vec<f64>,
    planner: Planner,
}

impl RunningMemory {
    /// The memory of `relaxation` (g, N/m) at rest, for as many steps as that has values.
    pub fn new(relaxation: Vec<f64>) -> Self {
        let steps = relaxation.len();
        let (increments, past_n) = (Vec::with_capacity(steps), vec![0.0; steps]);
        Self { relaxation, increments, past_n, planner: Planner::new() }
    }

    /// g_0, N/m.
    pub fn instant(&self) -> f64 {
        self.relaxation[0]
    }

    /// The force (N) that earlier increments leave in the coming step; none after the last one.
    pub fn past_n(&self) -> Option<f64> {
        let now = self.increments.len();
        let complete = *self.past_n.get(now)?;
        let block = &self.increments[now - now % BLOCK..];
        let near: f64 = block.iter().rev().zip(&self.relaxation[1..]).map(|(dy, g)| dy * g).sum();
        Some(near + complete)
    }

    /// Takes the `increment` (m) of this step.
    pub fn push(&mut self, increment: f64) {
        self.increments.push(increment);
        let complete = self.increments.len();
        if complete.is_multiple_of(BLOCK) {
            self.pass_on(1 << complete.trailing_zeros());
        }
    }

    /// Adds what the last `length` increments leave in as many steps to come.
    fn pass_on(&mut self, length: usize) {
        let now = self.increments.len();
        let ahead = length.min(self.past_n.len().saturating_sub(now));
        if ahead == 0 {
            return;
        }
        let points = 2 * length;
        let (forward, backward) = (self.planner.forward(points), self.planner.backward(points));
        let spectrum = |values: &[f64]| host_fft::spectrum(&*forward, values.iter().copied());
        let mut product = spectrum(&self.increments[now - length..]);
        product.iter_mut().zip(spectrum(&self.relaxation)).for_each(|(value, kernel)| *value *= kernel);
        let time = host_fft::samples(&*backward, product);
        // What wraps around lands in the first half, which belongs to the block itself.
        for (sum, value) in self.past_n[now..now + ahead].iter_mut().zip(&time[length..]) {
            *sum += value / points as f64;
        }
    }
}
