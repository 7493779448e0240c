//! The page's site at a port: slow clients, and how soon a click stops.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Instant;

use axum::http::StatusCode;
use host_sim::bench::web::{SECRET, serve};
use serde_json::{Value, json};
use tests::sweep::full_sweep;
use tests::virtual_board::Scene;

use crate::page::{Desk, HOST, PATIENCE, volts};

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
