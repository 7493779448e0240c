//! Films that are not, or not quite, the controller's model.

use std::sync::OnceLock;

use springpot::{Actuator, Law, LawOptions, LawState, Preset, VoltageDrive};

pub const STEP_S: f64 = 1e-3;
/// Largest voltage of the amplifiers in these tests, V.
const MAX_V: f64 = 11e3;

#[allow(clippy::large_enum_variant)] // there is one of them at a time
#[derive(Clone)]
pub enum Film {
    /// The paper's model of `table3-n2`, stiffer or softer, or with another force.
    Model(ModelFilm),
    /// A strip with springs that stiffen: no member of the model's family.
    Strip(Strip),
}

impl Film {
    /// A film by its kind, and its stiffness, force, stiffening or coupling.
    pub fn of_kind(kind: &str, parameter: f64) -> Self {
        match kind {
            "less force" => Self::Model(ModelFilm::new(1.0, parameter)),
            "strip" => Self::Strip(Strip::new(parameter)),
            "pulls in" => Self::Strip(Strip::pulling_in(parameter)),
            "warms" => Self::Model(ModelFilm::warming(parameter)),
            _ => Self::Model(ModelFilm::new(parameter, 1.0)),
        }
    }

    /// Displacement (m) after a step under `volts` (V).
    pub fn step(&mut self, volts: f64) -> f64 {
        match self {
            Self::Model(film) => film.step(volts),
            Self::Strip(strip) => strip.step(volts),
        }
    }
}

/// A film that follows a law in f64.
#[derive(Clone)]
pub struct ModelFilm {
    law: &'static (Law<f64>, VoltageDrive<f64>),
    state: LawState<f64>,
    /// √ of the force in units of the model's.
    force_root: f64,
    /// The same once the film has warmed.
    warm_root: f64,
}

/// Laws of the model from 0.8 to 1.2 times its stiffness.
static LAWS: [OnceLock<(Law<f64>, VoltageDrive<f64>)>; 9] = [const { OnceLock::new() }; 9];

fn law(index: usize) -> &'static (Law<f64>, VoltageDrive<f64>) {
    LAWS[index].get_or_init(|| {
        let model = Preset::TABLE3_N2.model().expect("valid");
        let scaled = model.scaled(0.8 + 0.05 * index as f64).expect("positive");
        let law = Law::compressed(&scaled, LawOptions::at_step(STEP_S)).expect("valid");
        let drive = VoltageDrive::new(&Actuator::KARNER_2022, MAX_V, law.stiffness()).expect("valid");
        (law, drive)
    })
}

impl ModelFilm {
    /// A film at rest, `stiffness` times as stiff as the model (0.8 to 1.2, in steps of 0.05), with `force` times its force.
    pub fn new(stiffness: f64, force: f64) -> Self {
        let index = ((stiffness - 0.8) / 0.05).round().clamp(0.0, 8.0) as usize;
        let law = law(index);
        Self { law, state: law.0.state(), force_root: force.sqrt(), warm_root: force.sqrt() }
    }

    /// The model, whose force becomes `force` times as large with a time constant of 2 s.
    pub fn warming(force: f64) -> Self {
        Self { warm_root: force.sqrt(), ..Self::new(1.0, 1.0) }
    }

    fn step(&mut self, volts: f64) -> f64 {
        let (law, drive) = self.law;
        self.force_root += (self.warm_root - self.force_root) * STEP_S / 2.0;
        law.displacement_under(&mut self.state, drive.load(volts * self.force_root))
    }
}

/// A strip of Zener elements side by side, a dashpot, and a spring that stiffens with the cube of the stroke:
///
/// ```text
/// c x' + k x + k₃ x³ + Σ kᵢ (x − zᵢ) = F (1 + κ x),    zᵢ' = (x − zᵢ) / τᵢ
/// ```
///
/// Its relaxation modulus is within a fifth of the model's from 0.1 s to 100 s at small strokes. Beyond, and at large ones, it is not.
#[derive(Clone)]
pub struct Strip {
    stiffening_n_per_m3: f64,
    /// κ, 1/m: the film pulls in where κ F reaches its stiffness.
    coupling_per_m: f64,
    displacement_m: f64,
    dashpots_m: [f64; 4],
}

impl Strip {
    /// c, N s/m.
    const DAMPING: f64 = 300.0;
    /// k, N/m.
    const SPRING: f64 = 20e3;
    /// kᵢ (N/m) and τᵢ (s).
    const ELEMENTS: [(f64, f64); 4] = [(48e3, 0.03), (32e3, 0.3), (20e3, 3.0), (14e3, 30.0)];

    /// A strip at rest, whose cubic spring carries `share` of what its linear spring does at a stroke of 1 mm.
    pub fn new(share: f64) -> Self {
        let stiffening_n_per_m3 = share * Self::SPRING / 1e-6;
        Self { stiffening_n_per_m3, coupling_per_m: 0.0, displacement_m: 0.0, dashpots_m: [0.0; 4] }
    }

    /// A strip that does not stiffen, and whose force grows with the stroke.
    pub fn pulling_in(coupling_per_m: f64) -> Self {
        Self { coupling_per_m, ..Self::new(0.0) }
    }

    /// Implicit in x, so that it is stable for any step: one step of Newton from the last x.
    fn step(&mut self, volts: f64) -> f64 {
        let force_n = Actuator::KARNER_2022.force(volts, 0.0);
        let x = self.displacement_m;
        let held = Self::ELEMENTS.iter().zip(self.dashpots_m).map(|((k, _), z)| k * (x - z)).sum::<f64>();
        let slope = Self::DAMPING / STEP_S - self.coupling_per_m * force_n
            + Self::SPRING
            + 3.0 * self.stiffening_n_per_m3 * x * x
            + Self::ELEMENTS.iter().map(|(k, _)| k).sum::<f64>();
        let rest =
            force_n * (1.0 + self.coupling_per_m * x) - Self::SPRING * x - self.stiffening_n_per_m3 * x.powi(3) - held;
        self.displacement_m = x + rest / slope;
        for (z, (_, tau)) in self.dashpots_m.iter_mut().zip(Self::ELEMENTS) {
            *z += (self.displacement_m - *z) * STEP_S / tau;
        }
        self.displacement_m
    }
}

/// The modulus of the strip against the closed form of its elements, and against the model's springpot, c t^−α / Γ(1 − α).
#[test]
fn the_strip_is_near_the_model_and_is_not_it() {
    let volts = 1500.0;
    let force_n = Actuator::KARNER_2022.force(volts, 0.0);
    let (mut strip, mut linear, mut model) = (Strip::new(0.5), Strip::new(0.0), ModelFilm::new(1.0, 1.0));
    let mut worst = 0.0f64;
    for tick in 1..=100_000 {
        let (x, y, reference) = (strip.step(volts), linear.step(volts), model.step(volts));
        assert!(x <= y, "it stiffens");
        if tick >= 100 {
            worst = worst.max((y / reference - 1.0).abs());
        }
    }
    assert!(worst > 0.02 && worst < 0.25, "{worst}");
    // All dashpots have given way in the end: the springs alone hold.
    for _ in 0..700_000 {
        linear.step(volts);
    }
    assert!((linear.displacement_m * Strip::SPRING / force_n - 1.0).abs() < 1e-4);
}
