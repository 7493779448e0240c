//! `springpot run` through an emulated supply at a pseudo-terminal.

use std::os::fd::AsRawFd;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Duration;

use serial2::SerialPort;
use tests::tool::{Bench, failed, names, number};

use crate::{TOOL, ctrl_c};

/// A supply of the generic kind, as it shows from outside.
struct Emulated {
    port: String,
    /// Its largest voltage so far, and the voltage now, V.
    largest_v: Arc<AtomicU32>,
    now_v: Arc<AtomicU32>,
    is_on: Arc<AtomicBool>,
    live: mpsc::Receiver<()>,
    bench: Bench,
}

impl Emulated {
    fn new(name: &'static str) -> Self {
        let (mut near, far) = SerialPort::pair().expect("a pseudo-terminal");
        near.set_read_timeout(Duration::from_millis(500)).expect("can be set");
        let port = std::fs::read_link(format!("/proc/self/fd/{}", far.as_raw_fd())).expect("a path");
        let (largest_v, now_v, is_on) = <(Arc<AtomicU32>, Arc<AtomicU32>, Arc<AtomicBool>)>::default();
        let (report, live) = mpsc::channel();
        let (largest, now, on) = (Arc::clone(&largest_v), Arc::clone(&now_v), Arc::clone(&is_on));
        thread::spawn(move || {
            let _ = &far;
            let (mut line, mut byte) = (String::new(), [0]);
            loop {
                // Its watchdog: half a second without a command.
                if !matches!(near.read(&mut byte), Ok(1)) {
                    now.store(0, Ordering::SeqCst);
                    on.store(false, Ordering::SeqCst);
                    continue;
                }
                if byte[0] != b'\n' {
                    line.push(char::from(byte[0]));
                    continue;
                }
                let command = std::mem::take(&mut line);
                let reply = match command.as_str() {
                    "ID?" => name.to_owned(),
                    "M?" => now.load(Ordering::SeqCst).to_string(),
                    "ON" | "OFF" => {
                        on.store(command == "ON", Ordering::SeqCst);
                        "OK".into()
                    }
                    set => {
                        let volts = set.strip_prefix("V ").and_then(|volts| volts.parse().ok()).expect("a voltage");
                        now.store(volts, Ordering::SeqCst);
                        if largest.fetch_max(volts, Ordering::SeqCst) < 1000 && volts >= 1000 {
                            let _ = report.send(());
                        }
                        continue;
                    }
                };
                let _ = near.write_all(format!("{reply}\n").as_bytes());
            }
        });
        let bench = Bench::new(TOOL);
        bench.write("ref.csv", "time_s,displacement_m\n0,0\n0.5,0.0003\n1,0.0003\n");
        bench.write("long.csv", "time_s,displacement_m\n0,0\n0.5,0.0003\n60,0.0003\n");
        Self { port: port.to_string_lossy().into_owned(), largest_v, now_v, is_on, live, bench }
    }

    fn line(&self, reference: &str) -> String {
        let port = &self.port;
        format!(
            "run --supply generic --port {port} --params preset:table3-n2 --reference {reference} --log out.csv --quiet"
        )
    }

    fn is_off(&self) -> bool {
        !self.is_on.load(Ordering::SeqCst) && self.now_v.load(Ordering::SeqCst) == 0
    }
}

/// A reference is followed to its end, and the log is a recording of it.
#[test]
fn a_run_ends_at_0_v_with_its_log() {
    let supply = Emulated::new("springpot emulated");
    let report = supply.bench.json(&supply.line("ref.csv"));
    assert_eq!(report["complete"], true, "{report}");
    assert!(number(&report["samples"]) > 90.0, "{report}");
    let [time_s, volts] = ["time_s", "voltage_v"].map(|title| supply.bench.column("out.csv", title));
    assert!((0.98..1.02).contains(&time_s[time_s.len() - 1]));
    let peak_v = volts.iter().copied().fold(0.0, f64::max);
    assert!(peak_v > 1000.0 && peak_v <= f64::from(supply.largest_v.load(Ordering::SeqCst)), "{peak_v} V");
    assert!(supply.is_off());
}

/// Ctrl-C ends a run at 0 V with the output off, and keeps the log.
#[test]
fn ctrl_c_ends_a_run_at_0_v() {
    let supply = Emulated::new("springpot emulated");
    let mut command = Command::new(TOOL.0);
    command.args(supply.line("long.csv").split(' ')).current_dir(supply.bench.path("")).stderr(Stdio::null());
    let mut run = command.stdout(Stdio::null()).spawn().expect("runs");
    supply.live.recv_timeout(Duration::from_secs(60)).expect("1 kV");
    ctrl_c(&run);
    assert_eq!(run.wait().expect("ends").code(), Some(130));
    assert!(supply.is_off());
    assert!(supply.bench.column("out.csv", "command_v").len() > 5);
}

/// Another device, and a supply whose lack of a watchdog is not accepted, get no voltage.
#[test]
fn a_run_is_refused_before_any_voltage() {
    let supply = Emulated::new("Marlin 2.1");
    names(&failed(supply.bench.with(&supply.line("ref.csv"))), &["no generic at this port"]);
    let line = supply.line("ref.csv").replace("generic", "shvps");
    names(&failed(supply.bench.with(&line)), &["--without-watchdog", "SHVPS"]);
    assert!(supply.largest_v.load(Ordering::SeqCst) == 0 && supply.is_off());
    assert!(!supply.bench.path("out.csv").exists());
}
