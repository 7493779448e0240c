//! Films that are no longer what was recorded: stiffer, softer, faster, slower, under another load. A minute with the sensor, ten without.
//!
//! `SPRINGPOT_SWEEP=full cargo test --release -p host-models --test it changed_films -- --nocapture` prints the table of docs/results.md; the
//! default runs some rows of the film that its law describes. The bench is the default one.

use host_io::files::parameters::Parameters;
use host_io::grid::Grid;
use host_models::fit::settings::CurveChoice;
use host_models::simulation::closed_loop::{self, BenchModel, LoopTick};
use host_models::simulation::controllers::ControllerKind;
use host_models::simulation::film::{self, Film};
use host_models::simulation::plant::{Mismatch, NonlinearPlant, Plant};
use rayon::prelude::*;
use springpot::{CommandLimits, GRAVITY, Maxwell, Preload, Springpot};

use crate::hours::Kind;
use crate::plants::{BlendedFilm, Change, LITTLE_CREEP, MUCH_CREEP, Stiffening, StiffeningFilm};
use crate::recorded::{controller, risen_sine_m};
use crate::sweep::full_sweep;
use crate::{measured_curve, two_curves};

pub(crate) const RATE_HZ: f64 = 1000.0;
const LOST_S: (f64, f64) = (60.0, 660.0);

/// A film, and the law that was fitted to it: of hossain with two curves to half an hour and twice 155 s, of the others as for hours and hertz.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Changing {
    Hossain,
    Wang,
    LittleCreep,
    MuchCreep,
    /// Films that their laws describe exactly.
    Springpot,
    TwoCurves,
    /// Hossain with the law of `springpot demo`, which has no curve: no values of what is estimated describe another stiffness.
    Straight,
}

pub(crate) const ALL: [Changing; 6] = [
    Changing::Hossain,
    Changing::Wang,
    Changing::LittleCreep,
    Changing::MuchCreep,
    Changing::Springpot,
    Changing::TwoCurves,
];

impl Changing {
    pub(crate) fn is_described(self) -> bool {
        matches!(self, Self::Springpot | Self::TwoCurves)
    }

    pub(crate) fn parameters(self) -> Parameters {
        match self {
            Self::Hossain => {
                let mut observations = vec![two_curves::of_finite_strain(6e3, 0.1, 1800.0, 100)];
                observations.extend([1.0 / 7.0, 0.2].map(|hz| two_curves::of_finite_strain(6e3, hz, 155.0, 10)));
                two_curves::fitted(&observations, CurveChoice::Two)
            }
            Self::Wang => Kind::Wang.parameters(),
            Self::LittleCreep => Kind::LittleCreep.parameters(),
            Self::MuchCreep => Kind::MuchCreep.parameters(),
            Self::Springpot => settled(measured_curve::film()),
            Self::TwoCurves => settled(two_curves::parsed(two_curves::FILE).expect("valid")),
            Self::Straight => two_curves::parsed(STRAIGHT).expect("valid"),
        }
    }

    /// Lowest and highest displacement of the reference, m.
    pub(crate) fn stroke_m(self) -> [f64; 2] {
        match self {
            Self::Hossain => [2e-3, 4e-3],
            Self::Straight => [1.5e-3, 4e-3],
            Self::Wang => [0.6e-3, 1.4e-3],
            Self::LittleCreep | Self::MuchCreep => [1e-3, 2.6e-3],
            Self::Springpot => [6e-3, 10e-3],
            Self::TwoCurves => [1.5e-3, 3e-3],
        }
    }

    /// Limits that leave room for a stiffer film.
    pub(crate) fn limits(self) -> CommandLimits {
        let max_voltage_v = match self {
            Self::Hossain | Self::Wang | Self::Straight => 8000.0,
            Self::TwoCurves => 6500.0,
            Self::LittleCreep | Self::MuchCreep | Self::Springpot => 4500.0,
        };
        CommandLimits { max_voltage_v, max_field_v_per_m: 1e8, ..CommandLimits::BENCH }
    }

