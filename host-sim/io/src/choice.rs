//! Choices and their names, the same on the command line, in Python and in files.

use springpot::{Discretisation, Preload, Topology};

/// One of a few named values.
pub trait Choice: Copy + PartialEq + Send + Sync + 'static {
    /// Every value, its name, and a line of help.
    const CHOICES: &'static [(Self, &'static str, &'static str)];

    /// The name.
    fn name(self) -> &'static str {
        Self::CHOICES.iter().find(|(value, ..)| *value == self).map_or("", |(_, name, _)| name)
    }

    /// The value of that name.
    fn from_name(name: &str) -> Option<Self> {
        Self::CHOICES.iter().find(|(_, known, _)| *known == name).map(|(value, ..)| *value)
    }
}

/// Serializes a choice as its name.
pub fn by_name<C: Choice, S: serde::Serializer>(choice: &C, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(choice.name())
}

/// Defines an enum that is a [`Choice`]: each value has its line of documentation, which is its help, and its name.
#[macro_export]
macro_rules! choice {
    ($(#[$meta:meta])* pub enum $choice:ident {
        $(#[doc = $help:literal] $(#[$mark:ident])? $value:ident = $name:literal,)+
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum $choice {
            $(#[doc = $help] $(#[$mark])? $value,)+
        }

        impl $crate::choice::Choice for $choice {
            const CHOICES: &'static [(Self, &'static str, &'static str)] = &[$((Self::$value, $name, $help),)+];
        }
    };
}

impl Choice for Discretisation {
    const CHOICES: &'static [(Self, &'static str, &'static str)] = &[
        (Self::Gl, "gl", "Grünwald–Letnikov, of first order in the step: Eq. 2 of the paper"),
        (Self::Bdf2, "bdf2", "Second-order backward differences"),
    ];
}

impl Choice for Topology {
    const CHOICES: &'static [(Self, &'static str, &'static str)] =
        &[(Self::Parallel, "parallel", "The generalised Maxwell model"), (Self::Eq11, "eq11", "As published")];
}

impl Choice for Preload {
    const CHOICES: &'static [(Self, &'static str, &'static str)] = &[
        (Self::Settled, "settled", "The weight has hung for minutes"),
        (Self::FromStart, "from-start", "The weight is hung on at t = 0"),
    ];
}
