//! The virtual board as `firmware/README.md` shows it: every command in its order, and what it answers.

use std::fs;
use std::io::{BufRead, BufReader};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread;

use host_sim::files::parameters::Parameters;
use tests::table::column;
use tests::tool::{Bench, number};
use tests::transcript::{Shown, blocks, shown, words};

use crate::{DEADLINE, TOOL, image, root};

/// How the page calls the tool.
const HOST_SIM: &str = "cargo run --release -p host-sim --";
/// The port in the page.
const PORT: &str = "tcp:127.0.0.1:4050";

/// `cargo xtask board`, with all that it has started, until this is dropped.
struct Board {
    started: Child,
    log: Receiver<String>,
}

impl Board {
    fn start() -> Self {
        let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
        let mut started = Command::new(cargo)
            .args(["xtask", "board", "--image"])
            .arg(image("virtual-board"))
            .current_dir(root())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .process_group(0)
            .spawn()
            .expect("runs");
        let log = BufReader::new(started.stdout.take().expect("piped"));
        let (sender, receiver) = channel();
        // What it says is taken to its end, so that it never waits to say it.
        thread::spawn(move || log.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)));
        Self { started, log: receiver }
    }

    /// Lines of the output up to the one that contains `what`.
    fn lines_until(&self, what: &str) -> Vec<String> {
        let mut lines = Vec::new();
        while !lines.last().is_some_and(|line: &String| line.contains(what)) {
            lines.push(self.log.recv_timeout(DEADLINE).unwrap_or_else(|_| panic!("{what:?} is missing in {lines:?}")));
        }
        lines
    }

    /// Ctrl-C in its terminal. Returns what was left to say.
    fn interrupt(&mut self) -> Vec<String> {
        let group = format!("-{}", self.started.id());
        assert!(Command::new("kill").args(["-INT", "--", &group]).status().expect("runs").success());
        self.started.wait().expect("ends");
        // Its end of the line is closed once the emulator has ended as well.
        std::iter::from_fn(|| self.log.recv_timeout(DEADLINE).ok()).collect()
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        if matches!(self.started.try_wait(), Ok(None)) {
            let group = format!("-{}", self.started.id());
            let _ = Command::new("kill").args(["-KILL", "--", &group]).status();
            let _ = self.started.wait();
        }
    }
}

/// Does `work` beside a busy loop on every core.
fn beside_busy_loops<R>(work: impl FnOnce() -> R) -> R {
    let done = AtomicBool::new(false);
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(2, usize::from) {
            scope.spawn(|| {
                while !done.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        // Also if it panics, or the loops would never end.
        struct Done<'a>(&'a AtomicBool);
        impl Drop for Done<'_> {
            fn drop(&mut self) {
                self.0.store(true, Ordering::Relaxed);
            }
        }
        let _done = Done(&done);
        work()
    })
}

/// RMS error (%) of the stroke of 0.6 mm along the sine of a log, from the second period on. The sensor's samples are 10 ms late, which is
/// one row.
fn error_pct(log: &Path) -> f64 {
    let settled = column(log, "time_s").iter().position(|&time_s| time_s > 1.5).expect("a second period");
    let (reference, measured) = (column(log, "reference_m"), column(log, "displacement_m"));
    let runs = column(log, "command_v").iter().rposition(|&volts| volts > 0.0).expect("runs");
    let errors = reference[settled..runs].iter().zip(&measured[settled + 1..]).map(|(r, y)| (r - y).powi(2));
    100.0 * (errors.sum::<f64>() / (runs - settled) as f64).sqrt() / 0.6e-3
}

/// NRMSE (%) of the model with full memory in f64 under the voltage of a log, of a film that pulls `stronger` than its parameters say. The
/// sensor's samples are 10 ms late, which is one row.
fn replay_pct(bench: &Bench, log: &Path, stronger: f64) -> f64 {
    let (time_s, volts, metres) = (column(log, "time_s"), column(log, "voltage_v"), column(log, "displacement_m"));
    let rows = time_s.iter().zip(&volts).zip(&metres[1..]);
    let rows: String = rows.map(|((time_s, volts), metres)| format!("{time_s},{volts},{metres}\n")).collect();
    bench.write("film.csv", format!("time_s,voltage_v,displacement_m\n{rows}"));
    let mut parameters = Parameters::preset("table3-n2").expect("a preset");
    parameters.actuator.relative_permittivity *= stronger;
    bench.write("film.toml", parameters.to_toml());
    let report = bench.json("replay --params film.toml --memory full --precision f64 film.csv");
    number(&report["recordings"][0]["nrmse_pct"])
}

