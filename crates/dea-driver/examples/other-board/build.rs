//! Puts the board's memory map where the linker finds it.

use std::env;
use std::error::Error;
use std::fs;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=build.rs");
    let map = match env::var("CARGO_CFG_TARGET_ARCH")?.as_str() {
        "arm" => "mps2-an505.x",
        "riscv32" => "virt.x",
        // A program of the host.
        _ => return Ok(()),
    };
    let out = env::var("OUT_DIR")?;
    fs::copy(map, Path::new(&out).join("memory.x"))?;
    println!("cargo:rustc-link-search={out}");
    println!("cargo:rerun-if-changed={map}");
    Ok(())
}
