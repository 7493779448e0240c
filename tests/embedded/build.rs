//! Puts the target's memory map where the linker finds it, its clock where the counter finds it, and the coefficients of the laws where
//! `cycles` finds them.

use std::env;
use std::error::Error;
use std::fs;
use std::path::Path;

use springpot::{Coefficients, Compressed, Law, LawOptions, Preset};

/// Memory maps of the example for boards of these cores.
const BOARDS: [&str; 2] = [
    "../../crates/dea-driver/examples/other-board/mps2-an505.x",
    "../../crates/dea-driver/examples/other-board/virt.x",
];

fn main() -> Result<(), Box<dyn Error>> {
    let target = env::var("TARGET")?;
    // Core clocks of QEMU's boards. RISC-V counts instructions itself.
    let (map, clock_mhz) = match target.split('-').next() {
        Some("thumbv6m") => ("microbit.x", "16"),
        Some("thumbv7em") => ("../../memory.x", "168"),
        Some("thumbv8m.main") => (BOARDS[0], "20"),
        Some("riscv32imac") => (BOARDS[1], ""),
        _ => return Err(format!("there is no board for {target}").into()),
    };
    println!("cargo:rustc-env=CLOCK_MHZ={clock_mhz}");
    let out = env::var("OUT_DIR")?;
    fs::copy(map, Path::new(&out).join("memory.x"))?;
    fs::write(Path::new(&out).join("coefficients.rs"), coefficients()?)?;
    println!("cargo:rustc-link-search={out}");
    println!("cargo:rerun-if-changed={map}");
    println!("cargo:rerun-if-changed=build.rs");
    Ok(())
}

/// The default law, alone, behind a curve, beside and in series with a spring, and the lean ones, of a published model.
fn coefficients() -> Result<String, Box<dyn Error>> {
    let model = Preset::TABLE3_N2.model()?;
    let options = LawOptions::at_step(1e-3);
    let default: Law<f32> = Law::compressed(&model, options)?;
    let curved = default.clone().behind(&chip_program::curve())?;
    let two = default.clone().beside(&chip_program::spring(), &chip_program::measure())?;
    let series = default.clone().in_series(&chip_program::spring())?;
    let lean: Law<f32, Compressed<f32, 8, 14, 4>> =
        Law::compressed(&model, options.with_horizon(3600.0).with_tolerance(1e-3))?;
    let leanest: Law<f32, Compressed<f32, 8, 16, 0>> =
        Law::compressed(&model, options.with_horizon(155.0).with_tolerance(1e-3))?;
    Ok([
        function("default_law", "12, 12, 24", &default.coefficients()),
        function("curved_law", "12, 12, 24", &curved.coefficients()),
        function("two_curves_law", "12, 12, 24", &two.coefficients()),
        function("series_law", "12, 12, 24", &series.coefficients()),
        function("lean_law", "8, 14, 4", &lean.coefficients()),
        function("leanest_law", "8, 16, 0", &leanest.coefficients()),
    ]
    .concat())
}

/// A function that returns `coefficients`.
fn function<const H: usize, const F: usize, const S: usize>(
    name: &str,
    sizes: &str,
    coefficients: &Coefficients<f32, H, F, S>,
) -> String {
    // What Debug prints is the expression itself, but for the method and the knots of the curve.
    let expression = format!("{coefficients:?}").replace("method: Gl", "method: springpot::Discretisation::Gl");
    let expression = expression.replace("Knot {", "springpot::Knot {").replace("] }", "].into_iter().collect() }");
    format!("fn {name}() -> Coefficients<f32, {sizes}> {{\n    {expression}\n}}\n")
}
