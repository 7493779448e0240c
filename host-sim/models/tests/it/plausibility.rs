//! Sizes in other units than metres and kilograms are refused with the unit, or doubted; those of films are not.

use std::path::Path;

use host_io::files::parameters::{Parameters, plausibility};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{Actuator, Preset};

/// A value between the ends, evenly on a logarithmic scale.
fn between(rng: &mut Pcg64, low: f64, high: f64) -> f64 {
    (low.ln() + (high / low).ln() * rng.random_range(0.0..1.0)).exp()
}

/// A film of the field, with a weight that it holds.
fn film(rng: &mut Pcg64) -> Actuator {
    let (area, aspect): (f64, f64) = (between(rng, 1e-4, 1.0), between(rng, 0.1, 10.0));
    let (length_m, width_m) = ((area * aspect).sqrt(), (area / aspect).sqrt());
    let thickness_m = between(rng, 10e-6, (2.5e-4 / area).min(2e-3));
    let heaviest = (1e6 * width_m * thickness_m / 9.81).clamp(1.1e-3, 10.0);
    Actuator {
        relative_permittivity: between(rng, 1.5, 1000.0),
        length_m,
        width_m,
        thickness_m,
        mass_kg: between(rng, 1e-3, heaviest),
        ..Actuator::KARNER_2022
    }
}

/// 20 000 random films pass without a doubt, and with any weight up to 10 kg without a refusal.
#[test]
fn films_of_the_field_pass() {
    let mut rng = Pcg64::seed_from_u64(28);
    for case in 0..20_000 {
        let film = film(&mut rng);
        assert_eq!(plausibility::check(&film), Ok(()), "case {case}: {film:?}");
        let doubts = plausibility::doubts(&film, false);
        assert!(doubts.is_empty(), "case {case}: {film:?}: {doubts:?}");
        let loaded = Actuator { mass_kg: between(&mut rng, 1e-3, 10.0), ..film };
        assert_eq!(plausibility::check(&loaded), Ok(()), "case {case}: {loaded:?}");
    }
    for preset in Preset::ALL {
        let parameters = Parameters::preset(preset.name()).expect("a preset");
        assert_eq!(parameters.doubts(), Vec::<String>::new(), "{}", preset.name());
    }
}

/// One quantity in another unit: the share of films that are refused or doubted. Grams of a weight of a few grams on a thick film, and the
/// shorter side of a film in millimetres where it is at most 5 mm, can be those of another film.
#[test]
fn a_wrong_unit_is_refused_with_the_right_value() {
    let mut rng = Pcg64::seed_from_u64(29);
    type Change = fn(&mut Actuator) -> (&mut f64, f64);
    let changes: [(&str, Change, f64); 8] = [
        ("length_m", |film| (&mut film.length_m, 1e3), 0.97),
        ("length_m", |film| (&mut film.length_m, 1e6), 1.0),
        ("width_m", |film| (&mut film.width_m, 1e3), 0.97),
        ("width_m", |film| (&mut film.width_m, 1e6), 1.0),
        ("thickness_m", |film| (&mut film.thickness_m, 1e3), 1.0),
        ("thickness_m", |film| (&mut film.thickness_m, 1e6), 1.0),
        ("mass_kg", |film| (&mut film.mass_kg, 1e3), 0.8),
        ("relative_permittivity", |film| (&mut film.relative_permittivity, springpot::EPSILON_0), 1.0),
    ];
    for (name, change, least) in changes {
        let (mut caught, mut corrected, cases) = (0_u32, 0_u32, 4000_u32);
        for _ in 0..cases {
            let sound = film(&mut rng);
            let mut wrong = sound;
            let (value, factor) = change(&mut wrong);
            let right = *value;
            *value *= factor;
            match plausibility::check(&wrong) {
                Err((quantity, cause)) => {
                    assert_eq!(quantity, name, "{cause}");
                    let advised =
                        cause.rsplit_once("write ").map(|(_, number)| number.parse::<f64>().expect("a number"));
                    corrected += u32::from(advised.is_some_and(|advised| (advised / right - 1.0).abs() < 1e-6));
                    caught += 1;
                }
                Ok(()) => caught += u32::from(!plausibility::doubts(&wrong, false).is_empty()),
            }
        }
        let share = f64::from(caught) / f64::from(cases);
        println!("{name}: {share:.3} caught, {corrected} of {cases} with the right value");
        assert!(share >= least, "{name}: {share}");
    }
}

