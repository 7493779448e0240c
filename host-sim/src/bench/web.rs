//! The page: requests in, what [`Control`](super::control::Control) permits out. Loopback is no boundary, since any page of a browser reaches it:
//! every request shows where it comes from, and every one that acts knows the secret.

use std::collections::HashMap;
use std::convert::Infallible;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use axum::body::{Body, Bytes, to_bytes};
use axum::extract::{Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use futures_util::stream::unfold;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use serde::Deserialize;
use serde_json::{Value, json};
use tokio::net::TcpListener;
use tokio::sync::Semaphore;

use super::control::Token;
use super::reference::{self, What};
use super::session::Session;
use super::shared::{Play, Sitting, Wish, locked};
use crate::choice::Choice;
use crate::error::Result;
use crate::references::Shape;
use crate::report::run_page;

/// Header with the secret of the tool's start.
pub const SECRET: &str = "x-springpot-secret";
/// Largest request, bytes, and how long one may take to arrive.
const MAX_BODY: usize = 4096;
const ARRIVES: Duration = Duration::from_secs(3);
/// Connections at a time; more are closed.
const MAX_CONNECTIONS: usize = 64;
/// How long the session may take to do something: its board may be slow.
const DONE: Duration = Duration::from_secs(15);

/// Nothing is loaded from anywhere else, nothing is inline, and no page frames this one.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// A report has its scripts within it, and reaches nothing: it is of no origin.
const REPORT_POLICY: &str = "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
                             img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Requests of a page.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Asked {
    /// 0 V, disarmed. Any page that knows the secret may.
    Stop { by: By },
    /// Be the page in control.
    Control,
    /// This page has drawn the state of this time.
    Drew { at_ms: u64 },
    /// Enable the amplifier at 0 V.
    Arm,
    /// Follow a reference.
    Play { mode: What, reference: Reference },
    /// Scale, from 0 to 2, and offset (m or V) of what is played.
    Tune { scale: f64, offset: f64 },
    /// Acknowledge a trip.
    Acknowledge,
    /// Commission the film: with a gauge under the sensor's target, as TRUE:READ or empty, and the film's serial number.
    Commission { gauge: String, serial: String },
    /// The report of a recording or of a sitting, by its name among the files.
    Report { file: String },
}

/// Who stops.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
enum By {
    Button,
    /// The space bar.
    Key,
    /// A page that is about to be hidden or closed.
    Hidden,
    Terminal,
}

/// A reference of a page.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Reference {
    /// A file among those that are offered.
    File(String),
    /// A shape, in m (or V) and s.
    Shape { shape: String, low: f64, high: f64, period_s: f64, duration_s: f64 },
}

/// A request of a page: who asks, which request it is, and for which arming.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Envelope {
    #[serde(default)]
    page: Option<Token>,
    #[serde(default)]
    number: u64,
    #[serde(default)]
    arming: Option<Token>,
    ask: Asked,
}

/// Makes a sitting, in a folder of this name, of a page's entries: gauge and serial number.
pub type Sittings = Box<dyn Fn(&str, &str, &str) -> Result<Sitting> + Send + Sync>;

/// Everything that the pages share.
pub struct Site {
    /// The session with the board.
    pub session: Session,
    /// The secret of this start.
    pub secret: Token,
    /// Values of `Host` that are this site's.
    pub hosts: Vec<String>,
    /// Folder of recordings and records.
    pub folder: PathBuf,
    /// References that were named at the start.
    pub references: Vec<PathBuf>,
    /// Commissioning, where there is a description of the bench.
    pub sittings: Option<Sittings>,
    reports: Mutex<HashMap<Token, String>>,
}

impl Site {
    /// A site of `session` on the ports that `hosts` name.
    pub fn new(session: Session, hosts: Vec<String>, folder: PathBuf) -> Self {
        Self {
            session,
            secret: Token::random(),
            hosts,
            folder,
            references: Vec::new(),
            sittings: None,
            reports: Mutex::default(),
        }
    }

