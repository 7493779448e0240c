//! The firmware's modules for hardware on models of the chip: what they leave in its registers, and what they do on the way.

#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
mod on_models;
