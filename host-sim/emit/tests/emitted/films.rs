//! Films to emit, and what drives them.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{
    Actuator, AmplifierLag, CapacitanceRelation, CommandLimits, Curve, Discretisation, Feedforward, Law, LawOptions,
    Learning, LearningOptions, Measure, ObserverOptions, Preload, Preset, SelfSensing, SelfSensingOptions, Spring,
    TemperatureDependence, Tracking,
};

use host_emit::Film;

/// All that a film's C is made of, and what it is compared with.
pub struct Case {
    pub name: String,
    pub law: Law<f32>,
    pub feedforward: Feedforward<f32>,
    pub tracking: Tracking<f32>,
    pub learning: Option<Learning<f32>>,
    pub sensed: Option<Sensed>,
    pub temperature: Option<TemperatureDependence>,
}

impl Case {
    /// The film as C, under `symbol`.
    pub fn film<'a>(&'a self, symbol: &'a str) -> Film<'a> {
        Film {
            symbol,
            name: &self.name,
            tracking: &self.tracking,
            learning: self.learning.as_ref(),
            self_sensing: self.sensed.as_ref().map(|sensed| &sensed.sensing),
            temperature: self.temperature.as_ref(),
        }
    }

    /// None: a law of control is refused.
    fn new(name: &str, law: Law<f32>, setup: &Setup, sensed: Option<Sensed>) -> Option<Self> {
        let Setup { actuator, amplifier, learning, bandwidths } = *setup;
        let limits = CommandLimits { amplifier, ..CommandLimits::BENCH };
        let tracking = bandwidths.iter().find_map(|&bandwidth_hz| {
            Tracking::new(law.clone(), &actuator, limits, ObserverOptions::at_bandwidth(bandwidth_hz)).ok()
        })?;
        let learning = learning
            .map(|options| Learning::new(&law, &actuator, limits.max_voltage_v, options).expect("options of learning"));
        let feedforward = Feedforward::new(law.clone(), &actuator, limits).expect("as tracking");
        let temperature = (amplifier != AmplifierLag::NONE).then_some(WARMS);
        Some(Self { name: name.into(), law, feedforward, tracking, learning, sensed, temperature })
    }

    /// The published model by these options, behind `curve`, or beside or in series with a spring of its shape.
    fn published(name: &str, options: LawOptions, curves: Curves, setup: &Setup) -> Self {
        let law = Law::compressed(&Preset::TABLE3_N2.model().expect("valid"), options).expect("valid");
        let law = match curves {
            Curves::None => law,
            Curves::One => law.behind(&curve()).expect("a curve"),
            Curves::Two => {
                let measure = Measure { exponent: 0.0, length_m: 0.01 }.curve(-0.8e-3, 2.4e-3).expect("rises");
                law.beside(&Spring::of_curve(&curve(), 3e3).expect("valid"), &measure).expect("curves")
            }
            Curves::Series => law.in_series(&Spring::of_curve(&curve(), 3e4).expect("valid")).expect("it rises"),
        };
        Self::new(name, law, setup, Some(Sensed::random(33))).expect("accepted")
    }
}

/// How films whose amplifier lags change with their temperature: in numbers that single precision has.
const WARMS: TemperatureDependence =
    TemperatureDependence { reference_c: 22.5, stiffness_per_k: -0.0078125, activation_kj_per_mol: 32.0 };

/// Self-sensing of a film, and what it was built of.
pub struct Sensed {
    pub sensing: SelfSensing<f32>,
    pub relation: CapacitanceRelation,
    pub options: SelfSensingOptions,
}

impl Sensed {
    fn new(relation: CapacitanceRelation, options: SelfSensingOptions) -> Self {
        Self { sensing: SelfSensing::new(&relation, options).expect("valid"), relation, options }
    }

    /// A film of any geometry whose relation creeps either way, any tone, monitors, cables.
    fn random(seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut of = |low: f64, high: f64| random.random_range(low..high);
        let rest_f = of(200e-12, 900e-12);
        let max_f = rest_f * of(1.1, 1.5);
        let geometry = CapacitanceRelation::of_geometry(rest_f, of(0.02, 0.1), of(1.0, 4.0), max_f);
        let relation = CapacitanceRelation { creep: of(-0.1, 0.2), alpha: of(0.1, 0.9), ..geometry };
        let options = SelfSensingOptions {
            tone_v: of(20.0, 100.0),
            periods: 2 + (seed % 12) as u16,
            cable_f: if seed % 3 == 2 { 0.0 } else { rest_f * of(0.1, 0.3) },
            drift_s: of(1.0, 600.0),
            ..SelfSensingOptions::BENCH
        };
        Self::new(relation, options)
    }
}

/// Curves of a film.
enum Curves {
    None,
    One,
    Two,
    Series,
}

struct Setup {
    actuator: Actuator,
    amplifier: AmplifierLag,
    learning: Option<LearningOptions>,
    bandwidths: &'static [f64],
}

/// The paper's bench: an amplifier that follows at once, nothing learned.
const BENCH: Setup =
    Setup { actuator: Actuator::KARNER_2022, amplifier: AmplifierLag::NONE, learning: None, bandwidths: &[0.6] };
const AT_1_KHZ: LawOptions = LawOptions::at_step(1e-3);

/// The paper's film on the paper's bench.
pub fn plain() -> Case {
    Case::published("karner-2022-table3-n2", AT_1_KHZ, Curves::None, &BENCH)
}

/// The same film, of which cycles are learned: nothing else differs.
pub fn learned() -> Case {
    let setup = Setup { learning: Some(LearningOptions::BENCH), ..BENCH };
    Case::published("karner-2022-table3-n2", AT_1_KHZ, Curves::None, &setup)
}

