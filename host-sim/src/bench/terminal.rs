//! The bench in a terminal, over ssh say: what the page shows, and the space bar to stop.

use std::io::{self, BufRead, BufReader, Error, Read, Write};
use std::net::TcpStream;
use std::str::FromStr;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;
use std::time::Duration;

use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Modifier, Style};
use ratatui::text::Line;
use ratatui::widgets::{Block, Paragraph, Sparkline};
use ratatui::{DefaultTerminal, Frame};

use super::control::Token;
use super::shared::Live;
use super::web::SECRET;

/// States come 20 times a second; without one for so long the bench is gone.
const SILENT: Duration = Duration::from_secs(3);
const KEYS: Duration = Duration::from_millis(30);
/// Strokes in the small plot.
const KEPT: usize = 400;

/// Where a page is, with its secret.
#[derive(Clone, Debug, PartialEq)]
pub struct Address {
    host: String,
    secret: Token,
}

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.trim().strip_prefix("http://").and_then(|rest| rest.split_once("/#"));
        let (host, secret) = parts.ok_or("not the address of a page of springpot bench")?;
        Ok(Self { host: host.into(), secret: secret.parse().map_err(String::from)? })
    }
}

/// The states of a page, as they come.
#[derive(Debug)]
pub struct States(BufReader<TcpStream>);

impl Address {
    fn connect(&self, request: &str, body: &str) -> io::Result<BufReader<TcpStream>> {
        let mut line = TcpStream::connect(&self.host)?;
        line.set_read_timeout(Some(SILENT))?;
        line.set_nodelay(true)?;
        let Self { host, secret } = self;
        // The older version of HTTP: an answer is what comes until its end, not in chunks.
        write!(
            line,
            "{request} HTTP/1.0\r\nHost: {host}\r\nOrigin: http://{host}\r\n{SECRET}: {secret}\r\nContent-Type: application/json\r\n\
             Content-Length: {}\r\n\r\n{body}",
            body.len()
        )?;
        let mut answer = BufReader::new(line);
        let mut status = String::new();
        answer.read_line(&mut status)?;
        if !status.contains(" 200 ") {
            return Err(Error::other(format!("it answers {}", status.trim())));
        }
        let mut header = String::from("x");
        while !header.trim().is_empty() {
            header.clear();
            answer.read_line(&mut header)?;
        }
        Ok(answer)
    }

    /// Subscribes to the states.
    pub fn states(&self) -> io::Result<States> {
        self.connect("GET /api/live", "").map(States)
    }

