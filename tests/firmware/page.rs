//! The session of the page with the firmware itself, in QEMU.

use std::net::TcpListener;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use dea_driver::wire::Mode;
use host_sim::bench::control::Token;
use host_sim::bench::session::Session;
use host_sim::bench::shared::{Live, Place, Play, Wish};

use crate::faults::{ANY_SILENCE_S, blob};
use crate::{DEADLINE, image};

/// The virtual board at a port; ends with this value.
struct Emulated(Child);

impl Emulated {
    fn at(port: u16) -> Self {
        let mut emulator = Command::new("qemu-system-arm");
        emulator.args(include_str!("../../firmware/qemu.args").split_whitespace());
        emulator.args(["-serial", &format!("tcp:127.0.0.1:{port},server=on,wait=off,nodelay=on"), "-kernel"]);
        emulator.arg(image("virtual-board")).stdin(Stdio::null()).stdout(Stdio::null());
        Self(emulator.spawn().expect("QEMU is installed"))
    }
}

impl Drop for Emulated {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Arm, play, stop; then a board that is gone shows as such.
#[test]
fn a_page_drives_and_stops_the_firmware() {
    let port = TcpListener::bind(("127.0.0.1", 0)).and_then(|free| free.local_addr()).expect("a port").port();
    let emulated = Emulated::at(port);
    let folder = tempfile::TempDir::new().expect("a folder");
    let place = Place {
        port: format!("tcp:127.0.0.1:{port}"),
        folder: folder.path().into(),
        every: 10,
        blob: Some(blob(ANY_SILENCE_S)),
    };
    let session = Session::begin(place);
    let live = session.live();
    let page = Token::random();
    session.control().take(page, session.now()).expect("no page is in control");
    // A page in sight, as long as this waits.
    let wait = |is_so: &dyn Fn(&Live) -> bool| {
        let end = Instant::now() + DEADLINE;
        loop {
            let now = live.borrow().clone();
            let _ = session.control().drew(page, Duration::from_millis(now.at_ms), session.now());
            if is_so(&now) {
                return now;
            }
            assert!(Instant::now() < end, "still {now:?}");
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    let ask = |number, arming, wish| {
        let permit = session.control().may(page, number, arming, session.now()).expect("permitted");
        let mut outcome = session.ask(wish, permit);
        loop {
            wait(&|_| true);
            match outcome.try_recv() {
                Ok(done) => return done,
                Err(error) => assert_eq!(error, tokio::sync::oneshot::error::TryRecvError::Empty),
            }
        }
    };
    let arming = Token::random();
    wait(&|live| live.state == "disarmed" && live.monitor_v.is_some());
    ask(1, None, Wish::Arm(arming)).expect("armed");
    let play = Play {
        name: "ramp".into(),
        mode: Mode::Voltage,
        values: (0..60_000).map(|k| 10.0 * k.min(200) as f32).collect(),
    };
    ask(2, Some(arming), Wish::Play(play)).expect("played");
    wait(&|live| live.monitor_v.is_some_and(|volts| volts > 1500.0));
    session.stop("this test");
    let live = wait(&|live| live.state == "disarmed" && !live.live);
    assert!(live.message.contains("this test") && live.monitor_v.is_some_and(|volts| volts.abs() < 60.0), "{live:?}");
    assert!(folder.path().join("run-001.csv").exists());
    drop(emulated);
    wait(&|live| live.state == "disconnected");
}
