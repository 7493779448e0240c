//! From voltage to force and back: Eq. 1.

use crate::error::{ActuatorError, first_not_positive};
use crate::numbers::Numbers;
use crate::scalar::Real;

/// Permittivity of free space in F/m.
pub const EPSILON_0: f64 = 8.854_187_812_8e-12;

/// Standard gravity in m/s².
pub const GRAVITY: f64 = 9.806_65;

/// Largest thinning of a film, in shares of its length.
const MAX_THINNING: f64 = 3.0;

/// When the weight that stretches the film begins to act.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum Preload {
    /// The weight has hung for long and displacement is measured from there: it does not appear in the force.
    #[default]
    Settled,
    /// The weight acts from t = 0 as a step, as in the paper.
    FromStart,
}

/// A dielectric elastomer actuator around its film: electrodes, weight, coupling. SI units.
///
/// ```
/// use springpot::{Actuator, ActuatorError, Preload};
///
/// // Another film in the paper's frame: twice as thick, and thinning as it lengthens.
/// let actuator = Actuator { thickness_m: 320e-6, stretch_coupling: 20.0, ..Actuator::KARNER_2022 };
/// actuator.check()?;
///
/// // Eq. 1 at 6 kV: a quarter of the force of the thin film.
/// let force_n = actuator.force_per_square_volt() * 6000.0 * 6000.0;
/// assert!((force_n - 35.1).abs() < 0.1);
///
/// // The weight acts on the film only with `FromStart`.
/// assert_eq!(actuator.preload_n(), 0.0);
/// assert!(Actuator { preload: Preload::FromStart, ..actuator }.preload_n() > 3.0);
/// # Ok::<(), ActuatorError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Actuator {
    /// Relative permittivity ε_r of the film.
    pub relative_permittivity: f64,
    /// One side l₁ of the active area, m.
    pub length_m: f64,
    /// The other side l₂ of the active area, m. Only the product enters.
    pub width_m: f64,
    /// Thickness l₃ of the film, m.
    pub thickness_m: f64,
    /// Mass of the weight that hangs on the film, kg; zero in a test machine, which carries it. Its inertia is that of the model: give
    /// [`Maxwell::new`](crate::Maxwell::new) the same mass.
    pub mass_kg: f64,
    /// Growth of the force with displacement, κ in 1/m: a film of constant volume and width thins as it lengthens, so that the force grows
    /// with 1 + κ x. Zero is Eq. 1. A fit may find a negative value, and behind a curve a larger one than the film can
    /// [thin](Self::thinning_per_m).
    pub stretch_coupling: f64,
    /// Saturation voltage V_s in V: the force saturates as V² / (1 + (V/V_s)²), as in zipping actuators, films with lossy
    /// electrodes and films whose instantaneous elasticity stiffens. None is Eq. 1.
    #[cfg_attr(feature = "serde", serde(default))]
    pub saturation_v: Option<f64>,
    /// When the weight begins to act.
    pub preload: Preload,
}

impl Actuator {
    /// The actuator of Karner et al. 2022: VHB 4910, 40 mm × 60 mm active, 160 µm thick, 316 g.
    pub const KARNER_2022: Self = Self {
        relative_permittivity: 4.7,
        length_m: 0.04,
        width_m: 0.06,
        thickness_m: 160e-6,
        mass_kg: 0.316,
        stretch_coupling: 0.0,
        saturation_v: None,
        preload: Preload::Settled,
    };

    /// Electrostatic force per voltage squared at x = 0, `ε₀ ε_r l₁ l₂ / l₃²` (Eq. 1), in N/V².
    #[must_use]
    pub fn force_per_square_volt(&self) -> f64 {
        EPSILON_0 * self.relative_permittivity * self.length_m * self.width_m / (self.thickness_m * self.thickness_m)
    }

    /// Returns 1/V_s² in 1/V²: zero where nothing saturates.
    #[must_use]
    pub fn saturation(&self) -> f64 {
        self.saturation_v.map_or(0.0, |volts| 1.0 / (volts * volts))
    }

    /// The squared voltage that Eq. 1 would need for the force of `squared_voltage` (V²): V² / (1 + (V/V_s)²), V².
    #[must_use]
    pub fn saturated(&self, squared_voltage: f64) -> f64 {
        squared_voltage / (1.0 + squared_voltage * self.saturation())
    }

    /// Electrostatic force under `voltage_v` (V, either sign) at x = 0, N.
    #[must_use]
    pub fn electrostatic_force(&self, voltage_v: f64) -> f64 {
        self.force_per_square_volt() * self.saturated(voltage_v * voltage_v)
    }

