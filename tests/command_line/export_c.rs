//! `export --emit c` and `--emit arduino`: what is written compiles, and is what the controller runs.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use dea_driver::Blob;
use host_sim::files::parameters::Parameters;
use springpot::{Applied, Feedforward, FilmReading, Follower, Load, SensorSample};
use tests::tool::{Bench, rows, text};
use tests::transcript::blocks;

use crate::TOOL;
use crate::export::sensed;

/// Runs `line` in the folder, which must succeed, and returns what it printed.
fn ran(bench: &Bench, line: &str) -> String {
    let mut words = line.split_whitespace();
    let mut command = Command::new(words.next().expect("a program"));
    let output = command.args(words).current_dir(bench.path("")).output().expect("starts");
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

/// Returns what the controller runs of `parameters` at 1 kHz.
fn controllers(parameters: &Parameters) -> Blob {
    let (bytes, board) = parameters.checked_blob(1000.0).expect("valid");
    Blob::decode(&bytes, board.id).expect("its own")
}

/// The program of docs/c.md with its command: it prints what the page says, and what the Rust law gives.
#[test]
fn the_program_of_the_page_runs() {
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/c.md")).expect("there");
    let bench = Bench::new(TOOL);
    let commands = blocks(&page, "```sh\n").concat();
    let [export, compile, program] = commands.lines().collect::<Vec<_>>()[..] else {
        panic!("three commands: {commands}")
    };
    bench.prints(export.strip_prefix("springpot ").expect("an export"));
    assert!(bench.path("springpot.h").is_file());
    bench.write("main.c", blocks(&page, "```c\n").concat());
    ran(&bench, &format!("{compile} -Wconversion -Werror"));
    let printed = ran(&bench, program);
    assert_eq!(printed, blocks(&page, "```text\n").concat());

    let blob = controllers(&Parameters::preset("table3-n2").expect("there"));
    let tracking = blob.follower().compensator();
    let (law, drive) = (tracking.observer().law(), tracking.observer().drive());
    let (mut state, mut real) = (tracking.state(law.state()), law.state());
    let (mut voltage, mut limited) = (0.0, 0);
    for tick in 0..10_000_u16 {
        let load = drive.load(voltage);
        let displacement = law.displacement_under(&mut real, Load { force_n: 1.03 * load.force_n, ..load });
        let sample = (tick % 10 == 0).then_some(SensorSample { displacement_m: displacement, age_ticks: 0 });
        tracking.observe(&mut state, Applied::as_commanded(voltage), sample);
        let reference_m = 1.1e-3 - 0.1e-3 * (std::f32::consts::TAU * 1e-4 * f32::from(tick)).cos();
        let command = tracking.command(&mut state, reference_m);
        (voltage, limited) = (command.voltage_v, command.limited.bits());
    }
    let displacement_mm = 1e3 * f64::from(real.position());
    assert_eq!(printed, format!("{displacement_mm:.3} mm, {voltage:.0} V, limits {limited}\n"));
}

/// A film with all that one can have: curve, saturation, an amplifier that lags, learning.
pub const RICH: &str = include_str!("films/rich.toml");

/// Two exported films in one program, ticked with learning in front of feedforward: the bits of every voltage are the controller's.
#[test]
fn two_exported_films_have_the_controllers_bits() {
    let bench = Bench::new(TOOL);
    bench.write("rich.toml", RICH);
    let sources = [("rich.toml", "rich_1"), ("preset:table3-n1", "n1")];
    for (params, name) in sources {
        let report = bench.json(&format!("export --params {params} --emit c --out {name}.c"));
        assert_eq!(report["symbol"], format!("film_{name}"), "{report}");
        let written = [format!("{name}.c"), "springpot.h".into(), format!("{name}.json")];
        assert_eq!(report["written"], serde_json::json!(written), "{report}");
    }
    bench.write("main.c", include_str!("c/two_films.c"));
    ran(&bench, "gcc -std=c99 -O2 -Wall -Wextra -Wpedantic -Wconversion -Werror main.c rich_1.c n1.c -lm -o main");
    let printed = ran(&bench, "./main");
    let mut lines = printed.lines();
    for (params, _) in sources {
        let path = bench.path(params);
        let parameters = Parameters::load(if path.exists() { text(&path) } else { params }).expect("valid");
        let blob = controllers(&parameters);
        let law = blob.follower().compensator().observer().law().clone();
        let rest = law.state();
        let board = parameters.board_or_bench(1000.0);
        let limits = board.command_limits();
        let follower = Follower::new(Feedforward::new(law, &parameters.actuator, limits).expect("valid"));
        let follower = match blob.follower().learning() {
            Some(learning) => follower.with_learning(*learning),
            None => follower,
        };
        let mut state = follower.state(rest);
        assert_eq!(state.learned().is_some(), params.ends_with("rich.toml"));
        let mut voltage = 0.0;
        for k in 0..12_000_u16 {
            let turn = k % 1000;
            let u = f32::from(if turn < 500 { turn } else { 1000 - turn }) / 500.0;
            // The film of the sensor is the model's, which does not need the sample to be stepped.
            let applied = Applied::as_monitored(voltage, 1.02 * voltage);
            let moved = follower.observe(&mut state.clone(), applied, None);
            let sample = (k % 10 == 0).then_some(SensorSample { displacement_m: 1.04 * moved, age_ticks: 0 });
            let reference = 0.6e-3 + 0.2e-3 * ((u * u) * (3.0 - 2.0 * u));
            voltage = follower.step(&mut state, applied, sample, reference).voltage_v;
            assert_eq!(lines.next(), Some(format!("{:08x}", voltage.to_bits()).as_str()), "{params}, tick {k}");
        }
        assert!(state.learned().is_none() || state.added().abs() > 1e-6, "something was learned");
    }
    assert_eq!(lines.next(), None);
}

/// A film that is its own sensor, beside one that is not: samples of a capacitor that grows are those of the controller, to the bit.
#[test]
fn an_exported_film_is_its_own_sensor() {
    let bench = Bench::new(TOOL);
    bench.write("film.toml", sensed());
    for (params, out) in [("film.toml", "film.c"), ("preset:table3-n2", "n2.c")] {
        bench.json(&format!("export --params {params} --emit c --out {out}"));
    }
    assert!(!bench.read("n2.c").contains("sensing"));
    bench.write("main.c", include_str!("c/own_sensor.c"));
    ran(&bench, "gcc -std=c99 -O2 -Wall -Wextra -Wpedantic -Wconversion -Werror main.c film.c n2.c -lm -o main");
    let blob = controllers(&Parameters::load(text(&bench.path("film.toml"))).expect("valid"));
    let sensing = blob.parameters().self_sensing.as_ref().expect("in the blob").sensing().expect("valid");
    let (mut state, mut before, mut current_a, mut expected) = (sensing.state(), 0.0, 0.0, String::new());
    for k in (0..2000_u16).map(f32::from) {
        let sensed = sensing.sense(&mut state, FilmReading { voltage_v: before, current_a });
        let voltage = sensing.drive(&state, k);
        current_a = (700e-9 + 2e-11 * k) * (voltage - before);
        before = voltage;
        if let Some(sensed) = sensed {
            let _ = writeln!(expected, "{:08x}", sensed.sample.displacement_m.to_bits());
        }
    }
    assert!(expected.lines().count() > 90);
    assert_eq!(ran(&bench, "./main"), expected);
    // The tick of the page: with a tone, and at 0 V from the fault of a broken current monitor on.
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/c.md")).expect("there");
    let tick = blocks(&page, "```c\n").into_iter().find(|block| block.contains("sensed_tick")).expect("there");
    bench.write("page.h", tick);
    bench.write("tick.c", include_str!("c/sensed_tick.c"));
    ran(&bench, "gcc -std=c99 -O2 -Wall -Wextra tick.c film.c -lm -o tick");
    assert_eq!(ran(&bench, "./tick"), "0 1 1\n3 0 0\n");
}

/// The library has what Arduino and PlatformIO ask for.
#[test]
fn the_arduino_library_is_described() {
    let bench = Bench::new(TOOL);
    let out = "libraries/vhb_5_s";
    let report = bench.json(&format!("export --params preset:table3-n2 --emit arduino --out {out}"));
    assert_eq!(report["symbol"], "film_vhb_5_s", "{report}");
    let read = |name: &str| bench.read(&format!("{out}/{name}"));
    for file in rows(&report["written"]) {
        assert!(bench.path(file.as_str().expect("a path")).is_file(), "{file}");
    }
    let properties = read("library.properties");
    for key in ["name", "version", "author", "maintainer", "sentence", "paragraph", "category", "url", "architectures"]
    {
        let value = properties.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
        assert!(value.is_some_and(|value| !value.is_empty()), "{key}: {properties}");
    }
    let described: serde_json::Value = serde_json::from_str(&read("library.json")).expect("JSON");
    assert_eq!(described["name"], "springpot_film_vhb_5_s");
    for text in [properties, read("library.json"), read("examples/Tracking/Tracking.ino")] {
        assert!(text.contains("film_vhb_5_s") && !text.contains('@'), "{text}");
    }
}

/// The example sketch, built as the Arduino IDE does, against pins that are not there: it ticks, and commands a voltage.
#[test]
#[ignore = "needs g++: cargo xtask faces"]
fn the_arduino_library_compiles() {
    let bench = Bench::new(TOOL);
    bench.json("export --params preset:table3-n2 --emit arduino --out vhb");
    bench.write("Arduino.h", include_str!("c/Arduino.h"));
    bench.write("board.cpp", include_str!("c/board.cpp"));
    let sketch = bench.read("vhb/examples/Tracking/Tracking.ino");
    bench.write("sketch.cpp", format!("#include <Arduino.h>\n{sketch}"));
    ran(&bench, "gcc -std=gnu11 -Os -Wall -Wextra -Werror -c vhb/src/film_vhb.c");
    let run = |loop_us: &str| {
        let options = format!("-std=gnu++11 -Os -Wall -Wextra -Werror -I. -Ivhb/src {loop_us}");
        ran(&bench, &format!("g++ {options} sketch.cpp board.cpp film_vhb.o -lm -o board"));
        ran(&bench, "./board")
    };
    let printed = run("-DLOOP_US=100UL");
    let numbers: Vec<i32> = printed.split_whitespace().map(|word| word.parse().expect("a number")).collect();
    assert_eq!(numbers[0], 1000, "a tick every millisecond of a second");
    assert!((20..=255).contains(&numbers[1]), "codes up to {}", numbers[1]);
    // A board that is too slow for the rate: a tick, then 0 V for good, and a line.
    let printed = run("-DLOOP_US=2500UL");
    assert!(printed.starts_with("too slow") && printed.ends_with(" 0\n"), "{printed}");
}
