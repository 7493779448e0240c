//! Blocks of self-sensing on an ideal capacitor, whose samples have closed forms: which blocks give one, its variance, and the time of another
//! sensor's samples.

use springpot::{
    CapacitanceRelation, FilmReading, SelfSensed, SelfSensing, SelfSensingFault, SelfSensingOptions, SelfSensingState,
    SensorSample,
};

const OPTIONS: SelfSensingOptions = SelfSensingOptions::BENCH;
const STEP_S: f64 = OPTIONS.step_s;
/// Ticks of a block, and the square of its phasor: the filter has a gain of 8, over 10 of 20 ticks.
const BLOCK: usize = 20;
const PHASOR_2: f64 = 4000.0 * 4000.0;

fn relation() -> CapacitanceRelation {
    CapacitanceRelation::of_geometry(700e-12, 0.06, 2.0, 900e-12)
}

/// A capacitor on an amplifier without a lag, whose voltage monitor shows the tone with a gain.
struct Bench {
    sensing: SelfSensing<f64>,
    state: SelfSensingState<f64>,
    reading: FilmReading<f64>,
    charge: f64,
    ticks: usize,
}

impl Bench {
    fn new(relation: &CapacitanceRelation, options: SelfSensingOptions) -> Self {
        let sensing = SelfSensing::new(relation, options).expect("valid");
        let (state, reading) = (sensing.state(), FilmReading { voltage_v: 0.0, current_a: 0.0 });
        Self { sensing, state, reading, charge: 0.0, ticks: 0 }
    }

    /// A tick at 2 kV, at whose end the film has this capacitance.
    fn tick(&mut self, capacitance_f: f64, gain: f64) -> Option<SelfSensed<f64>> {
        let sensed = self.sensing.sense(&mut self.state, self.reading);
        let voltage_v = self.sensing.drive(&self.state, 2000.0);
        let charge = capacitance_f * voltage_v;
        self.reading =
            FilmReading { voltage_v: 2000.0 + gain * (voltage_v - 2000.0), current_a: (charge - self.charge) / STEP_S };
        (self.charge, self.ticks) = (charge, self.ticks + 1);
        sensed
    }

    /// So many blocks of it.
    fn blocks(&mut self, count: usize, capacitance_f: f64, gain: f64) -> Vec<SelfSensed<f64>> {
        (0..BLOCK * count).filter_map(|_| self.tick(capacitance_f, gain)).collect()
    }
}

/// Noise of the current in a block, and of the voltage in a mean with weights of 1/64, whose variance is 1/127 of a block's. Its effect is the slope of
/// the relation over the logarithm of the capacitance.
#[test]
fn the_variance_has_its_closed_form_at_any_capacitance() {
    let certain = CapacitanceRelation { uncertainty_m: 1e-15, ..relation() };
    for options in [OPTIONS, SelfSensingOptions { voltage_noise_v: 2.0, ..OPTIONS }] {
        for capacitance_f in [700e-12, 880e-12] {
            let mut bench = Bench::new(&certain, options);
            let stated = bench.blocks(200, capacitance_f, 1.0).last().expect("sensed").variance_m2;
            let noise = 8.0 * 8.0 * 10.0 / PHASOR_2;
            let current = 2.0 * (options.current_noise_a * STEP_S / (2.0 * capacitance_f)).powi(2);
            let relative = noise * (current + options.voltage_noise_v.powi(2) / 127.0);
            let at = |share: f64| certain.displacement_of_change(share * capacitance_f / 700e-12 - 1.0);
            let slope = (at(1.0 + 1e-4) - at(1.0 - 1e-4)) / 2e-4;
            let expected = slope * slope * relative;
            assert!((stated / expected - 1.0).abs() < 1e-6, "{capacitance_f} F: {stated:e} m², not {expected:e}");
            if capacitance_f == 700e-12 {
                let of_rest = bench.sensing.noise_m(50.0, 1.0).powi(2);
                assert!((of_rest / expected - 1.0).abs() < 1e-6, "{of_rest:e} m², not {expected:e}");
            }
        }
    }
}

/// A voltage that is half a percent more is within the noise: the mean follows by 1/64 of the distance in a block.
#[test]
fn the_mean_of_the_tone_follows_within_64_blocks() {
    let mut bench = Bench::new(&relation(), OPTIONS);
    bench.blocks(100, 800e-12, 1.0);
    let left: Vec<f64> =
        bench.blocks(30, 800e-12, 1.005).iter().map(|sensed| 1.005 - 800e-12 / sensed.capacitance_f).collect();
    assert_eq!(left.len(), 30);
    // The first two blocks include ticks before it.
    for pair in left[2..].windows(2) {
        assert!((pair[1] / pair[0] - 63.0 / 64.0).abs() < 1e-6, "{pair:?}");
    }
}