    /// The weight's share of the force on the film, N: m g from the start, or zero if it has settled.
    #[must_use]
    pub fn preload_n(&self) -> f64 {
        match self.preload {
            Preload::Settled => 0.0,
            Preload::FromStart => self.mass_kg * GRAVITY,
        }
    }

    /// Force on the film in N under `voltage_v` (V, either sign) at `displacement_m` (m), the weight included: Eq. 1 with
    /// coupling and saturation,
    ///
    /// ```text
    /// F = ε₀ ε_r l₁ l₂ / l₃² · V² / (1 + (V/V_s)²) · (1 + κ x) + preload
    /// ```
    ///
    /// In f64, for a host. A controller computes the same in its own arithmetic with [`VoltageDrive`].
    ///
    /// ```
    /// use springpot::{Actuator, GRAVITY, Preload};
    ///
    /// // Eq. 1 with the values of Table 2 of Karner et al. 2022, at 6 kV.
    /// let paper = Actuator { preload: Preload::FromStart, ..Actuator::KARNER_2022 };
    /// let electrostatic = 8.8541878128e-12 * 4.7 * 0.04 * 0.06 / (160e-6 * 160e-6) * 6000.0 * 6000.0;
    /// assert!((paper.force(6000.0, 0.0) - (electrostatic + 0.316 * GRAVITY)).abs() < 1e-12);
    ///
    /// // With κ = 100 1/m and x = 2 mm the film is a fifth thinner, and Eq. 1 gives a fifth more.
    /// let coupled = Actuator { stretch_coupling: 100.0, ..Actuator::KARNER_2022 };
    /// assert!((coupled.force(6000.0, 2e-3) - 1.2 * electrostatic).abs() < 1e-12);
    /// ```
    #[must_use]
    pub fn force(&self, voltage_v: f64, displacement_m: f64) -> f64 {
        self.electrostatic_force(voltage_v) * self.force_growth(displacement_m) + self.preload_n()
    }

    /// The squared voltage in V² that exerts `force_n` (N, weight included) on the film at `displacement_m` (m): the inverse
    /// of [`force`](Self::force). Negative for a force below that at 0 V, which no voltage gives; infinite for one at or above that
    /// at which the actuator saturates.
    ///
    /// ```
    /// use springpot::Actuator;
    ///
    /// let actuator = Actuator { stretch_coupling: 100.0, ..Actuator::KARNER_2022 };
    /// let force_n = actuator.force(4000.0, 2e-3);
    /// assert!((actuator.squared_voltage(force_n, 2e-3) / 16e6 - 1.0).abs() < 1e-12);
    /// assert!(actuator.squared_voltage(-1.0, 2e-3) < 0.0);
    /// ```
    #[must_use]
    pub fn squared_voltage(&self, force_n: f64, displacement_m: f64) -> f64 {
        // 1 + κ x ≤ 0 is beyond the model: the force needs an unbounded voltage there.
        let growth = self.force_growth(displacement_m).max(1e-9);
        let unsaturated = (force_n - self.preload_n()) / (self.force_per_square_volt() * growth);
        let left = 1.0 - unsaturated * self.saturation();
        if left > 0.0 { unsaturated / left } else { f64::INFINITY }
    }

    /// The voltage in V (≥ 0) that exerts `force_n` (N, weight included) on the film at `displacement_m` (m); 0 V for a force
    /// below that at 0 V. No limit is applied.
    ///
    /// ```
    /// use springpot::Actuator;
    ///
    /// let actuator = Actuator { stretch_coupling: 100.0, ..Actuator::KARNER_2022 };
    /// let force_n = actuator.force(4000.0, 2e-3);
    /// assert!((actuator.voltage(force_n, 2e-3) - 4000.0).abs() < 1e-9);
    /// assert_eq!(actuator.voltage(-1.0, 2e-3), 0.0);
    /// ```
    #[must_use]
    pub fn voltage(&self, force_n: f64, displacement_m: f64) -> f64 {
        libm::sqrt(self.squared_voltage(force_n, displacement_m).max(0.0))
    }

