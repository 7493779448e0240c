//! Fits to a part of the recordings, and their errors on the rest.

use std::ops::Range;
use std::sync::atomic::Ordering;

use rayon::prelude::*;

use super::candidate::Candidate;
use super::descent::{Context, Found};
use super::objective::{Evaluation, Objective};
use super::observation::Observation;
use super::residuals::Loss;
use crate::error::Result;
use crate::least_squares::StoppingCriteria;
use crate::statistics::{mean, noise, range, robust_deviation};

/// Blocks of time of a recording, of which every second one is left out at a time.
const BLOCKS: usize = 8;
/// Shares of the way from the fit to everything to the fit without a part, on which a film with a response to that part is looked for.
const WAY_BACK: [f64; 5] = [1.0, 0.5, 0.25, 0.1, 0.0];

/// Fits to a part of the recordings, and their errors on the rest: without each recording, if there are several, and without every second
/// block of time.
pub struct LeftOut<'a> {
    whole: &'a Objective,
    blocks: Vec<Block>,
    folds: Vec<Fold>,
}

/// A block of time of a recording.
#[derive(Clone)]
struct Block {
    recording: usize,
    /// Its values in the recording.
    values: Range<usize>,
    /// Square of the recording's range.
    square: f64,
    /// Number among the recording's blocks.
    index: usize,
}

/// The blocks that are left out at a time.
struct Fold {
    what: String,
    others: Objective,
    blocks: Vec<Block>,
}

impl<'a> LeftOut<'a> {
    /// The folds of `observations`, whose objective is `whole`, with an objective of the same kind for each part.
    pub fn new(
        observations: &[Observation],
        whole: &'a Objective,
        objective: impl Fn(&[Observation]) -> Result<Objective>,
    ) -> Result<Self> {
        let several = observations.len() > 1;
        let mut blocks = Vec::new();
        for (recording, observation) in observations.iter().enumerate() {
            let count = observation.measured.value.len();
            let (low, high) = range(&observation.measured.value);
            let square = (high - low).powi(2).max(f64::MIN_POSITIVE) * observation.weight.powi(2);
            let cuts = (0..BLOCKS).map(|k| (k, k * count / BLOCKS..(k + 1) * count / BLOCKS));
            let cuts = cuts.filter(|(_, values)| !values.is_empty());
            blocks.extend(cuts.map(|(index, values)| Block { recording, values, square, index }));
        }
        let part = |what: String, others: Vec<Observation>, of: &dyn Fn(&Block) -> bool| {
            let blocks = blocks.iter().filter(|block| of(block)).cloned().collect();
            objective(&others).map(|others| Fold { what, others, blocks })
        };
        let mut folds = Vec::new();
        for out in (0..observations.len()).filter(|_| several) {
            let mut others = observations.to_vec();
            let one = others.remove(out);
            folds.push(part(one.name, others, &|block| block.recording == out)?);
        }
        for parity in 0..2 {
            let is_out = |block: &Block| block.index % 2 == parity;
            let mut others = observations.to_vec();
            for block in blocks.iter().filter(|block| is_out(block)) {
                let observation = &mut others[block.recording];
                if observation.sample_weights.is_empty() {
                    observation.sample_weights = vec![1.0; observation.measured.value.len()];
                }
                observation.sample_weights[block.values.clone()].fill(0.0);
            }
            let weighs = |o: &Observation| o.sample_weights.iter().any(|weight| *weight > 0.0);
            // Weights of the user may leave nothing of half of the time.
            if others.iter().all(weighs) {
                folds.push(part("every second block of time".into(), others, &is_out)?);
            }
        }
        Ok(Self { whole, blocks, folds })
    }

    /// Relative mean squares of the structure that was `found` in every block that is left out, fold by fold, and the fits to the parts; or the
    /// reason why they are missing.
    pub fn refitted(
        &self,
        context: &Context<'_>,
        found: &Found,
    ) -> std::result::Result<(Vec<f64>, Vec<Candidate>), String> {
        let folds = self.folds.par_iter().map(|fold| fold.refitted(self.whole, context, found));
        let fits: Vec<(Vec<f64>, Candidate)> = folds.collect::<std::result::Result<_, _>>()?;
        if context.stop.load(Ordering::Relaxed) {
            return Err("the search was interrupted".into());
        }
        let (errors, fits): (Vec<Vec<f64>>, Vec<Candidate>) = fits.into_iter().unzip();
        Ok((errors.concat(), fits))
    }

