//! Parameter files of films with a spring in series.

use std::path::Path;

use host_io::files::parameters::Parameters;
use springpot::Law;

pub(crate) const FILE: &str = r#"schema = 4
name = "spring in series"

[actuator]
relative_permittivity = 4.7
length_m = 0.03
width_m = 0.02
thickness_m = 100e-6
mass_kg = 0.1

[model]
topology = "parallel"
main = { c = 30000.0, alpha = 0.2 }
branches = []

[spring]
in_series = true
displacement_m = [-0.0005, 0.0, 0.002, 0.004]
force_n = [-4.0, 0.0, 18.0, 60.0]
"#;

pub(crate) fn parsed(text: &str) -> Result<Parameters, String> {
    Parameters::from_toml(Path::new("film.toml"), text).map_err(|error| error.to_string())
}

#[test]
fn a_spring_in_series_is_read_as_it_was_written() {
    let parameters = parsed(FILE).expect("valid");
    assert!(parameters.curve.is_none());
    let spring = parameters.spring.as_ref().expect("a spring");
    let written = parameters.to_toml();
    assert!(written.starts_with("schema = 4\n") && written.contains("[spring]\nin_series = true"), "{written}");
    assert_eq!(parsed(&written).expect("valid"), parameters);
    let law: Law<f32> = parameters.film().compressed_law(1000.0).expect("a law");
    assert!(law.coefficients().has_spring_in_series());

    // A stiffness alone, and a curve that is straight.
    let (memory, points) = FILE.split_once("displacement_m").expect("points");
    assert!(points.contains("force_n"));
    let linear = parsed(&format!("{memory}stiffness_n_per_m = 9000.0\n")).expect("valid");
    assert_eq!(linear.spring.as_ref().map(|spring| spring.slope(1e-3)), Some(9000.0));
    assert_eq!(parsed(&linear.to_toml()).expect("valid"), linear);
    let straight = parsed(&format!("{FILE}[curve]\nelastic = \"linear\"\n")).expect("valid");
    assert_eq!(straight.spring.as_ref(), Some(spring));
}

#[test]
fn a_spring_that_cannot_be_in_series_is_refused_with_its_line() {
    let curve = "[curve]\nelastic = \"measure\"\nexponent = 0.0\nfrom_m = -0.0005\nto_m = 0.006\n";
    for (from, to, cause) in [
        ("schema = 4", "schema = 3", "in_series needs schema = 4"),
        (
            "in_series = true",
            "in_series = false",
            "needs [curve], the strain measure of the memory, or in_series = true",
        ),
        ("in_series = true\n", "", "needs [curve], the strain measure of the memory, or in_series = true"),
        ("force_n = [-4.0, 0.0, 18.0, 60.0]", "force_n = [-4.0, 0.0, 18.0, 10.0]", "it must rise everywhere"),
        ("force_n = [-4.0, 0.0, 18.0, 60.0]", "force_n = [-4.0, 0.0, 18.0, 18.0]", "it must rise everywhere"),
    ] {
        let refused = parsed(&FILE.replace(from, to)).expect_err(cause);
        assert!(refused.contains("film.toml:16: [spring]") && refused.contains(cause), "{refused}");
    }
    let refused = parsed(&format!("{FILE}\n{curve}")).expect_err("both");
    assert!(refused.contains("film.toml:16: [spring] in_series excludes [curve]"), "{refused}");
}
