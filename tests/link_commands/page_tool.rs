//! `springpot bench` and `monitor` as processes, and the terminal's window.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use host_sim::bench::shared::Live;
use host_sim::bench::terminal::{Address, draw};
use host_sim::bench::web::SECRET;
use serde_json::{Value, json};
use tests::tool::names;
use tests::virtual_board::{Scene, VirtualBoard};

use crate::page::{PATIENCE, volts};
use crate::{TOOL, ctrl_c, ended};

/// The tool as a process, killed with this value.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // One that has ended is no error.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn tool(line: &str, folder: &Path) -> (Running, Address, String) {
    let mut command = Command::new(TOOL.0);
    command.args(["bench", "--out", "sitting", "-q"]).args(line.split(' ')).current_dir(folder);
    let child = Running(command.stdout(Stdio::null()).spawn().expect("runs"));
    let path = folder.join("sitting/bench.url");
    let end = Instant::now() + PATIENCE;
    // One that was killed has left its own.
    let is_open = |url: &str| url.split('/').nth(2).is_some_and(|host| TcpStream::connect(host).is_ok());
    let url = loop {
        match std::fs::read_to_string(&path) {
            Ok(url) if url.contains('#') && is_open(&url) => break url,
            _ => assert!(Instant::now() < end, "no address"),
        }
        thread::sleep(Duration::from_millis(5));
    };
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        assert_eq!(path.metadata().expect("there").permissions().mode() & 0o777, 0o600);
    }
    (child, url.parse().expect("an address"), url)
}

fn seen(address: &Address, is_so: impl Fn(&Live) -> bool) -> Live {
    let mut states = address.states().expect("a page");
    let found = (0..2000).find_map(|_| states.next_state().ok().filter(&is_so));
    found.expect("within 100 s")
}

/// The same with a page in sight.
fn drawn(address: &Address, url: &str, page: &Value, is_so: impl Fn(&Live) -> bool) {
    seen(address, |live| {
        over_http(url, &json!({ "page": page, "ask": { "drew": { "at_ms": live.at_ms } } }));
        is_so(live)
    });
}

/// Takes control over HTTP, and shows that the page has drawn a state now; returns its token.
fn over_control(address: &Address, url: &str) -> Value {
    let page = over_http(url, &json!({ "ask": "control" }))["page"].clone();
    let live = seen(address, |live| live.state == "disarmed" && !live.parameters.is_empty());
    over_http(url, &json!({ "page": page, "ask": { "drew": { "at_ms": live.at_ms } } }));
    page
}

/// Asks the tool over its port; returns the answer's body.
fn over_http(url: &str, ask: &Value) -> Value {
    let (host, secret) = url.trim().strip_prefix("http://").and_then(|rest| rest.split_once("/#")).expect("an address");
    let body = ask.to_string();
    let mut line = TcpStream::connect(host).expect("connected");
    write!(line, "POST /api HTTP/1.0\r\nHost: {host}\r\nOrigin: http://{host}\r\n{SECRET}: {secret}\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n{body}", body.len()).expect("sent");
    let mut answer = String::new();
    line.read_to_string(&mut answer).expect("an answer");
    let (head, body) = answer.split_once("\r\n\r\n").expect("a head");
    assert!(head.contains(" 200 "), "{answer}");
    serde_json::from_str(body).expect("JSON")
}

/// The tool with a film that is armed: ended by a terminal's stop, by Ctrl-C, or killed; each time 0 V.
#[test]
fn the_tool_ends_at_0_v_however_it_ends() {
    let board = VirtualBoard::start(Scene::CALM);
    let folder = tempfile::TempDir::new().expect("a folder");
    let line = format!("--port {} --params preset:table3-n2 --bench", board.port);
    for end in ["terminal", "ctrl-c", "killed"] {
        let (mut child, address, url) = tool(&line, folder.path());
        let page = over_control(&address, &url);
        over_http(&url, &json!({ "page": page, "number": 1, "ask": "arm" }));
        board.wait_for_enabled();
        match end {
            "terminal" => {
                address.stop().expect("a page");
                board.wait_for_disabled();
                seen(&address, |live| live.state == "disarmed" && live.message.contains("from a terminal"));
                names(&monitor(folder.path()).1, &["DISARMED: off", "run-001.csv"]);
                ctrl_c(&child.0);
            }
            "ctrl-c" => ctrl_c(&child.0),
            _ => child.0.kill().expect("killed"),
        }
        board.wait_for_disabled();
        let status = child.0.wait().expect("ends");
        if end != "killed" {
            assert_eq!(status.code(), Some(130));
            assert!(!folder.path().join("sitting/bench.url").exists());
        }
    }
    assert!(folder.path().join("sitting/run-002.csv").exists());
    // The address that a killed tool has left leads nowhere.
    names(&monitor(folder.path()).2, &["does not run any more"]);
}

