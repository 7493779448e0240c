//! The firmware's modules for hardware on models of the chip: what they leave in its registers, and what they do on the way.

#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
mod on_models;

#[cfg(not(all(target_arch = "x86_64", target_os = "linux")))]
#[test]
#[ignore = "registers trap on x86-64 with Linux alone: the firmware's modules for hardware were not run"]
fn hardware_was_not_tested() {}
