//! `export --emit fmu` and `--emit fmu2`: what is written is whole, the same every time, and refuses what it should; with FMPy, that it
//! has the bits of the controller's code.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Command;

use dea_driver::Blob;
use host_sim::files::parameters::Parameters;
use quick_xml::events::Event;
use springpot::{Adapting, Applied, Compensator, Feedforward, Follower, FollowerState, ObserverState, SensorSample};
use tests::recordings;
use tests::tool::{Bench, names, text};
use zip::ZipArchive;

use crate::TOOL;
use crate::export_c::RICH;

/// Both versions, as `--emit` and the standard call them, and the folder of their libraries.
const VERSIONS: [(&str, &str, &str); 2] = [("fmu", "3.0", "x86_64-linux"), ("fmu2", "2.0", "linux64")];

/// The files of an FMU by their paths.
fn unpacked(path: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut archive = ZipArchive::new(File::open(path).expect("there")).expect("an archive");
    let names: Vec<String> = archive.file_names().map(|name| name.expect("UTF-8").into_owned()).collect();
    names
        .into_iter()
        .map(|name| {
            let mut content = Vec::new();
            archive.by_name(&name).expect("there").read_to_end(&mut content).expect("whole");
            (name, content)
        })
        .collect()
}

/// The elements of a well-formed document: names and attributes.
fn elements(xml: &[u8]) -> Vec<(String, BTreeMap<String, String>)> {
    let mut reader = quick_xml::Reader::from_reader(xml);
    let (mut found, mut open) = (Vec::new(), 0_usize);
    loop {
        let event = reader.read_event().expect("well-formed");
        match event {
            Event::Start(_) => open += 1,
            Event::End(_) => open -= 1,
            Event::Eof => break,
            _ => {}
        }
        if let Event::Start(element) | Event::Empty(element) = event {
            let attributes = element.attributes().map(|attribute| {
                let attribute = attribute.expect("unique and quoted");
                let value = attribute.value.into_owned();
                assert!(!value.contains(['<', '&']), "{value}");
                (attribute.key.0.to_owned(), value)
            });
            let attributes = attributes.collect();
            found.push((element.name().0.to_owned(), attributes));
        }
    }
    assert_eq!(open, 0, "all elements are closed");
    found
}

/// Exports twice, of a film whose name would break a description: the bytes are the same, and what the descriptions name is there.
#[test]
fn an_fmu_is_whole_and_the_same_every_time() {
    let bench = Bench::new(TOOL);
    let odd = RICH.replace("name = \"rich\"", "name = 'rich<&>\"*/'");
    assert_ne!(odd, RICH);
    bench.write("rich.toml", odd);
    for (emit, version, platform) in VERSIONS {
        let [(report, bytes), (_, again)] = [(); 2].map(|()| {
            let report = bench.json(&format!("export --params rich.toml --emit {emit} --out rich_{emit}.fmu"));
            (report, fs::read(bench.path(&format!("rich_{emit}.fmu"))).expect("there"))
        });
        let symbol = format!("film_rich_{emit}");
        assert_eq!(report["symbol"], symbol, "{report}");
        assert!(bytes == again, "{emit}");

        let files = unpacked(&bench.path(&format!("rich_{emit}.fmu")));
        let read = |name: &str| String::from_utf8_lossy(&files[name]).into_owned();
        let described = elements(&files["modelDescription.xml"]);
        let one = |name: &str| &described.iter().find(|(element, _)| element == name).expect(name).1;
        let root = one("fmiModelDescription");
        assert_eq!(root["fmiVersion"], version);
        assert_eq!(root["license"], "0BSD");
        assert_eq!(root["description"], "The dielectric elastomer actuator rich and its control");
        assert_eq!(one("CoSimulation")["modelIdentifier"], symbol);
        assert_eq!(one("DefaultExperiment")["stepSize"], "0.001");
        // Linux on x86-64 has a library; elsewhere a note says why not.
        assert_eq!(files.contains_key(&format!("binaries/{platform}/{symbol}.so")), report["platform"].is_string());
        assert_ne!(report["platform"].is_string(), report["platform_note"].is_string(), "{report}");
        // The library knows its description by the token.
        let token = root.get("instantiationToken").or_else(|| root.get("guid")).expect("a token");
        let header = read("sources/springpot_fmu_film.h");
        for line in [format!("FMU_TOKEN \"{token}\""), format!("FMU_FILM {symbol}"), "FMU_LEARNS 1".into()] {
            assert!(header.contains(&line), "{line}: {header}");
        }
        let build = files.get("sources/buildDescription.xml").map(|file| elements(file));
        let kind = if version == "3.0" { "SourceFile" } else { "File" };
        let compiled: Vec<&String> = build
            .as_ref()
            .unwrap_or(&described)
            .iter()
            .filter(|(name, _)| name == kind)
            .map(|(_, file)| &file["name"])
            .collect();
        assert_eq!(compiled.len(), 2);
        for file in compiled {
            assert!(files.contains_key(&format!("sources/{file}")), "{file}");
        }
        // Every variable has the value reference that the C has.
        let variables: Vec<_> = described.iter().filter(|(_, a)| a.contains_key("causality")).collect();
        for (_, variable) in &variables {
            let line = format!("    FMU_{} = {},", variable["name"].to_uppercase(), variable["valueReference"]);
            assert!(header.contains(&line), "{line}");
        }
        assert_eq!(variables.len(), if version == "3.0" { 23 } else { 22 });
    }
}

