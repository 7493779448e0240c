//! Parameter blobs that are whole but wrong: valid ones, mutated in their contents, with the checksum made right again.
//!
//! Explored: flipped bits, and values replaced by NaN, infinities, 0, the opposite, something far too large or small, a denormal, a
//! little more or less, or another field's, in benches of several calibrations, ranges and laws. Every blob that decodes is run for
//! 2000 ticks in a closed loop of single precision around a simulated amplifier that follows the blob's own calibration and a film
//! that is not the blob's model, in all modes, with random set-points; what trips is acknowledged and armed again.
//!
//! Pass, in every tick: no panic; volts at the DAC finite and within its range; the volts at the film, by the amplifier's calibration in
//! double precision at the code that the DAC gets, no higher than `max_voltage_v` and the field limit of the thinned film by more than
//! one step of the DAC; a trip ends at 0 V in the same tick; telemetry finite, but for a converter that is silent, and for
//! a model that grows without end, which must have tripped.
//!
//! Cases: 400 blobs in the sample, 100 000 in full. Bytes at random are the fuzzer's.

use std::collections::BTreeMap;

use dea_driver::chips::{Calibration, CommandRange, DacCode};
use dea_driver::{BLOB_LEN, Blob, Controller, DriverState, Inputs, Mode, OnSensorFault, Outputs, Parameters};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{Actuator, AmplifierLag, Curve, Discretisation, Law, LawOptions, Measure, Preset, Spring};

use crate::bench::{board_parameters, law_in_series};
use crate::board::sealed;
use crate::scale::cases;

const BOARD: u16 = 0x0405;
const TICKS: u32 = 2000;
/// No film moves that far, m.
const GROWN_M: f32 = 1e3;
/// Full scale of the sensors' ADCs, V.
const ADC_V: f64 = 10.24;

/// Benches whose blobs are mutated.
fn benches() -> Vec<Parameters> {
    let paper = board_parameters();
    let model = Preset::TABLE3_N1.model().expect("valid");
    let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(2e-3)).expect("valid");
    let mut slow = Parameters::bench(&law, Actuator::KARNER_2022);
    slow.limits.on_sensor_fault = OnSensorFault::OpenLoop;
    let mut bent = Parameters {
        amplifier: Calibration::Parabola { offset: 20.0, gain: 1000.0, quadratic: -15.0 },
        monitor: Calibration::Parabola { offset: -15.0, gain: 950.0, quadratic: 3.0 },
        sensor: Calibration::Parabola { offset: -1.1e-3, gain: 1.05e-3, quadratic: -2e-6 },
        ..paper.clone()
    };
    bent.limits.max_field_v_per_m = 2.5e7;
    let points = |points: &[[f32; 2]]| Calibration::points(points).expect("rising");
    let module = Parameters {
        command_range: CommandRange::FiveVolts,
        amplifier: points(&[[0.0, 0.0], [0.6, 15.0], [0.8, 160.0], [2.0, 2500.0], [5.0, 7200.0]]),
        monitor: points(&[[0.0, -5.0], [5.0, 4900.0], [10.0, 9800.0]]),
        ..paper.clone()
    };
    // Behind an elastic curve, through a drive that saturates, in the second-order discretisation.
    let options = LawOptions::at_step(1e-3).with_method(Discretisation::Bdf2);
    let stiffening = Curve::through(&[(-0.5e-3, -0.45e-3), (0.0, 0.0), (1e-3, 1.2e-3), (2e-3, 2.9e-3)]).expect("rises");
    let law = Law::compressed(&model, options).and_then(|law| law.behind(&stiffening)).expect("valid");
    let mut stiffening = Parameters::bench(&law, Actuator { saturation_v: Some(9e3), ..Actuator::KARNER_2022 });
    stiffening.actuator.stretch_coupling = -15.0;
    // Through a converter that lags, with cycles that are learned.
    stiffening.amplifier_lag = AmplifierLag { rise_s: 0.05, fall_s: 0.2 };
    stiffening.control.harmonics = 6;
    // With two curves.
    let measure = Measure { exponent: 0.0, length_m: 0.06 }.curve(-0.5e-3, 2e-3).expect("rises");
    let law = Law::compressed(&model, LawOptions::at_step(1e-3));
    let law = law.and_then(|law| law.beside(&Spring::linear(9e3).expect("valid"), &measure)).expect("valid");
    let beside = Parameters::bench(&law, Actuator::KARNER_2022);
    let in_series = Parameters { law: law_in_series::<f32>().coefficients(), ..paper.clone() };
    vec![paper, slow, bent, module, stiffening, beside, in_series]
}

