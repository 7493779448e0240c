//! The page of `springpot bench`, on a board that runs in this process: its requests, without a browser.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::Body;
use axum::http::{Request, StatusCode};
use dea_driver::wire::boards;
use host_sim::bench::control::Token;
use host_sim::bench::session::{Live, Place, Session};
use host_sim::bench::terminal::{Address, draw};
use host_sim::bench::web::{SECRET, Site, router, serve};
use host_sim::files::parameters::Parameters;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::{Value, json};
use tests::sweep::full_sweep;
use tests::table::column;
use tests::tool::names;
use tests::virtual_board::{Scene, VirtualBoard};
use tokio::runtime::Runtime;
use tower::ServiceExt;

use crate::{TOOL, ctrl_c};

const HOST: &str = "127.0.0.1:4321";
/// A test that waits for longer has failed.
const PATIENCE: Duration = Duration::from_secs(60);

/// A board, and the site of a session with it.
struct Desk {
    site: Arc<Site>,
    router: Router,
    runtime: Runtime,
    board: VirtualBoard,
    folder: tempfile::TempDir,
}

/// A page: its token, its newest request, its arming.
#[derive(Default)]
struct Page {
    token: Value,
    number: u64,
    arming: Value,
}

impl Desk {
    fn new(scene: Scene) -> Self {
        let board = VirtualBoard::start(scene);
        let folder = tempfile::TempDir::new().expect("a folder");
        let parameters = Parameters::preset("table3-n2").expect("built in");
        let blob = parameters.blob_to_drive(1000.0, true).expect("a blob");
        assert_eq!(parameters.bench(1000.0).id, boards::STM32F405);
        let place = Place { port: board.port.clone(), folder: folder.path().into(), every: 10, blob: Some(blob) };
        let site = Arc::new(Site::new(Session::begin(place), vec![HOST.into()], folder.path().into()));
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        let desk = Self { router: router(Arc::clone(&site)), site, runtime, board, folder };
        desk.wait(|live| live.state == "disarmed");
        desk
    }

    fn live(&self) -> Live {
        self.site.session.live().borrow().clone()
    }

    fn wait(&self, is_so: impl Fn(&Live) -> bool) -> Live {
        let end = Instant::now() + PATIENCE;
        loop {
            let live = self.live();
            if is_so(&live) {
                return live;
            }
            assert!(Instant::now() < end, "still {live:?}");
            thread::sleep(Duration::from_millis(2));
        }
    }

    fn send(&self, request: Request<Body>) -> (StatusCode, String) {
        self.runtime.block_on(async {
            let response = self.router.clone().oneshot(request).await.expect("infallible");
            let status = response.status();
            let body = axum::body::to_bytes(response.into_body(), 1 << 24).await.expect("a body");
            (status, String::from_utf8_lossy(&body).into_owned())
        })
    }

    fn post(&self, body: &Value) -> (StatusCode, String) {
        let request = Request::post("/api").header("host", HOST).header("origin", format!("http://{HOST}"));
        let request = request.header("content-type", "application/json").header(SECRET, self.site.secret.to_string());
        self.send(request.body(Body::from(body.to_string())).expect("a request"))
    }

    fn asks(&self, page: &mut Page, ask: Value) -> (StatusCode, String) {
        page.number += 1;
        self.post(&json!({ "page": page.token, "number": page.number, "arming": page.arming, "ask": ask }))
    }

    /// The answer to what must be done.
    fn done(&self, page: &mut Page, ask: Value) -> Value {
        let (status, text) = self.asks(page, ask);
        assert_eq!(status, StatusCode::OK, "{text}");
        serde_json::from_str(&text).expect("JSON")
    }

    /// Why it is not done.
    fn denied(&self, page: &mut Page, ask: Value) -> String {
        let (status, text) = self.asks(page, ask);
        assert_eq!(status, StatusCode::CONFLICT, "{text}");
        text
    }

    /// A page in control.
    fn page(&self) -> Page {
        let mut page = Page::default();
        page.token = self.done(&mut page, json!("control"))["page"].clone();
        page
    }

    fn arm(&self, page: &mut Page) {
        page.arming = Value::Null;
        page.arming = self.done(page, json!("arm"))["arming"].clone();
    }

