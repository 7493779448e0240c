//! The fully fractional generalised Maxwell model, Eqs. 9 and 11.

use heapless::Vec;
use num_complex::Complex;

use crate::complex;
use crate::error::{MAX_BRANCHES, ModelElement, ModelError};
use crate::model::Springpot;

/// How the branches are connected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "lowercase"))]
pub enum Topology {
    /// As published: `n / Σ 1/(c s^α)` over all 2n springpots of the branches, their harmonic mean (Eq. 9).
    Eq11,
    /// The generalised Maxwell model proper: every branch is two springpots in series, and the branches' forces add.
    Parallel,
}

/// Eq. 11 of Karner et al. 2022: a main springpot, up to five branches of two springpots each, and a mass.
///
/// With `s` the Laplace variable, displacement over force is
///
/// ```text
/// x(s)/F(s) = 1 / (m s² + K(s))
/// K(s) = c₁₁ s^α₁₁ + n / Σ_i [ 1/(c_i1 s^α_i1) + 1/(c_i2 s^α_i2) ]       Topology::Eq11
/// K(s) = c₁₁ s^α₁₁ + Σ_i 1 / [ 1/(c_i1 s^α_i1) + 1/(c_i2 s^α_i2) ]       Topology::Parallel
/// ```
///
/// The two topologies agree for one branch and differ for more: the published one is the harmonic mean of the branches.
///
/// ```
/// use springpot::{Maxwell, ModelError, Springpot, Topology};
///
/// # fn main() -> Result<(), ModelError> {
/// let main = Springpot::new(62_740.0, 0.2);
/// let branch = [Springpot::new(47_958.0, 0.0), Springpot::new(173_210.0, 1.0)];
/// let model = Maxwell::new(main, &[branch], Topology::Parallel, 0.316)?;
///
/// // The film lengthens for hours under a steady force: displacement per newton after 1 s and after 1 h.
/// let (soon, late) = (model.creep_compliance(1.0), model.creep_compliance(3600.0));
/// assert!(late > 5.0 * soon);
///
/// // The amplitude per newton at 0.1 Hz, and how far it lags behind the force.
/// let response = model.frequency_response(0.1);
/// assert!(response.re > 0.0 && response.im < 0.0);
///
/// // What no film has is refused.
/// assert_eq!(Maxwell::new(main, &[], Topology::Parallel, -1.0), Err(ModelError::Mass(-1.0)));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "Unchecked"))]
pub struct Maxwell {
    main: Springpot,
    branches: Vec<[Springpot; 2], MAX_BRANCHES>,
    topology: Topology,
    mass_kg: f64,
}

impl Maxwell {
    /// A model of `main` beside `branches` (at most [`MAX_BRANCHES`]), carrying `mass_kg`.
    ///
    /// # Errors
    ///
    /// [`ModelError`] for a coefficient that is not finite and positive, an order outside 0…1, a mass that is
    /// negative or not finite, or too many branches.
    pub fn new(
        main: Springpot,
        branches: &[[Springpot; 2]],
        topology: Topology,
        mass_kg: f64,
    ) -> Result<Self, ModelError> {
        check(ModelElement::Main, main)?;
        for (branch, pair) in branches.iter().enumerate() {
            for (element, &springpot) in pair.iter().enumerate() {
                check(ModelElement::Branch { branch, element }, springpot)?;
            }
        }
        if !(mass_kg.is_finite() && mass_kg >= 0.0) {
            return Err(ModelError::Mass(mass_kg));
        }
        let branches = Vec::from_slice(branches).map_err(|_| ModelError::Branches(branches.len()))?;
        Ok(Self { main, branches, topology, mass_kg })
    }

    /// The springpot beside the branches.
    #[must_use]
    pub fn main(&self) -> Springpot {
        self.main
    }

    /// The branches.
    #[must_use]
    pub fn branches(&self) -> &[[Springpot; 2]] {
        &self.branches
    }

    /// How the branches are connected.
    #[must_use]
    pub fn topology(&self) -> Topology {
        self.topology
    }

    /// The mass in kg.
    #[must_use]
    pub fn mass_kg(&self) -> f64 {
        self.mass_kg
    }

    /// The same elements in another topology. For more than one branch this is another model.
    #[must_use]
    pub fn with_topology(mut self, topology: Topology) -> Self {
        self.topology = topology;
        self
    }

    /// The model with every coefficient times `factor`: with `factor = A / L` it turns a material law (stress from
    /// strain) into an actuator law (force from displacement), with `L / A` back (Eqs. 12–13). The mass stays.
    ///
    /// # Errors
    ///
    /// [`ModelError::Coefficient`] where the product is not finite and positive.
    pub fn scaled(mut self, factor: f64) -> Result<Self, ModelError> {
        self.main.c *= factor;
        for springpot in self.branches.as_flattened_mut() {
            springpot.c *= factor;
        }
        Self::new(self.main, &self.branches, self.topology, self.mass_kg)
    }

