//! Draws the README's picture: creep with full, compressed and short memory.
//!
//! `cargo run --release -p host-sim --example creep_picture -- docs/creep.svg`

use std::path::PathBuf;

use host_sim::files::parameters::Parameters;
use host_sim::files::recording::Input;
use host_sim::grid::{Grid, Samples};
use host_sim::replay::memory::{MemoryChoice, Precision, RunOptions};
use host_sim::replay::simulate;
use host_sim::report::figure::{Colour, Figure, Line, Panel};
use host_sim::report::figure_file;
use host_sim::simulation::film::Waveform;
use indicatif::ProgressBar;

fn main() -> host_sim::Result<()> {
    let path = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "docs/creep.svg".into()));
    let parameters = Parameters::preset("table3-n2")?;
    let grid = Grid::covering(155.0, 1000.0)?;
    let time_s: Vec<f64> = (0..grid.samples).map(|k| grid.time_s(k)).collect();
    let waveform = Waveform { peak_v: 6000.0, frequencies_hz: vec![1.0 / 7.0] };
    let value = time_s.iter().map(|&t| waveform.voltage_v(t)).collect();
    let input = Input::Voltage(Samples { time_s: time_s.clone(), value });
    let displacement_mm = |memory, precision| -> host_sim::Result<Vec<f64>> {
        let options = RunOptions { memory, precision, ..RunOptions::default() };
        let response = simulate::response(&parameters, &input, grid, &options, &ProgressBar::hidden())?;
        Ok(response.displacement_m.iter().map(|x| 1e3 * x).collect())
    };
    let full = displacement_mm(MemoryChoice::Full, Precision::F64)?;
    let compressed = displacement_mm(MemoryChoice::Compressed, Precision::F32)?;
    let window = displacement_mm(MemoryChoice::Window(10.0), Precision::F32)?;
    let nanometres: Vec<f64> = compressed.iter().zip(&full).map(|(a, b)| 1e6 * (a - b)).collect();
    let figure = Figure::new(
        "Creep",
        vec![
            Panel::new("Creep under 0…6 kV at 1/7 Hz, Table 3, n = 2", "time (s)", "displacement (mm)")
                .with(Line::new("full memory, f64", &time_s, &full).beneath())
                .with(Line::new("compressed, f32: 0.7 kB", &time_s, &compressed).coloured(Colour::BLUE))
                .with(Line::new("10 s window, f32: 80 kB", &time_s, &window).coloured(Colour::VERMILION)),
            Panel::new("Compressed minus full memory", "time (s)", "difference (nm)")
                .with(Line::new("compressed, f32", &time_s, &nanometres).coloured(Colour::BLUE)),
        ],
    );
    figure_file::stage_image(&path, &figure)?.commit()
}