    fn stop(&self) {
        self.done(&mut Page::default(), json!({ "stop": { "by": "button" } }));
    }

    /// Has `page` draw what comes, as a browser does with a page in sight.
    fn eyes(&self, page: &Page) -> Eyes {
        let (site, open) = (Arc::clone(&self.site), Arc::new(AtomicBool::new(true)));
        let token: Token = page.token.as_str().expect("a token").parse().expect("a token");
        let flag = Arc::clone(&open);
        let thread = thread::spawn(move || {
            let live = site.session.live();
            while flag.load(Ordering::Relaxed) {
                let drawn = Duration::from_millis(live.borrow().at_ms);
                // Another page may be in control by now.
                let _ = site.session.control().drew(token, drawn, site.session.now());
                thread::sleep(Duration::from_millis(50));
            }
        });
        Eyes { open, thread: Some(thread) }
    }

    fn column(&self, title: &str) -> Vec<f64> {
        column(&self.folder.path().join("run-001.csv"), title)
    }
}

/// A page that is drawn until this value ends.
struct Eyes {
    open: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Eyes {
    fn drop(&mut self) {
        self.open.store(false, Ordering::Relaxed);
        self.thread.take().map(JoinHandle::join);
    }
}

fn volts(high: f64, duration_s: f64) -> Value {
    let shape = json!({ "shape": "sine", "low": 0.0, "high": high, "period_s": 2.0, "duration_s": duration_s });
    json!({ "play": { "mode": "voltage", "reference": { "shape": shape } } })
}

/// Arm, play, tune, the end of the reference, and a stop; the recording has every sample, and its report opens.
#[test]
fn a_run_from_the_page_is_recorded_whole() {
    let desk = Desk::new(Scene::CALM);
    let mut page = desk.page();
    let _eyes = desk.eyes(&page);
    assert!(desk.denied(&mut page, json!({ "tune": { "scale": 1.0, "offset": 0.0 } })).contains("which arming"));
    desk.arm(&mut page);
    names(&desk.denied(&mut page, volts(6500.0, 4.0)), &["beyond the limits"]);
    let stroke = json!({ "shape": "sine", "low": 0.0, "high": 2e-4, "period_s": 2.0, "duration_s": 3.0 });
    desk.done(&mut page, json!({ "play": { "mode": "tracking", "reference": { "shape": stroke } } }));
    let live = desk.wait(|live| live.state == "running" && live.reference_m.is_some_and(|m| m > 1e-4));
    assert!(live.live && live.played_s[1] > 2.9 && live.playing.contains("sine"), "{live:?}");
    names(&desk.denied(&mut page, volts(100.0, 4.0)), &["played already"]);
    desk.wait(|live| live.state == "armed" && live.message.contains("to its end"));
    desk.done(&mut page, volts(3000.0, 600.0));
    desk.board.wait_for_voltage(|(_, now)| now > 1000.0);
    // Half of it, slowly; then more than the limits allow, and the last that they did is back.
    desk.done(&mut page, json!({ "tune": { "scale": 0.5, "offset": 0.0 } }));
    desk.done(&mut page, json!({ "tune": { "scale": 1.0, "offset": 9000.0 } }));
    desk.wait(|live| live.message.contains("beyond the limits") && live.tuned != [1.0, 9000.0]);
    assert!(desk.denied(&mut page, json!({ "tune": { "scale": 3.0, "offset": 0.0 } })).contains("from 0 to 2"));
    desk.stop();
    desk.board.wait_for_disabled();
    desk.wait(|live| live.state == "disarmed" && live.message.contains("stop button"));

    let ticks = desk.column("tick");
    assert!(ticks.len() > 300 && ticks.windows(2).all(|pair| pair[1] - pair[0] == 10.0), "{} samples", ticks.len());
    assert_eq!(desk.live().samples, [ticks.len() as u64, 0]);
    let largest = desk.column("command_v").into_iter().fold(0.0, f64::max);
    assert!((1000.0..=6000.0).contains(&largest), "{largest} V");

    let (_, files) = desk.send(get(&desk, "/api/files"));
    names(&files, &["run-001.csv"]);
    let address = desk.done(&mut page, json!({ "report": { "file": "run-001.csv" } }))["address"].clone();
    let report = Request::get(address.as_str().expect("text")).header("host", HOST);
    let (status, html) = desk.send(report.body(Body::empty()).expect("a request"));
    assert_eq!(status, StatusCode::OK);
    names(&html, &["The film was within", "% RMS"]);
    for outside in ["../Cargo.toml", "/etc/passwd", "none.csv"] {
        assert!(desk.denied(&mut page, json!({ "report": { "file": outside } })).contains("no such file"));
    }
}

fn get(desk: &Desk, path: &str) -> Request<Body> {
    let request = Request::get(path).header("host", HOST).header(SECRET, desk.site.secret.to_string());
    request.body(Body::empty()).expect("a request")
}

/// A page that is closed, hidden or killed while the film is driven: 0 V, its arming void, and no request of it is obeyed any more.
#[test]
fn a_page_that_is_gone_leaves_the_film_at_0_v() {
    let desk = Desk::new(Scene::CALM);
    let mut page = desk.page();
    let eyes = desk.eyes(&page);
    desk.arm(&mut page);
    desk.done(&mut page, volts(2000.0, 600.0));
    desk.board.wait_for_voltage(|(_, now)| now > 1000.0);
    drop(eyes);
    desk.board.wait_for_disabled();
    let live = desk.wait(|live| live.state == "disarmed");
    names(&live.message, &["0 V", "not seen"]);
    assert!(desk.denied(&mut page, json!("arm")).contains("does not show"));
    let _eyes = desk.eyes(&page);
    thread::sleep(Duration::from_millis(200));
    names(&desk.denied(&mut page, volts(2000.0, 600.0)), &["arm again"]);
    desk.arm(&mut page);
    desk.stop();
    desk.board.wait_for_disabled();
    assert_eq!(desk.board.voltage().1, 0.0);
}

/// Two pages: the second one may stop, and gets control only while the film is disarmed.
#[test]
fn a_second_page_may_only_stop() {
    let desk = Desk::new(Scene::CALM);
    let mut first = desk.page();
    let _eyes = desk.eyes(&first);
    desk.arm(&mut first);
    let mut second = Page::default();
    assert!(desk.denied(&mut second, json!("control")).contains("stop it first"));
    second.token = json!(Token::random());
    second.arming = first.arming.clone();
    assert!(desk.denied(&mut second, volts(1000.0, 9.0)).contains("not in control"));
    desk.stop();
    desk.wait(|live| live.state == "disarmed" && live.message.contains("stop button"));
    let mut second = desk.page();
    assert!(desk.denied(&mut first, json!("arm")).contains("not in control"));
    let _eyes = desk.eyes(&second);
    desk.arm(&mut second);
    desk.wait(|live| live.in_control == 2);
}

/// A trip is shown with its cause, ends the arming, and is acknowledged; a board that is gone is looked for again.
#[test]
fn a_trip_is_shown_and_acknowledged() {
    let desk = Desk::new(Scene::CALM);
    let mut page = desk.page();
    let _eyes = desk.eyes(&page);
    desk.arm(&mut page);
    desk.board.open_interlock(true);
    let live = desk.wait(|live| live.state == "tripped");
    assert_eq!(live.cause, "Interlock");
    desk.stop();
    assert!(desk.denied(&mut page, volts(1000.0, 9.0)).contains("arm again"));
    page.arming = Value::Null;
    desk.board.open_interlock(false);
    desk.done(&mut page, json!("acknowledge"));
    desk.wait(|live| live.state == "disarmed");
    desk.arm(&mut page);
    desk.stop();
    desk.board.wait_for_disabled();
}

/// How a request is forged: each changes a sound one so that it must not be obeyed.
type Forgery = fn(&mut Pcg64, axum::http::request::Builder, Value, &str) -> Request<Body>;

fn body(value: &Value) -> Body {
    Body::from(value.to_string())
}

const FORGERIES: [(&str, Forgery); 9] = [
    ("another host, as after rebinding a name", |random, request, ask, _| {
        let host = ["evil.example:4321", "127.0.0.1:4322", "127.0.0.1", "localhost.evil:4321", "[::1]:4321", ""];
        let request =
            request.header("host", *host.choose(random).expect("some")).header("origin", format!("http://{HOST}"));
        request.header("content-type", "application/json").body(body(&ask)).expect("a request")
    }),
    ("two hosts", |_, request, ask, _| {
        let request =
            request.header("host", HOST).header("host", "evil.example").header("origin", format!("http://{HOST}"));
        request.header("content-type", "application/json").body(body(&ask)).expect("a request")
    }),
    ("another origin, or none", |random, request, ask, _| {
        let mut request = request.header("host", HOST).header("content-type", "application/json");
        let origins =
            ["null", "http://evil.example", "https://127.0.0.1:4321", "http://127.0.0.1:4321.evil.example", "file://"];
        if random.random_bool(0.8) {
            request = request.header("origin", *origins.choose(random).expect("some"));
        }
        request.body(body(&ask)).expect("a request")
    }),
    ("a form", |random, request, ask, _| {
        let kinds = ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data", "application/jsonp", ""];
        let request = request.header("host", HOST).header("origin", format!("http://{HOST}"));
        request.header("content-type", *kinds.choose(random).expect("some")).body(body(&ask)).expect("a request")
    }),
    ("fetched by another site", |random, request, ask, _| {
        let sites = ["cross-site", "same-site", "none"];
        let request = request.header("host", HOST).header("origin", format!("http://{HOST}"));
        let request = request.header("sec-fetch-site", *sites.choose(random).expect("some"));
        request.header("content-type", "application/json").body(body(&ask)).expect("a request")
    }),
    ("too large", |random, request, ask, _| {
        let filling = " ".repeat(random.random_range(4097..60_000));
        let request = request.header("host", HOST).header("origin", format!("http://{HOST}"));
        let request = request.header("content-type", "application/json");
        request.body(Body::from(format!("{filling}{ask}"))).expect("a request")
    }),
    ("cut off, or with bytes that were changed", |random, request, ask, _| {
        let mut bytes = ask.to_string().into_bytes();
        bytes.truncate(random.random_range(0..bytes.len()));
        for _ in 0..random.random_range(0..4) {
            if !bytes.is_empty() {
                let at = random.random_range(0..bytes.len());
                bytes[at] = random.random_range(0..=255);
            }
        }
        let request = request.header("host", HOST).header("origin", format!("http://{HOST}"));
        request.header("content-type", "application/json").body(Body::from(bytes)).expect("a request")
    }),
    ("of another client: another page, another arming", |_, request, mut ask, _| {
        ask["page"] = json!(Token::random());
        ask["arming"] = json!(Token::random());
        sound(request, &ask)
    }),
    ("replayed: the number of a request that was obeyed", |random, request, mut ask, _| {
        ask["number"] = json!(random.random_range(0..=REPLAYED));
        sound(request, &ask)
    }),
];

/// The number up to which requests of the page were obeyed.
const REPLAYED: u64 = 1000;

fn sound(request: axum::http::request::Builder, ask: &Value) -> Request<Body> {
    let request = request.header("host", HOST).header("origin", format!("http://{HOST}"));
    request.header("content-type", "application/json").body(body(ask)).expect("a request")
}

/// Rebinding, other sites, forms, other clients, replays, oversized and damaged requests, with the secret and without: none is obeyed, armed or not.
/// `SPRINGPOT_SWEEP=full` sends a million.
#[test]
fn no_forged_request_is_obeyed() {
    let desk = Desk::new(Scene::CALM);
    let mut page = desk.page();
    let _eyes = desk.eyes(&page);
    page.number = REPLAYED - 1;
    desk.arm(&mut page);
    let mut random = Pcg64::seed_from_u64(32);
    let count = if full_sweep() { 1_000_000 } else { 10_000 };
    let before = desk.wait(|live| live.state == "armed");
    let mut refused = std::collections::BTreeMap::new();
    for k in 0..count {
        // What acts: all that may move the film, or take it from the page in control.
        let asks = [
            json!("arm"),
            volts(500.0, 60.0),
            json!({ "tune": { "scale": 1.5, "offset": 100.0 } }),
            json!("acknowledge"),
            json!({ "stop": { "by": "key" } }),
            json!("control"),
        ];
        let (name, forge) = FORGERIES[k % FORGERIES.len()];
        // Those of another client may ask to stop, and for control, which is refused while the film is armed.
        let known = if k % FORGERIES.len() >= 7 { 4 } else { asks.len() };
        let ask = json!({ "page": page.token, "number": REPLAYED + 1, "arming": page.arming, "ask": asks[random.random_range(0..known)] });
        let has_secret = k % FORGERIES.len() >= 7 || random.random_bool(0.7);
        let mut request = Request::post("/api");
        if has_secret {
            request = request.header(SECRET, desk.site.secret.to_string());
        } else if random.random_bool(0.5) {
            request = request.header(SECRET, Token::random().to_string());
        }
        let secret = desk.site.secret.to_string();
        let (status, text) = desk.send(forge(&mut random, request, ask, &secret));
        assert!(status.is_client_error(), "{name}: {status} {text}");
        *refused.entry(name).or_insert(0) += 1;
    }
    // Sound but for the secret.
    let ask = json!({ "ask": { "stop": { "by": "key" } } });
    assert_eq!(desk.send(sound(Request::post("/api"), &ask)).0, StatusCode::FORBIDDEN);
    assert_eq!(refused.len(), FORGERIES.len());
    let after = desk.live();
    assert_eq!(
        (after.state.as_str(), after.in_control, &after.recording),
        ("armed", before.in_control, &before.recording)
    );
    assert_eq!(desk.board.voltage(), (0.0, 0.0));
    // The same, sound, is obeyed: the search would find what is.
    desk.done(&mut page, volts(500.0, 60.0));
    desk.stop();
    desk.board.wait_for_disabled();
}

/// The site at a port, in a thread.
struct Served {
    desk: Desk,
    host: String,
    _thread: JoinHandle<()>,
}

impl Served {
    fn new() -> Self {
        let desk = Desk::new(Scene::CALM);
        let listener = std::net::TcpListener::bind(("127.0.0.1", 0)).expect("a port");
        listener.set_nonblocking(true).expect("can be set");
        let host = listener.local_addr().expect("bound").to_string();
        let router = desk.router.clone();
        let thread = thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
            runtime.block_on(async {
                let listener = tokio::net::TcpListener::from_std(listener).expect("a listener");
                serve(listener, router, std::future::pending()).await;
            });
        });
        Self { desk, host, _thread: thread }
    }

    fn connect(&self) -> TcpStream {
        let line = TcpStream::connect(&self.host).expect("connected");
        line.set_nodelay(true).expect("can be set");
        line.set_read_timeout(Some(PATIENCE)).expect("can be set");
        line
    }

    /// Headers of a sound request with a body of this length.
    fn head(&self, length: usize) -> String {
        format!(
            "POST /api HTTP/1.1\r\nHost: {HOST}\r\nOrigin: http://{HOST}\r\n{SECRET}: {}\r\nContent-Type: application/json\r\nContent-Length: {length}\r\n\r\n",
            self.desk.site.secret
        )
    }
}

