//! The constants that a tick computes with, from the times, shares and bounds that the documentation states: the emitted C has them too, so that no
//! comparison of both notices another one. The film is a spring beside one that relaxes, whose stiffness has a closed form.

use std::f64::consts::{PI, TAU};

use springpot::{
    Actuator, AmplifierLag, CapacitanceRelation, CommandLimits, Law, LawOptions, Learning, LearningOptions, Maxwell,
    Numbers, ObserverOptions, SelfSensing, SelfSensingOptions, Springpot, Topology, Tracking,
};

const STEP_S: f64 = 1e-3;
const SPRING: f64 = 2e4;
const RELAXES: f64 = 1e4;
const RELAXATION_S: f64 = 0.5;
const BANDWIDTH_HZ: f64 = 0.6;
const OMEGA: f64 = TAU * BANDWIDTH_HZ;
/// Adaptation time and sample interval of [`ObserverOptions::at_bandwidth`], s.
const ADAPTATION_S: f64 = 30.0;
const SAMPLE_S: f64 = 0.01;

/// The constants of each structure, in order.
#[derive(Default)]
struct Visited {
    structure: &'static str,
    values: Vec<(&'static str, &'static str, f64)>,
}

impl Numbers<f64> for Visited {
    fn structure(&mut self, name: &'static str, _: &'static str) {
        self.structure = name;
    }

    fn number(&mut self, name: &'static str, value: f64, _: &'static str) {
        self.values.push((self.structure, name, value));
    }

    fn count(&mut self, name: &'static str, value: u32, about: &'static str) {
        self.number(name, f64::from(value), about);
    }
}

impl Visited {
    /// The first constants of a structure are these, within rounding or a per mille: as far as the steps of 1 ms are from the continuous film.
    fn begin(&self, structure: &str, expected: &[(&str, &[f64])]) {
        let mut found = self.values.iter().filter(|(of, ..)| *of == structure);
        for (name, values) in expected {
            for &value in *values {
                let &(_, found_name, found) = found.next().expect("as many");
                assert_eq!(found_name, *name, "{structure}");
                let near = found == value || (found - value).abs() < 1e-3 * value.abs();
                assert!(near, "{structure}.{name}: {found} instead of {value}");
            }
        }
    }

    fn are(&self, structure: &str, expected: &[(&str, &[f64])]) {
        let count: usize = expected.iter().map(|(_, values)| values.len()).sum();
        assert_eq!(count, self.values.iter().filter(|(of, ..)| *of == structure).count(), "{structure}");
        self.begin(structure, expected);
    }
}

fn law() -> Law<f64> {
    law_of(SPRING, STEP_S)
}

/// The film with another spring that stays, N/m, or another step.
fn law_of(spring: f64, step_s: f64) -> Law<f64> {
    let branch = [Springpot::new(RELAXES, 0.0), Springpot::new(RELAXES * RELAXATION_S, 1.0)];
    let model = Maxwell::new(Springpot::new(spring, 0.0), &[branch], Topology::Parallel, 0.0).expect("valid");
    Law::compressed(&model, LawOptions::at_step(step_s)).expect("a law")
}

/// Largest force, N.
fn largest_n() -> f64 {
    Actuator::KARNER_2022.electrostatic_force(6000.0)
}

/// Stiffness at a frequency in phase with the displacement, and a quarter of a cycle before it, N/m.
fn stiffness_at(frequency_hz: f64) -> [f64; 2] {
    let turn = TAU * frequency_hz * RELAXATION_S;
    let relaxes = RELAXES * turn / (1.0 + turn * turn);
    [SPRING + relaxes * turn, relaxes]
}

/// Stroke at the largest voltage, m: of slow changes, at 1 Hz.
fn stroke_m() -> f64 {
    largest_n() / stiffness_at(1.0)[0]
}

/// Weight of a step of a backward difference, for a rate.
fn weight(rate: f64, step_s: f64) -> f64 {
    1.0 - 1.0 / (1.0 + rate * step_s)
}