/// A simulated film needs no board; the page is for this computer alone.
#[test]
fn a_simulated_film_is_driven_from_the_page() {
    let folder = tempfile::TempDir::new().expect("a folder");
    let (mut child, address, url) = tool("--plant hossain --params preset:table3-n2", folder.path());
    let page = over_control(&address, &url);
    let arming = over_http(&url, &json!({ "page": page, "number": 1, "ask": "arm" }))["arming"].clone();
    over_http(&url, &json!({ "page": page, "number": 2, "arming": arming, "ask": volts(3000.0, 60.0) }));
    drawn(&address, &url, &page, |live| live.displacement_m.is_some_and(|metres| metres > 5e-5));
    // From here on the page is missed.
    seen(&address, |live| live.state == "disarmed" && live.message.contains("not seen"));
    ctrl_c(&child.0);
    assert_eq!(child.0.wait().expect("ends").code(), Some(130));
    for elsewhere in ["0.0.0.0:0", "192.168.1.2:80", "[::]:0", "here"] {
        let line = ["bench", "--plant", "hossain", "--listen", elsewhere];
        TOOL.with(&line).current_dir(folder.path()).assert().code(2);
    }
}

/// Commissioning begins from the page with its step shown; a stop ends it at 0 V without a record.
#[test]
fn a_sitting_from_the_page_is_stopped() {
    let board = crate::Linked::ready(Scene::CALM);
    crate::commission::files(&board);
    let folder = board.bench.path("");
    let (mut child, address, url) = tool(&format!("--port {} --board b.toml", board.port), &folder);
    let page = over_control(&address, &url);
    let ask = json!({ "commission": { "gauge": "2mm:2.01mm", "serial": "A 17" } });
    over_http(&url, &json!({ "page": page, "number": 1, "ask": ask }));
    drawn(&address, &url, &page, |live| {
        live.playing.contains("ramp") && live.monitor_v.is_some_and(|volts| volts > 250.0)
    });
    address.stop().expect("a page");
    board.wait_for_disabled();
    seen(&address, |live| live.state == "disarmed" && !live.live);
    assert!(!folder.join("sitting/sitting-1/record.json").exists());
    ctrl_c(&child.0);
    assert_eq!(child.0.wait().expect("ends").code(), Some(130));
}

/// The text that a terminal shows once.
fn monitor(folder: &Path) -> (Option<i32>, String, String) {
    ended(&TOOL.with(&["monitor", "sitting", "--once"]).current_dir(folder).output().expect("runs"))
}

/// A terminal shows state, voltage and message in words, and a connection that is lost above all.
#[test]
fn a_terminal_shows_the_state_in_words() {
    let live = Live {
        state: "running".into(),
        live: true,
        monitor_v: Some(2998.4),
        displacement_m: Some(1.2346e-3),
        reference_m: Some(1.2e-3),
        limited: vec!["slew".into()],
        playing: "sine".into(),
        played_s: [3.0, 60.0],
        message: "plays sine".into(),
        ..Live::default()
    };
    let shown = |fault: Option<&str>| {
        let mut terminal = ratatui::Terminal::new(ratatui::backend::TestBackend::new(80, 20)).expect("a terminal");
        terminal.draw(|frame| draw(frame, &live, &[1, 2, 3], fault)).expect("drawn");
        terminal.backend().to_string()
    };
    names(
        &shown(None),
        &["RUNNING: !! HIGH VOLTAGE", "2998 V", "1.2346 mm", "34.6 µm", "slew", "3.0 of 60.0 s", "SPACE stops"],
    );
    names(&shown(Some("gone")), &["NO CONNECTION: gone"]);
}