const STOP: &str = r#"{"ask":{"stop":{"by":"button"}}}"#;

/// Slow requests, and more connections than there is room for, end by themselves; meanwhile a stop is obeyed.
#[test]
fn slow_clients_do_not_delay_a_stop() {
    let served = Served::new();
    let desk = &served.desk;
    let mut stop = served.connect();
    let mut page = desk.page();
    let _eyes = desk.eyes(&page);
    desk.arm(&mut page);
    let mut slow: Vec<TcpStream> = (0..100).map(|_| served.connect()).collect();
    for (k, line) in slow.iter_mut().enumerate() {
        let begun = if k % 2 == 0 { "POST /api HTTP/1.1\r\nHost: ".into() } else { served.head(1000) };
        // Of those without room some are closed already.
        let _ = line.write_all(begun.as_bytes());
    }
    write!(stop, "{}{STOP}", served.head(STOP.len())).expect("sent");
    desk.board.wait_for_disabled();
    for line in &mut slow {
        // An answer that it was too slow, or nothing; in any case the end.
        let mut rest = Vec::new();
        let _ = line.read_to_end(&mut rest);
        assert!(!String::from_utf8_lossy(&rest).starts_with("HTTP/1.1 200"));
    }
}

/// Prints shares of times.
fn report(times_ms: &[f64]) {
    let mut sorted = times_ms.to_vec();
    sorted.sort_by(f64::total_cmp);
    let [median, most, nearly_all, largest] =
        [0.5, 0.99, 0.999, 1.0].map(|share| sorted[((sorted.len() - 1) as f64 * share) as usize]);
    println!(
        "{} clicks: median {median:.2} ms, 99 % {most:.2}, 99.9 % {nearly_all:.2}, largest {largest:.2}",
        sorted.len()
    );
}

