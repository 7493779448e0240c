//! Puts the memory map and the budget where the linker finds them.

use std::env;
use std::error::Error;
use std::fs;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let out = env::var("OUT_DIR")?;
    for script in ["../memory.x", "budget.x"] {
        let script = Path::new(script);
        let name = script.file_name().ok_or("a script has a name")?;
        fs::copy(script, Path::new(&out).join(name))?;
        println!("cargo:rerun-if-changed={}", script.display());
    }
    println!("cargo:rustc-link-search={out}");
    println!("cargo:rerun-if-changed=build.rs");
    Ok(())
}