fn tracking() -> Visited {
    let limits = CommandLimits { amplifier: AmplifierLag { rise_s: 0.02, fall_s: 0.05 }, ..CommandLimits::BENCH };
    let options = ObserverOptions::at_bandwidth(BANDWIDTH_HZ);
    let tracking = Tracking::<f64>::new(law(), &Actuator::KARNER_2022, limits, options).expect("valid");
    let mut visited = Visited::default();
    tracking.numbers(&mut visited);
    tracking.numbers_of_changes(&mut visited);
    visited
}

#[test]
fn an_observer_has_the_constants_of_its_bandwidth() {
    let ([elastic, viscous], largest_n) = (stiffness_at(BANDWIDTH_HZ), largest_n());
    let per_tick = OMEGA * STEP_S;
    tracking().are(
        "observer",
        &[
            ("gains", &[viscous, elastic * per_tick, 0.5 * elastic * per_tick * per_tick]),
            // 50 ms.
            ("lost_after", &[50.0]),
            ("smoothing", &[weight(4.0 * OMEGA, STEP_S)]),
            ("recovery", &[weight(OMEGA, STEP_S)]),
            ("averaging", &[weight(1.0 / 20.0, STEP_S)]),
            ("forgetting", &[weight(1.0 / ADAPTATION_S, STEP_S)]),
            ("forgetting_slope", &[weight(OMEGA, SAMPLE_S)]),
            ("adapting", &[1.0]),
            // A tenth of the largest force over a tenth of a second.
            ("regularisation", &[(0.1 * largest_n).powi(2) * 0.1 / STEP_S]),
            ("excited", &[0.02 * largest_n]),
            ("max_disturbance", &[largest_n]),
            ("max_slope", &[largest_n * per_tick]),
            ("max_innovation", &[largest_n / elastic]),
            ("statistics", &[1.0 / 200.0]),
            ("full_share", &[0.9]),
            ("scales", &[0.25, 4.0]),
        ],
    );
}

/// A time of 0 turns the adaptation off, any other one on; a film that has no losses needs no proportional action.
#[test]
fn an_observer_adapts_unless_its_time_is_0() {
    let spring = Maxwell::new(Springpot::new(SPRING, 0.0), &[], Topology::Parallel, 0.0).expect("valid");
    for (adaptation_s, adapting, forgetting) in
        [(0.0, 0.0, 0.0), (0.5, 1.0, weight(2.0, STEP_S)), (f64::INFINITY, 1.0, 0.0)]
    {
        let law = Law::compressed(&spring, LawOptions::at_step(STEP_S)).expect("a law");
        let options = ObserverOptions { adaptation_s, ..ObserverOptions::at_bandwidth(BANDWIDTH_HZ) };
        let tracking = Tracking::<f64>::new(law, &Actuator::KARNER_2022, CommandLimits::BENCH, options).expect("valid");
        let mut visited = Visited::default();
        tracking.numbers(&mut visited);
        let number = |wanted: &str| {
            visited.values.iter().find(|(of, name, _)| (*of, *name) == ("observer", wanted)).expect("there").2
        };
        assert!(
            (number("forgetting") - forgetting).abs() < 1e-12 && number("adapting") == adapting,
            "{adaptation_s} s"
        );
        assert!(number("gains").abs() < 1e-6, "{}", number("gains"));
        // Nothing of it relaxes: all of the stiffness lasts, and a round has no modes.
        let mut changes = Visited::default();
        tracking.numbers_of_changes(&mut changes);
        let [first, count, _, lasting] = [0, 1, 2, 3].map(|index| changes.values[index].2);
        assert_eq!((first, count), (0.0, 0.0));
        assert!((lasting - SPRING).abs() < 1e-6, "{lasting} N/m");
    }
}

/// The correction fades from 0.6 to 0.85 bandwidths. A sine through a high-pass of 2 / ω, whose path is low-passed with the same time, has the path length
/// over the net excursion of √(1 + 4 r²) at r bandwidths.
#[test]
fn the_correction_fades_between_the_stated_bandwidths() {
    let [full, faded] = [0.6_f64, 0.85].map(|bandwidths| (1.0 + 4.0 * bandwidths * bandwidths).sqrt());
    let slope = (1.0 - 0.03) / (faded - full);
    let times = [2.0, 4.0, 1.0].map(|time| weight(OMEGA / time, SAMPLE_S));
    tracking().are(
        "fade",
        &[
            ("high_pass", &times[..1]),
            ("averaging", &times[1..2]),
            ("smoothing", &times[2..]),
            ("floor", &[2e-3 * stroke_m()]),
            ("intercept", &[1.0 + slope * full]),
            ("slope", &[slope]),
            ("min_share", &[0.03]),
        ],
    );
}

