//! `export --emit sfunction`, and `matlab/springpot_replay.m` beside `replay`.

use std::fs;
use std::path::Path;
use std::process::Command;

use host_sim::files::parameters::Parameters;
use tests::tool::{Bench, number};
use tests::transcript::blocks;

use crate::TOOL;

/// Exports `params`, and builds the MEX function of `name`.c as docs/matlab.md says.
fn build_mex(bench: &Bench, params: &str, name: &str) {
    bench.json(&format!("export --params {params} --emit sfunction --out {name}.c"));
    let mut build = Command::new("mkoctfile");
    build.current_dir(bench.path("")).args(["--mex", &format!("{name}_mex.c"), &format!("{name}.c")]);
    assert!(build.status().expect("mkoctfile").success());
}

/// Runs `script` in Octave, in the folder, with `matlab/` on its path.
fn octave(bench: &Bench, script: &str) -> String {
    let matlab = Path::new(env!("CARGO_MANIFEST_DIR")).join("../matlab");
    let script = format!("addpath('{}'); {script}", matlab.display());
    let arguments = ["--no-init-file", "--no-history", "--quiet", "--eval", &script];
    let output = Command::new("octave-cli").current_dir(bench.path("")).args(arguments).output().expect("octave-cli");
    let printed = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{script}\n{printed}");
    String::from_utf8(output.stdout).expect("text")
}

/// The line that the script prints, of what `replay` says with `options`.
fn line(bench: &Bench, params: &str, file: &str, options: &str, how: &str) -> String {
    let row = &bench.json(&format!("replay --params {params} {file} {options}"))["recordings"][0];
    let number = |name: &str| number(&row[name]);
    format!(
        "{file} by {how}: R2 {:.5}, NRMSE {:.3} %, RMSE {:.2} um, {} samples\n",
        number("r2"),
        number("nrmse_pct"),
        1e6 * number("rmse_m"),
        row["samples"]
    )
}

/// A fitted film, by its MEX function and by the script's own sum: the digits of `replay`, and a plot with lines in it.
#[test]
#[ignore = "needs Octave: cargo xtask faces"]
fn the_script_replays_as_the_command_does() {
    let bench = Bench::new(TOOL);
    bench.recordings("hossain");
    bench.json("fit hossain-7s.csv --topology parallel --branches 1 --curve none --out film.toml");
    // As published, with the weight from the start, and its recording in other units with a value left out.
    let published = Parameters::preset("table3-n2").expect("there").to_toml();
    assert!(published.contains("\"settled\""));
    bench.write("published.toml", published.replace("\"settled\"", "\"from-start\""));
    let rows = bench.read("hossain-5s.csv");
    let in_mm: Vec<String> = rows
        .lines()
        .filter(|line| !line.starts_with('#'))
        .enumerate()
        .map(|(k, line)| {
            let cells: Vec<&str> = line.split(',').collect();
            match k {
                0 => "displacement_mm,note,time_s,voltage_kv".to_owned(),
                77 => format!(",7,{},{:?}", cells[0], 1e-3 * cells[1].parse::<f64>().expect("a number")),
                _ => {
                    let [volts, metres] = [1, 2].map(|k| cells[k].parse::<f64>().expect("a number"));
                    format!("{:?},7,{},{:?}", 1e3 * metres, cells[0], 1e-3 * volts)
                }
            }
        })
        .collect();
    bench.write("rec-5s.csv", in_mm.join("\n"));

    // What the monitor shows above 6 kV counts.
    for params in ["film.toml", "published.toml"] {
        bench.write(params, bench.read(params) + include_str!("films/limits.toml"));
    }

    let mut expected = String::new();
    let mut script = String::new();
    for (name, file) in [("film", "hossain-7s.csv"), ("published", "rec-5s.csv")] {
        let params = format!("{name}.toml");
        build_mex(&bench, &params, name);
        script +=
            &format!("r = springpot_replay('{name}.json', '{file}', 'plot', '{name}.png'); assert(isfield(r, 'r2'));");
        expected += &line(&bench, &params, file, "", &format!("{name}_mex at 1000 Hz"));
        script += &format!("springpot_replay('{name}.json', '{file}', 'law', 'full', 'rate', 100, 'plot', 'none');");
        let full = "--rate 100 --memory full --precision f64";
        expected += &line(&bench, &params, file, full, "full at 100 Hz");
    }
    // A held force whose clock begins a step after 0, when it was applied.
    let held = (1..=200).map(|k| format!("{:?},20,{:?}", 0.01 * f64::from(k), 1e-4 * f64::from(k).sqrt()));
    bench.write_table("held.csv", "time_s,force_n,displacement_m", held);
    script += "springpot_replay('film.json', 'held.csv', 'plot', 'none');";
    expected += &line(&bench, "film.toml", "held.csv", "", "film_mex at 1000 Hz");
    // Two lines of different colours on white, and none of them everywhere.
    script += "for name = {'film.png', 'published.png'} p = double(imread(name{1})); p = reshape(p(:, :, 1:3), [], 3); \
               c = max(p, [], 2) - min(p, [], 2) > 60; s = mean(c); assert(s > 0.003 && s < 0.3); \
               assert(any(c & p(:, 1) > p(:, 3)) && any(c & p(:, 3) > p(:, 1))); assert(mean(all(p == 255, 2)) > 0.5); end";
    let printed = octave(&bench, &script);
    assert_eq!(printed, expected);
    // For the eye.
    let seen = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/faces");
    fs::create_dir_all(&seen).expect("made");
    fs::copy(bench.path("film.png"), seen.join("springpot_replay.png")).expect("copied");
}

