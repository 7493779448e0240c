//! Smaller models with the same response.
//!
//! Springpots of the same order in series are one springpot (Fig. 8 of Karner et al. 2022 merges dashpots so), and so are
//! springpots of the same order in parallel. Springpots that have no effect at the frequencies of interest are dropped.

use num_complex::Complex;
use springpot::{Chain, Maxwell, ModelError, Springpot, Topology};

use crate::error::{Error, Result};
use crate::files::parameters::Parameters;

/// How closely a reduced model must agree with the original.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Criterion {
    /// Lowest frequency of interest, Hz.
    pub from_hz: f64,
    /// Highest frequency of interest, Hz.
    pub to_hz: f64,
    /// Largest relative change of the dynamic modulus between them.
    pub tolerance: f64,
}

impl Default for Criterion {
    /// 1e-9 from 1 µHz (eleven days) to 10 kHz.
    fn default() -> Self {
        Self { from_hz: 1e-6, to_hz: 1e4, tolerance: 1e-9 }
    }
}

impl Criterion {
    /// Refuses frequencies and tolerances that make no sense.
    fn check(self) -> Result<()> {
        if !(1e-12..=1e12).contains(&self.from_hz) {
            return Err(Error::field("from_hz", format!("{:?} Hz must be from 1e-12 to 1e12", self.from_hz)));
        }
        if !(self.from_hz..=1e12).contains(&self.to_hz) {
            return Err(Error::field("to_hz", format!("{:?} Hz must be from `from_hz` to 1e12", self.to_hz)));
        }
        if !(1e-12..1.0).contains(&self.tolerance) {
            return Err(Error::field("tolerance", format!("{:?} must be from 1e-12 to below 1", self.tolerance)));
        }
        Ok(())
    }

    /// s = 2πif at twenty frequencies per decade.
    fn places(&self) -> Vec<Complex<f64>> {
        let (low, high) = (self.from_hz.log10(), self.to_hz.log10());
        let count = ((high - low) * 20.0).ceil().max(1.0) as usize;
        (0..=count)
            .map(|k| 10f64.powf(low + (high - low) * k as f64 / count as f64))
            .map(|frequency| Complex::new(0.0, std::f64::consts::TAU * frequency))
            .collect()
    }
}

/// `parameters` with the smallest model that agrees within `criterion`, and how it was found. Intervals of the elements are left out.
///
/// # Errors
///
/// [`Error`] for a criterion that makes no sense, and where coefficients overflow.
pub fn reduced_parameters(parameters: &Parameters, criterion: Criterion) -> Result<(Parameters, Reduction)> {
    criterion.check()?;
    let reduction = reduced(&parameters.model, criterion)?;
    let mut parameters = parameters.clone();
    // The intervals are of the elements before the reduction.
    if let Some(provenance) = &mut parameters.provenance {
        provenance.remove("intervals_95_pct");
    }
    parameters.name = format!("{}, reduced", parameters.name);
    parameters.model = reduction.model.clone();
    Ok((parameters, reduction))
}

/// A reduced model with its steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Reduction {
    /// The reduced model.
    pub model: Maxwell,
    /// Descriptions of what was merged and dropped, in order.
    pub steps: Vec<String>,
    /// Largest relative change of the dynamic modulus at these frequencies.
    pub change: f64,
}

/// Springpots in series; the forces of several series add.
type Springpots = Vec<Springpot>;

/// The smallest model found whose dynamic modulus agrees with that of `model` within `criterion`.
///
/// # Errors
///
/// [`ModelError`] where coefficients overflow.
pub fn reduced(model: &Maxwell, criterion: Criterion) -> std::result::Result<Reduction, ModelError> {
    let mut main = model.main();
    let mut steps = Vec::new();
    // The first chain is the main springpot; a factor multiplies every coefficient of its chain.
    let scaled = |chain: Chain<'_>| -> Springpots {
        chain.elements.iter().map(|e| Springpot::new(chain.scale * e.c, e.alpha)).collect()
    };
    let mut chains: Vec<Springpots> = model.chains().skip(1).map(scaled).collect();
    for chain in &mut chains {
        merge(chain, |a, b| a * b / (a + b), "in series", &mut steps);
    }
    // Every dropped springpot changes the response: each of at most ten may take a tenth of the tolerance.
    let share = 0.1 * criterion.tolerance;
    let places = criterion.places();
    for chain in &mut chains {
        drop_stiff(chain, share, &places, &mut steps);
    }
    // Chains of one springpot are in parallel to the main one.
    let mut parallel: Springpots = vec![main];
    chains.retain(|chain| {
        if let [single] = chain.as_slice() {
            parallel.push(*single);
        }
        chain.len() > 1
    });
    merge(&mut parallel, |a, b| a + b, "in parallel", &mut steps);
    main = parallel.remove(0);
    chains.extend(parallel.into_iter().map(|single| vec![single]));
    drop_soft(main, &mut chains, share, &places, &mut steps);
    let reduced = ordered(&assembled(main, &chains, model.topology(), model.mass_kg())?)?;
    let change = places
        .iter()
        .map(|&s| (reduced.modulus(s) - model.modulus(s)).norm() / model.modulus(s).norm())
        .fold(0.0, f64::max);
    Ok(Reduction { model: reduced, steps, change })
}