/// Everything that a film can have at once: a curve that ends within the stroke, second-order differences, saturation, coupling, a weight from the start,
/// an amplifier that lags, a period that is learned and was not given.
pub fn rich() -> Case {
    rich_with(Curves::One)
}

/// The same with two curves.
pub fn richest() -> Case {
    rich_with(Curves::Two)
}

/// The same with a spring in series.
pub fn in_series() -> Case {
    rich_with(Curves::Series)
}

fn rich_with(curves: Curves) -> Case {
    let preload = Preload::FromStart;
    let actuator = Actuator { stretch_coupling: 20.0, saturation_v: Some(9000.0), preload, ..Actuator::KARNER_2022 };
    let amplifier = AmplifierLag { rise_s: 0.03, fall_s: 0.2 };
    let setup = Setup { actuator, amplifier, learning: Some(LearningOptions::BENCH), ..BENCH };
    Case::published("rich */ film", AT_1_KHZ.with_method(Discretisation::Bdf2), curves, &setup)
}

/// Films of short cycles: whose period is given, and whose period is found behind an amplifier that lags.
pub fn cycles() -> [Case; 2] {
    let lagging = AmplifierLag { rise_s: 0.02, fall_s: 0.1 };
    let films = [(Some(0.5), Preload::Settled, AmplifierLag::NONE), (None, Preload::FromStart, lagging)];
    films.map(|(period_s, preload, amplifier)| {
        let actuator = Actuator { preload, ..Actuator::KARNER_2022 };
        let learning = Some(LearningOptions { period_s, ..LearningOptions::BENCH });
        Case::published("cycles", AT_1_KHZ, Curves::None, &Setup { actuator, amplifier, learning, bandwidths: &[0.5] })
    })
}

/// A film whose period is given, at another rate.
pub fn periodic() -> Case {
    let learning = Some(LearningOptions { period_s: Some(10.0), harmonics: 4, ..LearningOptions::BENCH });
    let setup = Setup { learning, bandwidths: &[0.4], ..BENCH };
    Case::published("periodic", LawOptions::at_step(2e-3), Curves::None, &setup)
}

/// A film of the chip program: what its laws of control are built of.
pub fn of_program(film: chip_program::Film) -> Case {
    let model = Preset::named(film.preset).expect("a preset").model().expect("valid").with_topology(film.topology);
    let options = LawOptions::at_step(film.step_s).with_method(film.method);
    let law: Law<f32> = Law::compressed(&model, options).expect("valid");
    let learning = LearningOptions { period_s: Some(0.05), sample_interval_s: 1e-3, ..LearningOptions::BENCH };
    let learning = (!film.is_curved()).then_some(learning);
    let setup = Setup { actuator: film.actuator(), learning, ..BENCH };
    // As in the chip program.
    let sensed =
        (film == chip_program::FILMS[1]).then(|| Sensed::new(chip_program::relation(), SelfSensingOptions::BENCH));
    Case::new(film.preset, film.bent(law), &setup, sensed).expect("accepted")
}

/// 16 pieces from −0.8 mm to 2.4 mm, softer by a tenth, then stiffer.
fn curve() -> Curve {
    let points: Vec<(f64, f64)> = (0..17)
        .map(|k| {
            let x = 2e-4 * (f64::from(k) - 4.0);
            (x, x * (1.0 + x * (4e4 * x - 80.0)))
        })
        .collect();
    Curve::through(&points).expect("it rises")
}

/// `count` films of random models: of eight two behind a random curve, one beside a spring and one in series with it; every third second-order.
pub fn random(count: usize) -> Vec<Case> {
    let models = crate::models::random_models(16, 2 * count);
    let cases = models.iter().enumerate().filter_map(|(k, (name, model))| {
        let method = if k % 3 == 2 { Discretisation::Bdf2 } else { Discretisation::Gl };
        let law: Law<f32> = Law::compressed(model, LawOptions::at_step(1e-3).with_method(method)).ok()?;
        let spring = || Spring::of_curve(&random_curve(k + 1), 3e3 * k as f64).ok();
        let law = match k % 8 {
            1 | 5 => law.behind(&random_curve(k)).ok()?,
            3 => law.beside(&spring()?, &random_curve(k % 7)).ok()?,
            7 => law.in_series(&spring()?).ok()?,
            _ => law,
        };
        let amplifier = if k % 5 == 4 { AmplifierLag { rise_s: 0.05, fall_s: 0.05 } } else { AmplifierLag::NONE };
        let setup = Setup {
            actuator: Actuator { saturation_v: (k % 4 == 3).then_some(8000.0), ..Actuator::KARNER_2022 },
            amplifier,
            learning: (k % 7 == 6).then_some(LearningOptions { period_s: Some(0.5), ..LearningOptions::BENCH }),
            bandwidths: &[0.6, 0.1, 0.02, 0.004, 0.001],
        };
        Case::new(name, law, &setup, Some(Sensed::random(k as u64)))
    });
    let cases: Vec<Case> = cases.take(count).collect();
    assert_eq!(cases.len(), count, "too few of the random models have a law and an observer");
    let in_series = cases.iter().filter(|case| case.law.coefficients().has_spring_in_series()).count();
    assert!(in_series > count / 16, "{in_series} of {count} have a spring in series");
    cases
}

fn random_curve(seed: usize) -> Curve {
    let pieces = 2 + seed % 15;
    let points: Vec<(f64, f64)> = (0..=pieces)
        .map(|k| {
            let x = 4e-3 * (k as f64 / pieces as f64 - 0.3);
            (x, x * (1.0 + x * ((seed % 50) as f64 - 25.0)))
        })
        .collect();
    Curve::through(&points).expect("it rises")
}