/// Exports without a compiler: an FMU has its sources, and a line says so.
fn sources(bench: &Bench, options: &str) -> BTreeMap<String, Vec<u8>> {
    let line = format!("export --out film.fmu {options}");
    let run = bench.with(&line).env("PATH", "").assert().success().get_output().clone();
    names(&String::from_utf8_lossy(&run.stderr), &["compiler", "sources"]);
    let files = unpacked(&bench.path("film.fmu"));
    assert!(files.keys().all(|name| !name.starts_with("binaries/")), "{:?}", files.keys());
    assert!(files.contains_key("sources/film.c") && files.contains_key("sources/springpot.h"));
    files
}

/// The sources of both versions, without a warning.
#[test]
fn sources_compile_without_a_warning() {
    let bench = Bench::new(TOOL);
    for (emit, interface) in [("fmu", "fmi3.c"), ("fmu2", "fmi2.c")] {
        for (path, content) in sources(&bench, &format!("--params preset:table3-n2 --emit {emit}")) {
            if let Some(name) = path.strip_prefix("sources/") {
                bench.write(name, content);
            }
        }
        let strict = "-std=c99 -fsyntax-only -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror";
        let mut gcc = Command::new("gcc");
        gcc.args(strict.split(' ')).args([interface, "film.c"]).current_dir(bench.path(""));
        let output = gcc.output().expect("there is gcc");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && errors.is_empty(), "{emit}: {errors}");
    }
}

/// Films, rates and versions give different tokens.
#[test]
fn a_token_belongs_to_a_film() {
    let bench = Bench::new(TOOL);
    let runs =
        ["table3-n1 --emit fmu", "table3-n2 --emit fmu", "table3-n1 --rate 500 --emit fmu", "table3-n1 --emit fmu2"];
    let tokens: BTreeSet<String> = runs
        .iter()
        .map(|run| {
            let files = sources(&bench, &format!("--params preset:{run}"));
            let (_, root) = elements(&files["modelDescription.xml"]).swap_remove(0);
            root.get("instantiationToken").or_else(|| root.get("guid")).expect("a token").clone()
        })
        .collect();
    assert_eq!(tokens.len(), runs.len());
}

/// The compiler needs a place for its files; where it has none, nothing is written.
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
#[test]
fn without_a_temporary_folder_nothing_is_written() {
    let bench = Bench::new(TOOL);
    let mut export = bench.with("export --params preset:table3-n2 --emit fmu --out film.fmu");
    let run = export.env("TMPDIR", bench.path("nowhere")).assert().failure();
    names(&String::from_utf8_lossy(&run.get_output().stderr), &["nowhere", "set TMPDIR"]);
    assert!(bench.files().is_empty());
}

/// A tick's inputs: voltage, reference, sample, whether there is one, its age, reading, whether there is one, temperature.
type Input = [f64; 8];
/// The outputs: displacement, force, command, shaped reference, disturbance, force scale, ageing, change of the stiffness, limits, whether the sensor is
/// lost.
type Row = [f64; 10];

