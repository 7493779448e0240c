//! The parameters of a board: values, bytes, and two slots of flash (feature `store`).

mod blob;
#[cfg(feature = "link")]
mod digest;
mod memory;
#[cfg(feature = "store")]
mod ram_flash;
mod self_sensor;
mod settings;
#[cfg(feature = "store")]
mod store;

#[cfg(feature = "store")]
pub use blob::BlobHeader;
pub use blob::{BLOB_LEN, Blob, BlobError, SCHEMA};
#[cfg(feature = "link")]
pub(crate) use digest::{digest, digest_of};
pub use memory::ControllerMemory;
pub(crate) use memory::Watched;
#[cfg(feature = "store")]
pub use ram_flash::RamFlash;
pub use self_sensor::SelfSensor;
pub use settings::{Control, Parameters};
#[cfg(feature = "store")]
pub use store::{Store, StoreError, Stored};
