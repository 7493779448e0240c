//! Self-sensing: the film's displacement from its capacitance.

use crate::control::capacitance::{CapacitanceRelation, CreepCoefficients, Relation, RelationState};
use crate::control::demodulation::{Demodulator, GAIN, products, square};
use crate::control::observer::SensorSample;
use crate::control::path::is_finite;
use crate::control::self_sensing_fault::{SelfSensingFault, Thresholds};
use crate::control::self_sensing_options::SelfSensingOptions;
use crate::error::SelfSensingError;
use crate::numbers::Numbers;
use crate::scalar::Real;

/// Readings of the amplifier's monitors in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmReading<T> {
    /// Voltage at the end of the tick, V.
    pub voltage_v: T,
    /// Mean current into cable and film from the end of the last tick to that of this one, A: the charge over the time of a tick.
    pub current_a: T,
}

/// A result of [`SelfSensing`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelfSensed<T> {
    /// The displacement, as a sensor's.
    pub sample: SensorSample<T>,
    /// Its variance, m².
    pub variance_m2: T,
    /// Capacitance of film and cable, F.
    pub capacitance_f: T,
    /// Apparent series resistance, Ω: that of electrodes and leads for a sinusoidal tone; less for the steps of a fast amplifier, whose
    /// current has fallen by the end of a tick.
    pub resistance_ohm: T,
}

impl<T: Real> SelfSensed<T> {
    /// Standard deviation of the displacement, m.
    #[must_use]
    pub fn uncertainty_m(&self) -> T {
        self.variance_m2.sqrt()
    }
}

/// The film as its own displacement sensor: a tone on the drive, its current, the capacitance, the displacement.
///
/// In every tick: [`sense`](Self::sense) takes the readings of the last one and returns a [`SelfSensed`] with the tick after each block; then
/// [`drive`](Self::drive) adds the tone to the voltage of the next tick.
///
/// # Exactly
///
/// With V and I the phasors of the tone, demodulated over a block, and h a tick: the mean current of a tick is the change of the charge
/// over h, and of the charge's phasor (1 + i) / h. So (1 + i) I is proportional to the current at the end of the tick, and
///
/// ```text
/// Z = V / (π (1 + i) I / 4) = R + 1 / (i ω C),    ω = π / 2 h,    C = −1 / (ω Im Z),    R = Re Z
/// ```
///
/// For C this holds for a sine, and for any waveform with no current through R at the ends of the ticks. Steps through an amplifier with a
/// lag of a fifth of a tick make an error of some 2 % of R ω C, a lag of a tick 30 %: constant, and so a part of the calibration.
///
/// The tone of the drive is the same in every block, so V is a mean over the last blocks: noise of the voltage monitor, large beside a tone of a
/// hundredth of its range, hardly matters. A block whose voltage differs from that mean by more than its noise, as one with
/// a jump of the drive, gives no sample; the mean begins anew with the fourth in a row.
///
/// No plane is fitted to charge, voltage and current. The cable is parallel to the film and its part of C; the
/// [`CapacitanceRelation`] is calibrated with it.
///
/// Readings of the current must be means over a tick, by oversampling or an integrator: the current of an amplifier that is faster than
/// the tick is a peak at its begin, which a single conversion misses.
///
/// # A second sensor
///
/// [`correct`](Self::correct) takes its samples. Self-sensing is precise from block to block and drifts with its relation, so the difference
/// to the other sensor is estimated (a Kalman filter of one state) and added. It stays when that sensor is lost, and its variance returns
/// to that of the relation within `drift_s`.
///
/// ```
/// use springpot::{CapacitanceRelation, FilmReading, SelfSensing, SelfSensingOptions};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let relation = CapacitanceRelation::of_geometry(700e-12, 0.06, 2.0, 900e-12);
/// let sensing = SelfSensing::<f32>::new(&relation, SelfSensingOptions::BENCH)?;
/// let mut state = sensing.state();
/// // An ideal capacitor of 800 pF instead of film, cable and amplifier.
/// let (mut before_v, mut sensed) = (0.0, None);
/// let mut reading = FilmReading { voltage_v: 0.0, current_a: 0.0 };
/// for _ in 0..100 {
///     sensed = sensing.sense(&mut state, reading).or(sensed);
///     let voltage_v = sensing.drive(&state, 3000.0);
///     reading = FilmReading { voltage_v, current_a: 800e-12 * (voltage_v - before_v) / 1e-3 };
///     before_v = voltage_v;
/// }
/// let sensed = sensed.ok_or("no block has ended")?;
/// assert!((sensed.capacitance_f - 800e-12).abs() < 1e-15);
/// let stretch = f32::sqrt(800.0 / 700.0);
/// assert!((sensed.sample.displacement_m - 0.06 * (stretch - 1.0)).abs() < 20e-6);
/// assert_eq!(sensed.sample.age_ticks, 14);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SelfSensing<T> {
    relation: Relation<T>,
    tone: T,
    /// Ticks of a block, and the age of its sample.
    ticks: u16,
    age: u16,
    /// Factors of |J|² / (V × J) for the capacitance, and of (V · J) / |J|² for the resistance.
    capacitance: T,
    resistance: T,
    /// Variances of the phasors of a block by noise, relative ones once divided by their squares.
    voltage_noise: T,
    current_noise: T,
    thresholds: Thresholds<T>,
    /// Variance of the relation, m², and the share of it that returns in a block.
    variance: T,
    drift: T,
}

