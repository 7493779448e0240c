//! The fractional model and other models of creep, fitted to the same recordings.

use std::hint::black_box;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use serde::Serialize;
use springpot::{Actuator, Compressed, Law, LawOptions, Memory, Springpot, Topology, VoltageDrive};

use crate::agreement::{mean_nrmse_pct, mean_r2};
use crate::error::{Error, Result};
use crate::files::recording::Input;
use crate::fit::candidate::{Candidate, Variable};
use crate::fit::descent::{Context, Found, PreparedObservations};
use crate::fit::left_out::LeftOut;
use crate::fit::objective::Objective;
use crate::fit::observation::Observation;
use crate::fit::{Settings, refuse_copies, selection, starts};
use crate::progress::Stage;
use crate::statistics::mean;
use crate::studies::prandtl_ishlinskii::PrandtlIshlinskii;

/// A model of the comparison, as `compare --json` prints it.
#[derive(Clone, Debug, Serialize)]
pub struct ModelRow {
    /// Name of the model.
    pub model: String,
    /// The kind of model.
    pub family: &'static str,
    /// Number of fitted quantities.
    pub parameters: usize,
    /// Mean of the recordings' R².
    pub r2_mean: f64,
    /// Mean of the recordings' NRMSE, %.
    pub nrmse_pct: f64,
    /// Mean NRMSE (%) of every recording under a fit to the others; null for a single recording.
    pub left_out_nrmse_pct: Option<f64>,
    /// RMS error in % of the measured RMS, after the part that was fitted; null where all was fitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beyond_pct: Option<f64>,
    /// Time of a step on this machine, f32, ns.
    pub step_ns: f64,
}

/// Models that the recursion can run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CreepModel {
    /// Springs and dashpots: a generalised Maxwell model, or Prony series.
    Prony(usize),
    /// Springpots.
    Fractional(Topology, usize),
}

/// The kinds of models.
pub const FAMILIES: [&str; 4] = ["springs and dashpots", "springpots in parallel", "Eq. 11", "Prandtl–Ishlinskii"];

const MODELS: [(&str, CreepModel); 10] = [
    ("single springpot", CreepModel::Fractional(Topology::Parallel, 0)),
    ("standard linear solid", CreepModel::Prony(1)),
    ("Prony series, 2 branches", CreepModel::Prony(2)),
    ("Prony series, 3 branches", CreepModel::Prony(3)),
    ("Prony series, 4 branches", CreepModel::Prony(4)),
    ("Prony series, 5 branches", CreepModel::Prony(5)),
    ("fractional Maxwell, n = 1", CreepModel::Fractional(Topology::Parallel, 1)),
    ("Eq. 11, n = 2", CreepModel::Fractional(Topology::Eq11, 2)),
    ("fractional Maxwell, n = 2", CreepModel::Fractional(Topology::Parallel, 2)),
    ("fractional Maxwell, n = 3", CreepModel::Fractional(Topology::Parallel, 3)),
];

/// Fits every model to `observations` and to all of them but one, and predicts `beyond`, the same recordings after what is fitted of
/// them; `progress` is called with each model as it begins. `stop` ends it without a result: a part of a comparison is of no use.
///
/// # Errors
///
/// [`Error`] where a model cannot be fitted; [`Error::Interrupted`].
pub fn compare(
    observations: &[Observation],
    beyond: &[Observation],
    settings: &Settings,
    stop: &AtomicBool,
    progress: &dyn Fn(&Stage),
) -> Result<Vec<ModelRow>> {
    refuse_copies(observations)?;
    let objective = |observations: &[Observation]| Objective::new(observations, settings.actuator.preload);
    let foretold = if beyond.is_empty() { None } else { Some(objective(beyond)?) };
    let prepared = PreparedObservations::new(observations, &settings.actuator)?;
    let context = &prepared.context(settings, stop);
    let left_out = LeftOut::new(observations, context.fine, objective)?;
    let mut rows = Vec::new();
    let mut smaller: Option<Candidate> = None;
    for (index, (name, model)) in MODELS.into_iter().enumerate() {
        progress(&Stage::numbered(name, index + 1, MODELS.len() + 1));
        let found = model
            .best(context, smaller.as_ref())
            .ok_or_else(|| Error::Computation(format!("{name}: no fit was found")))?;
        if stop.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
        smaller = Some(found.candidate.clone());
        let agreements = selection::agreements(context.fine, &found.candidate);
        rows.push(ModelRow {
            model: name.into(),
            family: model.family(),
            parameters: found.variables.len(),
            r2_mean: mean_r2(&agreements),
            nrmse_pct: mean_nrmse_pct(&agreements),
            left_out_nrmse_pct: left_out.refitted(context, &found).ok().and_then(|(of, _)| left_out.nrmse_pct(&of)),
            beyond_pct: foretold.as_ref().and_then(|objective| error_pct(objective, &found.candidate)),
            step_ns: model.step_ns(&found.candidate, &observations[0].input)?,
        });
    }
    progress(&Stage::numbered("Prandtl–Ishlinskii", MODELS.len() + 1, MODELS.len() + 1));
    rows.push(prandtl_ishlinskii(observations)?);
    Ok(rows)
}

/// RMS error of `candidate` over all of `objective`, in % of the measured RMS.
fn error_pct(objective: &Objective, candidate: &Candidate) -> Option<f64> {
    let evaluation = objective.evaluate(candidate)?;
    let (mut error, mut size) = (0.0, 0.0);
    for (measured, modelled) in objective.measured().flatten().zip(evaluation.modelled.iter().flatten()) {
        error += (modelled - measured).powi(2);
        size += measured.powi(2);
    }
    Some(100.0 * (error / size).sqrt())
}