/// The rich film, fitted at several temperatures: in numbers that single precision has.
fn warming() -> String {
    let temperature = "[temperature]\nreference_c = 22.5\nstiffness_per_k = -0.0078125\nactivation_kj_per_mol = 32.0\n";
    RICH.replace("schema = 2", "schema = 5") + temperature
}

/// FMPy in an environment of its own.
struct Importer(PathBuf);

impl Importer {
    fn there() -> Self {
        let python = std::env::var_os("SPRINGPOT_FMPY").expect("run by cargo xtask faces fmu, which installs FMPy");
        Self(python.into())
    }

    fn call(&self, arguments: &[&str]) {
        let driver = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-sim/emit/tests/fmu/driver.py");
        let output = Command::new(&self.0).arg(driver).args(arguments).output().expect("there is Python");
        let [printed, errors] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
        assert!(output.status.success(), "{arguments:?}: {printed}{errors}");
    }

    /// A run of `fmu` in `mode`, from rest, with these parameters true.
    fn run(&self, fmu: &Path, mode: &str, parameters: &[&str], inputs: &[Input]) -> Vec<Row> {
        let [given, written] = ["inputs", "outputs"].map(|name| fmu.with_extension(name));
        let bytes: Vec<u8> = inputs.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        fs::write(&given, bytes).expect("written");
        self.call(&[&["run", text(fmu), mode, text(&given), text(&written)], parameters].concat());
        let bytes = fs::read(&written).expect("rows");
        let values: Vec<f64> = bytes.as_chunks::<8>().0.iter().map(|chunk| f64::from_le_bytes(*chunk)).collect();
        let (rows, rest) = values.as_chunks::<10>();
        assert!(rest.is_empty() && rows.len() == inputs.len());
        rows.to_vec()
    }
}

/// A recording's voltages below the board's largest, as the tool reads it. Returns time, voltage, force and displacement of `simulate`.
fn simulated(bench: &Bench, recording: &Path) -> Vec<[f64; 4]> {
    let rows = |text: &str| -> Vec<Vec<f64>> {
        let rows = text.lines().filter(|line| !line.starts_with(['#', 't']));
        rows.map(|line| line.split(',').map(|cell| cell.parse().expect("a number")).collect()).collect()
    };
    let recorded = rows(&fs::read_to_string(recording).expect("committed"));
    let profile = recorded.iter().map(|row| format!("{},{}", row[0], 0.95 * row[1]));
    bench.write_table("profile.csv", "time_s,voltage_v", profile);
    bench.json("simulate --params preset:table3-n2 --profile profile.csv --out response.csv");
    rows(&bench.read("response.csv")).into_iter().map(|row| row.try_into().expect("four columns")).collect()
}

