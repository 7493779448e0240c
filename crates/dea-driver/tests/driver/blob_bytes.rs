//! The bytes of a blob stay what they were: controllers hold blobs of earlier hosts with the same schema.
//!
//! The files under `blobs/` were written by `springpot export` when the blob got schema 4.

use dea_driver::{BLOB_LEN, Blob, BlobError, BlobHeader, Parameters, SCHEMA};
use springpot::{
    Actuator, AmplifierLag, Coefficients, Compressed, Curve, Discretisation, Knot, Law, LawOptions, Maxwell, Measure,
    Preload, Preset, Spring, Springpot, Topology, VoltageDrive,
};

use crate::bench::{encoded, law, law_in_series};

const BOARD: u16 = 0x0405;
const PRESET: &[u8] = include_bytes!("blobs/table3-n2.bin");
const CURVED: &[u8] = include_bytes!("blobs/behind-a-curve.bin");
const COUPLED: &[u8] = include_bytes!("blobs/coupled-from-start.bin");

/// Decodes `bytes`, after a check that they would be written the same today.
fn parameters(bytes: &[u8]) -> Parameters {
    let parameters = Blob::decode(bytes, BOARD).expect("valid").into_parameters();
    assert_eq!(encoded(&parameters, BOARD), bytes);
    parameters
}

/// The coefficients of `law`, with the bound that hosts then stored: that of the straight law of `model`.
fn holds(stored: &Coefficients<f32>, law: &Law<f32>, (straight, model): (&Law<f32>, &Maxwell)) {
    let bound = straight.compression_bound(model, LawOptions::DEFAULT_HORIZON_S);
    let mut reserved = [0; 20];
    postcard::to_slice(&bound, &mut reserved).expect("five numbers");
    assert_eq!(stored, &Coefficients { reserved, ..law.coefficients() });
}

/// The parameters of a blob that was stored with this law in `schema`: they are those of the law, and a controller has it. With `SPRINGPOT_WRITE` the
/// file is written first.
fn stored(name: &str, schema: u16, law: &Law<f32>) -> Parameters {
    let path = format!("{}/tests/driver/blobs/{name}.bin", env!("CARGO_MANIFEST_DIR"));
    if std::env::var_os("SPRINGPOT_WRITE").is_some() {
        std::fs::write(&path, encoded(&Parameters::bench(law, Actuator::KARNER_2022), BOARD)).expect("written");
    }
    let bytes = std::fs::read(path).expect("a blob");
    assert_eq!(BlobHeader::read(&bytes).expect("a blob").schema, schema);
    let sent = parameters(&bytes);
    assert_eq!(sent.law, law.coefficients());
    let blob: Blob = Blob::new(sent.clone()).expect("valid");
    steps_as(&blob, law);
    sent
}

/// A controller's law is the host's, to the bit.
fn steps_as(blob: &Blob, law: &Law<f32>) {
    let received = blob.follower().compensator().observer().law();
    assert_eq!(received, law);
    let (mut here, mut there) = (law.state(), received.state());
    for k in 0..1000 {
        let force_n = if k < 500 { 8.0 } else { 0.2 };
        assert_eq!(received.displacement(&mut there, force_n), law.displacement(&mut here, force_n), "step {k}");
    }
}

#[test]
fn a_blob_is_read_and_written_byte_for_byte() {
    let preset = parameters(PRESET);
    assert_eq!(preset.actuator, Actuator::KARNER_2022);
    holds(&preset.law, &law(), (&law(), &Preset::TABLE3_N2.model().expect("valid")));
    assert_eq!(preset.rate_hz, 1000.0);
}

/// With another actuator, the weight acting from the start, and the fields behind them.
#[test]
fn every_field_of_the_actuator_keeps_its_place() {
    let coupled = parameters(COUPLED);
    let actuator = Actuator { stretch_coupling: 12.5, preload: Preload::FromStart, ..Actuator::KARNER_2022 };
    assert_eq!(coupled.actuator, actuator);
    let branch = [Springpot::new(47_958.0, 1.0), Springpot::new(173_210.0, 1.0)];
    let main = Springpot::new(62_740.0, 0.2);
    let model = Maxwell::new(main, &[branch], Topology::Parallel, actuator.mass_kg).expect("valid");
    let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1.0 / 500.0)).expect("valid");
    holds(&coupled.law, &law, (&law, &model));
    assert_eq!(coupled.name, "coupled, from the start");
    assert_eq!(coupled.sensor_offset_m, 0.0);
}