/// The model of `main` in parallel to `chains`.
fn assembled(
    main: Springpot,
    chains: &[Springpots],
    topology: Topology,
    mass_kg: f64,
) -> std::result::Result<Maxwell, ModelError> {
    let mut branches = Vec::new();
    for chain in chains {
        let mut elements = chain.clone();
        if !elements.len().is_multiple_of(2) {
            // A branch has two springpots: the last one is split into two of half its compliance.
            if let Some(last) = elements.pop() {
                elements.extend([Springpot::new(2.0 * last.c, last.alpha); 2]);
            }
        }
        elements.sort_by(|a, b| a.alpha.total_cmp(&b.alpha));
        // Eq. 9 multiplies by the number of branches; with parallel branches a chain is one pair.
        let pairs = elements.len() / 2;
        branches.extend(
            (0..pairs).map(|i| [elements[i], elements[i + pairs]].map(|e| Springpot::new(e.c / pairs as f64, e.alpha))),
        );
    }
    Maxwell::new(main, &branches, topology, mass_kg)
}

/// Merges springpots of the same order.
fn merge(chain: &mut Springpots, both: impl Fn(f64, f64) -> f64, how: &str, steps: &mut Vec<String>) {
    let mut merged: Springpots = Vec::new();
    for element in chain.drain(..) {
        match merged.iter_mut().find(|other| other.alpha == element.alpha) {
            Some(other) => {
                steps.push(format!("merge two {} {how}", named(element.alpha)));
                other.c = both(other.c, element.c);
            }
            None => merged.push(element),
        }
    }
    *chain = merged;
}

fn named(order: f64) -> String {
    match order {
        0.0 => "springs".into(),
        1.0 => "dashpots".into(),
        _ => format!("springpots of order {order}"),
    }
}

fn compliance(element: Springpot, s: Complex<f64>) -> Complex<f64> {
    s.powf(-element.alpha) / element.c
}

fn modulus(chain: &[Springpot], s: Complex<f64>) -> Complex<f64> {
    chain.iter().map(|&e| compliance(e, s)).sum::<Complex<f64>>().inv()
}

/// Drops springpots so stiff that they have no effect on their chain.
fn drop_stiff(chain: &mut Springpots, share: f64, places: &[Complex<f64>], steps: &mut Vec<String>) {
    while chain.len() > 1 {
        let part = |element: Springpot| {
            let shares = places.iter().map(|&s| (compliance(element, s) * modulus(chain, s)).norm());
            shares.fold(0.0, f64::max)
        };
        let parts: Vec<f64> = chain.iter().map(|&element| part(element)).collect();
        let Some(least) = (0..chain.len()).min_by(|&a, &b| parts[a].total_cmp(&parts[b])) else { return };
        if parts[least] > share {
            return;
        }
        let Springpot { c, alpha } = chain.remove(least);
        steps.push(format!("drop c = {c:.4e}, alpha = {alpha}: too stiff to have an effect in its chain"));
    }
}

/// Drops chains so soft that they have no effect on the model.
fn drop_soft(
    main: Springpot,
    chains: &mut Vec<Springpots>,
    share: f64,
    places: &[Complex<f64>],
    steps: &mut Vec<String>,
) {
    let whole: Vec<Complex<f64>> = places
        .iter()
        .map(|&s| compliance(main, s).inv() + chains.iter().map(|chain| modulus(chain, s)).sum::<Complex<f64>>())
        .collect();
    chains.retain(|chain| {
        let effect =
            places.iter().zip(&whole).map(|(&s, whole)| (modulus(chain, s) / whole).norm()).fold(0.0, f64::max);
        if effect <= share {
            let names: Vec<String> = chain.iter().map(|e| format!("c = {:.4e}, alpha = {}", e.c, e.alpha)).collect();
            steps.push(format!("drop the branch of {}: too soft to have an effect", names.join(" with ")));
        }
        effect > share
    });
}

/// The same model with the more elastic springpot of every branch first, and branches from fast to slow.
pub fn ordered(model: &Maxwell) -> std::result::Result<Maxwell, ModelError> {
    let mut branches: Vec<[Springpot; 2]> = model.branches().to_vec();
    for pair in &mut branches {
        pair.sort_by(|a, b| a.alpha.total_cmp(&b.alpha));
    }
    branches.sort_by(|a, b| relaxation_time(a).total_cmp(&relaxation_time(b)));
    Maxwell::new(model.main(), &branches, model.topology(), model.mass_kg())
}

/// Time (s) at which both springpots of a branch are equally stiff; infinite for equal orders.
pub fn relaxation_time([first, second]: &[Springpot; 2]) -> f64 {
    let order = second.alpha - first.alpha;
    if order == 0.0 { f64::INFINITY } else { ((second.c / first.c).ln() / order).exp() }
}