impl CreepModel {
    fn family(self) -> &'static str {
        match self {
            Self::Prony(_) => FAMILIES[0],
            Self::Fractional(Topology::Parallel, _) => FAMILIES[1],
            Self::Fractional(Topology::Eq11, _) => FAMILIES[2],
        }
    }

    /// The best candidate of this model; `smaller` is the fit before, from which a Prony series starts as well.
    fn best(self, context: &Context<'_>, smaller: Option<&Candidate>) -> Option<Found> {
        match self {
            Self::Fractional(topology, branches) => context.best(topology, branches, &[]),
            Self::Prony(branches) => {
                let mut starts: Vec<Candidate> = [0.2, 0.5, 1.0].map(|share| prony(context, branches, share)).into();
                starts.extend(
                    smaller.filter(|c| c.branches() + 1 == branches).into_iter().flat_map(|c| grown(context, c)),
                );
                let mut variables: Vec<Variable> = (0..=2 * branches).map(Variable::Coefficient).collect();
                variables.extend(&context.freed);
                context.best_from(&starts, &variables)
            }
        }
    }

    /// Time of a step of the law on a controller, run on this machine in the direction of `input`.
    fn step_ns(self, candidate: &Candidate, input: &Input) -> Result<f64> {
        let model = candidate.model()?;
        match self {
            // For plain relaxation times a head of one sample and six poles are enough.
            Self::Prony(_) => {
                let law: Law<f32, Compressed<f32, 1, 6, 0>> = Law::compressed(&model, LawOptions::at_step(1e-3))?;
                law_step_ns(&law, &candidate.actuator, input, || law.state())
            }
            Self::Fractional(..) => {
                let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3))?;
                law_step_ns(&law, &candidate.actuator, input, || law.state())
            }
        }
    }
}

/// Springs and dashpots whose relaxation times are within those that the recordings resolve.
fn prony(context: &Context<'_>, branches: usize, share: f64) -> Candidate {
    let mut elements = starts::elements(branches, context.scales, share, 1.0);
    elements[0] = Springpot::new(context.scales.stiffness, 0.0);
    let mut actuator = context.settings.actuator;
    if context.freed.contains(&Variable::StretchCoupling) && actuator.stretch_coupling == 0.0 {
        actuator.stretch_coupling = context.scales.coupling;
    }
    Candidate::linear(actuator, elements, Topology::Parallel)
}

/// The candidate with one more small branch of a spring and a dashpot, at several relaxation times.
fn grown(context: &Context<'_>, smaller: &Candidate) -> Vec<Candidate> {
    let (short, long) = context.scales.times_s;
    let stiffness = 0.1 * context.scales.stiffness;
    let times = [0.1, 0.3, 0.5, 0.7, 0.9].map(|share| short * f64::powf(long / short, share));
    times
        .into_iter()
        .map(|time| {
            let mut grown = smaller.clone();
            grown.elements[0].alpha = 0.0;
            grown.elements.extend([Springpot::new(stiffness, 0.0), Springpot::new(stiffness * time, 1.0)]);
            grown
        })
        .collect()
}

const STEPS: usize = 200_000;

/// The shortest of several runs, per step.
fn nanoseconds(mut run: impl FnMut()) -> f64 {
    (0..5)
        .map(|_| {
            let started = Instant::now();
            run();
            1e9 * started.elapsed().as_secs_f64() / STEPS as f64
        })
        .fold(f64::INFINITY, f64::min)
}

fn law_step_ns<M: Memory<f32>>(
    law: &Law<f32, M>,
    actuator: &Actuator,
    input: &Input,
    state: impl Fn() -> springpot::LawState<f32, M>,
) -> Result<f64> {
    if let Input::Displacement(_) = input {
        return Ok(nanoseconds(|| {
            let mut state = state();
            for k in 0..STEPS {
                black_box(law.force(&mut state, black_box(1e-3 * (k % 5000) as f32 / 5000.0)));
            }
        }));
    }
    let drive = VoltageDrive::new(actuator, 6000.0, law.stiffness())?;
    Ok(nanoseconds(|| {
        let mut state = state();
        for k in 0..STEPS {
            let voltage = 6000.0 * (k % 5000) as f32 / 5000.0;
            black_box(law.displacement_under(&mut state, drive.load(black_box(voltage))));
        }
    }))
}

fn prandtl_ishlinskii(observations: &[Observation]) -> Result<ModelRow> {
    let model = PrandtlIshlinskii::fit(observations)?;
    let agreements = observations.iter().map(|o| model.agreement(o)).collect::<Result<Vec<_>>>()?;
    let left_out = (0..observations.len())
        .map(|out| {
            let others: Vec<Observation> =
                observations.iter().enumerate().filter(|(k, _)| *k != out).map(|(_, o)| o.clone()).collect();
            Ok(PrandtlIshlinskii::fit(&others)?.agreement(&observations[out])?.nrmse_pct)
        })
        .collect::<Result<Vec<f64>>>();
    let loads: Vec<f32> = (0..STEPS).map(|k| (6000.0 * (k % 5000) as f32 / 5000.0).powi(2)).collect();
    Ok(ModelRow {
        model: "Prandtl–Ishlinskii, rate-dependent".into(),
        family: FAMILIES[3],
        parameters: PrandtlIshlinskii::PARAMETERS,
        r2_mean: mean_r2(&agreements),
        nrmse_pct: mean_nrmse_pct(&agreements),
        left_out_nrmse_pct: if observations.len() > 1 { Some(mean(&left_out?)) } else { None },
        beyond_pct: None,
        step_ns: nanoseconds(|| {
            model.steps_f32(black_box(&loads), 1000.0, |x| {
                black_box(x);
            });
        }),
    })
}
