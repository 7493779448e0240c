//! The feature `serde`: names in text, bytes in binary, and checks when a model is read.

use springpot::{
    Actuator, Coefficients, CommandLimits, Compressed, Law, LawOptions, Maxwell, ObserverOptions, Preload, Topology,
};

use crate::support::models::{presets, random_models};

const MODEL: &str = r#"{
    "main": { "c": 62740.0, "alpha": 0.2 },
    "branches": [[{ "c": 47958.0, "alpha": 1.0 }, { "c": 173210.0, "alpha": 1.0 }]],
    "topology": "parallel",
    "mass_kg": 0.316
}"#;

#[test]
fn a_model_is_read_as_it_is_written() {
    for (name, model) in presets().into_iter().chain(random_models(1, 20)) {
        let mut bytes = [0; 256];
        let bytes = postcard::to_slice(&model, &mut bytes).expect("room");
        assert_eq!(postcard::from_bytes::<Maxwell>(bytes), Ok(model), "{name}");
    }
    let model: Maxwell = serde_json::from_str(MODEL).expect("valid");
    assert_eq!((model.topology(), model.branches().len(), model.mass_kg()), (Topology::Parallel, 1, 0.316));
    let text = serde_json::to_string(&model).expect("text");
    assert_eq!(serde_json::from_str::<Maxwell>(&text).expect("valid"), model);
}

#[test]
fn invalid_models_are_refused_when_read() {
    let refused = |from: &str, to: &str| {
        assert!(MODEL.contains(from));
        serde_json::from_str::<Maxwell>(&MODEL.replace(from, to)).expect_err("refused").to_string()
    };
    assert!(refused("0.2", "1.2").contains("main springpot: alpha = 1.2"));
    assert!(refused("47958.0", "-1.0").contains("branch 1, springpot 1: c = -1"));
    assert!(refused("0.316", "-0.1").contains("mass"));
    assert!(refused("parallel", "series").contains("unknown variant"));
    assert!(refused("\"mass_kg\"", "\"mass_g\"").contains("unknown field"));
    let pair = r#"[{ "c": 1.0, "alpha": 0.5 }, { "c": 1.0, "alpha": 0.5 }]"#;
    refused("]]", &format!("], {pair}, {pair}, {pair}, {pair}, {pair}]"));
}

#[test]
fn fields_have_the_names_of_the_types() {
    let actuator = Actuator { preload: Preload::FromStart, stretch_coupling: 12.5, ..Actuator::KARNER_2022 };
    let text = serde_json::to_string(&actuator).expect("text");
    assert_eq!(
        text,
        "{\"relative_permittivity\":4.7,\"length_m\":0.04,\"width_m\":0.06,\"thickness_m\":0.00016,\"mass_kg\":0.316,\
         \"stretch_coupling\":12.5,\"saturation_v\":null,\"preload\":\"from-start\"}"
    );
    assert_eq!(serde_json::from_str::<Actuator>(&text).expect("valid"), actuator);
    assert_eq!(serde_json::to_string(&Preload::Settled).expect("text"), "\"settled\"");
    assert_eq!(serde_json::to_string(&Topology::Eq11).expect("text"), "\"eq11\"");

    fn same<T: serde::Serialize + for<'a> serde::Deserialize<'a> + PartialEq + std::fmt::Debug>(value: T) {
        let mut bytes = [0; 64];
        let bytes = postcard::to_slice(&value, &mut bytes).expect("room");
        assert_eq!(postcard::from_bytes::<T>(bytes), Ok(value));
    }
    same(CommandLimits::BENCH);
    same(ObserverOptions::at_bandwidth(0.6));
    same(LawOptions::at_step(1e-3));
}

/// Plain numbers, one byte each for the method and for no curve, 20 reserved ones, and the same law again, bit for bit.
#[test]
fn coefficients_are_the_numbers_alone() {
    for (name, model) in presets() {
        let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3)).expect("valid");
        let mut bytes = [0; 512];
        let bytes = postcard::to_slice(&law.coefficients(), &mut bytes).expect("room");
        assert_eq!(bytes.len(), 1 + 2 * 8 + (12 + 2 * 12 + 2 * 24) * 4 + 20 + 1);
        let read: Coefficients<f32> = postcard::from_bytes(bytes).expect("valid");
        assert_eq!(Law::from_coefficients(&read, 1e-3, model.mass_kg()), Ok(law), "{name}");
        assert!(postcard::from_bytes::<Coefficients<f32>>(&bytes[..bytes.len() - 1]).is_err());
    }
    // More than the 32 elements that serde itself has arrays for, and in text.
    type Long = Compressed<f64, 40, 2, 36>;
    let (_, model) = presets().swap_remove(2);
    let law: Law<f64, Long> = Law::compressed(&model, LawOptions::at_step(1e-3)).expect("valid");
    let text = serde_json::to_string(&law.coefficients()).expect("text");
    let read: Coefficients<f64, 40, 2, 36> = serde_json::from_str(&text).expect("valid");
    assert_eq!(read.head.len(), 40);
    let short = serde_json::from_str::<Coefficients<f64, 41, 2, 36>>(&text);
    assert!(short.expect_err("refused").to_string().contains("an array of 41"));
}