    /// The film with `change` under a weight that is `load` times as heavy. Where the film does not hang on it, a constant force.
    pub(crate) fn plant(self, parameters: &Parameters, change: Change, load: f64, substep_s: f64) -> Box<dyn Plant> {
        let stiffening = |elements| {
            let film = Stiffening::with(elements);
            let weight_n = (load - 1.0) * film.inertia.0 * GRAVITY;
            Box::new(StiffeningFilm::new(Stiffening { weight_n, ..film }, substep_s).changed(change))
        };
        let strip = |plant| {
            let film = Film::new(plant).stiffened(change.stiffness).warmed(1.0, change.times).loaded(load);
            // It lives as long as the test.
            Box::new(NonlinearPlant::at_rest(Box::leak(Box::new(film)), substep_s))
        };
        match self {
            Self::Hossain | Self::Straight => strip(film::Plant::Hossain),
            Self::Wang => strip(film::Plant::Wang),
            Self::LittleCreep => stiffening(LITTLE_CREEP),
            Self::MuchCreep => stiffening(MUCH_CREEP),
            Self::Springpot | Self::TwoCurves => {
                let mut film = BlendedFilm::at_rest(&changed(parameters, change), None, substep_s);
                film.weight_n = (load - 1.0) * parameters.actuator.mass_kg * GRAVITY;
                Box::new(film)
            }
        }
    }

    /// Follows a sine of 10 s, without the sensor where it is `lost_s`: each tick with its time (s).
    fn follow(
        self,
        kind: ControllerKind,
        parameters: &Parameters,
        (change, load): (Change, f64),
        lost_s: (f64, f64),
        mut seen: impl FnMut(f64, LoopTick),
    ) {
        let [low_m, high_m] = self.stroke_m();
        let grid = Grid::covering(lost_s.1, RATE_HZ).expect("a grid");
        let mut controller = controller(kind, parameters, self.limits(), None, high_m);
        let mut plant = self.plant(parameters, change, load, closed_loop::substeps(grid).1);
        let bench = BenchModel { sensor_lost_s: vec![lost_s], ..BenchModel::default() };
        let reference = |k: usize| risen_sine_m(grid.time_s(k), 5.0, low_m, high_m, 0.1);
        closed_loop::follow(plant.as_mut(), &bench, controller.as_mut(), reference, grid, |k, tick| {
            seen(grid.time_s(k), tick);
            Ok(())
        })
        .unwrap_or_else(|error| panic!("{self:?} {change:?}: {error}"));
    }

    /// RMS error without the sensor, in % of peak to peak.
    fn error_pct(self, kind: ControllerKind, parameters: &Parameters, change: (Change, f64)) -> f64 {
        let [low_m, high_m] = self.stroke_m();
        let (mut squares, mut ticks) = (0.0, 0u32);
        self.follow(kind, parameters, change, LOST_S, |time_s, tick| {
            if time_s >= LOST_S.0 {
                squares += (tick.displacement_m - tick.asked_m).powi(2);
                ticks += 1;
            }
        });
        100.0 / (high_m - low_m) * (squares / f64::from(ticks)).sqrt()
    }
}

fn settled(mut parameters: Parameters) -> Parameters {
    parameters.actuator.preload = Preload::Settled;
    parameters
}

/// `parameters` with `change`. Springpots with relaxation times that are f times as long have f^α times the c.
fn changed(parameters: &Parameters, change: Change) -> Parameters {
    let mismatch = Mismatch { stiffness: change.stiffness, alpha: change.alpha };
    let model = mismatch.apply(&parameters.model).expect("valid");
    let main = Springpot::new(model.main().c * change.times.powf(model.main().alpha), model.main().alpha);
    assert!(model.branches().is_empty(), "springpots alone");
    let model = Maxwell::new(main, &[], model.topology(), model.mass_kg()).expect("valid");
    let spring = parameters.spring.as_ref().map(|spring| spring.scaled(change.stiffness).expect("valid"));
    Parameters { model, spring, ..parameters.clone() }
}

