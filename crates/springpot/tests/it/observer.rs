//! Observer and tracking on films that the model knows and does not know: a heavier load, a stiffer film, a sensor that is
//! slow, late, noisy, lost.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{
    Actuator, Applied, CommandLimits, ControlError, Discretisation, Follower, Law, LawOptions, LawState, Load, Maxwell,
    Observer, ObserverOptions, ObserverState, SensorSample, Springpot, Topology, Tracking, VoltageDrive,
};

type Estimate = ObserverState<f32>;
type Film = LawState<f64>;

fn model(factor: f64) -> Maxwell {
    let sp = |c: f64, alpha| Springpot::new(factor * c, alpha);
    let branches = [[sp(1.1e4, 0.0), sp(9e3, 1.0)], [sp(7e3, 0.02), sp(7e4, 0.95)]];
    Maxwell::new(sp(2.4e4, 0.03), &branches, Topology::Parallel, 0.316).expect("valid")
}

/// The film itself: the model in f64, stiffer by a factor and under a force that the model does not know.
struct Plant {
    law: Law<f64>,
    drive: VoltageDrive<f64>,
    film: Film,
}

impl Plant {
    fn new(factor: f64) -> Self {
        let law = Law::compressed(&model(factor), LawOptions::at_step(1e-3)).expect("a law");
        let drive = VoltageDrive::new(&Actuator::KARNER_2022, 6000.0, law.stiffness()).expect("valid");
        Self { film: law.state(), law, drive }
    }

    fn step(&mut self, voltage: f64, disturbance: f64) -> f64 {
        let load = self.drive.load(voltage);
        self.law.displacement_under(&mut self.film, Load { force_n: load.force_n + disturbance, ..load })
    }
}

fn observer(options: ObserverOptions) -> Observer<f32> {
    let law = Law::compressed(&model(1.0), LawOptions::at_step(1e-3)).expect("a law");
    Observer::new(law, &Actuator::KARNER_2022, 6000.0, options).expect("valid")
}

fn volts(k: usize) -> f64 {
    1500.0 * (1.0 - (TAU * 0.1e-3 * k as f64).cos()) + 1500.0
}

/// The sensor: every `interval` ticks, `delay` ticks late.
struct Sensor {
    interval: usize,
    delay: usize,
    past: Vec<f64>,
}

impl Sensor {
    fn read(&mut self, x: f64) -> Option<SensorSample<f32>> {
        self.past.push(x);
        let k = self.past.len() - 1;
        let taken = k.checked_sub(self.delay)?;
        let due = taken % self.interval == 0;
        due.then(|| SensorSample { displacement_m: self.past[taken] as f32, age_ticks: self.delay })
    }
}

/// Errors of the estimate (m) and the states after every second, over 30 s.
fn run(
    observer: &Observer<f32>,
    plant: &mut Plant,
    sensor: &mut Sensor,
    disturbance: impl Fn(usize) -> f64,
) -> (Vec<f64>, Vec<Estimate>) {
    let mut state = observer.state(observer.law().state());
    let (mut errors, mut states) = (Vec::new(), Vec::new());
    for k in 0..30_000 {
        let x = plant.step(volts(k), disturbance(k));
        let sample = sensor.read(x);
        let estimate = observer.observe(&mut state, Applied::as_commanded(volts(k) as f32), sample);
        errors.push(f64::from(estimate) - x);
        if k % 1000 == 999 {
            states.push(state.clone());
        }
    }
    (errors, states)
}

fn largest(errors: &[f64]) -> f64 {
    errors.iter().fold(0.0, |largest, error| largest.max(error.abs()))
}

#[test]
fn predicts_exactly_what_the_model_knows() {
    let observer = observer(ObserverOptions::at_bandwidth(0.6));
    for interval in [1, 10, usize::MAX] {
        let mut sensor = Sensor { interval, delay: 10, past: Vec::new() };
        let (errors, states) = run(&observer, &mut Plant::new(1.0), &mut sensor, |_| 0.0);
        // The digits of f32.
        assert!(largest(&errors) < 5e-9, "{}", largest(&errors));
        assert!(states.iter().all(|s| s.disturbance().abs() < 1e-3 && (s.force_scale() - 1.0).abs() < 1e-4));
    }
}