/// Blocks whose estimates are kept, for samples of another sensor that arrive later.
const PAST: usize = 8;
/// Blocks at the start that are not used: those in which the filter fills.
const SETTLING: u8 = 1;
/// Blocks over which the tone's voltage is averaged.
const AVERAGED: f64 = 64.0;
/// Square of its distance from that mean above which it is another tone, in variances: noise alone is there once in millions of blocks.
const ANOTHER: f64 = 32.0;
/// Blocks with another tone that give no sample, as does the block after them: a jump of the drive reaches into two. What lasts longer is the tone.
const OTHERS: u8 = 3;
/// Faulty blocks in a row that are a fault.
const FAULTY: u8 = 2;

/// State of [`SelfSensing`]: changes with every tick.
#[derive(Clone, Debug, PartialEq)]
pub struct SelfSensingState<T: Real> {
    relation: RelationState<T>,
    voltage: Demodulator<T>,
    current: Demodulator<T>,
    /// Sum of the current in this block.
    current_sum: T,
    /// Tick of the block.
    tick: u16,
    settling: u8,
    faulty: u8,
    fault: Option<SelfSensingFault>,
    /// Whether the last block gave a sample; capacitance (F), resistance (Ω) and relative variance of the last one that did.
    is_good: bool,
    /// Mean of the voltage's phasor, and the weight of the last block in it.
    tone: [T; 2],
    weight: T,
    /// Blocks in a row with another tone.
    others: u8,
    capacitance: T,
    resistance: T,
    relative: T,
    drive: T,
    /// Estimates without the offset, newest at `newest`.
    past: [T; PAST],
    newest: usize,
    /// The displacement by another sensor minus the estimate, m, its variance, and the sample that the next estimate is compared with.
    offset: T,
    variance: T,
    pending: Option<Pending<T>>,
}

/// A sample of another sensor that waits for an estimate of its time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pending<T> {
    displacement: T,
    variance: T,
    /// Its age once the next estimate is made, ticks.
    age: usize,
}

impl<T: Real> SelfSensing<T> {
    /// Self-sensing of a film of this `relation`, with these `options`.
    ///
    /// # Errors
    ///
    /// [`SelfSensingError`] for values that are not finite and positive, a relation that does not rise, periods that are not 2 to 64, a cable with
    /// more capacitance than film and cable, and a springpot whose memory has too few modes.
    pub fn new(relation: &CapacitanceRelation, options: SelfSensingOptions) -> Result<Self, SelfSensingError> {
        options.check()?;
        Self::from_relation(Relation::new(relation, options.sample_interval_s())?, relation, options)
    }