    /// Files by their names: references, then what is in the folder.
    fn files(&self) -> Vec<(String, PathBuf)> {
        let mut found: Vec<PathBuf> = std::fs::read_dir(&self.folder)
            .into_iter()
            .flatten()
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.extension().is_some_and(|ending| ending == "csv"))
            .collect();
        found.extend((1..).map(|k| self.folder.join(sitting(k)).join("record.html")).take_while(|path| path.exists()));
        found.sort();
        let name = |path: PathBuf| {
            let below = path.strip_prefix(&self.folder).ok().or_else(|| path.file_name().map(std::path::Path::new))?;
            Some((below.to_string_lossy().replace('\\', "/"), path))
        };
        self.references.iter().cloned().chain(found).filter(|path| path.exists()).filter_map(name).collect()
    }

    fn file(&self, name: &str) -> Option<PathBuf> {
        self.files().into_iter().find(|(known, _)| known == name).map(|(_, path)| path)
    }
}

/// Name of the folder of a sitting.
fn sitting(number: u32) -> String {
    format!("sitting-{number}")
}

/// An answer, or why it was refused.
type Answered = std::result::Result<Json<Value>, (StatusCode, String)>;

fn no(why: impl ToString) -> (StatusCode, String) {
    (StatusCode::CONFLICT, why.to_string())
}

/// All requests that the site answers.
pub fn router(site: Arc<Site>) -> Router {
    let asset =
        |kind: &'static str, text: &'static str| get(move || async move { ([(header::CONTENT_TYPE, kind)], text) });
    let script = "text/javascript; charset=utf-8";
    let style = "text/css; charset=utf-8";
    Router::new()
        .route("/", asset("text/html; charset=utf-8", include_str!("page.html")))
        .route("/page.js", asset(script, include_str!("page.js")))
        .route("/page.css", asset(style, include_str!("page.css")))
        .route("/report.css", asset(style, include_str!("../report/assets/page.css")))
        .route("/uplot.js", asset(script, include_str!("../report/assets/uplot/uPlot.iife.min.js")))
        .route("/uplot.css", asset(style, include_str!("../report/assets/uplot/uPlot.min.css")))
        .route("/report/{ticket}", get(report))
        .route("/api/live", get(live))
        .route("/api/files", get(files))
        .route("/api", post(ask))
        .layer(from_fn_with_state(Arc::clone(&site), guard))
        .with_state(site)
}

/// The only value of a header; none if it is missing or comes twice.
fn only<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    let mut values = headers.get_all(name).iter();
    values.next().filter(|_| values.next().is_none())?.to_str().ok()
}

/// Refuses what does not come from this site's own page, and reads a whole request in its time.
async fn guard(State(site): State<Arc<Site>>, request: Request, next: Next) -> Response {
    let admitted = admit(&site, request).await;
    let mut response = match admitted {
        Ok(request) => next.run(request).await,
        Err((status, why)) => (status, why.to_owned()).into_response(),
    };
    let headers = response.headers_mut();
    for (name, value) in [
        ("content-security-policy", POLICY),
        ("x-content-type-options", "nosniff"),
        ("x-frame-options", "DENY"),
        ("referrer-policy", "no-referrer"),
        ("cross-origin-resource-policy", "same-origin"),
        ("cross-origin-opener-policy", "same-origin"),
        ("cache-control", "no-store"),
    ] {
        // A report has its own policy.
        headers.entry(name).or_insert(HeaderValue::from_static(value));
    }
    response
}

