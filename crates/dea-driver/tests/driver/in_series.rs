//! Control of a film with a spring in series: its creep is that of a memory alone, its stroke stiffens.

use dea_driver::{Mode, Parameters};
use springpot::Law;

use crate::bench::{board_parameters, law, law_in_series};
use crate::film_bench::FilmBench as Bench;

fn parameters(law: &Law<f32>) -> Parameters {
    Parameters { law: law.coefficients(), ..board_parameters() }
}

/// Swings between 0.4 mm and 1.2 mm; returns how far the film is off its reference, at most.
fn furthest_off_m(law: &Law<f32>, mode: Mode, force_scale: f64) -> f64 {
    let mut bench = Bench { force_scale, ..Bench::around(law_in_series(), parameters(law)) };
    bench.start(mode);
    bench.track(0..20_000, 10_000, |time_s| (0.8e-3 * (time_s / 2.0).min(1.0) - 0.4e-3 * (0.6 * time_s).sin()).max(0.0))
}

/// Along its own law the film is where it shall be; a law without the spring is off by a good part of the stroke. Tracking corrects a force that is off.
#[test]
fn feedforward_and_tracking_follow_a_film_with_a_spring_in_series() {
    let (law, straight) = (law_in_series(), law());
    let um = [
        (&law, Mode::Feedforward, 1.0),
        (&straight, Mode::Feedforward, 1.0),
        (&law, Mode::Feedforward, 0.9),
        (&law, Mode::Tracking, 0.9),
    ]
    .map(|(law, mode, force_scale)| 1e6 * furthest_off_m(law, mode, force_scale));
    println!("off by {um:.1?} µm: its own law, one without the spring, a weaker film, tracked");
    assert!(um[0] < 2.0 && um[1] > 50.0 && um[2] > 30.0 && um[3] < 0.3 * um[2], "{um:?}");
}