#[test]
fn a_command_has_the_constants_of_its_limits() {
    let left = |time_s: f64| (-STEP_S / time_s).exp();
    // Two poles at 5 Hz.
    let pole = 1.0 / (1.0 + TAU * 5.0 * STEP_S);
    let tracking = tracking();
    // At once the film has nearly both springs.
    let max_return_m = 0.1 * largest_n() / (SPRING + RELAXES / (1.0 + STEP_S / RELAXATION_S));
    tracking.are(
        "inverse",
        &[
            ("max_increment", &[0.05 * STEP_S]),
            ("max_change", &[0.5 * STEP_S * STEP_S]),
            ("damping", &[1.0 - pole * pole]),
            ("approach", &[(1.0 - pole) / (1.0 + pole)]),
            ("max_return", &[max_return_m]),
            ("max_voltage", &[6000.0]),
            ("field_voltage", &[4.2e7 * 160e-6]),
            ("thinning", &[0.0]),
            ("slew", &[50e3 * STEP_S]),
            ("averaging", &[weight(1.0 / 10.0, STEP_S)]),
            ("gain_share", &[0.02]),
            ("gains", &[0.8, 1.25]),
        ],
    );
    tracking.are(
        "amplifier",
        &[
            ("up", &[1.0 - left(0.02)]),
            // An amplifier falls no more slowly than it rises, but for its bleeder.
            ("down", &[1.0 - left(0.02)]),
            ("left", &[left(0.05)]),
            // 0.4 % of the largest voltage, of a pace that is known to 30 %.
            ("reading_share", &[0.004 / 0.3]),
            ("gain_s", &[10.0]),
            ("paces", &[1.0 / 1.5, 2.0]),
        ],
    );
}

/// A round of ticks visits each mode of the memory once, and has two more ticks. A film has aged by 1 with a tenth in stiffness, a quarter in memory, half in
/// its rates, a twentieth in their spread.
#[test]
fn an_adaptation_has_the_constants_of_its_expectations() {
    let ([elastic, _], largest_n, tracking) = (stiffness_at(BANDWIDTH_HZ), largest_n(), tracking());
    let count = tracking.values.iter().find(|(.., name, _)| *name == "count").expect("there").2;
    let round_s = (count + 2.0) * STEP_S;
    let blend = weight(1.0, round_s);
    let relaxes = RELAXES / (1.0 + STEP_S / RELAXATION_S);
    let rounded = 1.0 + 1e-5;
    let forgotten = round_s / ADAPTATION_S;
    let row = |expected: f64, bound: f64, forgetting: f64, relinearising: f64, aged: f64| {
        [expected, bound, bound * rounded, forgetting * forgotten, relinearising, 1.0 / aged]
    };
    let rows = [
        row(0.3, 4.0_f64.ln(), 0.0, 0.0, 1.1_f64.ln()),
        row(0.3, 0.7, 0.25, 2.5, 1.25_f64.ln()),
        row(0.7, 3.0_f64.ln(), 0.25, 2.5, 1.5_f64.ln()),
        row(0.15, 0.25, 0.25, 2.5, 0.05),
        [0.005 * largest_n, largest_n, f64::INFINITY, 0.5 * forgotten, 0.0, 0.0],
    ];
    tracking.begin(
        "adaptation",
        &[
            ("first", &[0.0]),
            ("count", &[count]),
            ("step", &[STEP_S]),
            ("lasting", &[SPRING]),
            ("relaxing", &[relaxes]),
            ("share", &[1.0 - SPRING / elastic]),
            ("stiffness", &[elastic]),
            ("ticks", &[count + 2.0]),
            ("blend", &[blend]),
            ("averaging", &[blend / 20.0]),
            // 1.5 % of the largest force in 0.1 s.
            ("precision", &[(round_s / 0.1).sqrt() / (0.015 * largest_n)]),
            ("excited", &[0.01 * largest_n]),
            ("plausible", &[9.0]),
            ("described", &[0.9]),
            // Half a percent of the force scale in an adaptation time.
            ("wandering", &[(0.005_f64 / 0.3).powi(2) * forgotten]),
            ("by_chance", &[3.0]),
            ("min_change", &[0.0125]),
            ("forgotten", &[1e-3]),
            ("logarithm", &[2.0 / 3.0, 2.0 / 5.0]),
            ("exponential", &[1.0 / 16.0, 1.0 / 6.0]),
        ],
    );
    let found: Vec<f64> = tracking.values.iter().filter(|(.., name, _)| *name == "parameters").map(|v| v.2).collect();
    for (found, expected) in found.iter().zip(rows.as_flattened()) {
        // Bounds and changes are stated with three digits.
        assert!(found == expected || (found - expected).abs() < 5e-3 * expected.abs(), "{found} instead of {expected}");
    }
    assert_eq!(found.len(), rows.as_flattened().len());
}

