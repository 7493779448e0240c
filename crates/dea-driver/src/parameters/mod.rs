//! The parameters of a board, as bytes and over power loss.

mod blob;
mod store;

pub use blob::{BLOB_LEN, Blob, BlobError, Control, Parameters, SCHEMA};
pub use store::{Store, StoreError};