/// The blob of `contents` as doc/blob.md describes it.
fn framed(contents: &[u8]) -> Vec<u8> {
    let mut bytes = b"DEA\x01\x04\x00".to_vec();
    bytes.extend(BOARD.to_le_bytes());
    bytes.extend(u16::try_from(contents.len()).expect("short").to_le_bytes());
    bytes.extend(contents);
    sealed(&bytes)
}

fn calibration(calibration: &mut Calibration) -> Vec<&mut f32> {
    match calibration {
        Calibration::Parabola { offset, gain, quadratic } => vec![offset, gain, quadratic],
        Calibration::Points(points) => points.iter_mut().flatten().collect(),
    }
}

/// Every number of single precision in a blob, those of the law at the end.
fn singles(p: &mut Parameters) -> Vec<&mut f32> {
    let (limits, control) = (&mut p.limits, &mut p.control);
    let (monitor, sensor) = (&mut limits.monitor, &mut limits.sensor);
    let mut fields = vec![
        &mut p.rate_hz,
        &mut p.sensor_offset_m,
        &mut limits.max_voltage_v,
        &mut limits.max_field_v_per_m,
        &mut limits.thickness_m,
        &mut limits.max_slew_v_per_s,
        &mut limits.max_displacement_m,
        &mut limits.max_disturbance_share,
        &mut limits.heartbeat_s,
        &mut limits.discharge_s,
        &mut monitor.slew_v_per_s,
        &mut monitor.band_v,
        &mut monitor.band_share,
        &mut monitor.settle_s,
        &mut sensor.low,
        &mut sensor.high,
        &mut sensor.jump,
        &mut sensor.stuck_band,
        &mut control.max_velocity_m_per_s,
        &mut control.max_acceleration_m_per_s2,
        &mut control.return_hz,
        &mut control.bandwidth_hz,
        &mut control.sample_interval_s,
        &mut control.delay_s,
        &mut control.lost_after_s,
        &mut control.adaptation_s,
    ];
    for instrument in [&mut p.amplifier, &mut p.monitor, &mut p.sensor] {
        fields.extend(calibration(instrument));
    }
    fields.extend(p.law.curve.iter_mut().flat_map(|knot| [&mut knot.displacement, &mut knot.value, &mut knot.slope]));
    fields.extend(p.law.head.iter_mut());
    fields.extend(p.law.fast.iter_mut().chain(&mut p.law.slow).flat_map(|(loss, weight)| [loss, weight]));
    fields
}

/// Every number of double precision.
fn doubles(p: &mut Parameters) -> Vec<&mut f64> {
    let actuator = &mut p.actuator;
    let mut fields = vec![
        &mut p.law.instant,
        &mut p.law.tail_error,
        &mut actuator.relative_permittivity,
        &mut actuator.length_m,
        &mut actuator.width_m,
        &mut actuator.thickness_m,
        &mut actuator.mass_kg,
        &mut actuator.stretch_coupling,
    ];
    fields.extend(&mut actuator.saturation_v);
    fields
}

fn mutated(value: f64, other: f64, random: &mut Pcg64) -> f64 {
    match random.random_range(0..16) {
        0 => f64::NAN,
        1 => f64::INFINITY,
        2 => f64::NEG_INFINITY,
        3 => 0.0,
        4 => -value,
        5 => 1e-41,
        6 => 1e37,
        7 => value * 1e3,
        8 => value * 1e-3,
        9 => other,
        10 => value * 10f64.powf(random.random_range(-12.0..12.0)),
        11..=13 => value * random.random_range(0.5..2.0),
        _ => value * random.random_range(0.97..1.03),
    }
}

/// The contents of a blob with one to four mutations.
fn contents(base: &Parameters, random: &mut Pcg64) -> Vec<u8> {
    let mut parameters = base.clone();
    let flips = random.random_bool(0.4);
    for _ in 0..if flips { 0 } else { random.random_range(1..=4) } {
        if random.random_bool(0.25) {
            let mut fields = doubles(&mut parameters);
            let other = *fields[random.random_range(0..fields.len())];
            let index = random.random_range(0..fields.len());
            *fields[index] = mutated(*fields[index], other, random);
        } else {
            let mut fields = singles(&mut parameters);
            // Most of the numbers are the law's.
            let end = if random.random_bool(0.7) { fields.len() - 84 } else { fields.len() };
            let other = f64::from(*fields[random.random_range(0..end)]);
            let index = random.random_range(0..end);
            *fields[index] = mutated(f64::from(*fields[index]), other, random) as f32;
        }
    }
    if !flips && random.random_bool(0.1) {
        parameters.limits.sensor.stuck_ticks = random.random();
    }
    let mut contents = postcard::to_slice(&parameters, &mut [0; BLOB_LEN]).expect("fits").to_vec();
    for _ in 0..if flips { random.random_range(1..=4) } else { 0 } {
        let bit = random.random_range(0..8 * contents.len());
        contents[bit / 8] ^= 1 << (bit % 8);
    }
    contents
}