/// Relaxation is separated from stiffness up to nine tenths of it.
#[test]
fn a_film_that_relaxes_nearly_completely_has_one_stiffness() {
    let relaxes = stiffness_at(BANDWIDTH_HZ)[0] - SPRING;
    for (spring, is_apart) in [(2e3, true), (500.0, false)] {
        let options = ObserverOptions::at_bandwidth(BANDWIDTH_HZ);
        let tracking =
            Tracking::<f64>::new(law_of(spring, STEP_S), &Actuator::KARNER_2022, CommandLimits::BENCH, options)
                .expect("valid");
        let mut visited = Visited::default();
        tracking.numbers_of_changes(&mut visited);
        let found = visited.values.iter().find(|(.., name, _)| *name == "share").expect("there").2;
        let share = if is_apart { relaxes / (spring + relaxes) } else { 0.0 };
        // As far as steps of 1 ms are from the continuous film.
        assert!((found - share).abs() < 1e-3, "{found} instead of {share}");
    }
}

#[test]
fn learning_has_the_stated_constants() {
    let learning = Learning::<f64>::new(&law(), &Actuator::KARNER_2022, 6000.0, LearningOptions::BENCH).expect("valid");
    let mut visited = Visited::default();
    learning.numbers(&mut visited);
    visited.are(
        "learning",
        &[
            ("min_swing", &[1e-3 * stroke_m()]),
            ("swing_decay", &[weight(1.0 / 20.0, STEP_S)]),
            ("hysteresis", &[0.1]),
            ("overdue", &[1.5]),
            ("agreement", &[0.02]),
            ("period", &[0.0]),
            ("harmonics", &[6.0]),
            // 0.3 of a sensor of 100 Hz.
            ("largest_angle", &[TAU * 30.0 * STEP_S]),
            ("rate", &[1000.0]),
            // The mean and six harmonics are visited in turn, each with a time constant of 0.1 s.
            ("approach", &[7.0 * STEP_S / 0.1]),
            ("slow", &[TAU * 2.0]),
            ("initial_step_size", &[0.6]),
            ("probing_step_size", &[0.05]),
            ("step_size", &[0.8]),
            ("inverse_gains", &[1e-3, 25.0]),
            ("mean_inverse_gains", &[0.4, 2.5]),
            ("significance", &[25.0]),
            ("drift_unknown", &[-2.0, -1.0]),
            ("drift_kept", &[0.7]),
            ("drift_significance", &[9.0]),
            ("unresponsive_blocks", &[2.0]),
            ("growth", &[1.2, 1.5, 2.0]),
            ("noise_parts", &[26.0]),
            ("excess", &[6.0]),
            ("excess_samples", &[16.0]),
            ("taken", &[1.0 / 16.0]),
            ("caution", &[0.5, 1.2]),
            ("harm", &[1.5]),
            ("trust", &[0.5, 0.1]),
            ("settled", &[0.9, 0.7]),
            ("no_error", &[1e30]),
            ("series_angle", &[0.35]),
            ("cosine", &[1.0, -1.0 / 2.0, 1.0 / 24.0, -1.0 / 720.0]),
            ("sine", &[1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0]),
            ("settling_s", &[0.2, 0.5]),
            ("min_block_s", &[0.5, 2.5]),
            ("max_block_s", &[4.0 * 2.5]),
            ("min_samples", &[16.0]),
            ("smoothing", &[0.2]),
            ("fade_weight", &[0.1]),
            ("same_period", &[0.3]),
            ("faded_out", &[0.01]),
            ("turn", &[TAU]),
        ],
    );
}