/// Tracking forgets what the film is without the sensor, apart from its scale; adaptive tracking goes on with it.
#[test]
fn a_film_that_has_changed_is_followed_without_its_sensor() {
    let films = if full_sweep() { ALL.as_slice() } else { &ALL[5..] };
    let stiffness = [0.8, 0.9, 1.1, 1.2].map(|stiffness| (Change { stiffness, ..Change::NONE }, 1.0));
    let times = [0.5, 2.0].map(|times| (Change { times, ..Change::NONE }, 1.0));
    let orders = [0.9, 1.1].map(|alpha| (Change { alpha, ..Change::NONE }, 1.0));
    let loads = [0.9, 1.1].map(|load| (Change::NONE, load));
    let mut missed = Vec::new();
    for &film in films {
        let parameters = film.parameters();
        let mut changes = vec![(Change::NONE, 1.0)];
        if full_sweep() {
            changes.extend(stiffness.into_iter().chain(times).chain(loads));
            changes.extend(orders.into_iter().filter(|_| film.is_described()));
        } else {
            changes.extend([stiffness[0], orders[1], times[1]]);
        }
        let most_pct = match film {
            Changing::Springpot | Changing::TwoCurves => 0.5,
            Changing::Hossain | Changing::Straight | Changing::Wang | Changing::LittleCreep => 1.5,
            // What is missed, with a margin: relaxation times that are twice as long.
            Changing::MuchCreep => 5.5,
        };
        let errors: Vec<[f64; 2]> = changes
            .par_iter()
            .map(|&(change, load)| {
                [ControllerKind::Tracking, ControllerKind::Adaptive]
                    .map(|kind| film.error_pct(kind, &parameters, (change, load)))
            })
            .collect();
        for ((change, load), [tracking, adaptive]) in changes.into_iter().zip(errors) {
            let Change { stiffness, times, alpha } = change;
            println!(
                "| {film:?} | stiffness {stiffness}, times {times}, order {alpha}, load {load} | {tracking:.2} | {adaptive:.2} |"
            );
            if adaptive > most_pct {
                missed.push(format!("{film:?} {change:?} {load}: {adaptive:.2} %"));
            }
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
}

const STRAIGHT: &str = r#"schema = 1
name = "straight"
[actuator]
relative_permittivity = 4.7
length_m = 0.04
width_m = 0.06
thickness_m = 0.00016
mass_kg = 0.316
preload = "settled"
stretch_coupling = 31.044203699595784
[model]
topology = "parallel"
main = { c = 27691.84280792028, alpha = 0.023346077935007103 }
branches = [
  [{ c = 11225.294420387987, alpha = 0.09337769258712451 }, { c = 9263.936064845486, alpha = 1.0 }],
  [{ c = 4824.362072261779, alpha = 0.0 }, { c = 48899.327138452805, alpha = 1.0 }],
]
"#;

/// Estimates at their bounds do not lead a law away that no values make right.
#[test]
fn a_law_that_no_values_make_right_is_not_led_away() {
    let (film, parameters) = (Changing::Straight, Changing::Straight.parameters());
    [0.7, 0.74, 0.76, 0.78, 0.8, 0.82, 0.84, 0.86].into_par_iter().for_each(|stiffness| {
        let error_pct = |kind| film.error_pct(kind, &parameters, (Change { stiffness, ..Change::NONE }, 1.0));
        let [tracking, adaptive] = [ControllerKind::Tracking, ControllerKind::Adaptive].map(error_pct);
        println!("stiffness {stiffness}: tracking {tracking:.2} %, adaptive {adaptive:.2} %");
        assert!(adaptive < 1.65 * tracking, "stiffness {stiffness}: {adaptive} % for {tracking} %");
    });
}

/// The change of stiffness that is reported in ten minutes: none of a film as it was recorded, whatever its law leaves unexplained. What else has changed shows as
/// stiffness, too.
#[test]
fn a_film_as_it_was_recorded_is_not_reported() {
    let films = if full_sweep() { ALL.as_slice() } else { &ALL[5..] };
    let stiffness = [1.0, 0.8, 0.98, 1.02, 1.1].map(|stiffness| (Change { stiffness, ..Change::NONE }, 1.0));
    let weights = [0.9, 1.1].map(|load| (Change::NONE, load));
    let changes: Vec<(Change, f64)> = stiffness.into_iter().chain(weights).collect();
    for &film in films {
        let parameters = film.parameters();
        let reported = |change: &(Change, f64)| {
            let (mut largest, mut last) = (0.0f64, 0.0);
            film.follow(ControllerKind::Adaptive, &parameters, *change, (600.0, 600.0), |_, tick| {
                last = tick.output.stiffness_change.expect("it learns");
                largest = largest.max(last.abs());
            });
            (largest, last)
        };
        let reports: Vec<(f64, f64)> = changes.par_iter().map(reported).collect();
        for ((change, load), (largest, last)) in changes.iter().zip(reports) {
            let changed = change.stiffness - 1.0;
            println!(
                "| {film:?} | stiffness {}, load {load} | {:.1} % | largest {:.1} % |",
                change.stiffness,
                1e2 * last,
                1e2 * largest
            );
            let is_sound = changed == 0.0 && *load == 1.0;
            assert!(!is_sound || largest == 0.0, "{film:?}: {largest}");
            assert!(!film.is_described() || (last - changed).abs() < 3e-3, "{film:?} {change:?} {load}: {last}");
        }
    }
}
