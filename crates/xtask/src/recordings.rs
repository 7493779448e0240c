//! The recordings that tests replay.

use crate::process::{Result, cargo, run as run_command};

/// Makes the six recordings again: both plants, 155 s at 100 Hz, 0…6 kV at the paper's three frequencies.
pub fn run() -> Result<()> {
    let mut seed = 0;
    for plant in ["hossain", "wang"] {
        for period in [13, 7, 5] {
            seed += 1;
            let frequency = 1.0 / f64::from(period);
            let out = format!("--seed {seed} --out tests/recordings/{plant}-{period}s.csv");
            let record = format!("plant --plant {plant} --frequency {frequency} --duration 155 --rate 100 {out}");
            run_command(cargo(&format!("run --quiet --release --package host-sim -- {record}")))?;
        }
    }
    Ok(())
}
