//! Puts the memory map and the budget where the linker finds them.

use std::env;
use std::error::Error;
use std::fs;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let out = env::var("OUT_DIR")?;
    let g4 = env::var_os("CARGO_FEATURE_STM32G4").is_some();
    let memory = if g4 { "src/boards/nucleo_g474re.x" } else { "../memory.x" };
    for (script, name) in [(memory, "memory.x"), ("budget.x", "budget.x")] {
        fs::copy(script, Path::new(&out).join(name))?;
        println!("cargo:rerun-if-changed={script}");
    }
    println!("cargo:rustc-link-search={out}");
    println!("cargo:rerun-if-changed=build.rs");
    Ok(())
}
