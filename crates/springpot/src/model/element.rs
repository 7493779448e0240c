//! The springpot: one element between a spring and a dashpot.

/// A springpot, `f = c D^α x`: a spring at order 0, a dashpot at order 1.
///
/// The fields are plain so that tables can be written as constants; [`Maxwell::new`](crate::Maxwell::new) refuses
/// invalid values.
///
/// ```
/// use springpot::Springpot;
///
/// // Nearly a spring, of 60 kN·s^0.2/m.
/// let element = Springpot::new(60e3, 0.2);
///
/// // The material it is made of, as a film of 49 mm × 0.16 mm across and 60 mm along the load (Eqs. 12–13).
/// let (area_m2, length_m) = (49e-3 * 0.16e-3, 60e-3);
/// let eta = element.material_constant(area_m2, length_m); // Pa·s^0.2
/// let again = Springpot::from_material(eta, 0.2, area_m2, length_m);
/// assert!((again.c / element.c - 1.0).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Springpot {
    /// Coefficient in N·s^α/m, greater than 0.
    pub c: f64,
    /// Order α, from 0 (spring) to 1 (dashpot).
    pub alpha: f64,
}

impl Springpot {
    /// An element of coefficient `c` (N·s^α/m) and order `alpha`.
    #[must_use]
    pub const fn new(c: f64, alpha: f64) -> Self {
        Self { c, alpha }
    }

    /// The element of a body of the material law `σ = η D^α ε`: `c = η A / L` (Karner et al. 2022, Eqs. 12–13).
    ///
    /// `eta` in Pa·s^α, `area_m2` the cross-section A across the load, `length_m` the length L along it.
    #[must_use]
    pub fn from_material(eta: f64, alpha: f64, area_m2: f64, length_m: f64) -> Self {
        Self { c: eta * area_m2 / length_m, alpha }
    }

    /// The material constant `η = c L / A` in Pa·s^α of which this element is a body; the inverse of
    /// [`from_material`](Self::from_material).
    #[must_use]
    pub fn material_constant(&self, area_m2: f64, length_m: f64) -> f64 {
        self.c * length_m / area_m2
    }
}
