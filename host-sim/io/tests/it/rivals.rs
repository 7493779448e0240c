//! Two columns of one kind, factors in titles, and set points: each is a question where it is not certain.

use crate::lab_files::{Sample, difference, gives_the_samples, has, read, refuses, rows};

/// The cells that a column has in such a file.
type Cells = fn(&Sample) -> f64;

/// A file of time, voltage, laser, and a further column, which may have a row above the names.
fn file(names: [&str; 4], above: &str, cells: [Cells; 3]) -> String {
    let [time, voltage, laser, further] = names;
    let numbers = rows(";", '.', |s| vec![s.time_s, cells[0](s), cells[1](s), cells[2](s)]);
    format!("{above}{time};{voltage};{laser};{further}\n{numbers}")
}

const VOLTS: Cells = |s| 1e3 * s.voltage_kv;
const KILOVOLTS: Cells = |s| s.voltage_kv;
const MM: Cells = |s| s.laser_mm;
const UM: Cells = |s| 1e3 * s.laser_mm;
const ELSEWHERE: Cells = |s| 7.0 + 0.1 * s.laser_mm;

/// A unit in a wrong encoding, or one that is not known, leaves its column a rival of others.
#[test]
fn a_column_whose_unit_cannot_be_read_is_a_rival() {
    for unit in ["\u{fffd}m", "Âµm", "lines", "0.001 mm?"] {
        let text =
            file(["Time (s)", "HV (V)", &format!("Laser ({unit})"), "Position (mm)"], "", [VOLTS, UM, ELSEWHERE]);
        refuses(&text, "", &["2 columns may be the displacement", "displacement=3", "displacement=4"]);
        gives_the_samples(&text, "displacement=3*1e-6");
    }
    // Units that are known, also of something else, leave no question.
    for (laser, cells) in [("Laser (㎛)", UM), ("Laser (мкм)", UM), ("Laser (㎜)", MM)] {
        let text = file(["Time (s)", "HV (V)", laser, "Laser (°C)"], "", [VOLTS, cells, ELSEWHERE]);
        gives_the_samples(&text, "");
    }
    for (name, cells) in [
        ("HV (kVDC)", KILOVOLTS),
        ("Potential (kV DC)", KILOVOLTS),
        ("Напряжение (кВ)", KILOVOLTS),
        ("CH1 HV (V DC)", VOLTS),
        ("HV (VDC)", VOLTS),
        ("HV, diff. probe (V)", VOLTS),
        ("HV differential probe (V)", VOLTS),
        ("Napięcie (V)", VOLTS),
    ] {
        let text = file(["Time (s)", name, "Laser (mm)", "Force (N)"], "", [cells, MM, ELSEWHERE]);
        gives_the_samples(&text, "");
    }
    let field =
        file(["Time (s)", "Field (V/µm)", "Laser (mm)", "Force (N)"], "", [|s| 10.0 * s.voltage_kv, MM, ELSEWHERE]);
    refuses(&field, "", &["electric field", "voltage=2:V*NUMBER", "voltage=none"]);
    gives_the_samples(&field, "voltage=2:V*100");
}

