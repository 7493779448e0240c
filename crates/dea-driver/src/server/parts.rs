//! Conversion of the converters' errors to the states of [`Inspection`](crate::wire::Inspection).

use crate::chips::{AdcError, AmplifierError};
use crate::wire::Part;

impl<T> From<Result<T, AdcError>> for Part {
    fn from(read: Result<T, AdcError>) -> Self {
        match read {
            Ok(_) => Self::Answers,
            Err(AdcError::Bus) => Self::Bus,
            Err(AdcError::Range { wanted, found }) => Self::Wrong { wanted, found },
            Err(AdcError::Starting) => Self::Starting,
        }
    }
}

impl From<Result<(), AmplifierError>> for Part {
    fn from(applied: Result<(), AmplifierError>) -> Self {
        match applied {
            Ok(()) => Self::Answers,
            Err(AmplifierError::Bus) => Self::Bus,
            Err(AmplifierError::Enable) => Self::Pin,
            Err(AmplifierError::NoReference) => Self::NoReference,
            Err(AmplifierError::Readback { wanted, found }) => Self::Wrong { wanted, found },
        }
    }
}
