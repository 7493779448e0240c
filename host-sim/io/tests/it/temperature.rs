//! Parameter files of films at several temperatures, and temperatures in recordings.

use std::path::Path;

use host_io::error::Error;
use host_io::files::import::{Hints, Quantity};
use host_io::files::parameters::Parameters;
use host_io::files::recording::Recording;

use crate::lab_files::save;
use crate::spring_in_series::{self, parsed};

/// The film with a spring in series, with branches and a dependence.
fn file() -> String {
    let branches = "branches = [
  [{ c = 3000.0, alpha = 0.0 }, { c = 9000.0, alpha = 1.0 }],
  [{ c = 2000.0, alpha = 0.5 }, { c = 100.0, alpha = 0.5 }],
]";
    let film = spring_in_series::FILE.replace("schema = 4", "schema = 5").replace("branches = []", branches);
    format!("{film}\n[temperature]\nreference_c = 20.0\nstiffness_per_k = -0.01\nactivation_kj_per_mol = 50.0\n")
}

#[test]
fn a_film_at_a_temperature_is_written_and_read() {
    let film = parsed(&file()).expect("valid");
    assert_eq!(parsed(&film.to_toml()).expect("valid"), film);
    // 10 K warmer: 0.9 times as stiff, times × exp(50/R (1/303.15 − 1/293.15)) = 0.508298.
    let warm = film.at_temperature(30.0).expect("within reach");
    let time: f64 = 0.508_298;
    let at = |c: f64, alpha: f64| 0.9 * c * time.powf(alpha);
    let near = |found: f64, wanted: f64| (found / wanted - 1.0).abs() < 1e-5;
    assert!(near(warm.model.main().c, at(30000.0, 0.2)), "{warm:?}");
    let [[spring, dashpot], [half, _]] = warm.model.branches() else { panic!("two branches") };
    assert!(near(spring.c, 2700.0) && near(dashpot.c, at(9000.0, 1.0)) && near(half.c, at(2000.0, 0.5)));
    let force_n = |film: &Parameters| film.spring.as_ref().expect("a spring").force(1.5e-3);
    assert!(near(force_n(&warm), 0.9 * force_n(&film)));
    assert_eq!(warm.model.mass_kg(), 0.1);
    // Its reference is that temperature: over another one, and back, it is the same film.
    let other = film.at_temperature(41.0).and_then(|film| film.at_temperature(30.0)).expect("within reach");
    let c = |film: &Parameters| film.model.branches().as_flattened().iter().map(|e| e.c).collect::<Vec<f64>>();
    assert!(c(&other).into_iter().zip(c(&warm)).all(|(other, warm)| (other / warm - 1.0).abs() < 1e-12));
    assert_eq!(parsed(&warm.to_toml()).expect("valid"), warm);
    // A recording says at which temperature it was made; without the column the parameters hold as they are.
    let recording = |temperature_c: Option<f64>| {
        let warm = temperature_c.map(|value| (Quantity::Temperature, vec![value - 1.0, value + 1.0]));
        let columns = [(Quantity::Voltage, vec![0.0, 1.0])].into_iter().chain(warm).collect();
        Recording::of_values("r", vec![0.0, 1.0], columns).expect("valid")
    };
    assert_eq!(*film.along(&recording(Some(30.0))).expect("within reach"), warm);
    assert_eq!(*film.along(&recording(None)).expect("as it is"), film);
    // One that is beyond reach is left out beside others.
    assert!(matches!(film.along(&recording(Some(140.0))), Err(Error::Computation(_))));
}

#[test]
fn temperatures_of_no_film_are_refused() {
    for (from, to, cause) in [
        ("schema = 5", "schema = 4", "film.toml:24: [temperature] needs schema = 5"),
        ("reference_c = 20.0", "reference_c = 293.15", "film.toml:24: [temperature] a temperature of 293.15 °C"),
        ("stiffness_per_k = -0.01", "stiffness_per_k = nan", "film.toml:24: [temperature] stiffness_per_k = NaN"),
        ("activation_kj_per_mol = 50.0", "activation_kj_per_mol = 50e3", "activation_kj_per_mol = 50000 must be"),
        ("reference_c = 20.0\n", "", "missing field \"reference_c\""),
        ("reference_c", "reference_k", "unknown field \"reference_k\""),
    ] {
        let refused = parsed(&file().replace(from, to)).expect_err(cause);
        assert!(refused.contains(cause), "{refused}");
    }
    let film = parsed(&file()).expect("valid");
    for (temperature_c, cause) in [(115.0, "beyond what its dependence"), (310.0, "K or °F?"), (f64::NAN, "NaN °C")] {
        let refused = film.at_temperature(temperature_c).expect_err(cause).to_string();
        assert!(refused.contains(cause), "{refused}");
    }
}

/// A column that is a temperature by its words or its unit is named where none is used; other columns are not.
#[test]
fn a_temperature_that_is_not_used_is_named() {
    let remark = |columns: &str, rows: &str| {
        let csv = format!("time_s,{columns}\n0,{rows}\n1,{rows}\n");
        Recording::from_csv(Path::new("r.csv"), csv.as_bytes()).expect("valid").unused_temperature()
    };
    let names = "Temp (°C)|temperature_k|ambientTemperature|T °C|T [℃]|Température|环境温度|室温|PT100|Temp1|NTC2 (K)|Raumtemperatur";
    for name in names.split('|') {
        let remark = remark(&format!("voltage_v,{name}"), "1,20").unwrap_or_default();
        assert!(remark.starts_with(&format!("{name:?} is not used")), "{name}: {remark}");
    }
    for name in ["Template", "Charge (C)", "Attempts", "Capacitance (F)", "K", "tempo_s"] {
        assert_eq!(remark(&format!("voltage_v,{name}"), "1,20"), None, "{name}");
    }
    // The film's is there, and what has no film has none.
    assert_eq!(remark("voltage_v,temperature_c,Temp (°C)", "1,20,20"), None);
    let path = save("reference.csv", "time_s,displacement_m,Temp (°C)\n0,0,20\n1,1e-3,20\n");
    let reference = Recording::read_reference(&path, &Hints::default()).expect("valid");
    assert_eq!(reference.unused_temperature(), None);
}
