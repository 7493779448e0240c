//! The published parameter sets: Tables 3 and 4 of Karner et al. 2022.

use crate::actuator::Actuator;
use crate::error::ModelError;
use crate::model::Springpot;
use crate::model::{Maxwell, Topology};

/// A published parameter set: Tables 3 and 4 of Karner, Belšak and Gotlih, Fractal Fract. 2022, 6, 720.
///
/// The paper's coefficients are in newtons per *millimetre*: with c₁₁ ≈ 63 N/mm its 140 N at 6 kV make the millimetres
/// of its figures, although its Table 1 says metres. Here they are multiplied by 1000, in N·s^α/m.
///
/// Two values are not legible in the copy used here: α₆₂ of Table 3, n = 5, is taken as 1 (it changes the
/// displacement by about 1e-5), and α₁₁ of n = 2 as 0.2 (from the text).
///
/// ```
/// use springpot::{Preset, Topology};
///
/// let preset = Preset::TABLE3_N2;
/// let model = preset.model()?;
/// assert_eq!(Preset::named("table3-n2"), Some(preset));
/// assert_eq!((model.branches().len(), model.topology()), (2, Topology::Eq11));
///
/// let names: Vec<&str> = Preset::ALL.iter().map(Preset::name).collect();
/// assert_eq!(names[5..], ["table4-f13", "table4-f7", "table4-f5"]);
/// # Ok::<(), springpot::ModelError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Preset {
    name: &'static str,
    main: Springpot,
    branches: &'static [[Springpot; 2]],
}

impl Preset {
    /// Table 3, 1 branch.
    pub const TABLE3_N1: Self =
        Self { name: "table3-n1", main: c(62_952.0, 0.2), branches: &[[c(36.0, 0.002), c(142.0, 1.0)]] };
    /// Table 3, 2 branches.
    pub const TABLE3_N2: Self = Self {
        name: "table3-n2",
        main: c(62_740.0, 0.2),
        branches: &[[c(47_958.0, 1.0), c(173_210.0, 1.0)], [c(430_381.0, 0.523), c(215.0, 0.046)]],
    };
    /// Table 3, 3 branches.
    pub const TABLE3_N3: Self = Self {
        name: "table3-n3",
        main: c(62_950.0, 0.2),
        branches: &[[c(267.0, 1.0), c(464.0, 1.0)], [c(140.0, 1.0), c(88.0, 0.002)], [c(36.0, 1.0), c(237.0, 1.0)]],
    };
    /// Table 3, 4 branches.
    pub const TABLE3_N4: Self = Self {
        name: "table3-n4",
        main: c(62_950.0, 0.2),
        branches: &[
            [c(103.0, 0.002), c(36.0, 1.0)],
            [c(321.0, 0.002), c(36.0, 1.0)],
            [c(94.0, 1.0), c(157.0, 0.002)],
            [c(36.0, 1.0), c(225.0, 0.002)],
        ],
    };
    /// Table 3, 5 branches.
    pub const TABLE3_N5: Self = Self {
        name: "table3-n5",
        main: c(62_950.0, 0.2),
        branches: &[
            [c(97.0, 0.002), c(315.0, 1.0)],
            [c(36.0, 1.0), c(356.0, 1.0)],
            [c(36.0, 1.0), c(97.0, 0.002)],
            [c(36.0, 1.0), c(95.0, 0.002)],
            [c(36.0, 1.0), c(285.0, 1.0)],
        ],
    };
    /// Table 4, 1/13 Hz.
    pub const TABLE4_F13: Self = Self {
        name: "table4-f13",
        main: c(51_773.0, 0.1795),
        branches: &[[c(2.0, 1.0), c(2.0, 1.0)], [c(2.0, 1.0), c(2.0, 1.0)]],
    };
    /// Table 4, 1/7 Hz.
    pub const TABLE4_F7: Self = Self {
        name: "table4-f7",
        main: c(57_696.0, 0.188),
        branches: &[[c(569_346.0, 0.255), c(3.0, 0.046)], [c(406_744.0, 0.225), c(479.0, 0.880)]],
    };
    /// Table 4, 1/5 Hz.
    pub const TABLE4_F5: Self = Self {
        name: "table4-f5",
        main: c(73_133.0, 0.2),
        branches: &[[c(19_199.0, 1.0), c(188_074.0, 1.0)], [c(305_285.0, 1.0), c(191_367.0, 0.002)]],
    };

    /// All of them: Table 3 for n = 1…5, Table 4 for 1/13, 1/7 and 1/5 Hz.
    pub const ALL: [Self; 8] = [
        Self::TABLE3_N1,
        Self::TABLE3_N2,
        Self::TABLE3_N3,
        Self::TABLE3_N4,
        Self::TABLE3_N5,
        Self::TABLE4_F13,
        Self::TABLE4_F7,
        Self::TABLE4_F5,
    ];

    /// The preset of that name, such as `table3-n2` or `table4-f7`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|preset| preset.name == name)
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The model as published, in [`Topology::Eq11`], with the mass of [`Actuator::KARNER_2022`].
    ///
    /// # Errors
    ///
    /// None in practice: a test checks the tables.
    pub fn model(&self) -> Result<Maxwell, ModelError> {
        Maxwell::new(self.main, self.branches, Topology::Eq11, Actuator::KARNER_2022.mass_kg)
    }
}

const fn c(c: f64, alpha: f64) -> Springpot {
    Springpot::new(c, alpha)
}