    /// The voltage in V that makes the field `field_v_per_m` (V/m) in the film at `displacement_m` (m). A film with coupling
    /// [thins](Self::thinning) as it lengthens; a shortened film is not taken as thicker than l₃.
    ///
    /// ```
    /// use springpot::Actuator;
    ///
    /// let actuator = Actuator { stretch_coupling: 50.0, ..Actuator::KARNER_2022 };
    /// assert_eq!(actuator.field_voltage(4.2e7, 0.0), 4.2e7 * 160e-6);
    /// assert!((actuator.field_voltage(4.2e7, 2e-3) - 4.2e7 * 160e-6 / 1.1).abs() < 1e-9);
    /// assert_eq!(actuator.field_voltage(4.2e7, -2e-3), 4.2e7 * 160e-6);
    /// ```
    #[must_use]
    pub fn field_voltage(&self, field_v_per_m: f64, displacement_m: f64) -> f64 {
        field_v_per_m * self.thickness_m / self.thinning(displacement_m).max(1.0)
    }

    /// The load of `voltage_v` (V, either sign) in f64, the weight included: [`force`](Self::force) as a function of the
    /// displacement.
    #[must_use]
    pub fn load(&self, voltage_v: f64) -> Load<f64> {
        let electrostatic = self.electrostatic_force(voltage_v);
        Load { force_n: electrostatic + self.preload_n(), slope_n_per_m: electrostatic * self.stretch_coupling }
    }

    /// 1 + κ x: the force of a voltage at `displacement_m` (m) over that at x = 0.
    #[must_use]
    pub fn force_growth(&self, displacement_m: f64) -> f64 {
        1.0 + self.stretch_coupling * displacement_m
    }

    /// Thickness at x = 0 over that at `displacement_m` (m): 1 + t x, with t of [`thinning_per_m`](Self::thinning_per_m).
    ///
    /// ```
    /// use springpot::Actuator;
    ///
    /// // The force grows by more than the film can thin.
    /// let actuator = Actuator { stretch_coupling: 500.0, ..Actuator::KARNER_2022 };
    /// assert_eq!((actuator.force_growth(4e-3), actuator.thinning(4e-3)), (3.0, 1.3));
    /// ```
    #[must_use]
    pub fn thinning(&self, displacement_m: f64) -> f64 {
        1.0 + self.thinning_per_m() * displacement_m
    }

    /// Thinning of the film per displacement, 1/m: κ, at most 3 / l₁. A film of constant volume that is stretched to λ in both directions
    /// has λ⁻² of its thickness, so that for strokes up to its length l₁ it thins by less than 1 + 3 x / l₁. A larger κ describes the force
    /// alone.
    #[must_use]
    pub fn thinning_per_m(&self) -> f64 {
        self.stretch_coupling.min(MAX_THINNING / self.length_m)
    }

    /// Checks the values.
    ///
    /// # Errors
    ///
    /// [`ActuatorError::NotPositive`], [`ActuatorError::Mass`], [`ActuatorError::Coupling`] or [`ActuatorError::Saturation`].
    pub fn check(&self) -> Result<(), ActuatorError> {
        let values = [
            ("relative_permittivity", self.relative_permittivity),
            ("length_m", self.length_m),
            ("width_m", self.width_m),
            ("thickness_m", self.thickness_m),
        ];
        if let Some((quantity, value)) = first_not_positive(&values) {
            return Err(ActuatorError::NotPositive { quantity, value });
        }
        if !(self.mass_kg.is_finite() && self.mass_kg >= 0.0) {
            return Err(ActuatorError::Mass(self.mass_kg));
        }
        if !self.stretch_coupling.is_finite() {
            return Err(ActuatorError::Coupling(self.stretch_coupling));
        }
        // 1/V_s² must be a number as well.
        if let Some(volts) = self.saturation_v
            && !(volts.is_finite() && volts > 0.0 && self.saturation().is_finite())
        {
            return Err(ActuatorError::Saturation(volts));
        }
        Ok(())
    }
}

/// A force that depends on where the film is: `force + slope · x`.
///
/// With a positive slope the force grows as the film lengthens, as the electrostatic force does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load<T> {
    /// Force at x = 0, N.
    pub force_n: T,
    /// Change of the force with displacement, N/m; must stay below [`Law::stiffness`](crate::Law::stiffness).
    pub slope_n_per_m: T,
}

/// Eq. 1 both ways, as it runs in a step: voltage → force, force → voltage.
///
/// ```
/// use springpot::{Actuator, Law, LawOptions, Preset, VoltageDrive};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let law: Law<f32> = Law::compressed(&Preset::TABLE3_N2.model()?, LawOptions::at_step(1e-3))?;
/// let drive = VoltageDrive::new(&Actuator::KARNER_2022, 6000.0, law.stiffness())?;
///
/// let load = drive.load(3000.0);
/// assert!((drive.voltage(load.force_n, 0.0) - 3000.0).abs() < 1e-2);
///
/// // Either sign lengthens the film, voltages are clamped to the largest, and no voltage shortens the film.
/// assert_eq!(drive.load(-3000.0), load);
/// assert_eq!(drive.load(9000.0), drive.load(6000.0));
/// assert_eq!(drive.voltage(-1.0, 0.0), 0.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoltageDrive<T> {
    force_per_square_volt: T,
    coupling: T,
    /// 1/V_s², 1/V².
    saturation: T,
    preload: T,
    max_voltage: T,
}

