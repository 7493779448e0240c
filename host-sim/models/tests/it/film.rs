//! The nonlinear film: its published peaks, and the committed recordings.

use host_models::simulation::film::{Film, Plant, Waveform};

/// Largest displacement (m) in the first and the last full period over 155 s of 0…6 kV.
fn peaks(plant: Plant, period_s: usize) -> [f64; 2] {
    const RATE: usize = 100;
    let film = Film::new(plant);
    let times: Vec<f64> = (0..=155 * RATE).map(|k| k as f64 / RATE as f64).collect();
    let waveform = Waveform { peak_v: 6000.0, frequencies_hz: vec![1.0 / period_s as f64] };
    let states = film.states(film.rest(), &times, |t| waveform.voltage_v(t)).expect("no pull-in");
    let x: Vec<f64> = states.iter().map(|state| film.displacement_m(state)).collect();
    let period = period_s * RATE;
    let peak = |range: &[f64]| range.iter().copied().fold(0.0, f64::max);
    let last = (x.len() - 1) / period - 1;
    [peak(&x[..period]), peak(&x[last * period..][..period])]
}

#[test]
fn peaks_are_the_expected_ones() {
    assert!((Film::new(Plant::Hossain).rest_stretch() - 6.00).abs() < 0.005);
    assert!((Film::new(Plant::Wang).rest_stretch() - 3.73).abs() < 0.005);
    for (plant, period_s, expected_mm) in [
        (Plant::Hossain, 13, [5.04, 5.47]),
        (Plant::Hossain, 7, [4.68, 5.22]),
        (Plant::Hossain, 5, [4.49, 5.10]),
        (Plant::Wang, 13, [1.61, 1.78]),
        (Plant::Wang, 7, [1.52, 1.74]),
        (Plant::Wang, 5, [1.48, 1.71]),
    ] {
        for (peak, expected) in peaks(plant, period_s).into_iter().zip(expected_mm) {
            // Two decimals, read off a recording with 5 µm noise.
            assert!(
                (1e3 * peak - expected).abs() < 0.01,
                "{plant:?} {period_s} s: {:.3} mm for {expected}",
                1e3 * peak
            );
        }
    }
}

/// At rest nothing moves; stiffer film, smaller stroke.
#[test]
fn rests_under_its_weight_and_stiffens() {
    for plant in [Plant::Hossain, Plant::Wang] {
        let film = Film::new(plant);
        let slope = film.derivative(0.0, &film.rest());
        assert!(slope.iter().all(|rate| rate.abs() < 1e-9), "{slope:?}");
        let stiff = film.stiffened(1.2);
        assert!(stiff.rest_stretch() < film.rest_stretch());
        let stroke = |film: &Film| {
            let states = film.states(film.rest(), &[0.0, 10.0], |_| 4000.0).expect("no pull-in");
            film.displacement_m(&states[1])
        };
        assert!(stroke(&stiff) < stroke(&film) && stroke(&stiff) > 0.0);
    }
}

#[test]
fn pull_in_is_reported() {
    let film = Film::new(Plant::Hossain);
    let error = film.states(film.rest(), &[0.0, 10.0, 20.0], |_| 30_000.0).expect_err("30 kV tear the film");
    assert!(error.to_string().contains("pull-in"), "{error}");
}
