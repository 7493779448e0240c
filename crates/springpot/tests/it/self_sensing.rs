//! Self-sensing, against circuits that are integrated here and impedances in closed form.

use core::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{
    CapacitanceRelation, Complex, FilmReading, Maxwell, SelfSensed, SelfSensing, SelfSensingError, SelfSensingFault,
    SelfSensingOptions, SelfSensingState, SensorSample, Springpot, Topology,
};

use crate::support::full_memory::FullMemory;

const OPTIONS: SelfSensingOptions = SelfSensingOptions::BENCH;
const STEP_S: f64 = OPTIONS.step_s;
/// Parts of a tick in which circuits are integrated.
const PARTS: f64 = 400.0;

fn relation() -> CapacitanceRelation {
    CapacitanceRelation::of_geometry(700e-12, 0.06, 2.0, 900e-12)
}

/// A film behind the resistance of its electrodes, with a leak, beside a cable, on an amplifier with a lag.
#[derive(Clone, Copy)]
struct Circuit {
    film_f: f64,
    electrodes_ohm: f64,
    leak_ohm: f64,
    cable_f: f64,
    lag_s: f64,
    amplifier_v: f64,
    film_v: f64,
}

impl Circuit {
    fn new(film_f: f64, electrodes_ohm: f64) -> Self {
        Self { film_f, electrodes_ohm, leak_ohm: 5e9, cable_f: 100e-12, lag_s: 2e-4, amplifier_v: 0.0, film_v: 0.0 }
    }

    /// A tick of the commanded voltage, which follows its steps through a lag.
    fn tick(&mut self, commanded_v: f64) -> FilmReading<f64> {
        let lag = -(-STEP_S / PARTS / self.lag_s).exp_m1();
        self.tick_of(|_, before_v| before_v + lag * (commanded_v - before_v))
    }

    /// A tick under the amplifier's voltage: of the part of the tick and the voltage before it.
    fn tick_of(&mut self, voltage: impl Fn(f64, f64) -> f64) -> FilmReading<f64> {
        let part_s = STEP_S / PARTS;
        let mut charge = 0.0;
        for part in 1..=PARTS as u32 {
            let before_v = self.amplifier_v;
            self.amplifier_v = voltage(f64::from(part) / PARTS, before_v);
            // The film by the trapezoidal rule.
            let (conductance, leak) = (1.0 / self.electrodes_ohm, 1.0 / self.leak_ohm);
            let (storage, loss) = (self.film_f / part_s, 0.5 * (conductance + leak));
            let driven = 0.5 * conductance * (before_v + self.amplifier_v);
            let film_v = ((storage - loss) * self.film_v + driven) / (storage + loss);
            let middle_v = 0.5 * (film_v + self.film_v);
            let current = conductance * (0.5 * (before_v + self.amplifier_v) - middle_v);
            self.film_v = film_v;
            charge += current * part_s + self.cable_f * (self.amplifier_v - before_v);
        }
        FilmReading { voltage_v: self.amplifier_v, current_a: charge / STEP_S }
    }

    /// The series capacitance and resistance that it has at the frequency of the tone.
    fn at_tone(&self) -> (f64, f64) {
        let omega = TAU / (4.0 * STEP_S);
        let film = (Complex::new(1.0 / self.leak_ohm, omega * self.film_f)).inv() + self.electrodes_ohm;
        let impedance = (film.inv() + Complex::new(0.0, omega * self.cable_f)).inv();
        (-1.0 / (omega * impedance.im), impedance.re)
    }
}

