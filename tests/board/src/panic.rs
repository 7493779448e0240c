//! Replaces `firmware/src/panic.rs`, which owns the chip's memory and its panic handler.

/// The message of the panic that ended the last run; empty if none did.
pub struct Message(pub String);

impl Message {
    pub fn as_str(&self) -> &str {
        &self.0
    }
}