impl<T: Real> VoltageDrive<T> {
    /// The drive of `actuator` up to `max_voltage_v` (V, either sign), for a law of the given `stiffness`
    /// ([`Law::stiffness`](crate::Law::stiffness), N/m).
    ///
    /// # Errors
    ///
    /// [`ActuatorError`] for values that are not finite and positive, and for pull-in: the coupling's pull at that voltage
    /// reaches 99 % of the stiffness of one step, so that a step has no solution. A film creeps towards far less stiffness
    /// than that of one step; a weaker coupling can still pull it in over many steps, which the run shows.
    pub fn new(actuator: &Actuator, max_voltage_v: f64, stiffness: T) -> Result<Self, ActuatorError> {
        actuator.check()?;
        if !(max_voltage_v.is_finite() && max_voltage_v > 0.0) {
            return Err(ActuatorError::NotPositive { quantity: "max_voltage_v", value: max_voltage_v });
        }
        let largest = actuator.electrostatic_force(max_voltage_v);
        if !(largest.is_finite() && T::from_f64(largest).to_f64().is_finite()) {
            return Err(ActuatorError::NotPositive { quantity: "force at max_voltage_v", value: largest });
        }
        let (pull, stiffness) = (largest * actuator.stretch_coupling, stiffness.to_f64());
        // One percent is left for rounding: the solve divides by the difference.
        if pull > 0.99 * stiffness {
            return Err(ActuatorError::PullIn { pull, stiffness });
        }
        Ok(Self {
            force_per_square_volt: T::from_f64(actuator.force_per_square_volt()),
            coupling: T::from_f64(actuator.stretch_coupling),
            saturation: T::from_f64(actuator.saturation()),
            preload: T::from_f64(actuator.preload_n()),
            max_voltage: T::from_f64(max_voltage_v),
        })
    }

    /// The load of `voltage` (V, either sign; clamped to the largest), weight included.
    #[inline]
    #[must_use]
    pub fn load(&self, voltage: T) -> Load<T> {
        let voltage = if voltage > self.max_voltage {
            self.max_voltage
        } else if voltage < -self.max_voltage {
            -self.max_voltage
        } else {
            voltage
        };
        let square = voltage * voltage;
        let electrostatic =
            self.force_per_square_volt * voltage * voltage / (T::from_f64(1.0) + square * self.saturation);
        Load { force_n: electrostatic + self.preload, slope_n_per_m: electrostatic * self.coupling }
    }

    /// The voltage (V, ≥ 0) that exerts `force` (N, weight included) on the film at `displacement` (m); 0 V for forces
    /// below that of 0 V, infinite for one at or above that at which the actuator saturates. Not clamped to the largest voltage.
    #[inline]
    #[must_use]
    pub fn voltage(&self, force: T, displacement: T) -> T {
        let electrostatic = force - self.preload;
        let thinned = self.force_per_square_volt + self.force_per_square_volt * self.coupling * displacement;
        let per_square_volt = thinned - electrostatic * self.saturation;
        if electrostatic > T::ZERO && thinned > T::ZERO {
            if per_square_volt > T::ZERO {
                (electrostatic / per_square_volt).sqrt()
            } else {
                T::from_f64(f64::INFINITY)
            }
        } else {
            T::ZERO
        }
    }

    /// Visits the constants of a conversion.
    #[doc(hidden)]
    pub fn numbers(&self, take: &mut impl Numbers<T>) {
        take.structure(
            "drive",
            "Voltage to force and back: F = force_per_square_volt V^2 / (1 + saturation V^2) (1 + coupling x) + preload.",
        );
        take.number("force_per_square_volt", self.force_per_square_volt, "N/V^2");
        take.number("coupling", self.coupling, "1/m");
        take.number("saturation", self.saturation, "1/V^2");
        take.number("preload", self.preload, "N");
        take.number("max_voltage", self.max_voltage, "V; larger ones count as this");
    }

    /// The weight's share of the force, N.
    pub(crate) fn preload(&self) -> T {
        self.preload
    }
}