    /// Stops: 0 V, disarmed.
    pub fn stop(&self) -> io::Result<()> {
        let mut rest = String::new();
        self.connect("POST /api", r#"{"ask":{"stop":{"by":"terminal"}}}"#)?.read_to_string(&mut rest).map(drop)
    }
}

impl States {
    /// Waits for the next one.
    pub fn next_state(&mut self) -> io::Result<Live> {
        loop {
            let mut line = String::new();
            if self.0.read_line(&mut line)? == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            if let Some(text) = line.strip_prefix("data: ") {
                return serde_json::from_str(text).map_err(Error::other);
            }
        }
    }
}

/// A state in lines of text, the most important first.
pub fn lines(live: &Live) -> Vec<String> {
    let number = |value: Option<f64>, factor: f64, digits: usize| {
        value.map_or("–".into(), |value| format!("{:.digits$}", factor * value))
    };
    let mark = if live.live { "!! HIGH VOLTAGE" } else { "off" };
    let cause = if live.cause.is_empty() { String::new() } else { format!(" ({})", live.cause) };
    let error = live.displacement_m.zip(live.reference_m).map(|(film, wanted)| film - wanted);
    let mut lines = vec![
        format!("{}{cause}: {mark}", live.state.to_uppercase()),
        format!(
            "voltage    {:>9} V    commanded {:>9} V",
            number(live.monitor_v, 1.0, 0),
            number(live.command_v, 1.0, 0)
        ),
        format!(
            "stroke     {:>9} mm   reference {:>9} mm",
            number(live.displacement_m, 1e3, 4),
            number(live.reference_m, 1e3, 4)
        ),
        format!(
            "error      {:>9} µm   limits    {}",
            number(error, 1e6, 1),
            if live.limited.is_empty() { "none".into() } else { live.limited.join(", ") }
        ),
    ];
    if !live.playing.is_empty() {
        lines.push(format!("plays      {}, {:.1} of {:.1} s", live.playing, live.played_s[0], live.played_s[1]));
    }
    lines.push(format!("recording  {}, {} samples, {} lost", live.recording, live.samples[0], live.samples[1]));
    lines.push(format!("board      {} {}, parameters {}", live.port, live.firmware, live.parameters));
    lines.push(live.message.clone());
    lines
}

/// Draws a state; `strokes` are of the last seconds, in µm, and `fault` is why there is no newer one.
pub fn draw(frame: &mut Frame<'_>, live: &Live, strokes: &[u64], fault: Option<&str>) {
    let [top, plot, keys] =
        Layout::vertical([Constraint::Length(10), Constraint::Min(3), Constraint::Length(1)]).areas(frame.area());
    let strong = Style::new().add_modifier(Modifier::BOLD);
    let mut text: Vec<Line<'_>> = lines(live).into_iter().map(Line::from).collect();
    text[0] = text[0].clone().style(if live.live { strong.add_modifier(Modifier::REVERSED) } else { strong });
    if let Some(fault) = fault {
        text[0] = Line::from(format!("NO CONNECTION: {fault}; what follows is old"))
            .style(strong.add_modifier(Modifier::REVERSED));
    }
    frame.render_widget(Paragraph::new(text).block(Block::bordered().title("springpot bench")), top);
    let shown = strokes.len().saturating_sub(usize::from(plot.width.saturating_sub(2)));
    frame.render_widget(Sparkline::default().data(&strokes[shown..]).block(Block::bordered().title("stroke")), plot);
    frame.render_widget(
        Paragraph::new("SPACE stops: 0 V, disarmed.   q leaves; the bench goes on.").style(strong),
        keys,
    );
}

/// Draws the states of `address` until a key ends it.
pub fn show(address: &Address) -> io::Result<()> {
    let states = address.states()?;
    let terminal = ratatui::try_init()?;
    let shown = watch(terminal, address, &received(states));
    ratatui::restore();
    shown
}

/// Receives on another thread: a key is never waited for behind a state.
fn received(mut states: States) -> Receiver<io::Result<Live>> {
    let (send, receive) = channel();
    thread::spawn(move || {
        loop {
            let state = states.next_state();
            let is_last = state.is_err();
            if send.send(state).is_err() || is_last {
                return;
            }
        }
    });
    receive
}

fn watch(mut terminal: DefaultTerminal, address: &Address, states: &Receiver<io::Result<Live>>) -> io::Result<()> {
    let (mut live, mut strokes, mut fault) = (Live::default(), Vec::new(), None);
    loop {
        loop {
            match states.try_recv() {
                Ok(Ok(state)) => {
                    strokes.push((1e6 * state.displacement_m.unwrap_or(0.0)).max(0.0) as u64);
                    strokes.drain(..strokes.len().saturating_sub(KEPT));
                    live = state;
                }
                Ok(Err(error)) => fault = Some(error.to_string()),
                Err(TryRecvError::Empty | TryRecvError::Disconnected) => break,
            }
        }
        terminal.draw(|frame| draw(frame, &live, &strokes, fault.as_deref()))?;
        if !event::poll(KEYS)? {
            continue;
        }
        let Event::Key(key) = event::read()? else { continue };
        let ends = key.code == KeyCode::Char('q')
            || (key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL));
        if key.kind == KeyEventKind::Press && ends {
            return Ok(());
        }
        if key.kind == KeyEventKind::Press && key.code == KeyCode::Char(' ') {
            // Before anything is drawn again.
            if let Err(error) = address.stop() {
                fault = Some(format!("NOT STOPPED ({error})"));
            }
        }
    }
}