/// The quantity at `volts` in double precision.
fn apply(calibration: &Calibration, volts: f64) -> f64 {
    match calibration {
        &Calibration::Parabola { offset, gain, quadratic } => {
            f64::from(offset) + volts * (f64::from(gain) + volts * f64::from(quadratic))
        }
        Calibration::Points(points) => {
            let point = |index: usize| points[index].map(f64::from);
            match points.iter().position(|point| f64::from(point[0]) > volts) {
                Some(0) => point(0)[1],
                None => point(points.len() - 1)[1],
                Some(index) => {
                    let ([u0, y0], [u1, y1]) = (point(index - 1), point(index));
                    y0 + (volts - u0) / (u1 - u0) * (y1 - y0)
                }
            }
        }
    }
}

/// The volts of a rising calibration at `value`, within its ADC's range.
fn invert(calibration: &Calibration, value: f64) -> f64 {
    let (mut low, mut high) = (0.0, ADC_V * 65_535.0 / 65_536.0);
    // To a count of 16 bits.
    for _ in 0..17 {
        let middle = 0.5 * (low + high);
        if apply(calibration, middle) < value {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

#[derive(Debug, Default)]
struct Counts {
    blobs: u64,
    decoded: u64,
    refused: BTreeMap<String, u64>,
    ticks: u64,
    running: u64,
    trips: BTreeMap<String, u64>,
    highest_share: f64,
    /// Blobs whose model grew without end.
    grown: u64,
}

struct Loop {
    controller: Controller,
    parameters: Parameters,
    film_v: f64,
    film_m: f64,
    lag: f64,
    m_per_v2: f64,
    random: Pcg64,
    /// Whether the model has ever been farther away than any film is long.
    grown: bool,
}

impl Loop {
    fn new(blob: Blob, seed: u64) -> Self {
        let parameters = blob.parameters().clone();
        let mut random = Pcg64::seed_from_u64(seed);
        let most_v = f64::from(parameters.limits.max_voltage_v);
        // A film of a first order, stiffer or softer than any model.
        let most_m = 0.6 * f64::from(parameters.limits.max_displacement_m) * random.random_range(0.1..1.0);
        let lag = 1.0 - (-1.0 / (0.1 * f64::from(parameters.rate_hz))).exp();
        Self {
            controller: Controller::new(blob),
            film_v: 0.0,
            film_m: 0.0,
            lag,
            m_per_v2: most_m / (most_v * most_v),
            random,
            grown: false,
            parameters,
        }
    }

    fn ask(&mut self) {
        self.controller.heartbeat();
        let limits = self.parameters.limits;
        match self.controller.supervisor().state() {
            DriverState::Tripped(_) => drop(self.controller.acknowledge()),
            DriverState::Disarmed => drop(self.controller.arm()),
            DriverState::Armed => {
                let mode = [Mode::Voltage, Mode::Feedforward, Mode::Tracking][self.random.random_range(0..3)];
                self.controller.start(mode).expect("armed");
            }
            DriverState::Running if self.random.random_bool(0.04) => self.controller.stop().expect("running"),
            DriverState::Running => {
                // Also beyond the limits, which is refused.
                let share: f32 = self.random.random_range(-0.1..1.2);
                let _ = self.controller.set_voltage(share * limits.max_voltage_v);
                let _ = self.controller.set_reference(share * 0.5 * limits.max_displacement_m);
            }
        }
    }

    fn inputs(&mut self) -> Inputs {
        let count = ADC_V / 65_536.0;
        let monitor_v = invert(&self.parameters.monitor, self.film_v);
        let noise_v = self.random.random_range(0.0..2.0) * count;
        let sensor_v =
            invert(&self.parameters.sensor, self.film_m + f64::from(self.parameters.sensor_offset_m)) + noise_v;
        let mut shown =
            |volts: f64| (!self.random.random_bool(2e-4)).then_some(((volts / count).round() * count) as f32);
        Inputs { interlock_closed: true, monitor_adc_v: shown(monitor_v), sensor_adc_v: shown(sensor_v) }
    }

    fn run(&mut self, counts: &mut Counts) {
        for tick in 0..TICKS {
            if tick % 16 == 1 {
                self.ask();
            }
            let inputs = self.inputs();
            let before = self.controller.supervisor().state();
            let outputs = self.controller.tick(inputs);
            let after = self.controller.supervisor().state();
            self.check(&inputs, &outputs, after, counts);
            counts.running += u64::from(after == DriverState::Running);
            if let DriverState::Tripped(cause) = after
                && before != after
            {
                *counts.trips.entry(format!("{cause:?}")).or_default() += 1;
            }
        }
        counts.ticks += u64::from(TICKS);
        counts.grown += u64::from(self.grown);
    }

    fn check(&mut self, inputs: &Inputs, outputs: &Outputs, state: DriverState, counts: &mut Counts) {
        let range = self.parameters.command_range;
        let dac_v = outputs.dac_v;
        assert!((0.0..=range.full_scale_v()).contains(&dac_v), "{dac_v} V at the DAC, {state:?}");
        assert_eq!(outputs.enable, state.is_live());
        if state != DriverState::Running {
            assert_eq!(outputs.telemetry.command_v, 0.0, "{state:?}");
        }
        self.check_telemetry(inputs, outputs, state);
        if !outputs.enable {
            assert_eq!(dac_v, 0.0, "{state:?}");
            return self.film_moves(0.0);
        }
        let code = DacCode::from_volts(dac_v, range);
        let at = |code: u16| apply(&self.parameters.amplifier, f64::from(DacCode(code).volts(range)));
        let film_v = at(code.0);
        let step_v = film_v - at(code.0.saturating_sub(1));
        let limits = &self.parameters.limits;
        let furthest_m = f64::from(outputs.telemetry.predicted_m).max(0.0);
        let thinning = 1.0 + furthest_m / self.parameters.actuator.length_m;
        let by_field = f64::from(limits.max_field_v_per_m) * f64::from(limits.thickness_m) / thinning;
        let most_v = by_field.min(f64::from(limits.max_voltage_v));
        // At code 0 the amplifier shows its offset, which no command lowers.
        if code.0 > 0 {
            counts.highest_share = counts.highest_share.max((film_v - step_v) / most_v);
            assert!(film_v <= most_v * (1.0 + 1e-5) + step_v, "{film_v} V, at most {most_v} V, a step of {step_v} V");
        }
        self.film_moves(film_v);
    }

    fn film_moves(&mut self, volts: f64) {
        self.film_v = volts;
        self.film_m += self.lag * (self.m_per_v2 * volts * volts - self.film_m);
    }

    /// The model is finite. The law of a mutated blob may grow without end; one that is not finite has tripped.
    fn check_telemetry(&mut self, inputs: &Inputs, outputs: &Outputs, state: DriverState) {
        let telemetry = &outputs.telemetry;
        assert_eq!(telemetry.monitor_v.is_nan(), inputs.monitor_adc_v.is_none());
        assert_eq!(telemetry.displacement_m.is_nan(), inputs.sensor_adc_v.is_none());
        let of_model = [
            telemetry.command_v,
            telemetry.predicted_m,
            telemetry.reference_m,
            telemetry.disturbance_n,
            telemetry.force_scale,
            telemetry.innovation_m,
        ];
        let far = telemetry.predicted_m.is_nan() || telemetry.predicted_m.abs() > GROWN_M;
        self.grown |= far;
        assert!(self.grown || of_model.iter().all(|value| value.is_finite()), "{state:?}: {telemetry:?}");
        let trips = telemetry.predicted_m.is_finite() || matches!(state, DriverState::Tripped(_));
        assert!(trips, "{state:?}: {telemetry:?}");
    }
}

#[test]
fn no_blob_breaks_the_limits() {
    let benches = benches();
    let mut random = Pcg64::seed_from_u64(11);
    let mut counts = Counts::default();
    let mut failed = Vec::new();
    for seed in 0..cases(400, 100_000) {
        let base = &benches[random.random_range(0..benches.len())];
        let contents = contents(base, &mut random);
        counts.blobs += 1;
        match Blob::decode(&framed(&contents), BOARD) {
            Ok(blob) => {
                counts.decoded += 1;
                let parameters = blob.parameters().clone();
                // Goes on, so that one run finds all.
                let ran = std::panic::catch_unwind(core::panic::AssertUnwindSafe(|| {
                    Loop::new(blob, seed).run(&mut counts);
                }));
                if ran.is_err() {
                    println!("blob {seed}: {parameters:#?}");
                    failed.push(seed);
                }
            }
            Err(error) => {
                let name = format!("{error:?}");
                let name = name.split(['(', ' ']).next().unwrap_or_default().to_owned();
                *counts.refused.entry(name).or_default() += 1;
            }
        }
    }
    let refused: u64 = counts.refused.values().sum();
    println!("blobs: {refused} refused, {counts:?}");
    assert!(failed.is_empty(), "blobs {failed:?}");
    assert!(counts.decoded > counts.blobs / 20 && counts.running > counts.ticks / 10);
    assert!(refused > counts.blobs / 10);
}
