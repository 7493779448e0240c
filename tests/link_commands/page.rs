//! The page of `springpot bench`, on a board that runs in this process: its requests, without a browser.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::Body;
use axum::http::request::Builder;
use axum::http::{Request, StatusCode};
use dea_driver::wire::boards;
use host_sim::bench::control::{Permit, Token};
use host_sim::bench::session::Session;
use host_sim::bench::shared::{Live, Place, Sitting, Wish};
use host_sim::bench::web::{SECRET, Site, router};
use host_sim::error::Error;
use host_sim::files::parameters::Parameters;
use host_sim::progress::Stage;
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

pub const HOST: &str = "127.0.0.1:4321";
/// A test that waits for longer has failed.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// A board, and the site of a session with it.
pub struct Desk {
    pub site: Arc<Site>,
    pub router: Router,
    pub runtime: Runtime,
    pub board: VirtualBoard,
    pub folder: tempfile::TempDir,
}

/// A page: its token, its newest request, its arming.
#[derive(Default)]
pub struct Page {
    pub token: Value,
    pub number: u64,
    pub arming: Value,
}

impl Page {
    fn permit(&mut self, desk: &Desk) -> Permit {
        self.number += 1;
        let token = self.token.as_str().expect("a token").parse().expect("a token");
        let now = desk.site.session.now();
        desk.site.session.control().may(token, self.number, None, now).expect("permitted")
    }
}