/// Behind an elastic curve, through a drive that saturates, in the second-order discretisation.
#[test]
fn a_blob_carries_the_curve_and_the_method() {
    let curved = parameters(CURVED);
    let actuator = Actuator { stretch_coupling: -12.5, saturation_v: Some(9000.0), ..Actuator::KARNER_2022 };
    assert_eq!(curved.actuator, actuator);
    let main = Springpot::new(62_740.0, 0.2);
    let model = Maxwell::new(main, &[], Topology::Parallel, actuator.mass_kg).expect("valid");
    let options = LawOptions::at_step(1e-3).with_method(Discretisation::Bdf2);
    let points = [(-0.5e-3, -0.45e-3), (0.0, 0.0), (1e-3, 1.2e-3), (2e-3, 2.9e-3)];
    let curve = Curve::through(&points).expect("rises");
    let straight: Law<f32> = Law::compressed(&model, options).expect("valid");
    let law = straight.clone().behind(&curve).expect("valid");
    holds(&curved.law, &law, (&straight, &model));
    assert_eq!((curved.law.method, curved.law.curve.len()), (Discretisation::Bdf2, 4));
    assert_eq!(curved.amplifier_lag, AmplifierLag { rise_s: 0.1, fall_s: 0.5 });
    assert_eq!((curved.control.harmonics, curved.control.period_s), (5, 2.5));
}

/// A law with two curves, in the schema that came with them.
#[test]
fn a_blob_carries_both_curves() {
    let model = Maxwell::new(Springpot::new(62_740.0, 0.2), &[], Topology::Parallel, 0.316).expect("valid");
    let spring = Spring::through(&[(-0.5e-3, -6.0), (0.0, 0.0), (1e-3, 11.0), (2e-3, 20.0)]).expect("valid");
    let measure = Measure { exponent: 0.0, length_m: 0.06 }.curve(-0.5e-3, 2e-3).expect("rises");
    let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3)).expect("valid");
    let law = law.beside(&spring, &measure).expect("valid");
    stored("beside-a-spring", SCHEMA - 1, &law);

    // A curve of nine knots beside a spring of as many, with a name and the longest of the rest of a bench, still has room.
    let points: Vec<(f64, f64)> = (0..9).map(|k| 1e-4 * f64::from(k - 4)).map(|x| (x, 1e4 * x)).collect();
    let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3)).expect("valid");
    let law = law.beside(&Spring::through(&points).expect("valid"), &measure).expect("valid");
    let name = "a name of thirty-two characters.".parse().expect("fits");
    let long = Parameters { name, ..Parameters::bench(&law, Actuator::KARNER_2022) };
    assert!(encoded(&long, BOARD).len() <= BLOB_LEN);
}

/// A law with a spring in series, in the schema that came with it. Its first knot alone says so: damage of that one is refused, as that of the spring.
#[test]
fn a_blob_carries_a_spring_in_series() {
    let sent = stored("in-series", SCHEMA, &law_in_series());
    let damages: [fn(&mut [Knot<f32>]); 8] = [
        |knots| knots[0].displacement = 1e-6,
        |knots| knots[0].displacement = f32::NAN,
        |knots| knots[0].value = 1e-6,
        |knots| knots[0].slope = 0.0,
        |knots| knots[0].slope = 1.0 + f32::EPSILON,
        |knots| knots[2].value = f32::NAN,
        |knots| knots[3].value = knots[2].value,
        |knots| knots[1].displacement = knots[2].displacement,
    ];
    for (index, damage) in damages.iter().enumerate() {
        let mut damaged = sent.clone();
        damage(&mut damaged.law.curve);
        let refused = Blob::<Compressed<f32>>::new(damaged).err();
        assert!(matches!(refused, Some(BlobError::Law(_))), "{index}: {refused:?}");
    }
}

/// A controller steps the host's law, of either method, to the bit, behind the host's drive; a full name has room.
#[test]
fn parameters_and_blob_carry_the_method() {
    let model = Preset::named("table3-n2").expect("there").model().expect("valid");
    for method in [Discretisation::Gl, Discretisation::Bdf2] {
        let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3).with_method(method)).expect("valid");
        let name = "a name of thirty-two characters.".parse().expect("fits");
        let sent = Parameters { name, ..Parameters::bench(&law, Actuator::KARNER_2022) };
        let blob = Blob::decode(&encoded(&sent, BOARD), BOARD).expect("valid");
        assert_eq!(blob.parameters(), &sent);
        assert_eq!(law.method(), method);
        steps_as(&blob, &law);
        let max_voltage_v = sent.limits.max_voltage_v.into();
        let drive = VoltageDrive::new(&Actuator::KARNER_2022, max_voltage_v, law.stiffness()).expect("valid");
        assert_eq!(blob.follower().compensator().observer().drive(), &drive);
    }
}