    /// The same with the springpot of the relation as numbers from a host ([`creep`](Self::creep)): building it takes a controller as long
    /// as building a law.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new), and for numbers that no springpot has.
    pub fn with_creep(
        relation: &CapacitanceRelation,
        options: SelfSensingOptions,
        creep: &CreepCoefficients<T>,
    ) -> Result<Self, SelfSensingError> {
        options.check()?;
        Self::from_relation(Relation::with_creep(relation, options.sample_interval_s(), creep)?, relation, options)
    }

    fn from_relation(
        running: Relation<T>,
        relation: &CapacitanceRelation,
        options: SelfSensingOptions,
    ) -> Result<Self, SelfSensingError> {
        let SelfSensingOptions { step_s, tone_v, cable_f, .. } = options;
        if !(cable_f >= 0.0 && cable_f < relation.rest_f) {
            return Err(SelfSensingError::Cable { cable_f, rest_f: relation.rest_f });
        }
        let ticks = 4 * options.periods;
        let n = f64::from(ticks);
        // Of noise in each part of the phasor.
        let noise = GAIN * GAIN * n / 2.0;
        Ok(Self {
            relation: running,
            tone: T::from_f64(tone_v),
            ticks,
            age: 2 * options.periods + 4,
            capacitance: T::from_f64(0.5 * step_s),
            resistance: T::from_f64(core::f64::consts::FRAC_2_PI * 2.0),
            voltage_noise: T::from_f64(noise * options.voltage_noise_v * options.voltage_noise_v),
            current_noise: T::from_f64(2.0 * noise * options.current_noise_a * options.current_noise_a),
            thresholds: Thresholds::new(relation, options),
            variance: T::from_f64(relation.uncertainty_m * relation.uncertainty_m),
            drift: T::from_f64(1.0 - libm::exp(-2.0 * options.sample_interval_s() / options.drift_s)),
        })
    }

    /// The springpot of the relation as numbers, for [`with_creep`](Self::with_creep).
    #[must_use]
    pub fn creep(&self) -> CreepCoefficients<T> {
        self.relation.creep()
    }

    /// Visits the constants of a tick.
    #[doc(hidden)]
    pub fn numbers(&self, take: &mut impl Numbers<T>) {
        take.structure(
            "self_sensing",
            "The film as its own sensor. J is the phasor of the current, V that of the voltage.",
        );
        take.count("ticks", self.ticks.into(), "of a block");
        take.count("age", self.age.into(), "of its sample, ticks");
        take.number("tone", self.tone, "amplitude, V");
        take.number("capacitance", self.capacitance, "factor of |J|^2 / (V x J)");
        take.number("resistance", self.resistance, "factor of (V . J) / |J|^2");
        take.number("voltage_noise", self.voltage_noise, "variance of V in a block");
        take.number("current_noise", self.current_noise, "of J");
        take.number("variance", self.variance, "of the relation, m^2");
        take.number("drift", self.drift, "share of it that returns in a block");
        take.number("least_weight", T::from_f64(1.0 / AVERAGED), "of a block in the mean of V");
        take.number(
            "another",
            T::from_f64(ANOTHER),
            "square of the distance of another tone from that mean, in variances",
        );
        take.count("others", OTHERS.into(), "blocks with another tone that give no sample");
        take.count("settling", SETTLING.into(), "blocks at the start that are not used");
        take.count("faulty", FAULTY.into(), "blocks in a row that are a fault");
        self.thresholds.numbers(take);
        self.relation.numbers(take);
    }

    /// Standard deviation (m) that the noise of the monitors causes in the mean displacement of this number of `blocks`, for a film at rest
    /// and a tone of `tone_v` (V) behind the amplifier. It shows whether monitors suffice.
    #[must_use]
    pub fn noise_m(&self, tone_v: f64, blocks: f64) -> f64 {
        let phasor = GAIN * f64::from(self.ticks) / 2.0 * tone_v;
        let current = self.current_noise.to_f64() / (blocks * self.thresholds.rest());
        let voltage = self.voltage_noise.to_f64() / (2.0 * AVERAGED - 1.0);
        libm::sqrt(current + voltage) / phasor * self.relation.slope_at_rest()
    }