/// Before the first tick there is nothing to report, and all of the correction is in use.
#[test]
fn a_new_state_knows_nothing_but_its_film() {
    let observer = observer(ObserverOptions::at_bandwidth(0.6));
    let state = observer.state(observer.law().state());
    let zeros = [state.displacement(), state.disturbance(), state.innovation(), state.statistics().mean()];
    assert_eq!((zeros, state.statistics().variance()), ([0.0; 4], 0.0));
    assert_eq!((state.force_scale(), state.share(), state.ticks_since_sample()), (1.0, 1.0, 0));
    let at_0_v = VoltageDrive::<f32>::new(&Actuator::KARNER_2022, 6000.0, observer.law().stiffness()).expect("valid");
    assert_eq!(state.load(), at_0_v.load(0.0));
}

/// An unknown force is found, whether samples arrive every tick, every tenth tick, or late.
#[test]
fn finds_an_unknown_force_within_the_bandwidth() {
    for (interval, delay) in [(1, 0), (1, 10), (10, 0), (10, 10), (33, 20)] {
        let observer = observer(ObserverOptions {
            sample_interval_s: 1e-3 * interval as f64,
            delay_s: 1e-3 * delay as f64,
            adaptation_s: 0.0,
            ..ObserverOptions::at_bandwidth(0.6)
        });
        let mut sensor = Sensor { interval, delay, past: Vec::new() };
        let force = |k: usize| if k < 10_000 { 0.0 } else { 3.0 };
        let (errors, states) = run(&observer, &mut Plant::new(1.0), &mut sensor, force);
        let found = f64::from(states[13].disturbance());
        println!(
            "every {interval} ticks, {delay} late: {found:.4} N after 4 s, error {:.2e} m",
            largest(&errors[14_000..])
        );
        // 3 N move the film by 75 µm at once; 4 s are 15 time constants of the bandwidth, and the film still creeps.
        assert!((found - 3.0).abs() < 0.05 && (f64::from(states[29].disturbance()) - 3.0).abs() < 0.01);
        assert!(largest(&errors[14_000..]) < 1e-6);
        let statistics = states[29].statistics();
        assert!(statistics.mean().abs() < 1e-6 && statistics.variance() < 1e-10);
    }
}

/// A film that has become stiffer shows in the force scale, and in nothing else after a while.
#[test]
fn reports_drift_of_stiffness() {
    for factor in [0.8, 1.25] {
        let observer = observer(ObserverOptions::at_bandwidth(0.6));
        let mut sensor = Sensor { interval: 10, delay: 10, past: Vec::new() };
        let (errors, states) = run(&observer, &mut Plant::new(factor), &mut sensor, |_| 0.0);
        let scale = f64::from(states[29].force_scale());
        println!("{factor} times as stiff: force scale {scale:.4}, disturbance {:.3} N", states[29].disturbance());
        assert!((scale * factor - 1.0).abs() < 0.01, "{scale}");
        assert!(states[29].disturbance().abs() < 0.2 && largest(&errors[25_000..]) < 1e-6);
    }
}