/// At 50 Hz a round of visits takes longer than their time constant: each goes all the way.
#[test]
fn learning_goes_all_the_way_at_most() {
    let slow = law_of(SPRING, 0.02);
    let options = LearningOptions { sample_interval_s: 0.02, ..LearningOptions::BENCH };
    let learning = Learning::<f64>::new(&slow, &Actuator::KARNER_2022, 6000.0, options).expect("valid");
    let mut visited = Visited::default();
    learning.numbers(&mut visited);
    let approach = visited.values.iter().find(|(_, name, _)| *name == "approach").expect("there").2;
    assert_eq!(approach, 1.0);
}

/// Five periods of four ticks, and monitors of 16 bits over 6 kV and 0.5 mA with noise of 2 bits. The filter of three ticks has a gain of 8 at the tone.
#[test]
fn self_sensing_has_the_constants_of_its_tone() {
    let relation = CapacitanceRelation::of_geometry(700e-12, 0.06, 2.0, 900e-12);
    let sensing = SelfSensing::<f64>::new(&relation, SelfSensingOptions::BENCH).expect("valid");
    let mut visited = Visited::default();
    sensing.numbers(&mut visited);
    let bits = |range: f64| 2.0 * range / 65536.0;
    let noise = 8.0 * 8.0 * 20.0 / 2.0;
    let admittance = |capacitance_f: f64| 2.0 * capacitance_f / STEP_S;
    visited.begin(
        "self_sensing",
        &[
            ("ticks", &[20.0]),
            ("age", &[14.0]),
            ("tone", &[50.0]),
            ("capacitance", &[0.5 * STEP_S]),
            ("resistance", &[4.0 / PI]),
            ("voltage_noise", &[noise * bits(6000.0).powi(2)]),
            ("current_noise", &[2.0 * noise * bits(0.5e-3).powi(2)]),
            ("variance", &[relation.uncertainty_m.powi(2)]),
            ("drift", &[1.0 - (-2.0_f64 * 0.02 / 600.0).exp()]),
            ("least_weight", &[1.0 / 64.0]),
            ("another", &[32.0]),
            ("others", &[3.0]),
            ("settling", &[1.0]),
            ("faulty", &[2.0]),
            // A quarter of the tone.
            ("min_voltage", &[(0.25 * 8.0 * 10.0 * 50.0_f64).powi(2)]),
            ("max_current", &[20.0 * 0.2e-3]),
            // Half of the cable, the film at rest, half of both, and twice the largest.
            ("min_admittance", &[admittance(50e-12).powi(2)]),
            ("rest_admittance", &[admittance(700e-12).powi(2)]),
            ("min_capacitance", &[0.5 * (100e-12 + 700e-12)]),
            ("max_capacitance", &[2.0 * 900e-12]),
            ("rest", &[700e-12]),
            ("per_rest", &[1.0 / 700e-12]),
            // A quarter of the range beyond both ends.
            ("changes", &[-0.25 * 200.0 / 700.0, 1.25 * 200.0 / 700.0]),
            // The square root of a stretch, and its slope.
            ("stroke", &[0.03, -0.0075, 0.00375]),
            ("slope", &[-0.015, 0.01125]),
            ("creep", &[0.0]),
            ("instant", &[1.0]),
        ],
    );
    assert_eq!(SelfSensingOptions::BENCH.age_ticks(), 14);
    // Where the cable is not known, a sixteenth of the film has to show.
    let unknown = SelfSensingOptions { cable_f: 0.0, ..SelfSensingOptions::BENCH };
    let mut visited = Visited::default();
    SelfSensing::<f64>::new(&relation, unknown).expect("valid").numbers(&mut visited);
    let least = visited.values.iter().find(|(.., name, _)| *name == "min_admittance").expect("there").2;
    assert!((least / admittance(700e-12 / 16.0).powi(2) - 1.0).abs() < 1e-12, "{least}");
}
