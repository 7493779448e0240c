//! Why a film cannot be sensed.

use crate::control::capacitance::CapacitanceRelation;
use crate::control::demodulation::{GAIN, products, square};
use crate::control::self_sensing_options::SelfSensingOptions;
use crate::numbers::Numbers;
use crate::scalar::Real;

/// Why a film cannot be sensed: found in two blocks in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum SelfSensingFault {
    /// The tone does not appear at the voltage monitor: the amplifier does not pass it, or is off.
    NoTone,
    /// The film conducts: more current than it may leak, as through a resistor, or more than twice the largest capacitance of its calibration.
    Shorted,
    /// The current monitor shows no tone, less than the cable alone would.
    CurrentMonitor,
    /// Less than half of the film's capacitance, or behind too much resistance: an electrode or its lead is lost.
    Electrode,
}

/// Where a film counts as faulty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Thresholds<T> {
    /// Square of the voltage's phasor.
    voltage: T,
    /// Largest sum of the current in a block.
    current: T,
    /// Squares of the current's phasor over that of the voltage: of less than the cable, and of the film at rest.
    cable: T,
    rest: T,
    /// Least and largest capacitance, F.
    capacitance: T,
    largest: T,
}

impl<T: Real> Thresholds<T> {
    pub(super) fn new(relation: &CapacitanceRelation, options: SelfSensingOptions) -> Self {
        let SelfSensingOptions { step_s, tone_v, cable_f, .. } = options;
        let n = f64::from(4 * options.periods);
        // |J| / |V| of a capacitance.
        let admittance = |capacitance_f: f64| 2.0 * capacitance_f / step_s;
        let square = |value: f64| T::from_f64(value * value);
        // Half of the cable's; a small part of the film's where the cable is not known.
        let no_current_f = if cable_f > 0.0 { 0.5 * cable_f } else { relation.rest_f / 16.0 };
        Self {
            voltage: square(0.25 * (GAIN * n / 2.0) * tone_v),
            current: T::from_f64(n * options.max_current_a),
            cable: square(admittance(no_current_f)),
            rest: square(admittance(relation.rest_f)),
            capacitance: T::from_f64(0.5 * (cable_f + relation.rest_f)),
            largest: T::from_f64(2.0 * relation.max_f),
        }
    }

    /// Visits them.
    pub(super) fn numbers(&self, take: &mut impl Numbers<T>) {
        take.number("min_voltage", self.voltage, "square of the voltage's phasor");
        take.number("max_current", self.current, "sum of a block, A");
        take.number("min_admittance", self.cable, "square of the current's phasor over that of the voltage");
        take.number("rest_admittance", self.rest, "likewise, of the film at rest");
        take.number("min_capacitance", self.capacitance, "F");
        take.number("max_capacitance", self.largest, "F");
    }

    /// |J|² / |V|² of the film at rest.
    pub(super) fn rest(&self) -> f64 {
        self.rest.to_f64()
    }

    /// The fault of a block with these phasors, of which the current's sum is `mean`; its capacitance is `capacitance` |J|² / (V × J).
    #[inline]
    pub(super) fn fault(&self, capacitance: T, voltage: [T; 2], current: [T; 2], mean: T) -> Option<SelfSensingFault> {
        let (voltage2, current2) = (square(voltage), square(current));
        let [cross, dot] = products(voltage, current);
        let capacitance = capacitance * current2;
        let has_film = capacitance > self.capacitance * cross;
        // Behind steps a resistor is half a capacitance.
        let conducts = (dot > cross || capacitance > self.largest * cross) && current2 > self.rest * voltage2;
        if voltage2 < self.voltage {
            Some(if mean > self.current { SelfSensingFault::Shorted } else { SelfSensingFault::NoTone })
        } else if current2 < self.cable * voltage2 {
            Some(SelfSensingFault::CurrentMonitor)
        } else if mean > self.current || conducts {
            Some(SelfSensingFault::Shorted)
        } else if dot > cross || !has_film {
            Some(SelfSensingFault::Electrode)
        } else {
            None
        }
    }
}