async fn admit(site: &Site, request: Request) -> std::result::Result<Request, (StatusCode, &'static str)> {
    let headers = request.headers();
    let host = only(headers, "host").filter(|host| site.hosts.iter().any(|own| own == host));
    let host = host.ok_or((StatusCode::MISDIRECTED_REQUEST, "another host"))?;
    // HTTP's other way to name a host.
    if request.uri().authority().is_some_and(|named| named.as_str() != host) {
        return Err((StatusCode::MISDIRECTED_REQUEST, "another host"));
    }
    let forbidden = |why| Err((StatusCode::FORBIDDEN, why));
    let is_post = request.method() == Method::POST;
    let is_api = request.uri().path().starts_with("/api");
    match only(headers, "origin") {
        Some(origin) if origin.strip_prefix("http://") == Some(host) => {}
        None if !is_post && !headers.contains_key("origin") => {}
        _ => return forbidden("another origin"),
    }
    let site_of = headers.get("sec-fetch-site").map(HeaderValue::as_bytes);
    if is_api && site_of.is_some_and(|fetched| fetched != b"same-origin") {
        return forbidden("another site");
    }
    let secret = only(headers, SECRET).and_then(|text| text.parse::<Token>().ok());
    if is_api && secret != Some(site.secret) {
        return forbidden("no secret: open the address that springpot has printed");
    }
    if !is_post {
        return Ok(request);
    }
    if only(headers, "content-type") != Some("application/json") {
        return Err((StatusCode::UNSUPPORTED_MEDIA_TYPE, "JSON only"));
    }
    let (parts, body) = request.into_parts();
    let body = match tokio::time::timeout(ARRIVES, to_bytes(body, MAX_BODY)).await {
        Ok(Ok(body)) => body,
        Ok(Err(_)) => return Err((StatusCode::PAYLOAD_TOO_LARGE, "too large")),
        Err(_) => return Err((StatusCode::REQUEST_TIMEOUT, "too slow")),
    };
    Ok(Request::from_parts(parts, Body::from(body)))
}

/// The states as server-sent events, 20 a second; a client that reads slowly misses some.
async fn live(State(site): State<Arc<Site>>) -> impl IntoResponse {
    let events = unfold(site.session.live(), |mut live| async {
        live.changed().await.ok()?;
        let text = serde_json::to_string(&*live.borrow_and_update()).unwrap_or_default();
        Some((Ok::<_, Infallible>(Bytes::from(format!("data: {text}\n\n"))), live))
    });
    ([(header::CONTENT_TYPE, "text/event-stream")], Body::from_stream(events))
}

async fn files(State(site): State<Arc<Site>>) -> Json<Value> {
    let names: Vec<String> = site.files().into_iter().map(|(name, _)| name).collect();
    Json(json!({ "files": names, "commission": site.sittings.is_some() }))
}

/// A report that was asked for; its address is valid as long as the tool runs.
async fn report(State(site): State<Arc<Site>>, Path(ticket): Path<String>) -> Response {
    let reports = locked(&site.reports);
    match ticket.parse().ok().and_then(|ticket: Token| reports.get(&ticket)) {
        Some(html) => {
            let kind = (header::CONTENT_TYPE, "text/html; charset=utf-8");
            ([kind, (header::CONTENT_SECURITY_POLICY, REPORT_POLICY)], html.clone()).into_response()
        }
        None => (StatusCode::NOT_FOUND, "no such report").into_response(),
    }
}