/// White noise on the sensor: the estimate is far better than the sensor, and the statistics of the innovation show the
/// noise.
#[test]
fn smooths_noise_and_measures_it() {
    let observer = observer(ObserverOptions::at_bandwidth(0.6));
    let mut random = Pcg64::seed_from_u64(5);
    let mut noise = || (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>() * 5e-6;
    let mut plant = Plant::new(1.0);
    let mut state = observer.state(observer.law().state());
    let (mut square, mut n) = (0.0, 0.0);
    for k in 0..60_000 {
        let x = plant.step(volts(k), 0.0);
        let sample = (k % 10 == 0).then(|| SensorSample { displacement_m: (x + noise()) as f32, age_ticks: 0 });
        let estimate = observer.observe(&mut state, Applied::as_commanded(volts(k) as f32), sample);
        if k > 5_000 {
            square += (f64::from(estimate) - x).powi(2);
            n += 1.0;
        }
    }
    let (rms, shown) = ((square / n).sqrt(), f64::from(state.statistics().variance()).sqrt());
    println!("5 µm of noise at 100 Hz: estimate {:.2} µm, innovation {:.2} µm", 1e6 * rms, 1e6 * shown);
    // A low-pass of 0.6 Hz leaves sqrt(π · 0.6 Hz / 100 Hz) = 14 % of the noise, the added slope half as much again.
    assert!(rms < 1.3e-6 && (4e-6..6e-6).contains(&shown));
}

#[test]
fn invalid_and_old_samples_are_ignored() {
    let observer = observer(ObserverOptions::at_bandwidth(0.6));
    let mut plant = Plant::new(1.0);
    let mut state = observer.state(observer.law().state());
    for k in 0..2000 {
        let x = plant.step(volts(k), 0.0) as f32;
        let sample = match k % 4 {
            0 => SensorSample { displacement_m: f32::NAN, age_ticks: 0 },
            1 => SensorSample { displacement_m: f32::INFINITY, age_ticks: 3 },
            2 => SensorSample { displacement_m: 1.0, age_ticks: 64 },
            _ => SensorSample { displacement_m: 1.0, age_ticks: usize::MAX },
        };
        let estimate = observer.observe(&mut state, Applied::as_commanded(volts(k) as f32), Some(sample));
        assert!((estimate - x).abs() < 5e-9);
    }
    assert_eq!(state.ticks_since_sample(), 2000);
    // And nonsense within its range does not make the film run away for good.
    for k in 0..20_000 {
        let wild = if k % 2 == 0 { 1e30 } else { -1e30 };
        observer.observe(
            &mut state,
            Applied::as_commanded(6000.0),
            Some(SensorSample { displacement_m: wild, age_ticks: 0 }),
        );
    }
    assert!(state.displacement().is_finite() && state.disturbance().is_finite() && state.force_scale().is_finite());
    assert!(state.statistics().variance().is_finite());
}

/// A lost sensor: the voltage neither jumps when it goes nor when it comes back, and the film is back on its reference
/// within a second.
#[test]
fn a_lost_sensor_causes_no_bump() {
    let law: Law<f32> = Law::compressed(&model(1.0), LawOptions::at_step(1e-3)).expect("a law");
    let rest = law.state();
    let options = ObserverOptions::at_bandwidth(0.6);
    let tracking: Tracking<f32> =
        Tracking::new(law, &Actuator::KARNER_2022, CommandLimits::BENCH, options).expect("valid");
    let mut state = tracking.state(rest);
    let mut plant = Plant::new(1.2);
    let mut sensor = Sensor { interval: 10, delay: 10, past: Vec::new() };
    let (mut voltage, mut x) = (0.0_f32, 0.0);
    let (mut steps, mut errors) = (Vec::new(), Vec::new());
    for k in 0..60_000 {
        let sample = sensor.read(x).filter(|_| !(20_000..50_000).contains(&k));
        tracking.observe(&mut state, Applied::as_commanded(voltage), sample);
        let t = (k + 1) as f64 * 1e-3;
        let s = (t / 4.0).min(1.0);
        let wave = if t < 4.0 { 0.0 } else { 0.5e-3 * (1.0 - (TAU * 0.1 * (t - 4.0)).cos()) };
        let reference = 1.5e-3 * s * s * s * (10.0 + s * (6.0 * s - 15.0)) + wave;
        // A step in the disturbance while the sensor is lost.
        let command = tracking.command(&mut state, reference as f32);
        steps.push((command.voltage_v - voltage).abs());
        voltage = command.voltage_v;
        x = plant.step(f64::from(voltage), if k > 30_000 { 1.0 } else { 0.0 });
        errors.push(x - reference);
    }
    let biggest = |range: std::ops::Range<usize>| steps[range].iter().copied().fold(0.0, f32::max);
    println!(
        "volts per tick: {:.2} with the sensor, {:.2} when it goes, {:.2} when it comes",
        biggest(10_000..19_900),
        biggest(20_000..22_000),
        biggest(50_000..52_000)
    );
    let rms = (errors[51_000..52_000].iter().map(|e| e * e).sum::<f64>() / 1000.0).sqrt();
    println!(
        "errors: {:.1} µm without, {:.2} µm from a second after on",
        1e6 * largest(&errors[35_000..50_000]),
        1e6 * largest(&errors[51_000..])
    );
    // A quarter of a percent of the reference's 2.5 mm.
    assert!(rms < 6e-6, "{rms}");
    assert!(biggest(20_000..22_000) < 5.0 && biggest(50_000..52_000) < 5.0);
    assert!(largest(&errors[40_000..50_000]) > 30e-6 && largest(&errors[53_000..]) < 1e-6);
}

#[test]
fn invalid_observers_are_refused() {
    let law: Law<f32> = Law::compressed(&model(1.0), LawOptions::at_step(1e-3)).expect("a law");
    let new = |options| Observer::<f32>::new(law.clone(), &Actuator::KARNER_2022, 6000.0, options).map(drop);
    let good = ObserverOptions::at_bandwidth(0.6);
    assert_eq!(new(good), Ok(()));
    for bad in [0.0, -1.0, f64::NAN] {
        for options in [
            ObserverOptions { bandwidth_hz: bad, ..good },
            ObserverOptions { sample_interval_s: bad, ..good },
            ObserverOptions { lost_after_s: bad, ..good },
            ObserverOptions { adaptation_s: bad - 1.0, ..good },
            ObserverOptions { delay_s: bad - 1.0, ..good },
        ] {
            assert!(matches!(new(options), Err(ControlError::NotPositive { .. })), "{options:?}");
        }
    }
    let still = ObserverOptions { bandwidth_hz: 0.9e-9, ..good };
    assert!(matches!(new(still), Err(ControlError::BandwidthTooLow { .. })));
    let lost = ObserverOptions { sample_interval_s: 0.06, ..good };
    assert!(matches!(new(lost), Err(ControlError::LostBetweenSamples { .. })));
    let slow = ObserverOptions { sample_interval_s: 0.2, lost_after_s: 1.0, ..good };
    assert!(matches!(new(slow), Err(ControlError::SensorTooSlow { .. })));
    let late = ObserverOptions { delay_s: 0.064, ..good };
    assert!(matches!(new(late), Err(ControlError::SensorTooLate { ticks: 64, most: 63 })));
    // 63 ticks, as single precision has them.
    let rounded = ObserverOptions { delay_s: f64::from(0.063f32), bandwidth_hz: 0.5, ..good };
    assert_eq!(new(rounded), Ok(()));
}

/// Bandwidths and permittivities over all of single precision: what is accepted stays finite.
#[test]
fn an_accepted_tracking_stays_finite() {
    let law: Law<f32> = Law::compressed(&model(1.0), LawOptions::at_step(1e-3)).expect("a law");
    let limits = CommandLimits::BENCH;
    let mut accepted = 0;
    for exponent in -42..38 {
        let value = f64::from(10f32.powi(exponent));
        for (bandwidth_hz, relative_permittivity) in [(value, 4.7), (0.6, value)] {
            let actuator = Actuator { relative_permittivity, ..Actuator::KARNER_2022 };
            let options = ObserverOptions::at_bandwidth(bandwidth_hz);
            let Ok(tracking) = Tracking::<f32>::new(law.clone(), &actuator, limits, options) else { continue };
            accepted += 1;
            let mut state = tracking.state(law.state());
            for k in 0..2000u16 {
                let sample = SensorSample { displacement_m: 1e-6 * f32::from(k), age_ticks: 10 };
                tracking.observe(
                    &mut state,
                    Applied::as_commanded(3.0 * f32::from(k)),
                    (k % 10 == 0).then_some(sample),
                );
                let command = tracking.command(&mut state, 1e-3);
                let observer = state.observer();
                let numbers = [command.voltage_v, observer.disturbance(), observer.force_scale()];
                assert!(numbers.iter().all(|x| x.is_finite()), "{bandwidth_hz} {relative_permittivity}: {numbers:?}");
            }
        }
    }
    assert!(accepted > 20);
}

/// A bandwidth above a third of the resonance is refused, of a film with enough damping not to ring below it. The resonance is read from the continuous model: where the force is no
/// longer in phase with the displacement.
#[test]
fn refuses_a_bandwidth_near_the_resonance() {
    let heavy = Maxwell::new(Springpot::new(4e4, 0.25), &[], Topology::Eq11, 214.0).expect("valid");
    let inertia_outweighs = |frequency_hz: f64| heavy.frequency_response(frequency_hz).re < 0.0;
    let resonance_hz = (1..1000).map(|k| f64::from(k) / 100.0).find(|&hz| inertia_outweighs(hz)).expect("below 10 Hz");
    assert!((2.5..3.5).contains(&resonance_hz), "{resonance_hz} Hz");
    let observer_at = |bandwidth_hz| {
        let law: Law<f32> = Law::compressed(&heavy, LawOptions::at_step(1e-3)).expect("a law");
        let options =
            ObserverOptions { sample_interval_s: 1e-3, delay_s: 0.0, ..ObserverOptions::at_bandwidth(bandwidth_hz) };
        Observer::<f32>::new(law, &Actuator::KARNER_2022, 6000.0, options).map(drop)
    };
    assert_eq!(observer_at(0.97 * resonance_hz / 3.0), Ok(()));
    for bandwidth_hz in [1.03 * resonance_hz / 3.0, 0.9 * resonance_hz, 5.0] {
        assert_eq!(observer_at(bandwidth_hz), Err(ControlError::NearResonance { bandwidth_hz }));
    }
}

/// A law at 500 Hz with little damping, and an observer whose bandwidth is a third to a twentieth of its resonance.
fn resonant(random: &mut Pcg64, case: usize) -> (Law<f64>, ObserverOptions) {
    let element = |c: f64, alpha: f64| Springpot::new(c, alpha);
    let (c, alpha) = (10f64.powf(random.random_range(1.5..4.5)), 10f64.powf(random.random_range(-2.5..-0.4)));
    let dashpot = c * 10f64.powf(random.random_range(-1.0..2.0));
    let branches = [[element(c * random.random_range(0.1..1.0), 0.0), element(dashpot, 1.0)]];
    let film = |mass_kg: f64| {
        let branches = if case.is_multiple_of(3) { &branches[..] } else { &[] };
        Maxwell::new(element(c, alpha), branches, Topology::Parallel, mass_kg).expect("valid")
    };
    let bandwidth_hz = random.random_range(0.2..1.0);
    let resonance_hz = bandwidth_hz * random.random_range(3.0..20.0);
    let film = film(film(0.0).frequency_response(resonance_hz).inv().re / (TAU * resonance_hz).powi(2));
    let method = if case.is_multiple_of(2) { Discretisation::Gl } else { Discretisation::Bdf2 };
    let law = Law::compressed(&film, LawOptions { method, ..LawOptions::at_step(2e-3) }).expect("a law");
    (law, ObserverOptions { sample_interval_s: 1e-2, delay_s: 1e-2, ..ObserverOptions::at_bandwidth(bandwidth_hz) })
}

/// An observer that is accepted comes to rest with a film that rests, however little damping its model has. Without its own correction the model does,
/// whatever its resonance.
#[test]
fn an_observer_does_not_ring_at_its_models_resonance() {
    let mut random = Pcg64::seed_from_u64(11);
    let (mut accepted, mut refused) = (0, 0);
    for case in 0..300 {
        let (law, options) = resonant(&mut random, case);
        let Ok(observer) = Observer::<f64>::new(law, &Actuator::KARNER_2022, 6000.0, options) else {
            refused += 1;
            continue;
        };
        accepted += 1;
        let mut state = observer.state(observer.law().state());
        let mut largest = [0.0_f64; 2];
        for k in 0..60_000 {
            let volts = if k < 500 { 2000.0 } else { 0.0 };
            let sample = (k % 5 == 0).then_some(SensorSample { displacement_m: 0.0, age_ticks: 5 });
            let x: f64 = observer.observe(&mut state, Applied::as_commanded(volts), sample);
            let part = &mut largest[usize::from(k > 50_000)];
            *part = part.max(x.abs());
        }
        assert!(largest[1] < 0.05 * largest[0], "{case}: {largest:?} of {options:?}");
    }
    println!("{accepted} accepted, {refused} refused");
    assert!(accepted > 50 && refused > 20);
}

/// A film that is its law, apart from a force that is 5 % less, is followed, is observed while its voltage is at a limit, and while something else sets it: with the
/// bandwidth that [`ObserverOptions::below_resonance`] gives, which is the largest of its steps that is accepted.
#[test]
fn tracking_does_not_ring_on_a_film_that_is_its_law() {
    let mut random = Pcg64::seed_from_u64(12);
    let (mut lowered, mut refused) = (0, 0);
    for case in 0..150 {
        let (law, wanted) = resonant(&mut random, case);
        let options = wanted.below_resonance(&law);
        let new = |options| Tracking::<f64>::new(law.clone(), &Actuator::KARNER_2022, CommandLimits::BENCH, options);
        let Ok(tracking) = new(options) else {
            assert_eq!(options, wanted, "{case}");
            refused += 1;
            continue;
        };
        if options != wanted {
            lowered += 1;
            let faster = ObserverOptions { bandwidth_hz: options.bandwidth_hz / 0.8, ..options };
            assert!(matches!(new(faster), Err(ControlError::NearResonance { .. })), "{case}: {faster:?}");
        }
        let follower = Follower::new(tracking);
        let (mut film, mut state, mut past) = (law.state(), follower.state(law.state()), [0.0; 5]);
        let drive = VoltageDrive::new(&Actuator::KARNER_2022, 6000.0, law.stiffness()).expect("valid");
        let stroke_m = 0.3 * Actuator::KARNER_2022.electrostatic_force(6000.0) * law.frequency_response(0.01).re;
        let mut voltage = 0.0;
        for phase in ["followed", "at 0 V", "another's voltage"] {
            let mut largest = [0.0_f64; 2];
            for k in 0..20_000 {
                let load = drive.load(voltage);
                let force_n = 0.95 * load.force_n + 0.05 * drive.load(0.0).force_n;
                let x: f64 = law.displacement_under(&mut film, Load { force_n, ..load });
                past.rotate_right(1);
                let sample = (k % 5 == 0).then_some(SensorSample { displacement_m: past[0], age_ticks: 5 });
                past[0] = x;
                let estimate = follower.observe(&mut state, Applied::as_commanded(voltage), sample);
                let mut error = estimate - x;
                match phase {
                    "followed" => {
                        let command = follower.command(&mut state, stroke_m);
                        (voltage, error) = (command.voltage_v, x - command.reference_m);
                    }
                    "at 0 V" => voltage = follower.command(&mut state, -stroke_m).voltage_v,
                    _ => {
                        follower.standby(&mut state);
                        voltage = 2500.0;
                    }
                }
                largest[usize::from(k > 15_000)] = largest[usize::from(k > 15_000)].max(error.abs());
            }
            assert!(largest[1] < 0.02 * stroke_m, "{case}, {phase}: {largest:?} m, stroke {stroke_m} m, {options:?}");
        }
    }
    println!("{lowered} lowered, {refused} refused");
    assert!(lowered > 10 && refused < 15);
}

/// A sensor that goes while the force scale is still on its way: there it stays.
#[test]
fn without_a_sensor_the_force_scale_stays() {
    let observer = observer(ObserverOptions::at_bandwidth(0.6));
    let (mut plant, mut state) = (Plant::new(1.25), observer.state(observer.law().state()));
    let mut sensor = Sensor { interval: 10, delay: 10, past: Vec::new() };
    let mut scales = Vec::new();
    for k in 0..12_000 {
        let sample = sensor.read(plant.step(volts(k), 0.0)).filter(|_| k < 3000);
        observer.observe(&mut state, Applied::as_commanded(volts(k) as f32), sample);
        scales.push(state.force_scale());
    }
    // It counts as lost 50 ms after the last sample.
    let (before, after) = (&scales[2000..3000], &scales[3050..]);
    println!("{} to {}, then {}", before[0], before[999], after[0]);
    assert!((before[0] - before[999]).abs() > 1e-3, "it moves");
    assert!(after.iter().all(|scale| scale.to_bits() == after[0].to_bits()), "it stays");
}

/// Noise of a sensor under a load that stays: the answers to it are no swing of the load, from which the stiffness shows.
#[test]
fn a_noisy_sensor_of_a_held_film_teaches_no_force_scale() {
    let law: Law<f32> = Law::compressed(&model(1.0), LawOptions::at_step(1e-3)).expect("a law");
    let options = ObserverOptions { delay_s: 0.014, sample_interval_s: 0.02, ..ObserverOptions::at_bandwidth(0.6) };
    let tracking =
        Tracking::<f32>::new(law.clone(), &Actuator::KARNER_2022, CommandLimits::BENCH, options).expect("valid");
    let mut random = Pcg64::seed_from_u64(23);
    for (factor, held_m, noise_m) in
        [(1.0, 1.0e-3, 1e-5), (0.8, 2.0e-3, 1e-5), (1.25, 1.5e-3, 3e-5), (1.0, 0.5e-3, 3e-5)]
    {
        let (mut plant, mut state, mut voltage_v) = (Plant::new(factor), tracking.state(law.state()), 0.0);
        let mut sensor = Sensor { interval: 20, delay: 14, past: Vec::new() };
        let mut scales = Vec::new();
        for k in 0..600_000 {
            let x = plant.step(f64::from(voltage_v), 0.0);
            let noise = (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
            let sample = sensor.read(x + noise_m * noise);
            tracking.observe(&mut state, Applied::as_commanded(voltage_v), sample);
            let reference_m = held_m * (f64::from(k) / 5e3).min(1.0);
            voltage_v = tracking.command(&mut state, reference_m as f32).voltage_v;
            if k % 60_000 == 59_999 {
                scales.push(f64::from(state.observer().force_scale()));
            }
        }
        println!("{factor} times as stiff, {held_m} m held, {noise_m} m of noise: {scales:.3?}");
        assert!(scales.iter().all(|scale| (scale / scales[0] - 1.0).abs() < 0.02), "{scales:?}");
    }
}