    /// A state of a film that has rested at x = 0, at the first tick of the tone.
    #[must_use]
    pub fn state(&self) -> SelfSensingState<T> {
        SelfSensingState {
            relation: self.relation.state(),
            voltage: Demodulator::AT_REST,
            current: Demodulator::AT_REST,
            current_sum: T::ZERO,
            tick: 0,
            settling: SETTLING,
            faulty: 0,
            fault: None,
            is_good: false,
            tone: [T::ZERO; 2],
            weight: T::from_f64(1.0),
            others: OTHERS,
            capacitance: self.relation.rest(),
            resistance: T::ZERO,
            relative: T::ZERO,
            drive: T::ZERO,
            past: [T::ZERO; PAST],
            newest: 0,
            offset: T::ZERO,
            variance: self.variance,
            pending: None,
        }
    }

    /// The voltage of this tick with the tone, V. Below the tone's amplitude the drive is that amplitude: the voltage never reaches below 0 V.
    /// At most it is one amplitude above `voltage` (V).
    #[inline]
    #[must_use]
    pub fn drive(&self, state: &SelfSensingState<T>, voltage: T) -> T {
        let voltage = if voltage > self.tone { voltage } else { self.tone };
        match state.tick & 3 {
            1 => voltage + self.tone,
            3 => voltage - self.tone,
            _ => voltage,
        }
    }

    /// Takes the `reading` of the tick that has ended. Returns the displacement with the tick after each block, unless that was faulty.
    ///
    /// A non-finite reading counts as the one before.
    #[inline]
    pub fn sense(&self, state: &mut SelfSensingState<T>, reading: FilmReading<T>) -> Option<SelfSensed<T>> {
        let FilmReading { voltage_v, current_a } = reading;
        let voltage = if is_finite(voltage_v) { voltage_v } else { state.voltage.last() };
        let current = if is_finite(current_a) { current_a } else { state.current.last() };
        state.drive = state.voltage.advance(voltage);
        state.current.advance(current);
        state.current_sum = state.current_sum + current;
        let tick = state.tick + 1;
        if tick >= self.ticks {
            state.tick = 0;
            self.end_block(state);
            return None;
        }
        state.tick = tick;
        if tick == 1 { self.estimate(state) } else { None }
    }

    /// The impedance of a block, and its faults.
    #[inline(never)] // a tick within a block does not pay for it
    fn end_block(&self, state: &mut SelfSensingState<T>) {
        let is_settled = state.settling == 0;
        state.settling = state.settling.saturating_sub(1);
        let voltage = state.voltage.take();
        let [re, im] = state.current.take();
        let current = [re - im, re + im];
        let mean = core::mem::replace(&mut state.current_sum, T::ZERO).abs();
        if !is_settled {
            return;
        }
        let fault = self.thresholds.fault(self.capacitance, voltage, current, mean);
        state.faulty = if fault.is_some() { state.faulty.saturating_add(1) } else { 0 };
        if state.faulty >= FAULTY && state.fault.is_none() {
            state.fault = fault;
        }
        state.is_good = fault.is_none() && self.is_tone(state, voltage);
        if state.is_good {
            let [cross, dot] = products(state.tone, current);
            let (voltage2, current2) = (square(state.tone), square(current));
            state.capacitance = self.capacitance * current2 / cross;
            state.resistance = self.resistance * dot / current2;
            let left = state.weight / (T::from_f64(2.0) - state.weight);
            state.relative = self.current_noise / current2 + left * self.voltage_noise / voltage2;
        }
    }

    /// Compares the voltage of a block with the tone of those before, whose mean follows it; true if it is that.
    #[inline]
    fn is_tone(&self, state: &mut SelfSensingState<T>, [re, im]: [T; 2]) -> bool {
        let one = T::from_f64(1.0);
        let off = [re - state.tone[0], im - state.tone[1]];
        let is_another = square(off) > T::from_f64(ANOTHER) * self.voltage_noise;
        if is_another && state.others < OTHERS {
            state.others += 1;
            return false;
        }
        // The current's filter reaches a tick further than the voltage's.
        let follows = state.others > 0 && !is_another;
        state.others = 0;
        let (least, next) = (T::from_f64(1.0 / AVERAGED), state.weight / (one + state.weight));
        let next = if next > least { next } else { least };
        state.weight = if is_another { one } else { next };
        state.tone = [state.tone[0] + state.weight * off[0], state.tone[1] + state.weight * off[1]];
        !follows
    }