#[test]
fn another_tone_gives_no_sample_for_three_blocks() {
    let mut bench = Bench::new(&relation(), OPTIONS);
    // One block fills the filter.
    assert_eq!(bench.blocks(10, 800e-12, 1.0).len(), 8);
    let sensed = bench.blocks(10, 800e-12, 1.2);
    assert_eq!(sensed.len(), 10 - 3);
    let found = sensed.last().expect("sensed").capacitance_f;
    assert!((found - 800e-12 / 1.2).abs() < 1e-17, "{found:e} F");
}

/// After the block that fills the filter.
#[test]
fn a_fault_is_two_blocks_in_a_row() {
    let sensing = SelfSensing::new(&relation(), OPTIONS).expect("valid");
    let mut state = sensing.state();
    assert_eq!(state.drive_v(), 0.0);
    let ticks = (1..).find(|_| {
        sensing.sense(&mut state, FilmReading { voltage_v: 0.0, current_a: 0.0 });
        state.fault().is_some()
    });
    assert_eq!((ticks, state.fault()), (Some(3 * BLOCK), Some(SelfSensingFault::NoTone)));
}

#[test]
fn a_reading_that_is_not_a_number_is_the_one_before() {
    let [mut bench, mut same] = [(); 2].map(|()| Bench::new(&relation(), OPTIONS));
    bench.blocks(5, 800e-12, 1.0);
    let before = bench.reading;
    bench.tick(800e-12, 1.0);
    same.blocks(5, 800e-12, 1.0);
    same.tick(800e-12, 1.0);
    bench.reading = FilmReading { voltage_v: f64::NAN, current_a: f64::INFINITY };
    same.reading = before;
    assert_eq!([&mut bench, &mut same].map(|bench| bench.tick(800e-12, 1.0)), [None; 2]);
    assert_eq!(bench.state, same.state);
}

/// A film at constant speed whose capacitance rises in proportion; another sensor's sample of every age, in every tick of a block. It is compared with what
/// the film sensed at its time, as far back as the oldest two of eight estimates, which are of 14 ticks ago and of every block before.
#[test]
fn a_sample_of_another_sensor_is_compared_at_its_time() {
    let linear = CapacitanceRelation { stroke_m: [0.06, 0.0, 0.0], uncertainty_m: 1e-3, ..relation() };
    let a_tick_m = 10e-3 * STEP_S;
    let advance = |bench: &mut Bench| bench.tick(700e-12 * (1.0 + a_tick_m * (bench.ticks + 1) as f64 / 0.06), 1.0);
    for phase in 0..BLOCK {
        for age in 0..BLOCK * 9 {
            let mut bench = Bench::new(&linear, OPTIONS);
            let begin = 10 * BLOCK + phase;
            for _ in 0..begin {
                advance(&mut bench);
            }
            // The readings are those of the tick before.
            let then = (begin - 1) as f64 - age as f64;
            let sample = SensorSample { displacement_m: a_tick_m * then, age_ticks: age };
            bench.sensing.correct(&mut bench.state, sample, 1e-16);
            let to_come = (1..).find(|_| advance(&mut bench).is_some()).expect("a block ends");
            let is_kept = age + to_come < 14 + 7 * BLOCK;
            let sensed = (0..BLOCK).find_map(|_| advance(&mut bench)).expect("a block ends");
            let (offset_m, uncertainty_m) = (bench.state.offset_m(), sensed.uncertainty_m());
            if is_kept {
                assert!(offset_m.abs() < 0.1 * a_tick_m, "{offset_m:e} m of a sample of {age} ticks, at {phase}");
                assert!(uncertainty_m < 0.1e-3, "{uncertainty_m:e} m after a sample of {age} ticks, at {phase}");
            } else {
                assert_eq!(offset_m, 0.0, "of a sample of {age} ticks, at {phase}");
                assert!(uncertainty_m > 0.99e-3, "{uncertainty_m:e} m after a sample of {age} ticks, at {phase}");
            }
        }
    }
}

#[test]
fn a_film_has_rested_before_the_first_tick() {
    let mut bench = Bench::new(&CapacitanceRelation { uncertainty_m: 1e-3, ..relation() }, OPTIONS);
    bench.blocks(3, 700e-12, 1.0);
    bench.sensing.correct(&mut bench.state, SensorSample { displacement_m: 0.0, age_ticks: 130 }, 1e-16);
    let sensed = bench.blocks(1, 700e-12, 1.0)[0];
    assert!(bench.state.offset_m().abs() < 1e-9, "{} m", bench.state.offset_m());
    assert!(sensed.uncertainty_m() < 0.1e-3);
}