/// Runs `sensing` for so many `ticks` at the `bias` (V, of a time in s), each reading passing `distort`; returns what it senses.
fn run(
    sensing: &SelfSensing<f32>,
    state: &mut SelfSensingState<f32>,
    circuit: &mut Circuit,
    ticks: u32,
    bias: impl Fn(f64) -> f64,
    mut distort: impl FnMut(u32, FilmReading<f64>) -> FilmReading<f64>,
) -> Vec<SelfSensed<f32>> {
    let mut sensed = Vec::new();
    let mut reading = FilmReading { voltage_v: 0.0, current_a: 0.0 };
    for k in 0..ticks {
        let rounded = FilmReading { voltage_v: reading.voltage_v as f32, current_a: reading.current_a as f32 };
        sensed.extend(sensing.sense(state, rounded));
        let commanded_v = sensing.drive(state, bias(f64::from(k) * STEP_S) as f32);
        reading = distort(k, circuit.tick(f64::from(commanded_v)));
    }
    sensed
}

/// Constant, on a slope, swinging: drives that move films.
const BIASES: [fn(f64) -> f64; 4] = [
    |_| 0.0,
    |t| 200.0 + 5000.0 * t,
    |t| 2250.0 - 1750.0 * (TAU * 3.0 * t).cos(),
    |t| 1500.0 - 750.0 * (TAU * (2.0 * (t - 0.31)).clamp(0.0, 0.5)).cos(),
];

#[test]
fn a_sine_shows_the_capacitance_and_the_resistance_of_the_impedance() {
    let sensing = SelfSensing::<f32>::new(&relation(), OPTIONS).expect("valid");
    for film_f in [500e-12, 700e-12, 1.6e-9] {
        for electrodes_ohm in [1e3, 20e3, 50e3] {
            let mut circuit = Circuit::new(film_f, electrodes_ohm);
            let (capacitance, resistance) = circuit.at_tone();
            let mut state = sensing.state();
            let mut sensed = None;
            for k in 0..200 {
                let angle = |part: f64| 0.25 * TAU * (f64::from(k) + part) + 0.3;
                let reading = circuit.tick_of(|part, _| 2000.0 + 50.0 * angle(part).sin());
                let rounded = FilmReading { voltage_v: reading.voltage_v as f32, current_a: reading.current_a as f32 };
                sensed = sensing.sense(&mut state, rounded).or(sensed);
            }
            let sensed = sensed.expect("blocks have ended");
            let error = f64::from(sensed.capacitance_f) / capacitance - 1.0;
            assert!(error.abs() < 2e-5, "{film_f:e} F, {electrodes_ohm} Ohm: {error:.1e}");
            let error = (f64::from(sensed.resistance_ohm) - resistance) * TAU * 250.0 * capacitance;
            assert!(error.abs() < 2e-5, "{film_f:e} F, {electrodes_ohm} Ohm: {error:.1e} of the reactance");
        }
    }
}

