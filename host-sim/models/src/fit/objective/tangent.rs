//! Changes of a displacement along its motion with small changes of the force.

use springpot::{Coefficients, Discretisation, Law};

use super::super::candidate::{Candidate, Curves};
use super::super::transfer::{FAST, HEAD, Recursion};
use super::{DriveSpectra, Record};

/// Variables whose derivatives are stepped together.
pub(super) const LANES: usize = 8;

/// Changes of a displacement with small changes of the force: a law with coupling, with curves, or with a spring in series, linearised along its motion.
///
/// With g the kernel and t = T'(x) x' of a change x' of the displacement, F' = W Σ g_j (t_{k−j} − t_{k−j−1}) + m (δ/h)² x' − S x'. W is 1;
/// beside a spring it is T'(x), and S is without E'(x) + T''(x) M. In series with a spring t is without what the force stretches that by.
pub(super) struct Tangent {
    /// g_0, and m/h², N/m.
    instant: f64,
    inertia: f64,
    /// The weights of (δ/h)² of the increments, newest first.
    differences: [f64; 4],
    memory: Coefficients<f64, HEAD, FAST, 0>,
    /// T'(x), S in N/m, and W at every step.
    slopes: Vec<[f64; 3]>,
    /// The compliance of a spring in series at every step, m/N; empty without one.
    compliances: Vec<f64>,
}

impl Tangent {
    /// Along `series` (m) of `record`, where the `memory` beside a spring has this force (N).
    pub(super) fn new(
        law: &Law<f64, Recursion>,
        candidate: &Candidate,
        curves: Option<&Curves>,
        memory: Option<&[f64]>,
        record: &Record,
        series: &[f64],
    ) -> Self {
        let actuator = &candidate.actuator;
        let scale = actuator.force_per_square_volt() * actuator.stretch_coupling;
        let at = curves.map(|curves| curves.curve.evaluator());
        let elastic = curves.and_then(|curves| Some(curves.spring.as_ref()?.evaluator()));
        let slope = |(k, &x): (usize, &f64)| {
            let grows = match &record.drive {
                DriveSpectra::Voltage { squared, .. } => scale * actuator.saturated(squared[k]),
                _ => 0.0,
            };
            let [_, slope, curvature] = at.as_ref().map_or([x, 1.0, 0.0], |at| at(x));
            match (&elastic, memory) {
                (Some(elastic), Some(memory)) => [slope, grows - elastic(x)[1] - curvature * memory[k], slope],
                _ => [slope, grows, 1.0],
            }
        };
        let coefficients = law.coefficients();
        Self {
            instant: coefficients.instant,
            inertia: actuator.mass_kg / law.step_s().powi(2),
            differences: match law.method() {
                Discretisation::Bdf2 => [2.25, -3.75, 1.75, -0.25],
                _ => [1.0, -1.0, 0.0, 0.0],
            },
            memory: coefficients,
            slopes: series.iter().enumerate().map(slope).collect(),
            compliances: Vec::new(),
        }
    }

    /// The same with a spring of these slopes (N/m) in series: its share of a change leaves the memory the rest.
    pub(super) fn in_series(mut self, springs: &[f64]) -> Self {
        for (slopes, spring) in self.slopes.iter_mut().zip(springs) {
            slopes[2] = spring / (self.instant + spring);
        }
        self.compliances = springs.iter().map(|spring| 1.0 / spring).collect();
        self
    }

    /// S (N/m) at every step.
    pub(super) fn grows(&self) -> impl Iterator<Item = f64> + '_ {
        self.slopes.iter().map(|slopes| slopes[1])
    }

    /// The displacements (m) from rest under up to `LANES` series of forces (N), in their place.
    pub(super) fn moved<const LANES: usize>(&self, series: &mut [Option<Vec<f64>>]) {
        let mut forces = vec![[0.0; LANES]; self.slopes.len()];
        for (lane, series) in series.iter().enumerate() {
            forces.iter_mut().zip(series.iter().flatten()).for_each(|(force, value)| force[lane] = *value);
        }
        self.displacements(&mut forces);
        for (lane, series) in series.iter_mut().enumerate() {
            series.iter_mut().flatten().zip(&forces).for_each(|(value, moved)| *value = moved[lane]);
        }
    }

    /// The displacements (m) from rest under `forces` (N), in their place.
    fn displacements<const LANES: usize>(&self, forces: &mut [[f64; LANES]]) {
        let [newest, first, second, third] = self.differences.map(|share| share * self.inertia);
        let Coefficients { head, fast, .. } = &self.memory;
        let mut increments = [[[0.0; LANES]; HEAD]; 2];
        let mut extensions = [[0.0; LANES]; FAST];
        // Force of all that is known before a step, without the first increment of t.
        let mut known = [0.0; LANES];
        let (mut stretched, mut position) = ([0.0; LANES], [0.0; LANES]);
        let mut past = [[0.0; LANES]; 3];
        for (step, (force, [slope, grows, weight])) in forces.iter_mut().zip(&self.slopes).enumerate() {
            let instant = weight * self.instant;
            let inverse = 1.0 / (instant * slope + newest - grows);
            let x = lanes(|lane| {
                let ahead = instant * stretched[lane] + newest * position[lane];
                let inert = first * past[0][lane] + second * past[1][lane] + third * past[2][lane];
                (force[lane] - weight * known[lane] + ahead - inert) * inverse
            });
            past = [lanes(|lane| x[lane] - position[lane]), past[0], past[1]];
            let reached = match self.compliances.get(step) {
                None => lanes(|lane| slope * x[lane]),
                Some(compliance) => lanes(|lane| {
                    let force = weight * (known[lane] + self.instant * (x[lane] - stretched[lane]));
                    x[lane] - compliance * force
                }),
            };
            let increment = lanes(|lane| reached[lane] - stretched[lane]);
            stretched = reached;
            position = x;
            *force = x;
            let place = HEAD - 1 - step % HEAD;
            let oldest = increments[0][place];
            increments[0][place] = increment;
            increments[1][place] = increment;
            known = lanes(|lane| -self.instant * increment[lane]);
            for (weight, value) in head.iter().zip(&increments.as_flattened()[place..place + HEAD]) {
                known = lanes(|lane| known[lane] + weight * value[lane]);
            }
            for (extension, (loss, weight)) in extensions.iter_mut().zip(fast) {
                *extension = lanes(|lane| oldest[lane] + (1.0 - loss) * extension[lane]);
                known = lanes(|lane| known[lane] + weight * extension[lane]);
            }
        }
    }
}

/// A value for every lane, in a loop that the compiler vectorises.
#[inline(always)]
fn lanes<const LANES: usize>(of: impl Fn(usize) -> f64) -> [f64; LANES] {
    let mut values = [0.0; LANES];
    (0..LANES).for_each(|lane| values[lane] = of(lane));
    values
}
