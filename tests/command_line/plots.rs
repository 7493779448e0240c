//! `--plot` of the commands that compute series: page, SVG and PNG.

use std::fs;

use tests::thinned_recordings;
use tests::tool::{Bench, names};

use crate::TOOL;
use crate::report_page::{check_page, document};

/// The commands that draw, with their panels; their output goes to `out.csv`.
const COMMANDS: [(&str, &[&str]); 7] = [
    ("replay --params preset:table3-n2 --rate 100 wang-5s.csv", &["measured and modelled", "residual"]),
    (
        "feedforward --params preset:table3-n2 --rate 100 --reference ref.csv --out out.csv",
        &["Reference and model", "Voltage"],
    ),
    (
        "observe --params preset:table3-n2 --rate 100 --out out.csv wang-5s.csv",
        &["Sensor and estimate", "Innovation", "Disturbance force"],
    ),
    (
        "simulate --params preset:table3-n2 --rate 100 --profile wang-5s.csv --out out.csv",
        &["Voltage", "Force on the film", "Displacement"],
    ),
    ("reference --shape triangle --low 0.001 --high 0.002 --period 5 --rate 100 --out out.csv", &["Reference"]),
    (
        "frequency-response --params preset:table3-n2 --from 0.01 --to 10 --points 50 --out out.csv",
        &["Displacement over force", "Phase"],
    ),
    (
        "closed-loop --plant preset:table3-n2 --controller tracking --params preset:table3-n2 --rate 100 --reference ref.csv --out out.csv",
        &["Reference and film", "Error", "Voltage"],
    ),
];

/// A folder with a reference and recordings.
fn bench() -> Bench {
    let bench = Bench::new(TOOL);
    thinned_recordings("wang", &bench.path(""), 40);
    bench.json("reference --shape sine --low 0.0003 --high 0.0012 --period 5 --duration 12 --rate 100 --out ref.csv");
    bench
}

#[test]
fn each_command_draws_a_page_that_holds_its_results() {
    let bench = bench();
    for (command, panels) in COMMANDS {
        let printed = bench.json(&format!("{command} --plot plot.html"));
        let page = bench.read("plot.html");
        check_page(&page);
        assert_eq!(document(&page), printed, "{command}");
        for panel in panels {
            assert!(
                page.contains(&format!("{panel}</h4>")) || page.contains(&format!("{panel}: ")),
                "{command}: {panel}"
            );
        }
    }
}

/// The legend is beneath: the lines take more than four fifths of the width.
#[test]
fn each_command_draws_svg_and_png() {
    let bench = bench();
    for (command, panels) in COMMANDS {
        bench.json(&format!("{command} --plot plot.svg"));
        let svg = bench.read("plot.svg");
        assert!(panels.iter().all(|panel| svg.contains(panel)), "{command}");
        let number = |text: &str| {
            text.split(|c: char| c != '.' && !c.is_ascii_digit()).next().and_then(|n| n.parse::<f64>().ok())
        };
        let width = svg.split("width=\"").nth(1).and_then(number).expect("a width");
        let xs: Vec<f64> = svg
            .split(" d=\"M")
            .skip(1)
            .flat_map(|path| {
                path.split('"').next().expect("a path").split(['M', 'L', ' ']).filter_map(number).collect::<Vec<_>>()
            })
            .collect();
        let right = xs.iter().copied().fold(0.0, f64::max);
        assert!(right > 0.9 * width, "{command}: lines end at {right} of {width}");
        bench.json(&format!("{command} --plot plot.png"));
        let png = fs::read(bench.path("plot.png")).expect("PNG");
        assert!(png.starts_with(b"\x89PNG\r\n\x1a\n") && png.len() > 10_000, "{command}");
    }
}

#[test]
fn compared_models_are_drawn() {
    let bench = bench();
    let printed = bench.json("compare --starts 1 --plot models.html wang-5s.csv wang-13s.csv");
    let page = bench.read("models.html");
    check_page(&page);
    assert_eq!(document(&page), printed);
    names(&page, &["left out</h4>", "springs and dashpots", "Prandtl–Ishlinskii", "Time of a step"]);
}