#[test]
fn steps_through_an_amplifier_show_the_capacitance_under_any_drive() {
    let sensing = SelfSensing::<f32>::new(&relation(), OPTIONS).expect("valid");
    for film_f in [500e-12, 700e-12, 1.6e-9] {
        for electrodes_ohm in [1e3, 20e3, 50e3] {
            // Resistance over reactance times this is the error: what still flows through the resistance at the end of a tick.
            for (lag_s, share) in [(2e-5, 0.01), (2e-4, 0.1), (1e-3, 0.5)] {
                for (kind, bias) in BIASES.iter().enumerate() {
                    let mut circuit = Circuit { lag_s, ..Circuit::new(film_f, electrodes_ohm) };
                    let sensed = run(&sensing, &mut sensing.state(), &mut circuit, 1000, bias, |_, reading| reading);
                    assert_eq!(sensed.len(), 48, "one a block, after the first");
                    let bound = 3e-4 + share * TAU * 250.0 * electrodes_ohm * film_f;
                    for sensed in sensed {
                        let error = f64::from(sensed.capacitance_f) / (film_f + circuit.cable_f) - 1.0;
                        assert!(
                            error.abs() < bound,
                            "{film_f:e} F, {electrodes_ohm} Ohm, {lag_s} s, {kind}: {error:.1e}"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn a_jump_of_the_drive_gives_no_sample_instead_of_a_wrong_one() {
    let sensing = SelfSensing::<f32>::new(&relation(), OPTIONS).expect("valid");
    let sample_at = |jump: u32| {
        let bias = |t: f64| if t > (f64::from(jump) - 0.5) * STEP_S { 2300.0 } else { 2000.0 };
        let mut noise = noise(u64::from(jump));
        let mut circuit = Circuit::new(600e-12, 1e3);
        let sensed = run(&sensing, &mut sensing.state(), &mut circuit, 400, bias, &mut noise);
        for sensed in &sensed {
            let error = f64::from(sensed.capacitance_f) / 700e-12 - 1.0;
            // Six standard deviations of a block whose tone is its own.
            assert!(error.abs() < 8e-3, "a jump at tick {jump}: {error:.1e}");
        }
        sensed.len()
    };
    // Wherever in a block it is: 18 samples without it.
    for jump in 100..140 {
        let samples = sample_at(jump);
        assert!((15..=18).contains(&samples), "a jump at tick {jump}: {samples} samples");
    }
    assert_eq!(sample_at(450), 18, "without a jump");
    assert_eq!(sample_at(110), 16, "in the middle of a block: that, and the next");
}

/// Readings with noise of these standard deviations.
fn noise(seed: u64) -> impl FnMut(u32, FilmReading<f64>) -> FilmReading<f64> {
    let mut random = Pcg64::seed_from_u64(seed);
    // Twelve uniform numbers have a variance of 1.
    let mut normal = move || (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
    move |_, reading| FilmReading {
        voltage_v: reading.voltage_v + OPTIONS.voltage_noise_v * normal(),
        current_a: reading.current_a + OPTIONS.current_noise_a * normal(),
    }
}

#[test]
fn the_stated_variance_is_that_of_the_noise() {
    let certain = CapacitanceRelation { uncertainty_m: 1e-9, ..relation() };
    for (seed, options) in
        [OPTIONS, SelfSensingOptions { tone_v: 20.0, periods: 12, ..OPTIONS }].into_iter().enumerate()
    {
        let sensing = SelfSensing::<f32>::new(&certain, options).expect("valid");
        let mut noise = noise(seed as u64);
        let (mut state, mut sensed, mut before_v) = (sensing.state(), Vec::new(), 0.0);
        let mut reading = FilmReading { voltage_v: 0.0_f32, current_a: 0.0_f32 };
        for k in 0..1_000_000 {
            sensed.extend(sensing.sense(&mut state, reading));
            let voltage_v = f64::from(sensing.drive(&state, 2000.0));
            // A capacitor.
            let noisy = noise(k, FilmReading { voltage_v, current_a: 800e-12 * (voltage_v - before_v) / STEP_S });
            reading = FilmReading { voltage_v: noisy.voltage_v as f32, current_a: noisy.current_a as f32 };
            before_v = voltage_v;
        }
        // Once the mean of the tone has its length.
        let sensed = &sensed[100..];
        let n = sensed.len() as f64;
        let mean = sensed.iter().map(|s| f64::from(s.sample.displacement_m)).sum::<f64>() / n;
        let square = sensed.iter().map(|s| (f64::from(s.sample.displacement_m) - mean).powi(2)).sum::<f64>() / n;
        let stated = sensed.iter().map(|s| f64::from(s.variance_m2)).sum::<f64>() / n;
        // The mean of the tone is another one some 300 times, of which a variance is known within a tenth.
        assert!((square / stated - 1.0).abs() < 0.15, "{square:.2e} m² measured, {stated:.2e} m² stated");
        // What is expected of a film at rest, which is 700 pF here.
        let expected = sensing.noise_m(options.tone_v, 1.0);
        assert!((expected.powi(2) / stated - 1.0).abs() < 0.35, "{expected:e} m expected, {stated:e} m² stated");
        assert!((sensed[0].uncertainty_m().powi(2) / sensed[0].variance_m2 - 1.0).abs() < 1e-5);
    }
}

#[test]
fn the_drive_stays_above_0_v_and_returns_without_the_tone() {
    let sensing = SelfSensing::<f32>::new(&relation(), OPTIONS).expect("valid");
    let mut state = sensing.state();
    let mut driven = Vec::new();
    for k in 0..400 {
        let commanded = sensing.drive(&state, if k < 200 { 0.0 } else { 1000.0 });
        assert!((0.0..=1050.0).contains(&commanded));
        driven.push(commanded);
        sensing.sense(&mut state, FilmReading { voltage_v: commanded, current_a: 0.0 });
        let expected = if k < 200 { 50.0 } else { 1000.0 };
        if k % 200 > 1 {
            assert_eq!(state.drive_v(), expected);
        }
    }
    assert_eq!(driven[200..].iter().sum::<f32>(), 200.0 * 1000.0, "the mean is the voltage that was asked for");
}

#[test]
fn capacitance_moves_with_the_film_and_the_age_is_its_own() {
    // A stroke of 3 Hz: half a millisecond of wrong age would show.
    let sensing = SelfSensing::<f32>::new(&relation(), OPTIONS).expect("valid");
    let mut state = sensing.state();
    let position = |t: f64| 2e-3 * (1.0 - (TAU * 3.0 * t).cos());
    // Film and cable as one capacitor: 700 pF at rest.
    let charge = |t: f64, voltage: f64| 700e-12 * (1.0 + position(t) / 0.06).powi(2) * voltage;
    let (mut before, mut reading) = (0.0, FilmReading { voltage_v: 0.0_f32, current_a: 0.0_f32 });
    let mut errors = Vec::new();
    for k in 0..4000 {
        let now = f64::from(k) * STEP_S;
        if let Some(sensed) = sensing.sense(&mut state, reading) {
            let then = now - sensed.sample.age_ticks as f64 * STEP_S;
            // Over a block the film moves: the mean of its places.
            let mean = (0..20).map(|k| position(then + (f64::from(k) - 9.5) * STEP_S)).sum::<f64>() / 20.0;
            errors.push(f64::from(sensed.sample.displacement_m) - mean);
        }
        let voltage = sensing.drive(&state, (2000.0 - 1500.0 * (TAU * 3.0 * now).cos()) as f32);
        let charged = charge(now + STEP_S, f64::from(voltage));
        reading = FilmReading { voltage_v: voltage, current_a: ((charged - before) / STEP_S) as f32 };
        before = charged;
    }
    let largest = errors[2..].iter().fold(0.0_f64, |largest, e| largest.max(e.abs()));
    // 0.1 % of the stroke; half a millisecond would be 0.47 %.
    assert!(largest < 4e-6, "{largest:.1e} m");
}

#[test]
fn the_relation_creeps_as_its_springpot_does() {
    // Half an hour, in blocks of 20 ms, against the defining sum of D^α by its Fourier transform.
    for (creep, alpha) in [(0.05, 0.2), (-0.04, 0.1), (0.1, 0.4)] {
        let relation = CapacitanceRelation { creep, alpha, ..relation() };
        let sensing = SelfSensing::<f32>::new(&relation, OPTIONS).expect("valid");
        let mut state = sensing.state();
        let blocks = 90_000;
        let capacitance = |k: usize| 700e-12 * (1.0 + 0.2 * (1.0 - (TAU * k as f64 / 40_000.0).cos()) / 2.0);
        let straight: Vec<f64> =
            (0..blocks).map(|k| relation.displacement_of_change(capacitance(k) / 700e-12 - 1.0)).collect();
        let model = Maxwell::new(Springpot::new(1.0, alpha), &[], Topology::Eq11, 0.0).expect("valid");
        let crept = FullMemory::new(blocks, 0.02).force(&model, &straight);
        let mut worst = 0.0_f64;
        let mut reading = FilmReading { voltage_v: 0.0_f32, current_a: 0.0_f32 };
        let (mut before_v, mut block) = (0.0, 0);
        for k in 0..20 * blocks as u32 {
            if let Some(sensed) = sensing.sense(&mut state, reading) {
                let exact = straight[block] + creep * crept[block];
                worst = worst.max((f64::from(sensed.sample.displacement_m) - exact).abs());
            }
            block = k as usize / 20;
            let voltage = sensing.drive(&state, 1000.0);
            // A capacitor that changes between blocks.
            reading = FilmReading {
                voltage_v: voltage,
                current_a: (capacitance(block) * (f64::from(voltage) - before_v) / STEP_S) as f32,
            };
            before_v = f64::from(voltage);
        }
        // Of 5.7 mm of stroke: a percent of the springpot's part, and single precision.
        assert!(worst < 0.01 * creep.abs() * 5.7e-3 + 3e-6, "creep {creep}, alpha {alpha}: {worst:.1e} m");
    }
}

/// The fault that `circuit` ends with, and the ticks until then, once it is `broken` from tick 500 on.
fn fault(
    options: SelfSensingOptions,
    mut broken: impl FnMut(&mut Circuit, FilmReading<f64>) -> FilmReading<f64>,
) -> Option<(SelfSensingFault, u32)> {
    let sensing = SelfSensing::<f32>::new(&relation(), options).expect("valid");
    let mut state = sensing.state();
    let mut circuit = Circuit::new(600e-12, 50e3);
    let mut noise = noise(7);
    let mut reading = FilmReading { voltage_v: 0.0, current_a: 0.0 };
    for k in 0..1500_u32 {
        let rounded = FilmReading { voltage_v: reading.voltage_v as f32, current_a: reading.current_a as f32 };
        sensing.sense(&mut state, rounded);
        if let Some(fault) = state.fault() {
            assert!(k >= 500, "{fault:?} in tick {k}, before anything was broken");
            return Some((fault, k - 500));
        }
        let bias = 2250.0 - 1750.0 * (TAU * 3.0 * f64::from(k) * STEP_S).cos();
        let mut next = circuit;
        reading = next.tick(f64::from(sensing.drive(&state, bias as f32)));
        reading = noise(k, if k >= 500 { broken(&mut next, reading) } else { reading });
        circuit = next;
    }
    None
}

#[test]
fn what_breaks_is_named_within_a_tenth_of_a_second() {
    let within = |found: Option<(SelfSensingFault, u32)>, expected, name| {
        let (fault, ticks) = found.unwrap_or_else(|| panic!("{name}: not found"));
        assert_eq!(fault, expected, "{name}");
        assert!(ticks <= 80, "{name}: {ticks} ticks");
    };
    assert_eq!(fault(OPTIONS, |_, reading| reading), None, "nothing is broken");
    let lost = |circuit: &mut Circuit, reading| {
        circuit.film_f = 1e-15;
        reading
    };
    within(fault(OPTIONS, lost), SelfSensingFault::Electrode, "an electrode that is off");
    let cracked = |circuit: &mut Circuit, reading| {
        circuit.electrodes_ohm = 2e7;
        reading
    };
    within(fault(OPTIONS, cracked), SelfSensingFault::Electrode, "an electrode with a crack");
    for ohm in [1e3, 1e5, 2e5] {
        let shorted = |circuit: &mut Circuit, reading: FilmReading<f64>| {
            circuit.leak_ohm = ohm;
            reading
        };
        within(fault(OPTIONS, shorted), SelfSensingFault::Shorted, "a short that the amplifier feeds");
        // An amplifier of 0.5 mA.
        let limited = |_: &mut Circuit, reading: FilmReading<f64>| FilmReading {
            voltage_v: (ohm * 0.5e-3_f64).min(reading.voltage_v),
            current_a: (reading.voltage_v / ohm).min(0.5e-3),
        };
        within(fault(OPTIONS, limited), SelfSensingFault::Shorted, "a short that the amplifier cannot feed");
    }
    for stuck in [0.0, 0.5e-3, -0.5e-3, 1e-5, f64::NAN, f64::INFINITY] {
        let monitor = |_: &mut Circuit, reading: FilmReading<f64>| FilmReading { current_a: stuck, ..reading };
        within(fault(OPTIONS, monitor), SelfSensingFault::CurrentMonitor, "a current monitor that is stuck");
    }
    let silent = |_: &mut Circuit, reading: FilmReading<f64>| FilmReading {
        voltage_v: 2000.0,
        current_a: 0.0 * reading.current_a,
    };
    within(fault(OPTIONS, silent), SelfSensingFault::NoTone, "an amplifier that passes no tone");
}

/// Behind an amplifier that steps, the current of a resistor has the phase of neither a resistor nor a capacitance. The monitor may end below it.
#[test]
fn a_short_behind_steps_is_named_at_the_lowest_drive() {
    let sensing = SelfSensing::<f32>::new(&relation(), OPTIONS).expect("valid");
    for (ohm, most_a) in [(5e5, 1.0), (3e5, 1.0), (4e4, 0.26e-3), (1e3, 0.26e-3)] {
        let mut state = sensing.state();
        let mut voltage_v = 0.0;
        let found = (0..81).find(|_| {
            sensing.sense(&mut state, FilmReading { voltage_v, current_a: (voltage_v / ohm).min(most_a) });
            voltage_v = sensing.drive(&state, 0.0);
            state.fault().is_some()
        });
        assert_eq!(state.fault(), Some(SelfSensingFault::Shorted), "{ohm} Ohm: {found:?}");
    }
}

#[test]
fn a_second_sensor_corrects_and_leaves_its_correction() {
    // The film is a capacitor of a relation that is a tenth off.
    let sensing =
        SelfSensing::<f32>::new(&CapacitanceRelation { uncertainty_m: 0.3e-3, ..relation() }, OPTIONS).expect("valid");
    let mut state = sensing.state();
    let position = |t: f64| 2e-3 * (1.0 - (TAU * 0.5 * t).cos());
    let charge = |t: f64, voltage: f64| 700e-12 * (1.0 + (position(t) + 0.3e-3) / 0.06).powi(2) * voltage;
    let (mut before, mut reading) = (0.0, FilmReading { voltage_v: 0.0_f32, current_a: 0.0_f32 });
    let (mut first, mut last) = (None, None);
    for k in 0..60_000_u32 {
        let now = f64::from(k) * STEP_S;
        if let Some(sensed) = sensing.sense(&mut state, reading) {
            let error =
                f64::from(sensed.sample.displacement_m) - position(now - sensed.sample.age_ticks as f64 * STEP_S);
            first = first.or(Some((error, sensed.uncertainty_m())));
            last = Some((error, sensed.uncertainty_m()));
        }
        // A camera of 25 Hz, 60 ms late, for 10 s.
        if (1000..10_000).contains(&k) && k % 40 == 39 {
            let sample = SensorSample { displacement_m: position(now - 0.06) as f32, age_ticks: 60 };
            sensing.correct(&mut state, sample, 1e-10);
        }
        if k == 11_000 {
            let corrected = state.offset_m();
            assert!((corrected + 0.3e-3).abs() < 5e-6, "{corrected:e} m");
            assert!(last.is_some_and(|(error, uncertainty)| error.abs() < 10e-6 && uncertainty < 60e-6), "{last:?}");
        }
        let voltage = sensing.drive(&state, 2000.0);
        let charged = charge(now + STEP_S, f64::from(voltage));
        reading = FilmReading { voltage_v: voltage, current_a: ((charged - before) / STEP_S) as f32 };
        before = charged;
    }
    let (error, uncertainty) = first.expect("sensed");
    assert!((error - 0.3e-3).abs() < 20e-6 && uncertainty >= 0.3e-3, "{error:e}, {uncertainty:e}");
    // 50 s without it.
    let (error, uncertainty) = last.expect("sensed");
    assert!(error.abs() < 10e-6, "{error:e} m");
    assert!((0.05e-3..0.2e-3).contains(&f64::from(uncertainty)), "{uncertainty:e} m: less than at first, and growing");
}

#[test]
fn what_cannot_be_sensed_is_refused() {
    let refused =
        |relation: CapacitanceRelation, options| SelfSensing::<f32>::new(&relation, options).expect_err("refused");
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let quantities = [
            ("step_s", SelfSensingOptions { step_s: bad, ..OPTIONS }),
            ("tone_v", SelfSensingOptions { tone_v: bad, ..OPTIONS }),
            ("voltage_noise_v", SelfSensingOptions { voltage_noise_v: bad, ..OPTIONS }),
            ("current_noise_a", SelfSensingOptions { current_noise_a: bad, ..OPTIONS }),
            ("max_current_a", SelfSensingOptions { max_current_a: bad, ..OPTIONS }),
            ("drift_s", SelfSensingOptions { drift_s: bad, ..OPTIONS }),
        ];
        for (name, options) in quantities {
            let error = refused(relation(), options);
            assert!(
                matches!(error, SelfSensingError::NotPositive { quantity, .. } if quantity == name),
                "{name}: {error}"
            );
        }
    }
    assert_eq!(refused(relation(), SelfSensingOptions { periods: 1, ..OPTIONS }), SelfSensingError::Periods(1));
    assert_eq!(refused(relation(), SelfSensingOptions { periods: 65, ..OPTIONS }), SelfSensingError::Periods(65));
    assert!(matches!(
        refused(relation(), SelfSensingOptions { cable_f: 700e-12, ..OPTIONS }),
        SelfSensingError::Cable { .. }
    ));
    assert!(matches!(
        refused(relation(), SelfSensingOptions { cable_f: f64::NAN, ..OPTIONS }),
        SelfSensingError::Cable { .. }
    ));
    let film = |changed| refused(changed, OPTIONS);
    assert!(matches!(film(CapacitanceRelation { max_f: 600e-12, ..relation() }), SelfSensingError::Range { .. }));
    assert!(matches!(film(CapacitanceRelation { alpha: 1.0, ..relation() }), SelfSensingError::Creep { .. }));
    assert!(matches!(film(CapacitanceRelation { creep: f64::NAN, ..relation() }), SelfSensingError::Creep { .. }));
    let falling = CapacitanceRelation { stroke_m: [0.03, -0.2, 0.0], ..relation() };
    assert!(matches!(film(falling), SelfSensingError::NotMonotone { .. }));
}

#[test]
fn every_order_has_a_memory() {
    for order in 1..20 {
        let relation = CapacitanceRelation { alpha: f64::from(order) / 20.0, creep: 0.05, ..relation() };
        for periods in [2, 5, 64] {
            let sensing = SelfSensing::<f32>::new(&relation, SelfSensingOptions { periods, ..OPTIONS });
            assert!(sensing.is_ok(), "order {}, {periods} periods: {:?}", relation.alpha, sensing.err());
        }
    }
}

/// A controller that gets the springpot in numbers senses to the bit what one does that has built it.
#[test]
fn a_springpot_in_numbers_is_the_one_that_was_built() {
    let relation = CapacitanceRelation { creep: 0.07, alpha: 0.3, ..relation() };
    let built = SelfSensing::<f32>::new(&relation, OPTIONS).expect("valid");
    assert_eq!(SelfSensing::with_creep(&relation, OPTIONS, &built.creep()), Ok(built.clone()));
    let mut damaged = built.creep();
    damaged.fast[3].1 = f32::NAN;
    let refused = SelfSensing::with_creep(&relation, OPTIONS, &damaged);
    assert!(matches!(refused, Err(SelfSensingError::Law(_))), "{refused:?}");
}