    /// The springpots as chains in series whose forces add. This is the one place that knows what a [`Topology`] means.
    ///
    /// The main springpot comes first, as a chain of one. The branches follow: in [`Topology::Eq11`] all of them in one
    /// chain of 2n springpots with the factor n (Eq. 9), in [`Topology::Parallel`] one chain of two springpots per branch.
    /// K(s) is the sum of `scale / Σ 1/(c s^α)` over these chains.
    ///
    /// ```
    /// use springpot::{Complex, Preset, Topology};
    ///
    /// # fn main() -> Result<(), Box<dyn core::error::Error>> {
    /// let model = Preset::TABLE3_N3.model()?;
    /// let shape = |topology| {
    ///     let model = model.clone().with_topology(topology);
    ///     model.chains().map(|chain| (chain.scale, chain.elements.len())).collect::<Vec<_>>()
    /// };
    /// assert_eq!(shape(Topology::Eq11), [(1.0, 1), (3.0, 6)]);
    /// assert_eq!(shape(Topology::Parallel), [(1.0, 1), (1.0, 2), (1.0, 2), (1.0, 2)]);
    ///
    /// // The sum over the chains is K(s). At s = 1/s every s^α is 1.
    /// let sum: f64 =
    ///     model.chains().map(|chain| chain.scale / chain.elements.iter().map(|e| 1.0 / e.c).sum::<f64>()).sum();
    /// let modulus = model.modulus(Complex::new(1.0, 0.0));
    /// assert!((sum / modulus.re - 1.0).abs() < 1e-12);
    /// # Ok(())
    /// # }
    /// ```
    pub fn chains(&self) -> impl Iterator<Item = Chain<'_>> {
        let elements = self.branches.as_flattened();
        #[allow(clippy::cast_precision_loss)] // at most five
        let (scale, length) = match self.topology {
            Topology::Eq11 => (self.branches.len() as f64, elements.len().max(1)),
            Topology::Parallel => (1.0, 2),
        };
        let branches = elements.chunks(length).map(move |elements| Chain { scale, elements });
        core::iter::once(Chain { scale: 1.0, elements: core::slice::from_ref(&self.main) }).chain(branches)
    }

    /// [`modulus`](Self::modulus) from ln s, where that is at hand: no logarithm, one exponential per springpot.
    #[must_use]
    pub fn modulus_of_ln(&self, ln_s: Complex<f64>) -> Complex<f64> {
        self.chains().map(|chain| chain.modulus(ln_s)).fold(Complex::ZERO, |sum, k| sum + k)
    }

    /// K(s) and dK/d ln s in N/m, from ln s.
    pub(crate) fn modulus_and_slope(&self, ln_s: Complex<f64>) -> (Complex<f64>, Complex<f64>) {
        self.chains().fold((Complex::ZERO, Complex::ZERO), |(modulus, slope), chain| {
            let (of_chain, its_slope) = chain.modulus_and_slope(ln_s);
            (modulus + of_chain, slope + its_slope)
        })
    }

    /// K(s) in N/m for a real s > 0 (1/s).
    pub(crate) fn modulus_real(&self, s: f64) -> f64 {
        let ln_s = libm::log(s);
        self.chains()
            .map(|chain| {
                let compliance: f64 = chain.elements.iter().map(|e| libm::exp(-e.alpha * ln_s) / e.c).sum();
                chain.scale / compliance
            })
            .sum()
    }

    /// The dynamic modulus K(s) in N/m: force over displacement, without the mass.
    #[must_use]
    pub fn modulus(&self, s: Complex<f64>) -> Complex<f64> {
        self.modulus_of_ln(complex::ln(s))
    }

    /// Displacement over force, Eq. 11, in m/N at the Laplace variable `s` (1/s).
    #[must_use]
    pub fn compliance(&self, s: Complex<f64>) -> Complex<f64> {
        Complex::new(1.0, 0.0) / (s * s * self.mass_kg + self.modulus(s))
    }
}

/// A model as it is read, before [`Maxwell::new`] has checked it.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
#[serde(rename = "Maxwell", deny_unknown_fields)]
struct Unchecked {
    main: Springpot,
    branches: Vec<[Springpot; 2], MAX_BRANCHES>,
    topology: Topology,
    mass_kg: f64,
}

#[cfg(feature = "serde")]
impl TryFrom<Unchecked> for Maxwell {
    type Error = ModelError;

    fn try_from(Unchecked { main, branches, topology, mass_kg }: Unchecked) -> Result<Self, ModelError> {
        Self::new(main, &branches, topology, mass_kg)
    }
}

/// Springpots in series, one summand of K(s): force is `scale / Σ 1/(c s^α)` times displacement, in N/m.
///
/// [`Maxwell::chains`] gives them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain<'a> {
    /// Factor of the chain: n for the branches of [`Topology::Eq11`], 1 otherwise.
    pub scale: f64,
    /// Its springpots.
    pub elements: &'a [Springpot],
}

impl Chain<'_> {
    fn modulus(&self, ln_s: Complex<f64>) -> Complex<f64> {
        let compliance =
            self.elements.iter().map(|e| complex::exp(ln_s * -e.alpha) / e.c).fold(Complex::ZERO, |sum, j| sum + j);
        Complex::new(self.scale, 0.0) / compliance
    }

    /// The same, and its derivative by ln s.
    fn modulus_and_slope(&self, ln_s: Complex<f64>) -> (Complex<f64>, Complex<f64>) {
        let (mut compliance, mut falls) = (Complex::ZERO, Complex::ZERO);
        for element in self.elements {
            let term = complex::exp(ln_s * -element.alpha) / element.c;
            compliance += term;
            falls += term * element.alpha;
        }
        let modulus = Complex::new(self.scale, 0.0) / compliance;
        (modulus, modulus * falls / compliance)
    }
}

fn check(element: ModelElement, springpot: Springpot) -> Result<(), ModelError> {
    let Springpot { c, alpha } = springpot;
    if !(c.is_finite() && c > 0.0) {
        return Err(ModelError::Coefficient { element, c });
    }
    if !(0.0..=1.0).contains(&alpha) {
        return Err(ModelError::Order { element, alpha });
    }
    Ok(())
}
