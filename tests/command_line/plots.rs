//! `--plot` of the commands that compute series: page, SVG and PNG.

use std::fs;

use tempfile::TempDir;
use tests::thinned_recordings;
use tests::tool::text;

use crate::TOOL;
use crate::report_page::{check_page, document};

/// A folder with a reference and a recording.
struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new() -> Self {
        let folder = TempDir::new().expect("a folder");
        thinned_recordings("wang", folder.path(), 40);
        let bench = Self { folder };
        let shape = [
            "reference",
            "--shape",
            "sine",
            "--low",
            "0.0003",
            "--high",
            "0.0012",
            "--period",
            "5",
            "--duration",
            "12",
        ];
        TOOL.with(&[shape.as_slice(), &["--rate", "100", "--out", text(&bench.file("ref.csv"))]].concat())
            .assert()
            .success();
        bench
    }

    fn file(&self, name: &str) -> std::path::PathBuf {
        self.folder.path().join(name)
    }

    /// The commands that draw, with their panels; their output goes to `out.csv`.
    fn commands(&self) -> Vec<(Vec<String>, &'static [&'static str])> {
        let file = |name: &str| text(&self.file(name)).to_owned();
        let command = |words: &[&str], files: &[(&str, &str)]| -> Vec<String> {
            let files = files.iter().flat_map(|(option, name)| [(*option).to_owned(), file(name)]);
            words.iter().map(|word| (*word).to_owned()).chain(files).filter(|word| !word.is_empty()).collect()
        };
        let model = ["--params", "preset:table3-n2", "--rate", "100"];
        let of = |name: &'static str, more: &[&'static str]| [&[name], more].concat();
        vec![
            (command(&of("replay", &model), &[("", "wang-5s.csv")]), &["measured and modelled", "residual"]),
            (
                command(&of("feedforward", &model), &[("--reference", "ref.csv"), ("--out", "out.csv")]),
                &["Reference and model", "Voltage"],
            ),
            (
                command(
                    &of("observe", &["--params", "preset:table3-n2", "--rate", "100", "--bandwidth", "0.1"]),
                    &[("--out", "out.csv"), ("", "wang-5s.csv")],
                ),
                &["Sensor and estimate", "Innovation", "Disturbance force"],
            ),
            (
                command(&of("simulate", &model), &[("--profile", "wang-5s.csv"), ("--out", "out.csv")]),
                &["Voltage", "Force on the film", "Displacement"],
            ),
            (
                command(
                    &[
                        "reference",
                        "--shape",
                        "triangle",
                        "--low",
                        "0.001",
                        "--high",
                        "0.002",
                        "--period",
                        "5",
                        "--rate",
                        "100",
                    ],
                    &[("--out", "out.csv")],
                ),
                &["Reference"],
            ),
            (
                command(
                    &of(
                        "frequency-response",
                        &["--params", "preset:table3-n2", "--from", "0.01", "--to", "10", "--points", "50"],
                    ),
                    &[("--out", "out.csv")],
                ),
                &["Displacement over force", "Phase"],
            ),
            (
                command(
                    &of(
                        "closed-loop",
                        &[
                            "--plant",
                            "preset:table3-n2",
                            "--controller",
                            "tracking",
                            "--params",
                            "preset:table3-n2",
                            "--rate",
                            "100",
                        ],
                    ),
                    &[("--reference", "ref.csv"), ("--out", "out.csv")],
                ),
                &["Reference and film", "Error", "Voltage"],
            ),
        ]
    }
}

fn run(command: &[String], more: &[&str]) -> serde_json::Value {
    let words: Vec<&str> = command.iter().map(String::as_str).chain(more.iter().copied()).collect();
    TOOL.json(&words)
}

#[test]
fn each_command_draws_a_page_that_holds_its_results() {
    let bench = Bench::new();
    for (command, panels) in bench.commands() {
        let page = bench.file("plot.html");
        let printed = run(&command, &["--plot", text(&page)]);
        let page = fs::read_to_string(&page).expect("a page");
        check_page(&page);
        assert_eq!(document(&page), printed, "{}", command[0]);
        for panel in panels {
            assert!(
                page.contains(&format!("{panel}</h4>")) || page.contains(&format!("{panel}: ")),
                "{}: {panel}",
                command[0]
            );
        }
    }
}

/// The legend is beneath: the lines take more than four fifths of the width.
#[test]
fn each_command_draws_svg_and_png() {
    let bench = Bench::new();
    for (command, panels) in bench.commands() {
        let (svg, png) = (bench.file("plot.svg"), bench.file("plot.png"));
        run(&command, &["--plot", text(&svg)]);
        let svg = fs::read_to_string(&svg).expect("SVG");
        assert!(panels.iter().all(|panel| svg.contains(panel)), "{}", command[0]);
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
        assert!(right > 0.9 * width, "{}: lines end at {right} of {width}", command[0]);
        run(&command, &["--plot", text(&png)]);
        let png = fs::read(&png).expect("PNG");
        assert!(png.starts_with(b"\x89PNG\r\n\x1a\n") && png.len() > 10_000, "{}", command[0]);
    }
}

#[test]
fn compared_models_are_drawn() {
    let bench = Bench::new();
    let page = bench.file("models.html");
    let (a, b) = (bench.file("wang-5s.csv"), bench.file("wang-13s.csv"));
    let printed = TOOL.json(&["compare", "--starts", "1", "--plot", text(&page), text(&a), text(&b)]);
    let page = fs::read_to_string(&page).expect("a page");
    check_page(&page);
    assert_eq!(document(&page), printed);
    for words in ["left out</h4>", "springs and dashpots", "Prandtl–Ishlinskii", "Time of a step"] {
        assert!(page.contains(words), "{words}");
    }
}
