//! What each branch of a model does: when it relaxes, and how much of the stiffness is its.

use std::f64::consts::FRAC_PI_2;
use std::fmt;

use num_complex::Complex;
use serde::Serialize;
use springpot::{Maxwell, Springpot, Topology};

use super::candidate::Candidate;

/// A branch in words and numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BranchRow {
    /// Its index in the parameter file, from 0.
    pub branch: usize,
    /// Time at which both of its springpots are equally stiff, s; null where they have the same order.
    pub relaxation_time_s: Option<f64>,
    /// Its share there, %; null without a time or a model.
    pub share_pct: Option<f64>,
    /// What it is a share of.
    pub share_of: &'static str,
}

/// The branches of `candidate`.
pub fn rows(candidate: &Candidate) -> Vec<BranchRow> {
    let model = candidate.model().ok();
    (0..candidate.branches())
        .map(|branch| {
            let [first, second] = pair(candidate, branch);
            // Both springpots are equally stiff at s = 1/τ: c_1 τ^-a = c_2 τ^-b.
            let time_s =
                (second.alpha != first.alpha).then(|| (second.c / first.c).powf(1.0 / (second.alpha - first.alpha)));
            let time_s = time_s.filter(|time_s| time_s.is_finite() && *time_s > 0.0);
            BranchRow {
                branch,
                relaxation_time_s: time_s,
                share_pct: time_s
                    .zip(model.as_ref())
                    .map(|(time_s, model)| share_pct(candidate, model, branch, time_s)),
                share_of: match candidate.topology {
                    Topology::Parallel => "stiffness",
                    Topology::Eq11 => "compliance of all branches",
                },
            }
        })
        .collect()
}

impl fmt::Display for BranchRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "branches[{}]: ", self.branch)?;
        let Some(time_s) = self.relaxation_time_s else {
            return f.write_str("no relaxation time, its springpots have the same order");
        };
        write!(f, "relaxation time {time_s:.3e} s")?;
        match self.share_pct {
            Some(share) => write!(f, ", {share:.2} % of the {} there", self.share_of),
            None => Ok(()),
        }
    }
}

fn pair(candidate: &Candidate, branch: usize) -> [Springpot; 2] {
    [1, 2].map(|k| candidate.elements[2 * branch + k])
}

/// The share of `branch` at s = j / `time_s`, %: of the stiffness, or of the chain's compliance.
fn share_pct(candidate: &Candidate, model: &Maxwell, branch: usize, time_s: f64) -> f64 {
    let ln_s = Complex::new(-time_s.ln(), FRAC_PI_2);
    let of = |e: &Springpot| (ln_s * e.alpha).exp() * e.c;
    let compliance = |branch: usize| pair(candidate, branch).iter().map(|e| of(e).inv()).sum::<Complex<f64>>();
    let share = match candidate.topology {
        Topology::Parallel => compliance(branch).inv() / model.modulus_of_ln(ln_s),
        Topology::Eq11 => compliance(branch) / (0..candidate.branches()).map(compliance).sum::<Complex<f64>>(),
    };
    100.0 * share.norm()
}