/// The examples of docs/simulink.md for the MEX function, in Octave: a stroke, a voltage, and a loop that passes its state on.
#[test]
#[ignore = "needs Octave: cargo xtask faces"]
fn the_examples_of_the_page_run() {
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/simulink.md")).expect("there");
    let (_, section) = page.split_once("\n## A function\n").expect("a section");
    let (section, _) = section.split_once("\n## ").expect("a section after it");
    let bench = Bench::new(TOOL);
    build_mex(&bench, "preset:table3-n2", "film");
    let examples = blocks(section, "```matlab\n");
    assert!(examples.len() >= 2, "{examples:?}");
    let checks = "assert(max(plant.displacement_m) > 1e-4); assert(max(command.voltage_v) > 1000); \
                  assert(numel(command.limited) == numel(t)); assert(out.voltage_v > 0 && out.displacement_m > 0);";
    octave(&bench, &format!("set(0, 'defaultfigurevisible', 'off');\n{}\n{checks}", examples.concat()));
}

/// A file that the script cannot use is refused with file and line, and a MEX function of another film is found out.
#[test]
#[ignore = "needs Octave: cargo xtask faces"]
fn the_script_refuses_what_it_cannot_use() {
    let bench = Bench::new(TOOL);
    let write = |name: &str, text: &str| bench.write(name, text);
    let published = Parameters::preset("table3-n2").expect("there").to_toml();
    let export = |name: &str, toml: &str| {
        bench.write(&format!("{name}.toml"), toml);
        bench.json(&format!("export --params {name}.toml --emit sfunction --out {name}.c"));
    };
    write("film.toml", &published);
    build_mex(&bench, "film.toml", "film");
    export("softer", &published.replace("c = 62740.0", "c = 62700.0"));
    export("larger", &published.replace("length_m = 0.04", "length_m = 0.05"));
    let curve =
        "[curve]\nelastic = \"free\"\ndisplacement_m = [-0.0005, 0.0, 0.002]\nvalue_m = [-0.00045, 0.0, 0.003]\n";
    export("curved", &format!("{}\n{curve}", published.replace("schema = 1", "schema = 2")));
    let described = bench.read("film.json");
    write("torn.json", &described[..described.len() / 2]);
    write("newer.json", &described.replace("\"schema\": 1", "\"schema\": 2"));
    write("good.csv", "time_s,voltage_v,displacement_m\n0,0,0\n0.01,100,1e-6\n0.02,200,2e-6\n");
    write("high.csv", "time_s,voltage_v,displacement_m\n0,0,0\n0.01,100,1e-6\n0.02,9e9,2e-6\n");
    write("word.csv", "time_s,voltage_v,displacement_m\n0,0,0\n0.01,much,1e-6\n");
    write("gap.csv", "# made\ntime_s,voltage_v,displacement_m\n0,0,0\n0.01,,1e-6\n");
    write("short.csv", "time_s,voltage_v,displacement_m\n0,0,0\n0.01,1\n");
    write("back.csv", "time_s,voltage_v,displacement_m\n0.01,0,0\n0,0,0\n");
    write("names.csv", "t,V,x\n0,0,0\n1,1,1\n");
    let weak = described.replace("\"stretch_coupling\": 0.0", "\"stretch_coupling\": 1000.0");
    assert_ne!(weak, described);
    write("weak.json", &weak);
    write("long.csv", "time_s,voltage_v,displacement_m\n0,0,0\n1,6000,0\n300,6000,0\n");
    let calls = [
        ("'none.json', 'good.csv'", "none.json: no such file"),
        ("'film.toml', 'good.csv'", "film.toml: not a film; give the .json"),
        ("'torn.json', 'good.csv'", "torn.json: not a film; give the .json"),
        ("'newer.json', 'good.csv'", "newer.json: schema 2 is not known"),
        ("'curved.json', 'good.csv'", "curved.json: it has a curve"),
        ("'softer.json', 'good.csv', 'law', 'film_mex'", "film_mex: it was built of other numbers than softer.json"),
        ("'larger.json', 'good.csv', 'law', 'film_mex'", "film_mex: it was built of other numbers than larger.json"),
        ("'curved.json', 'good.csv', 'law', 'film_mex'", "film_mex: it was built of other numbers than curved.json"),
        ("'film.json', 'good.csv', 'law', 'other_mex'", "other_mex: no such MEX function"),
        ("'film.json', 'good.csv', 'rate', 100", "rate: a MEX function has the rate"),
        ("'film.json', 'good.csv', 'law', 'full', 'rate', 0", "rate: it must be"),
        ("'film.json', 'good.csv', 'law', 'full', 'rate', 1e7", "good.csv: 200001 steps"),
        ("'film.json', 'good.csv', 'plots', 'x.png'", "plots: not an option"),
        ("'film.json', 'good.csv', 'plot'", "options: give pairs"),
        ("'film.json', 'good.csv', 'plot', 'x.doc'", "plot: x.doc ends"),
        ("'film.json', 'high.csv'", "high.csv: 9e+09 V, but film_mex takes at most 6000 V"),
        ("'weak.json', 'long.csv', 'law', 'full', 'rate', 100", "long.csv: the displacement grows without bound"),
        ("'film.json', 'word.csv'", "word.csv, line 3: \"much\" is not a number"),
        ("'film.json', 'gap.csv'", "gap.csv, line 4: time and input"),
        ("'film.json', 'short.csv'", "short.csv, line 3: the header has 3 columns"),
        ("'film.json', 'back.csv'", "back.csv, line 3: the time does not increase"),
        ("'film.json', 'names.csv'", "names.csv: it needs the columns time_s"),
    ];
    write("noisy.csv", "time_s,voltage_v,displacement_m\n0,0,0\n0.01,6010,1e-6\n0.02,0,2e-6\n");
    let printed = octave(&bench, "springpot_replay('film.json', 'noisy.csv', 'plot', 'none');");
    assert!(printed.starts_with("noisy.csv: 1 steps above 6000 V, up to 6010 V, count as 6000 V"), "{printed}");
    assert!(printed.contains("noisy.csv by film_mex at 1000 Hz: R2 "), "{printed}");
    for (call, words) in calls {
        let script = format!("try, springpot_replay({call}); disp('accepted'); catch e, disp(e.message); end");
        let printed = octave(&bench, &script);
        assert!(printed.lines().last().is_some_and(|line| line.starts_with(words)), "{call}: {printed}");
    }
}
