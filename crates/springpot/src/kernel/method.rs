//! How s is discretised: the generating function δ(ζ) of a convolution quadrature.

/// Discretisation of the time derivative.
///
/// Both methods replace s in Eq. 11 by δ(ζ)/h, with ζ the delay of one step h (convolution quadrature: C. Lubich, "Discretized
/// fractional calculus", SIAM J. Math. Anal. 17 (1986) 704). A step costs the same with either; only the numbers of the
/// law differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "lowercase"))]
#[non_exhaustive]
pub enum Discretisation {
    /// Grünwald–Letnikov, δ = 1 − ζ: Eq. 2 as the paper has it. First order in the step.
    #[default]
    Gl,
    /// Second-order backward differences, δ = (1 − ζ)(3 − ζ)/2: second-order in the step for input that is smooth and
    /// begins at rest. A jump must be sampled with the mean of both sides; otherwise the error is of first order.
    ///
    /// Holds for all elements and for the mass, whose inertia becomes `m δ(ζ)²/h²`. Modes of the memory have positive weights,
    /// as with [`Gl`](Self::Gl). Relaxation as fast as the step itself does not decay as an exponential in this
    /// discretisation, but nearly as j 2^−j: a branch with a plain relaxation time of 1 to 2.1 steps needs a head of 26
    /// increments instead of 12, and is refused with [`LawError::ToleranceMissed`](crate::LawError::ToleranceMissed) otherwise.
    Bdf2,
}

impl Discretisation {
    /// The step (s) where a mode of ρ = 1/(1 + ah) relaxes at the rate a (1 − ah/2), and 0 where it relaxes at the rate a.
    ///
    /// A singularity at ζ = 1 + ah belongs to the relaxation rate r = −δ(1 + ah)/h.
    pub(crate) fn bend(self, step_s: f64) -> f64 {
        match self {
            Self::Gl => 0.0,
            Self::Bdf2 => step_s,
        }
    }

    /// Coefficients of (δ/h)² over (1 − ζ)/h², which act on the increments: of an increment and of those before it.
    pub(crate) fn inertia(self) -> (f64, [f64; 3]) {
        match self {
            Self::Gl => (1.0, [-1.0, 0.0, 0.0]),
            Self::Bdf2 => (2.25, [-3.75, 1.75, -0.25]),
        }
    }
}