    /// The number of recordings that are left out: 0 of a single one.
    fn recordings(&self) -> usize {
        self.blocks.iter().map(|block| block.recording + 1).max().filter(|count| *count > 1).unwrap_or(0)
    }

    /// Mean NRMSE (%) of recordings that are left out, if there are several, from the errors of [`refitted`](Self::refitted).
    pub fn nrmse_pct(&self, errors: &[f64]) -> Option<f64> {
        let count = Some(self.recordings()).filter(|count| *count > 0)?;
        let (mut from, mut sum) = (0, 0.0);
        for fold in &self.folds[..count] {
            let values = |block: &Block| block.values.len() as f64;
            let squares = fold.blocks.iter().zip(&errors[from..]).map(|(block, square)| values(block) * square);
            sum += (squares.sum::<f64>() / fold.blocks.iter().map(values).sum::<f64>()).sqrt();
            from += fold.blocks.len();
        }
        Some(100.0 * sum / count as f64)
    }

    /// NRMSE (%) of the blocks of time that are left out, from these errors.
    pub(super) fn blocks_nrmse_pct(&self, errors: &[f64]) -> Option<f64> {
        let before: usize = self.folds[..self.recordings()].iter().map(|fold| fold.blocks.len()).sum();
        let squares = &errors[before..];
        (!squares.is_empty()).then(|| 100.0 * mean(squares).sqrt())
    }

    /// Mean squares of the noise in the residuals of `evaluation`, relative to the ranges, in every block and in those that are left out, fold by
    /// fold.
    pub(super) fn noise(&self, evaluation: &Evaluation) -> [Vec<f64>; 2] {
        let residuals = self.whole.residuals(evaluation);
        let mut rest = residuals.as_slice();
        let of = |values| rest.split_off(..values).map_or(0.0, |these| noise(these).powi(2));
        let recordings: Vec<f64> = self.whole.values().map(of).collect();
        let relative = |block: &Block| recordings[block.recording] / block.square;
        let left_out = self.folds.iter().flat_map(|fold| &fold.blocks);
        [self.blocks.iter().map(relative).collect(), left_out.map(relative).collect()]
    }

    /// Relative mean squares of `evaluation` in every block.
    pub(super) fn mean_squares(&self, loss: Loss, evaluation: &Evaluation) -> Vec<f64> {
        mean_squares(self.whole, loss, evaluation, &self.blocks)
    }
}

/// Mean squares of the residuals in `blocks`, relative to the ranges; for Huber's loss from robust estimates, which drop-outs do not change.
fn mean_squares(whole: &Objective, loss: Loss, evaluation: &Evaluation, blocks: &[Block]) -> Vec<f64> {
    let residuals = whole.residuals(evaluation);
    let mut from = vec![0];
    from.extend(whole.values().scan(0, |end, values| {
        *end += values;
        Some(*end)
    }));
    let of = |block: &Block| {
        let start = from[block.recording];
        let part = &residuals[start + block.values.start..start + block.values.end];
        let square = match loss {
            Loss::Square => part.iter().map(|r| r * r).sum::<f64>() / part.len() as f64,
            Loss::Huber => robust_deviation(part).powi(2),
        };
        square / block.square
    };
    blocks.iter().map(of).collect()
}

impl Fold {
    /// Relative mean squares in the blocks of the structure that was `found`, fitted to the others, and that fit. Their strokes leave the end of a curve
    /// open: where the film pulls in on what is left out, it is brought back towards the fit to everything.
    fn refitted(
        &self,
        whole: &Objective,
        context: &Context<'_>,
        found: &Found,
    ) -> std::result::Result<(Vec<f64>, Candidate), String> {
        // The fit to all of them is a close start.
        let stopping = StoppingCriteria { iterations: 40, decrease: 1e-5 };
        let fitted = context.descend_over(&self.others, &found.candidate, found.variables.clone(), stopping);
        let fitted = fitted.ok_or_else(|| format!("there is no fit without {}", self.what))?;
        let errors = |share: f64| {
            let mut candidate = found.candidate.clone();
            for variable in &found.variables {
                let (from, to) = (variable.get(&found.candidate), variable.get(&fitted.candidate));
                variable.set(&mut candidate, if share == 1.0 { to } else { from + share * (to - from) });
            }
            let errors = mean_squares(whole, context.settings.loss, &whole.evaluate(&candidate)?, &self.blocks);
            errors.iter().all(|error| error.is_finite()).then_some((errors, candidate))
        };
        let found = WAY_BACK.into_iter().find_map(errors);
        found.ok_or_else(|| format!("the fit without {} has no response to it", self.what))
    }
}
