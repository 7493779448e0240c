//! Warnings of the firmware are compiled in, as its own build has them: defmt leaves everything below errors out otherwise.

fn main() {
    println!("cargo::rustc-env=DEFMT_LOG=info");
    println!("cargo::rerun-if-changed=build.rs");
}