    /// The displacement of the last block. After a faulty one the relation creeps on with the last capacitance.
    #[inline(never)] // as above
    fn estimate(&self, state: &mut SelfSensingState<T>) -> Option<SelfSensed<T>> {
        let (displacement, slope) = self.relation.displacement(&mut state.relation, state.capacitance);
        state.remember(displacement);
        state.variance = state.variance + self.drift * (self.variance - state.variance);
        let noise = slope * slope * state.relative;
        if let Some(pending) = state.pending.take() {
            state.compare(pending, noise, self.ticks, self.age);
        }
        state.is_good.then(|| SelfSensed {
            sample: SensorSample { displacement_m: displacement + state.offset, age_ticks: usize::from(self.age) },
            variance_m2: state.variance + noise,
            capacitance_f: state.capacitance,
            resistance_ohm: state.resistance,
        })
    }

    /// Takes a `sample` of another sensor, of this variance (m²): the next estimate is compared with it. While one waits, others are ignored.
    pub fn correct(&self, state: &mut SelfSensingState<T>, sample: SensorSample<T>, variance_m2: T) {
        let is_usable = is_finite(sample.displacement_m) && is_finite(variance_m2) && variance_m2 > T::ZERO;
        if is_usable && state.pending.is_none() {
            // Ticks until the next estimate, which is made at tick 1 of a block.
            let to_come = if state.tick == 0 { 1 } else { self.ticks + 1 - state.tick };
            let age = sample.age_ticks.saturating_add(usize::from(to_come));
            state.pending = Some(Pending { displacement: sample.displacement_m, variance: variance_m2, age });
        }
    }
}

impl<T: Real> SelfSensingState<T> {
    #[inline]
    fn remember(&mut self, displacement: T) {
        self.newest = if self.newest == 0 { PAST - 1 } else { self.newest - 1 };
        if let Some(slot) = self.past.get_mut(self.newest) {
            *slot = displacement;
        }
    }

    /// Corrects the offset with `other`, from between two of the kept estimates, which are `ticks` apart, the newest `age` ticks old.
    fn compare(&mut self, other: Pending<T>, noise: T, ticks: u16, age: u16) {
        let Some(since) = other.age.checked_sub(usize::from(age)) else {
            // Younger than the newest estimate: the next will do.
            self.pending = Some(Pending { age: other.age.saturating_add(usize::from(ticks)), ..other });
            return;
        };
        let (Some(blocks), Some(rest)) = (since.checked_div(ticks.into()), since.checked_rem(ticks.into())) else {
            return;
        };
        let place = |blocks: usize| self.past.get((self.newest + blocks) % PAST).copied().unwrap_or(T::ZERO);
        if blocks + 1 >= PAST || !self.is_good {
            return;
        }
        #[allow(clippy::cast_possible_truncation)] // less than a block
        let part = T::from_f64(f64::from(rest as u16)) / T::from_f64(f64::from(ticks));
        let (later, earlier) = (place(blocks), place(blocks + 1));
        let estimate = later + part * (earlier - later);
        let gain = self.variance / (self.variance + other.variance + noise);
        self.offset = self.offset + gain * (other.displacement - estimate - self.offset);
        self.variance = self.variance - gain * self.variance;
    }

    /// The fault for which the film cannot be sensed; it stays until a new state. End at 0 V.
    #[must_use]
    #[inline]
    pub fn fault(&self) -> Option<SelfSensingFault> {
        self.fault
    }

    /// The voltage without the tone half a period ago, V, with which a model of the film is stepped.
    #[must_use]
    #[inline]
    pub fn drive_v(&self) -> T {
        self.drive
    }

    /// The displacement by another sensor minus that by the capacitance, m.
    #[must_use]
    pub fn offset_m(&self) -> T {
        self.offset
    }
}