/// A newcomer's first quarter of an hour: `cargo xtask board`, and every command of the page with its answer. What is played has its
/// own length by the log, and tracking follows a film that is not quite its model, whatever else the machine does.
#[test]
fn the_readme_works_as_written() {
    let page = fs::read_to_string(root().join("firmware/README.md")).expect("readable");
    let bench = Bench::new(TOOL);
    let mut board = Board::start();
    let begin = board.lines_until("In another terminal:");
    println!("{}", begin.join("\n"));
    let listens = begin.last().expect("a line");
    let port = listens.split("listens at ").nth(1).and_then(|rest| rest.split(". ").next()).expect("a port");
    // The log is the page's, and so are the commands below it.
    let log: Vec<&str> = begin.iter().map(String::as_str).skip_while(|line| !line.contains("firmware")).collect();
    let log = log.join("\n").replace(port, PORT);
    assert_eq!(blocks(&page, "```text\n")[0].trim_end(), log);
    let shown = shown(&page);
    assert!(shown.len() >= 9, "{} commands", shown.len());
    let next = board.lines_until(&shown.last().expect("some").command.replace(PORT, port));
    let next: Vec<&str> = next.iter().map(|line| line.trim()).filter(|line| !line.is_empty()).collect();
    let commands: Vec<String> = shown.iter().map(|shown| shown.command.replace(PORT, port)).collect();
    assert_eq!(next, commands);

    for Shown { command, answer } in &shown {
        let line = command.replace(HOST_SIM, &format!("'{}'", TOOL.0)).replace(PORT, port);
        let shell =
            |line: &str| Command::new("sh").args(["-c", line]).current_dir(bench.path("")).output().expect("runs");
        let run = || shell(&line);
        let output = if command.contains(" play ") { beside_busy_loops(run) } else { run() };
        let (printed, complained) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        println!("$ {command}\n{printed}{complained}");
        assert!(output.status.success(), "{command}: {complained}");
        let (found, wanted): (Vec<_>, Vec<_>) =
            (printed.lines().map(words).collect(), answer.iter().map(|line| words(line)).collect());
        assert_eq!(found, wanted, "{command}");
        if command.contains("--mode tracking") {
            // The same without the sensor, which the page only mentions.
            let blind = line.replace("--mode tracking", "--mode feedforward").replace("sine-log", "blind-log");
            assert!(shell(&blind).status.success());
        }
    }

    let [ramp, sine, blind] = ["ramp-log.csv", "sine-log.csv", "blind-log.csv"].map(|name| bench.path(name));
    for (log, length_s) in [(&ramp, 1.0), (&sine, 3.0)] {
        let last_s = column(log, "time_s").last().copied().expect("samples");
        // Arming and disarming are in the log as well.
        assert!((length_s - 0.1..length_s + 0.5).contains(&last_s), "{last_s} s");
    }
    assert!(column(&ramp, "voltage_v").iter().any(|&volts| volts > 2900.0));
    // The film pulls 3 % harder than its model: without the sensor that stays, 3 to 4 % of the stroke.
    let (tracked_pct, blind_pct) = (error_pct(&sine), error_pct(&blind));
    println!("tracking: {tracked_pct:.2} % of the stroke, feedforward: {blind_pct:.2} %");
    assert!(tracked_pct < 0.6 * blind_pct && (3.0..10.0).contains(&blind_pct), "{tracked_pct} %, {blind_pct} %");

    let errors_pct = [1.0, 1.03].map(|stronger| replay_pct(&bench, &ramp, stronger));
    println!("the film against full memory on the host: {errors_pct:?} % of the stroke, as modelled and 3 % stronger");
    assert!(errors_pct[0] > 2.0 * errors_pct[1] && errors_pct[1] < 1.0, "{errors_pct:?}");

    let end = board.interrupt();
    assert!(end.iter().any(|line| line.contains("the last run panicked: injected fault")), "{end:?}");
    assert!(!end.iter().any(|line| line.contains("clock")), "{end:?}");
    // The port is closed.
    TOOL.fails(&["link", "--port", port, "status"]);
}