impl Desk {
    pub fn new(scene: Scene) -> Self {
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

    pub fn live(&self) -> Live {
        self.site.session.live().borrow().clone()
    }

    pub fn wait(&self, is_so: impl Fn(&Live) -> bool) -> Live {
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

    pub fn send(&self, request: Request<Body>) -> (StatusCode, String) {
        self.runtime.block_on(async {
            let response = self.router.clone().oneshot(request).await.expect("infallible");
            let status = response.status();
            let body = axum::body::to_bytes(response.into_body(), 1 << 24).await.expect("a body");
            (status, String::from_utf8_lossy(&body).into_owned())
        })
    }

    pub fn post(&self, body: &Value) -> (StatusCode, String) {
        self.send(sound(Request::post("/api").header(SECRET, self.site.secret.to_string()), body))
    }

    pub fn asks(&self, page: &mut Page, ask: Value) -> (StatusCode, String) {
        page.number += 1;
        self.post(&json!({ "page": page.token, "number": page.number, "arming": page.arming, "ask": ask }))
    }

    /// The answer to what must be done.
    pub fn done(&self, page: &mut Page, ask: Value) -> Value {
        let (status, text) = self.asks(page, ask);
        assert_eq!(status, StatusCode::OK, "{text}");
        serde_json::from_str(&text).expect("JSON")
    }

    /// Why it is not done.
    pub fn denied(&self, page: &mut Page, ask: Value) -> String {
        let (status, text) = self.asks(page, ask);
        assert_eq!(status, StatusCode::CONFLICT, "{text}");
        text
    }

    /// A page in control.
    pub fn page(&self) -> Page {
        let mut page = Page::default();
        page.token = self.done(&mut page, json!("control"))["page"].clone();
        page
    }

    pub fn arm(&self, page: &mut Page) {
        page.arming = Value::Null;
        page.arming = self.done(page, json!("arm"))["arming"].clone();
    }

    pub fn stop(&self) {
        self.done(&mut Page::default(), json!({ "stop": { "by": "button" } }));
    }

    /// Has `page` draw what comes, as a browser does with a page in sight.
    pub fn eyes(&self, page: &Page) -> Eyes {
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

    pub fn column(&self, title: &str) -> Vec<f64> {
        column(&self.folder.path().join("run-001.csv"), title)
    }
}

/// A page that is drawn until this value ends.
pub struct Eyes {
    open: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Eyes {
    fn drop(&mut self) {
        self.open.store(false, Ordering::Relaxed);
        self.thread.take().map(JoinHandle::join);
    }
}

pub fn volts(high: f64, duration_s: f64) -> Value {
    let shape = json!({ "shape": "sine", "low": 0.0, "high": high, "period_s": 2.0, "duration_s": duration_s });
    json!({ "play": { "mode": "voltage", "reference": { "shape": shape } } })
}

/// A sitting that computes, and shows nothing new for longer than a page may stay unseen, is not ended; without a page in sight it is.
#[test]
fn a_sitting_that_computes_goes_on_while_its_page_is_in_sight() {
    let desk = Desk::new(Scene::CALM);
    let mut page = desk.page();
    let begin = |page: &mut Page, end_ms: u64| {
        let permit = page.permit(&desk);
        let (site, from_ms) = (Arc::clone(&desk.site), desk.live().at_ms);
        let sitting: Sitting = Box::new(move |_, _, watched| {
            watched.step(&Stage { what: "fit".into(), count: None, work: (390, 960) });
            let live = site.session.live();
            while live.borrow().at_ms < from_ms + end_ms && !watched.stop().load(Ordering::Relaxed) {
                thread::sleep(Duration::from_millis(20));
            }
            if watched.stop().load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok("computed".into()) }
        });
        let asked = desk.site.session.ask(Wish::Commission(sitting), permit);
        desk.runtime.block_on(asked).expect("an answer").expect("it begins");
        desk.wait(|live| live.state == "commissioning" && live.played_s == [390.0, 960.0]);
    };
    let eyes = desk.eyes(&page);
    begin(&mut page, 3000);
    desk.wait(|live| live.state == "disarmed" && live.message == "computed");
    begin(&mut page, 60_000);
    drop(eyes);
    desk.wait(|live| live.state == "disarmed" && live.message.contains("not seen any more"));
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
type Forgery = fn(&mut Pcg64, Builder, Value) -> Request<Body>;

const FORGERIES: [(&str, Forgery); 9] = [
    ("another host, as after rebinding a name", |random, request, ask| {
        let host = ["evil.example:4321", "127.0.0.1:4322", "127.0.0.1", "localhost.evil:4321", "[::1]:4321", ""];
        let request = request.header("host", *host.choose(random).expect("some"));
        json_of(request.header("origin", format!("http://{HOST}")), ask.to_string())
    }),
    ("two hosts", |_, request, ask| json_of(from_the_site(request).header("host", "evil.example"), ask.to_string())),
    ("another origin, or none", |random, request, ask| {
        let mut request = request.header("host", HOST);
        let origins =
            ["null", "http://evil.example", "https://127.0.0.1:4321", "http://127.0.0.1:4321.evil.example", "file://"];
        if random.random_bool(0.8) {
            request = request.header("origin", *origins.choose(random).expect("some"));
        }
        json_of(request, ask.to_string())
    }),
    ("a form", |random, request, ask| {
        let kinds = ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data", "application/jsonp", ""];
        let request = from_the_site(request).header("content-type", *kinds.choose(random).expect("some"));
        request.body(Body::from(ask.to_string())).expect("a request")
    }),
    ("fetched by another site", |random, request, ask| {
        let sites = ["cross-site", "same-site", "none"];
        sound(request.header("sec-fetch-site", *sites.choose(random).expect("some")), &ask)
    }),
    ("too large", |random, request, ask| {
        let filling = " ".repeat(random.random_range(4097..60_000));
        json_of(from_the_site(request), format!("{filling}{ask}"))
    }),
    ("cut off, or with bytes that were changed", |random, request, ask| {
        let mut bytes = ask.to_string().into_bytes();
        bytes.truncate(random.random_range(0..bytes.len()));
        for _ in 0..random.random_range(0..4) {
            if !bytes.is_empty() {
                let at = random.random_range(0..bytes.len());
                bytes[at] = random.random_range(0..=255);
            }
        }
        json_of(from_the_site(request), bytes)
    }),
    ("of another client: another page, another arming", |_, request, mut ask| {
        ask["page"] = json!(Token::random());
        ask["arming"] = json!(Token::random());
        sound(request, &ask)
    }),
    ("replayed: the number of a request that was obeyed", |random, request, mut ask| {
        ask["number"] = json!(random.random_range(0..=REPLAYED));
        sound(request, &ask)
    }),
];

/// The number up to which requests of the page were obeyed.
const REPLAYED: u64 = 1000;

/// With the headers of a page that the site has served.
fn from_the_site(request: Builder) -> Builder {
    request.header("host", HOST).header("origin", format!("http://{HOST}"))
}

/// A request whose body says that it is JSON.
fn json_of(request: Builder, body: impl Into<Body>) -> Request<Body> {
    request.header("content-type", "application/json").body(body.into()).expect("a request")
}

fn sound(request: Builder, ask: &Value) -> Request<Body> {
    json_of(from_the_site(request), ask.to_string())
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
        let (status, text) = desk.send(forge(&mut random, request, ask));
        assert!(status.is_client_error(), "{name}: {status} {text}");
        *refused.entry(name).or_insert(0) += 1;
    }
    // Sound but for the secret.
    let ask = json!({ "ask": { "stop": { "by": "key" } } });
    assert_eq!(desk.send(sound(Request::post("/api"), &ask)).0, StatusCode::FORBIDDEN);
    assert_eq!(refused.len(), FORGERIES.len());
    let after = desk.live();
    assert_eq!(after.state, "armed");
    assert_eq!((after.in_control, &after.recording), (before.in_control, &before.recording));
    assert_eq!(desk.board.voltage(), (0.0, 0.0));
    // The same, sound, is obeyed: the search would find what is.
    desk.done(&mut page, volts(500.0, 60.0));
    desk.stop();
    desk.board.wait_for_disabled();
}