/// The film: the numbers of `springpot simulate` along three recordings of 155 s, every bit, in both versions.
#[test]
#[ignore = "needs FMPy: cargo xtask faces fmu"]
fn a_plant_has_the_bits_of_simulate() {
    let (bench, importer) = (Bench::new(TOOL), Importer::there());
    for (emit, ..) in VERSIONS {
        let fmu = bench.path("film.fmu");
        bench.json(&format!("export --params preset:table3-n2 --emit {emit} --out film.fmu"));
        for recording in recordings("hossain") {
            let response = simulated(&bench, &recording);
            assert!(response.len() > 155_000);
            let inputs: Vec<Input> = response.iter().map(|row| [row[1], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).collect();
            let rows = importer.run(&fmu, "plant", &[], &inputs);
            for (k, (row, [_, _, force, displacement])) in rows.iter().zip(&response).enumerate() {
                assert_eq!(
                    [row[0], row[1]].map(f64::to_bits),
                    [*displacement, *force].map(f64::to_bits),
                    "{emit}, step {k}"
                );
            }
        }
    }
}

/// The inputs of a bench along a recording: a reference within reach, late samples that fail for a while, a monitor that fails at times.
fn along(response: &[[f64; 4]]) -> Vec<Input> {
    let steps = response.len();
    let wanted = |k: usize| 0.8e-3 + 0.15 * response[k][3];
    (0..steps)
        .map(|k| {
            let lost = (steps * 3 / 5..steps * 5 / 8).contains(&k);
            let taken = k % 10 == 3 && !lost;
            let sample = 0.97 * wanted(k.saturating_sub(10)) + 4e-6 * (k as f64).sin();
            let reference = if k > steps * 3 / 4 { 1.5 * wanted(k) } else { wanted(k) };
            let reading = if k % 11 == 5 { 0.0 } else { 1.01 * response[k][1] };
            let celsius = 25.0 + 5.0 * (k as f64 * 1e-4).sin();
            [response[k][1], reference, sample, f64::from(taken), 10.0, reading, f64::from(k % 11 != 5), celsius]
        })
        .collect()
}

/// An input's sample and the voltage that was applied: the last command, or the one that `is_given`.
fn taken(input: &Input, is_given: bool, command: f32) -> (Applied<f32>, Option<SensorSample<f32>>) {
    let sample =
        (input[3] != 0.0).then_some(SensorSample { displacement_m: input[2] as f32, age_ticks: input[4] as usize });
    let acted = if is_given { input[0] as f32 } else { command };
    let is_read = input[6] != 0.0;
    (if is_read { Applied::as_monitored(acted, input[5] as f32) } else { Applied::as_commanded(acted) }, sample)
}

/// Rows of a follower, and the largest that was added to a reference, m. `seen`: disturbance, force scale, ageing, change of the stiffness, whether the sensor
/// is lost.
fn followed<C: Compensator<f32>>(
    follower: &Follower<f32, C>,
    film: FollowerState<f32, C>,
    seen: impl Fn(&FollowerState<f32, C>) -> [f32; 5],
    warm: impl Fn(&mut FollowerState<f32, C>, f64),
    is_given: bool,
    inputs: &[Input],
) -> (Vec<Row>, f32) {
    let (mut state, mut voltage, mut added) = (film, 0.0_f32, 0.0_f32);
    let rows = inputs.iter().map(|input| {
        let (applied, sample) = taken(input, is_given, voltage);
        warm(&mut state, input[7]);
        let command = follower.step(&mut state, applied, sample, input[1] as f32);
        voltage = command.voltage_v;
        added = added.max(state.added().abs());
        let [disturbance, scale, ageing, change, lost] = seen(&state);
        let limits = f32::from(command.limited.bits());
        let followed = [state.displacement(), command.force_n, voltage, command.reference_m];
        let [[x, force, volts, reference], [disturbance, scale, ageing, change]] =
            [followed, [disturbance, scale, ageing, change]].map(|numbers| numbers.map(f64::from));
        [x, force, volts, reference, disturbance, scale, ageing, change, limits.into(), lost.into()]
    });
    (rows.collect(), added)
}

/// The same by the controller's code: observer, feedforward, tracking or adaptive tracking, with what is learned. The command was applied, or the
/// voltage that `is_given`. Returns the largest that was added to a reference as well, m.
fn controllers(parameters: &Parameters, blob: &Blob, mode: &str, is_given: bool, inputs: &[Input]) -> (Vec<Row>, f32) {
    let tracking = blob.follower();
    let observer = tracking.compensator().observer();
    let law = observer.law();
    let lost_after = (1000.0 * parameters.board_or_bench(1000.0).control.lost_after_s).ceil() as u32;
    let is_lost = |state: &ObserverState<f32>| f32::from(u8::from(state.ticks_since_sample() > lost_after));
    match mode {
        "observer" => {
            let mut state = observer.state(law.state());
            let rows = inputs.iter().map(|input| {
                let (_, sample) = taken(input, false, 0.0);
                let displacement = observer.observe(&mut state, Applied::as_commanded(input[0] as f32), sample);
                let load = state.load();
                let force = load.force_n + load.slope_n_per_m * displacement;
                let beyond = if state.film().beyond_curve() { 64.0 } else { 0.0 };
                let (disturbance, scale) = (state.disturbance(), state.force_scale());
                [displacement, force, 0.0, 0.0, disturbance, scale, 0.0, 0.0, beyond, is_lost(&state)].map(f64::from)
            });
            (rows.collect(), 0.0)
        }
        "feedforward" => {
            let limits = parameters.board_or_bench(1000.0).command_limits();
            let feedforward = Feedforward::new(law.clone(), &parameters.actuator, limits).expect("valid");
            let follower = Follower::new(feedforward);
            let follower = match tracking.learning() {
                Some(learning) => follower.with_learning(*learning),
                None => follower,
            };
            followed(&follower, follower.state(law.state()), |_| [0.0, 1.0, 0.0, 0.0, 0.0], |_, _| (), is_given, inputs)
        }
        _ => {
            let seen = |state: &FollowerState<f32>| {
                let observer = state.observer();
                let changes = state.compensator();
                let [ageing, change] = [changes.ageing(), changes.stiffness_change()];
                [observer.disturbance(), observer.force_scale(), ageing, change, is_lost(observer)]
            };
            let mut state = tracking.state(law.state());
            state.set_adapting(if mode == "adaptive" { Adapting::Learn } else { Adapting::Off });
            let warm = |state: &mut FollowerState<f32>, celsius: f64| {
                if mode == "adaptive" {
                    let celsius = f64::from(celsius as f32);
                    let [stiffness, time] = parameters.temperature_factors(celsius).expect("within reach");
                    state.set_temperature_factors(stiffness as f32, time as f32).expect("within reach");
                }
            };
            followed(tracking, state, seen, warm, is_given, inputs)
        }
    }
}

/// Tracking along three recordings, observer and feedforward along one, with all that a film can have: every bit of every number.
#[test]
#[ignore = "needs FMPy: cargo xtask faces fmu"]
fn controllers_have_the_bits_of_rust() {
    let (bench, importer) = (Bench::new(TOOL), Importer::there());
    bench.write("rich.toml", warming());
    let parameters = Parameters::load(text(&bench.path("rich.toml"))).expect("valid");
    let (bytes, board) = parameters.checked_blob(1000.0).expect("valid");
    let blob = Blob::decode(&bytes, board.id).expect("its own");
    let (mut limits, mut learned) = (0, 0.0_f32);
    for (emit, ..) in VERSIONS {
        let fmu = bench.path("film.fmu");
        bench.json(&format!("export --params rich.toml --emit {emit} --out film.fmu"));
        for (index, recording) in recordings("hossain").iter().enumerate() {
            let inputs = along(&simulated(&bench, recording));
            // Modes, and whether the input voltage is what was applied.
            let cases: &[(&str, bool)] = match (emit, index) {
                ("fmu", 0) => &[
                    ("tracking", false),
                    ("tracking", true),
                    ("adaptive", false),
                    ("feedforward", false),
                    ("feedforward", true),
                    ("observer", false),
                ],
                // Of the other version, which shares all but the interface, one recording.
                (_, 0) => &[("tracking", false), ("feedforward", false), ("observer", false)],
                ("fmu", _) => &[("tracking", false)],
                _ => &[],
            };
            for &(mode, is_given) in cases {
                let (rust, added) = controllers(&parameters, &blob, mode, is_given, &inputs);
                learned = learned.max(added);
                let given: &[&str] = match (mode, is_given) {
                    ("observer", _) => &[],
                    ("adaptive", _) => &["learning", "temperature_is_given"],
                    (_, false) => &["learning"],
                    (_, true) => &["learning", "applied_is_given"],
                };
                let rows = importer.run(&fmu, mode, given, &inputs);
                for (k, (row, expected)) in rows.iter().zip(&rust).enumerate() {
                    assert_eq!(
                        row.map(f64::to_bits),
                        expected.map(f64::to_bits),
                        "{emit}, {mode}, {given:?}, tick {k}: {row:?}, {expected:?}"
                    );
                    limits |= row[8] as u32;
                }
            }
        }
    }
    assert!(limits.count_ones() >= 3, "limits were met: {limits:#b}");
    assert!(learned > 1e-6, "something was learned");
}

/// FMPy finds nothing against schema and standard; steps, states, refusals, also those of another film's states, and a library that is built
/// anew are as they should be, and the sanitizers of gcc find nothing on the way.
#[test]
#[ignore = "needs FMPy: cargo xtask faces fmu"]
fn fmpy_accepts_fmus() {
    let bench = Bench::new(TOOL);
    bench.write("rich.toml", warming());
    for (emit, ..) in VERSIONS {
        let [paper, rich] = [("preset:table3-n2", "paper"), ("rich.toml", "rich")].map(|(params, name)| {
            bench.json(&format!("export --params {params} --emit {emit} --out {name}-{emit}.fmu"));
            text(&bench.path(&format!("{name}-{emit}.fmu"))).to_owned()
        });
        Importer::there().call(&["check", &paper, "does-not-learn", &rich]);
        Importer::there().call(&["check", &rich, "learns", &paper]);
    }
}
