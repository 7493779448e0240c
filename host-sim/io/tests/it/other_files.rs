//! Logs of amplifiers and material tests as laboratories have them: the same reader as for recordings.

use std::fmt::Write;

use host_io::Error;
use host_io::files::amplifier_log::AmplifierLog;
use host_io::files::material_test::{MaterialTest, Strain};

use super::lab_files::{has, hints, save};

fn log(text: &str, columns: &str) -> Result<AmplifierLog, Error> {
    AmplifierLog::read(&save("file.txt", text), &hints(columns))
}

fn test(text: &str, columns: &str) -> Result<MaterialTest, Error> {
    MaterialTest::read(&save("file.txt", text), &hints(columns))
}

/// Command and monitor in kV: up at once, the monitor a fifth of the way later; both with a decimal comma.
fn volts(k: u32) -> [f64; 2] {
    let command = if k % 40 < 20 { 0.0 } else { 3.5 };
    [command, 0.2 * f64::from(k % 5) + 0.1 * command]
}

fn german(header: &str) -> String {
    let mut text = format!("Scope 7\n{header}\n");
    for k in 0..120 {
        let [command, monitor] = volts(k);
        let row = format!("{};{command};{monitor}", 0.5 * f64::from(k));
        writeln!(text, "{}", row.replace('.', ",")).expect("written");
    }
    text
}

#[test]
fn an_amplifiers_log_is_read_in_the_labs_dialect() {
    for (header, columns) in [
        ("Zeit [ms];HV Soll [kV];HV Ist [kV]", ""),
        ("Time (ms);Command voltage (kV);Voltage monitor (kV)", ""),
        ("Time (ms);Setpoint (kV);HV (kV)", ""),
        ("t/ms;U/kV;CH2", "command=2,voltage=CH2:kV"),
        ("t/ms;CH1;CH2", "command=CH1*1000,voltage=3*1000"),
    ] {
        let log = log(&german(header), columns).unwrap_or_else(|error| panic!("{header}: {error}"));
        assert_eq!(log.time_s.len(), 120, "{header}");
        for k in 0..120 {
            let [command, monitor] = volts(k).map(|kilovolts| 1e3 * kilovolts);
            let row = k as usize;
            assert!((log.time_s[row] - 0.5e-3 * f64::from(k)).abs() < 1e-12, "{header}: time {k}");
            assert!((log.command_v[row] - command).abs() < 1e-9, "{header}: command {k}: {}", log.command_v[row]);
            assert!((log.monitor_v[row] - monitor).abs() < 1e-9, "{header}: monitor {k}: {}", log.monitor_v[row]);
        }
        let understood = log.understood.line();
        assert!(understood.contains("command = ") && understood.contains("voltage = "), "{understood}");
    }
}

#[test]
fn two_voltages_without_words_are_not_guessed() {
    for (header, named) in [
        ("Time (ms);CH1 (kV);CH2 (kV)", ["columns may be the", "CH1"]),
        ("Time (ms);HV Soll (kV);Temp (°C)", ["voltage_v", "`columns` voltage=NUMBER:kV"]),
        ("Time (ms);Command;HV Ist (kV)", ["\"Command\" has no unit", "`columns` command=2:kV"]),
    ] {
        has(&log(&german(header), "").expect_err(header).to_string(), &named);
    }
}

/// 100 × 10 mm² of film, 2 % more stretch a row, stress in proportion.
fn machine(header: &str, row: impl Fn(f64) -> [f64; 2]) -> String {
    let mut text = format!("Machine;Z010\nSpecimen;7\n\n{header}\n");
    for k in 0..40 {
        let [first, second] = row(f64::from(k));
        let line = format!("{};{first};{second}", 0.25 * f64::from(k));
        writeln!(text, "{}", line.replace('.', ",")).expect("written");
    }
    text
}

#[test]
fn a_material_test_is_read_in_the_labs_dialect() {
    let of_stretch = |k: f64| [1.0 + 0.02 * k, 0.01 * k];
    let of_specimen = |k: f64| [2.0 * k, 0.1 * k];
    let in_inches = |k: f64| [2.0 * k / 25.4, 0.1 * k / 4.4482216152605];
    for (text, columns) in [
        (machine("Prüfzeit [s];Standardweg [mm];Standardkraft [N]", of_specimen), ""),
        (machine("Time (sec);Extension (in);Load (lbf)", in_inches), ""),
        (machine("Time (s);Extension (mm);Load (kgf)", |k| [2.0 * k, 0.1 * k / 9.80665]), ""),
        (machine("Time (s);Extension (mm);Load (gf)", |k| [2.0 * k, 0.1 * k / 9.80665e-3]), ""),
        (machine("Prüfzeit Zeit [s];Stretch;Stress [MPa]", of_stretch), ""),
        (machine("Zeit (s);λ;Nominal stress (N/mm²)", of_stretch), ""),
        (machine("Zeit (s);a;b", of_stretch), "stretch=2,stress=3:MPa"),
        (machine("Zeit (s);Traverse Weg (mm);Kraft (N)", of_specimen), ""),
    ] {
        let test = test(&text, columns).unwrap_or_else(|error| panic!("{text}: {error}"));
        let displacement = test.displacement_m(Some(0.1), Strain::Engineering).expect("a length");
        let force = test.force_n(Some(1e-5)).expect("an area");
        for k in 0..40 {
            let row = f64::from(k);
            let k = k as usize;
            assert!((test.time_s[k] - 0.25 * row).abs() < 1e-12);
            assert!((displacement[k] - 2e-3 * row).abs() < 1e-12, "{text}: {} in row {k}", displacement[k]);
            assert!((force[k] - 0.1 * row).abs() < 1e-9, "{text}: {} in row {k}", force[k]);
        }
    }
}

#[test]
fn what_is_not_read_here_is_refused_with_what_is() {
    let error = log(&german("Time (ms);Command (kV);HV (kV)"), "stress=2:MPa").expect_err("no stress");
    assert!(error.to_string().ends_with("`columns` stress: what is read here is time, command, voltage"), "{error}");
    let error = test(&machine("Time (s);a;b", |k| [k, k]), "").expect_err("no names").to_string();
    has(&error, &["no column stretch or displacement_m", "stretch=NUMBER"]);
}

/// A stress of the stretched cross-section is a question, and lengths are not displacements.
#[test]
fn true_stresses_and_lengths_of_a_specimen_are_noticed() {
    for title in ["True stress [MPa]", "Cauchy stress (MPa)", "σ true stress/MPa"] {
        let error = test(&machine(&format!("Time (s);Stretch;{title}"), |k| [1.0 + 0.02 * k, 0.01 * k]), "");
        has(&error.expect_err(title).to_string(), &["may be computed", "stress=3"]);
    }
    for (first_mm, is_doubted) in [(100.0, true), (2.0, false)] {
        let text = machine("Time (s);Grip separation (mm);Load (N)", |k| [first_mm + 2.0 * k, 0.1 * k]);
        let test = test(&text, "").expect("read");
        assert_eq!(test.doubt(Some(0.1)).is_some_and(|doubt| doubt.contains("the length of the body")), is_doubted);
        assert_eq!(test.doubt(None), None);
    }
}