/// From a click, as the browser sends it, to the enable output: with two pages that watch and two busy threads. `SPRINGPOT_SWEEP=full` clicks
/// 10 000 times and prints the times.
#[test]
fn every_click_stops() {
    let served = Served::new();
    let desk = &served.desk;
    let busy = Arc::new(AtomicBool::new(full_sweep()));
    let spinning: Vec<_> = (0..2)
        .map(|_| {
            let busy = Arc::clone(&busy);
            thread::spawn(move || while busy.load(Ordering::Relaxed) {})
        })
        .collect();
    let mut watching: Vec<TcpStream> = (0..2).map(|_| served.connect()).collect();
    for line in &mut watching {
        let head = served.head(0).replacen("POST /api ", "GET /api/live ", 1);
        line.write_all(head.as_bytes()).expect("sent");
        let mut line = line.try_clone().expect("a second reader");
        thread::spawn(move || std::io::copy(&mut line, &mut std::io::sink()));
    }
    let mut page = desk.page();
    let _eyes = desk.eyes(&page);
    let mut line = served.connect();
    let mut times_ms = Vec::new();
    let count = if full_sweep() { 10_000 } else { 10 };
    while times_ms.len() < count {
        // On a machine that is this busy a board may take its host for dead.
        page.arming = Value::Null;
        let (status, text) = desk.asks(&mut page, json!("arm"));
        if status != StatusCode::OK {
            let _ = desk.asks(&mut page, json!("acknowledge"));
            continue;
        }
        page.arming = serde_json::from_str::<Value>(&text).expect("JSON")["arming"].clone();
        let _ = desk.asks(&mut page, volts(1000.0, 600.0));
        if desk.live().state == "tripped" {
            continue;
        }
        let clicked = Instant::now();
        write!(line, "{}{STOP}", served.head(STOP.len())).expect("sent");
        let fell = desk.board.wait_for_disabled().expect("it was enabled");
        // Before the click: the board has tripped by itself.
        if let Some(took) = fell.checked_duration_since(clicked) {
            times_ms.push(1e3 * took.as_secs_f64());
            if times_ms.len() % 1000 == 0 {
                report(&times_ms);
            }
        }
        let mut answer = [0; 2048];
        assert!(line.read(&mut answer).expect("an answer") > 0);
        desk.wait(|live| !live.live);
    }
    busy.store(false, Ordering::Relaxed);
    spinning.into_iter().for_each(|thread| thread.join().expect("ends"));
    report(&times_ms);
    assert_eq!(desk.board.voltage().1, 0.0);
}

/// The tool as a process, killed with this value.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // One that has ended is no error.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The tool itself, with the arguments of `line`.
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

/// Waits for a state.
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
                let monitor =
                    TOOL.with(&["monitor", "sitting", "--once"]).current_dir(folder.path()).output().expect("runs");
                names(&String::from_utf8_lossy(&monitor.stdout), &["DISARMED: off", "run-001.csv"]);
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
    assert!(address_is_refused(folder.path()));
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
        let refused = TOOL.with(&line).current_dir(folder.path()).output().expect("runs");
        assert_eq!(refused.status.code(), Some(2), "{elsewhere}");
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

/// The address that a killed tool has left leads nowhere.
fn address_is_refused(folder: &Path) -> bool {
    let monitor = TOOL.with(&["monitor", "sitting", "--once"]).current_dir(folder).output().expect("runs");
    String::from_utf8_lossy(&monitor.stderr).contains("does not run any more")
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