async fn ask(State(site): State<Arc<Site>>, body: Bytes) -> Answered {
    let envelope: Envelope =
        serde_json::from_slice(&body).map_err(|error| (StatusCode::BAD_REQUEST, error.to_string()))?;
    let session = &site.session;
    let now = session.now();
    let (page, number, arming) = (envelope.page, envelope.number, envelope.arming);
    let page_of = || page.ok_or_else(|| no("which page?"));
    let (wish, arming) = match envelope.ask {
        Asked::Stop { by } => {
            session.stop(match by {
                By::Button => "stop button",
                By::Key => "space bar",
                By::Hidden => "the page was hidden or closed",
                By::Terminal => "stopped from a terminal",
            });
            return Ok(Json(json!({})));
        }
        Asked::Control => {
            let page = Token::random();
            let place = session.control().take(page, now).map_err(no)?;
            return Ok(Json(json!({ "page": page, "place": place })));
        }
        Asked::Drew { at_ms } => {
            session.control().drew(page_of()?, Duration::from_millis(at_ms), now).map_err(no)?;
            return Ok(Json(json!({})));
        }
        Asked::Report { file } => return make_report(&site, &file).await,
        Asked::Arm => (Wish::Arm(Token::random()), None),
        Asked::Acknowledge => (Wish::Acknowledge, None),
        Asked::Play { mode, reference } => {
            let wanted = match &reference {
                Reference::File(name) => Some(site.file(name).ok_or_else(|| no("no such file"))?),
                Reference::Shape { .. } => None,
            };
            let play =
                tokio::task::spawn_blocking(move || reference.play(mode, wanted)).await.map_err(no)?.map_err(no)?;
            (Wish::Play(play), Some(arming.ok_or_else(|| no("which arming?"))?))
        }
        Asked::Tune { scale, offset } => {
            if !((0.0..=2.0).contains(&scale) && offset.is_finite()) {
                return Err(no("the scale is from 0 to 2, and the offset a number"));
            }
            (Wish::Tune([scale, offset]), Some(arming.ok_or_else(|| no("which arming?"))?))
        }
        Asked::Commission { gauge, serial } => {
            let sittings =
                site.sittings.as_ref().ok_or_else(|| no("no description of the bench was given (`board`)"))?;
            let folder = (1..).map(sitting).find(|name| !site.folder.join(name).exists()).unwrap_or_default();
            (Wish::Commission(sittings(&folder, &gauge, &serial).map_err(no)?), None)
        }
    };
    let permit = session.control().may(page_of()?, number, arming, session.now()).map_err(no)?;
    let armed = if let Wish::Arm(token) = &wish { Some(*token) } else { None };
    match tokio::time::timeout(DONE, session.ask(wish, permit)).await {
        Ok(Ok(Ok(()))) => Ok(Json(armed.map_or(json!({}), |arming| json!({ "arming": arming })))),
        Ok(Ok(Err(error))) => Err(no(error)),
        _ => Err((StatusCode::GATEWAY_TIMEOUT, "the board does not answer".into())),
    }
}

async fn make_report(site: &Site, name: &str) -> Answered {
    let path = site.file(name).ok_or_else(|| no("no such file"))?;
    let made = tokio::task::spawn_blocking(move || match path.extension().is_some_and(|ending| ending == "html") {
        true => std::fs::read_to_string(&path).map_err(|error| error.to_string()),
        false => run_page::html(&path).map_err(|error| error.to_string()),
    });
    let html = made.await.map_err(no)?.map_err(no)?;
    let ticket = Token::random();
    let mut reports = locked(&site.reports);
    if reports.len() >= 8 {
        reports.clear();
    }
    reports.insert(ticket, html);
    Ok(Json(json!({ "address": format!("/report/{ticket}") })))
}

impl Reference {
    /// The values, of the file at `path` or of the shape.
    fn play(&self, what: What, path: Option<PathBuf>) -> Result<Play> {
        let mode = what.into();
        match (self, path) {
            (Self::Shape { shape, low, high, period_s, duration_s }, _) => {
                let shape = Shape::from_name(shape).unwrap_or(Shape::Sine);
                reference::of_shape(mode, shape, [*low, *high], *period_s, *duration_s)
            }
            (Self::File(name), path) => reference::of_file(mode, name, &path.unwrap_or_default()),
        }
    }
}

/// Serves `router` until `over` resolves. Headers that do not arrive in time end their connection.
pub async fn serve(listener: TcpListener, router: Router, over: impl Future<Output = ()>) {
    let room = Arc::new(Semaphore::new(MAX_CONNECTIONS));
    let accept = async {
        loop {
            let Ok((line, _)) = listener.accept().await else {
                tokio::time::sleep(Duration::from_millis(20)).await;
                continue;
            };
            let Ok(place) = Arc::clone(&room).try_acquire_owned() else { continue };
            let _ = line.set_nodelay(true);
            let service = TowerToHyperService::new(router.clone());
            tokio::spawn(async move {
                let mut http = hyper::server::conn::http1::Builder::new();
                http.timer(TokioTimer::new()).header_read_timeout(ARRIVES).max_buf_size(16 * 1024);
                // A client that is gone needs no answer.
                let _ = http.serve_connection(TokioIo::new(line), service).await;
                drop(place);
            });
        }
    };
    futures_util::pin_mut!(accept, over);
    futures_util::future::select(accept, over).await;
}
