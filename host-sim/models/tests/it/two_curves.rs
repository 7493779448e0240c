//! Films with two curves from parameter files: full memory against the controller's law, and files that are refused.

use std::path::Path;

use host_io::files::parameters::Parameters;
use host_models::replay::full_memory::FullMemory;
use springpot::{Law, Load};

const RATE_HZ: f64 = 200.0;

const FILE: &str = r#"schema = 3
name = "two curves"

[actuator]
relative_permittivity = 4.7
length_m = 0.03
width_m = 0.02
thickness_m = 100e-6
mass_kg = 0.1

[model]
topology = "parallel"
main = { c = 3000.0, alpha = 0.2 }
branches = []

[curve]
elastic = "measure"
exponent = 0.0
from_m = -0.0005
to_m = 0.006

[spring]
displacement_m = [-0.0005, 0.0, 0.002, 0.006]
force_n = [-5.0, 0.0, 18.0, 45.0]
"#;

fn parsed(text: &str) -> Result<Parameters, String> {
    Parameters::from_toml(Path::new("film.toml"), text).map_err(|error| error.to_string())
}

#[test]
fn a_file_with_two_curves_is_read_as_it_was_written() {
    let parameters = parsed(FILE).expect("valid");
    let spring = parameters.spring.as_ref().expect("a spring");
    assert!((spring.force(2e-3) - 18.0).abs() < 1e-12);
    // The length of the measure is the film's.
    let curve = parameters.curve.as_ref().expect("a measure").pieces();
    assert!((curve.value(5e-3) - 0.03 * (7.0f64 / 6.0).ln()).abs() < 1e-7);
    assert_eq!(parsed(&parameters.to_toml()).expect("valid"), parameters);
    assert!(parameters.to_toml().starts_with("schema = 3"));
}

#[test]
fn files_that_do_not_fit_together_are_refused_with_their_line() {
    for (from, to, cause) in [
        ("schema = 3", "schema = 2", "needs schema = 3"),
        (
            "force_n = [-5.0, 0.0, 18.0, 45.0]",
            "force_n = [-5.0, 1.0, 18.0, 45.0]",
            "the spring has a force of 1 N at 0",
        ),
        ("force_n = [-5.0, 0.0, 18.0, 45.0]", "force_n = [-5.0, 0.0]", "as many numbers"),
        ("force_n = [-5.0, 0.0, 18.0, 45.0]", "force_n = [5e6, 0.0, -18e6, -45e6]", "must not fall so steeply"),
        (
            "displacement_m",
            "stiffness_n_per_m = 1.0\ndisplacement_m",
            "needs stiffness_n_per_m, or displacement_m and force_n",
        ),
        ("exponent = 0.0\n", "", "the curve needs exponent"),
        ("elastic = \"measure\"", "elastic = \"linear\"", "does not belong"),
    ] {
        let refused = parsed(&FILE.replace(from, to)).expect_err(cause);
        assert!(refused.contains("film.toml:") && refused.contains(cause), "{refused}");
    }
    let (alone, _) = FILE.split_once("[curve]").expect("a curve");
    let refused = parsed(&format!("{alone}[spring]\nstiffness_n_per_m = 9000.0\n")).expect_err("no measure");
    assert!(refused.contains("needs [curve]"), "{refused}");
}

/// Forwards and backwards, the answer with full memory is that of the law at the same step, to the compression of its memory and to what the
/// law's linearisation of a step neglects.
#[test]
fn full_memory_of_two_curves_is_that_of_the_law() {
    const SAMPLES: usize = 3000;
    let parameters = parsed(FILE).expect("valid");
    let film = parameters.film();
    let law: Law<f64> = film.compressed_law(RATE_HZ).expect("a law");
    let circle = FullMemory::new(SAMPLES, 1.0 / RATE_HZ);
    let force = |k: usize| 15.0 * (1.0 - (0.9 * k as f64 / RATE_HZ).cos());
    let path: Vec<f64> = (0..SAMPLES).map(|k| 2e-3 * (1.0 - (0.7 * k as f64 / RATE_HZ).cos())).collect();
    let shown = circle.force_along(film, &path);
    let mut state = law.state();
    for (x, exact) in path.iter().zip(&shown) {
        let stepped = law.force(&mut state, *x);
        assert!((stepped - exact).abs() < 1e-5 * 50.0, "{stepped} N instead of {exact}");
    }
    let loads: Vec<Load<f64>> =
        (0..SAMPLES).map(|k| Load { force_n: force(k), slope_n_per_m: 40.0 * force(k) }).collect();
    let exact = circle.displacement_under(film, &loads, 1.0 / RATE_HZ).expect("it converges");
    let mut state = law.state();
    let largest = exact.iter().copied().fold(0.0, f64::max);
    assert!(largest > 2e-3, "the curves matter: {largest}");
    for (load, exact) in loads.iter().zip(&exact) {
        let stepped = law.displacement_under(&mut state, *load);
        assert!((stepped - exact).abs() < 1e-5 * largest, "{stepped} m instead of {exact}");
    }
}