/// A factor or a computation in a title, in any form, is a question; a number of a channel is not.
#[test]
fn factors_in_titles_are_a_question() {
    for (voltage, laser) in [
        ("HV 1 V = 2 kV", "Laser (mm)"),
        ("HV % of 6 kV", "Laser (mm)"),
        ("HV ÷ 10 (kV)", "Laser (mm)"),
        ("HV hundred V", "Laser (mm)"),
        ("HV (V)", "Laser 10 V = 5 mm"),
        ("HV (V)", "Laser %FS 5 mm"),
        ("HV (V)", "Displacement in steps of 5 µm"),
        ("HV (V)", "Weg in Schritten von 5 µm"),
        ("HV (V)", "Displacement tenths of mm"),
        ("HV (V)", "Weg Zehntel mm"),
        ("HV (V)", "Weg 10fach (mm)"),
        ("HV (V)", "Laser, 10-fold (mm)"),
        ("HV (V)", "Laser times 10 (mm)"),
        ("HV (V)", "Laser (x2) (mm)"),
        ("HV (V)", "2 x Laser (mm)"),
        ("HV (V)", "half Laser (mm)"),
        ("HV (V)", "Weg doppelt (mm)"),
        ("HV (V)", "Laser² (mm)"),
        ("HV (V)", "dLaser/dt (mm)"),
        ("HV (V)", "Laser diff. (mm)"),
        ("HV (V)", "minus Laser (mm)"),
        ("HV (V)", "Laser (neg.) (mm)"),
        ("HV (V)", "abs(Laser) (mm)"),
        ("HV (V)", "Laser [mm] (2.5 mm/V)"),
        ("HV (V)", "Laser mm/V (mm)"),
        ("HV monitor 1V/kV (V)", "Laser (mm)"),
    ] {
        let text = file(["Time (s)", voltage, laser, "T (°C)"], "", [VOLTS, MM, ELSEWHERE]);
        refuses(&text, "", &[if voltage == "HV (V)" { laser } else { voltage }, "`columns`"]);
    }
    let names = ["Time (s)", "HV (V)", "Laser (mm)", "T (°C)"];
    for above in ["HV divider 2000:1", "Scale: HV x1000", "Laser 1:10", "# Laser (x10)"] {
        let recording = read(file(names, &format!("{above}\n"), [VOLTS, MM, ELSEWHERE]), "").expect(above);
        has(&recording.notes().join("; "), &["line 1", "not applied", "`columns`"]);
    }
    for above in ["Time 10:01", "Laser ILD1420-10", "HV probe 1", "Gear 1:10", "CH1: HV"] {
        let recording = read(file(names, &format!("{above}\n"), [VOLTS, MM, ELSEWHERE]), "").expect(above);
        assert!(!recording.notes().iter().any(|note| note.contains("not applied")), "{above}");
    }
    for time in ["Time 5 ms", "Time 1e-3 s", "Time in steps of 5 ms"] {
        let text = file([time, "HV (V)", "Laser (mm)", "T (°C)"], "", [VOLTS, MM, ELSEWHERE]);
        refuses(&text, "", &[time, "`columns` time=1"]);
    }
    for (time, laser) in [
        ("Time (s)", "Laser 2 mm"),
        ("t2 (s)", "Laser CH2 (mm)"),
        ("Time (s)", "Laser 2 (mm)"),
        ("Time (s)", "Laser x2 (mm)"),
        ("Time (s)", "CH 2 x (mm)"),
        ("Time (s)", "Laser s/mm"),
        ("Time/s", "Laser x/mm"),
        ("Time (s)", "Linear variable differential transformer, displacement (mm)"),
        ("Time (s)", "Incremental encoder, displacement (mm)"),
    ] {
        let text = file([time, "HV (V)", laser, "T (°C)"], "", [VOLTS, MM, ELSEWHERE]);
        gives_the_samples(&text, "");
    }
}

/// A set point is not a measurement, in every language and also where a row above the names says it.
#[test]
fn set_points_are_a_question() {
    let order = |s: &Sample| if s.laser_mm > 0.5 { 3.0 } else { 0.0 };
    for (set, measured) in [
        ("Spanning ingesteld (kV)", "Spanning gemeten (V)"),
        ("Spänning inställd (kV)", "Spänning uppmätt (V)"),
        ("Nastawa (kV)", "Napięcie zmierzone (V)"),
        ("Напряжение заданное (kV)", "Напряжение (V)"),
        ("Előírt feszültség (kV)", "Mért feszültség (V)"),
        ("Tensión ajustada (kV)", "Tensión medida (V)"),
    ] {
        let text = file(["t (s)", measured, "Laser (mm)", set], "", [VOLTS, MM, order]);
        gives_the_samples(&text, "voltage=2");
        match read(&text, "") {
            Ok(recording) => assert_eq!(difference(&recording), None, "{set}"),
            Err(error) => has(&error.to_string(), &["voltage=2"]),
        }
    }
    for name in ["Posição de referência (mm)", "Hedef konum (mm)", "Žádaná poloha (mm)"] {
        let text = file(["t (s)", "U (kV)", "Laser (V)", name], "", [KILOVOLTS, |s| 2.0 * s.laser_mm, order]);
        refuses(&text, "", &[name, "asked for"]);
    }
    let text = file(
        ["Time (s)", "HV (V)", "Laser (V)", "Position (mm)"],
        ";Amplifier;Measured;Setpoint\n",
        [VOLTS, MM, order],
    );
    refuses(&text, "", &["Position", "asked for"]);
    // Cells that were merged have their text in the first one, and those after the last are missing.
    let merged =
        file(["Time (s)", "HV (V)", "Laser (V)", "Position (mm)"], ";Amplifier;Setpoint\n", [VOLTS, MM, order]);
    refuses(&merged, "", &["asked for"]);
    let sound =
        file(["Time (s)", "HV (V)", "Laser (mm)", "T (°C)"], ";Amplifier;Measured;Room\n", [VOLTS, MM, ELSEWHERE]);
    gives_the_samples(&sound, "");
    let piezo = file(["Time (s)", "HVPS (V)", "Laser (mm)", "Piezo voltage (V)"], "", [VOLTS, MM, ELSEWHERE]);
    refuses(&piezo, "", &["2 columns may be the voltage"]);
}