/// All sizes in centimetres or inches: a small film would be a large one.
#[test]
fn films_in_centimetres_or_inches_are_found() {
    let mut rng = Pcg64::seed_from_u64(30);
    // With the thickness in that unit, or in metres.
    for (unit, factor, thickness, least) in [
        ("centimetres", 100.0, 100.0, 1.0),
        ("inches", 39.37, 39.37, 0.97),
        ("centimetres, thickness in metres", 100.0, 1.0, 0.9),
    ] {
        let cases = 4000;
        let is_found = |film: Actuator| {
            let Actuator { length_m, width_m, thickness_m, .. } = film;
            let [length_m, width_m, thickness_m] = [factor * length_m, factor * width_m, thickness * thickness_m];
            let wrong = Actuator { length_m, width_m, thickness_m, ..film };
            plausibility::check(&wrong).is_err() || !plausibility::doubts(&wrong, false).is_empty()
        };
        let share = (0..cases).filter(|_| is_found(film(&mut rng))).count() as f64 / f64::from(cases);
        assert!(share >= least, "{unit}: {share}");
    }
}

/// The message of the file names the line, every quantity that is at fault, and what to write.
#[test]
fn a_file_in_millimetres_and_grams_is_refused() {
    let right = Parameters::preset("table3-n2").expect("a preset").to_toml();
    let wrong = right
        .replace("length_m = 0.04", "length_m = 20")
        .replace("thickness_m = 0.00016", "thickness_m = 0.1")
        .replace("mass_kg = 0.316", "mass_kg = 100");
    let refusal = Parameters::from_toml(Path::new("film.toml"), &wrong).expect_err("refused").to_string();
    assert_eq!(
        refusal,
        "film.toml:6: length_m = 20 is 20 m: is it in millimetres? write 0.02; thickness_m = 0.1 is 0.1 m: is it in millimetres? \
         write 0.0001; mass_kg = 100 is 100 kg: is it in grams? write 0.1"
    );
}

/// The limits of a board: a thickness in micrometres would switch the supervisor's field limit off.
#[test]
fn limits_of_a_board_in_other_units_are_found() {
    let mut parameters = Parameters::preset("table3-n2").expect("a preset");
    parameters.board = Some(parameters.bench(1000.0));
    let sound = parameters.to_toml();
    let read = |text: &str| Parameters::from_toml(Path::new("film.toml"), text);
    assert_eq!(read(&sound).expect("sound").doubts(), Vec::<String>::new());
    let (film, board) = sound.split_once("[board").expect("a board");
    let wrong = format!("{film}[board{}", board.replace("thickness_m = 0.00016", "thickness_m = 0.16"));
    let refusal = read(&wrong).expect_err("refused").to_string();
    assert!(refusal.contains("limits.thickness_m = 0.16 is 0.16 m: is it in millimetres? write 0.00016"), "{refusal}");
    for (right, wrong, doubt) in [
        ("max_voltage_v = 6000.0", "max_voltage_v = 6.0", "max_voltage_v = 6 is 6 V: is it in kilovolts? write 6000"),
        ("max_field_v_per_m = 42000000.0", "max_field_v_per_m = 42.0", "is it in megavolts per metre? write 42000000"),
    ] {
        match read(&sound.replace(right, wrong)) {
            Ok(parameters) => assert!(parameters.doubts()[0].contains(doubt), "{:?}", parameters.doubts()),
            Err(refusal) => assert!(refusal.to_string().contains("max_"), "{refusal}"),
        }
    }
}

/// A fit may find a weight that no film has: its file is read again, with a doubt, and claims nothing of the field.
#[test]
fn assumed_sizes_are_doubted() {
    let film = Parameters::preset("table3-n2").expect("a preset");
    let heavy = Actuator { mass_kg: 531.5, ..film.actuator };
    let fitted = Parameters { assumed_sizes: true, actuator: heavy, ..film };
    let read = Parameters::from_toml(Path::new("film.toml"), &fitted.to_toml()).expect("readable");
    assert_eq!(read.doubts()[0], "mass_kg = 531.5 is 531.5 kg: is it in grams? write 0.5315");
    assert!(read.field_note().is_some());
    // The scale of its force is no property of a film of assumed sizes.
    let scaled = |assumed_sizes| {
        let actuator = Actuator { relative_permittivity: 0.014, ..read.actuator };
        Parameters { actuator, assumed_sizes, ..read.clone() }.doubts().join("; ").contains("relative_permittivity")
    };
    assert_eq!([true, false].map(scaled), [false, true]);
}
