//! Where a controller is: a serial port, or a TCP connection to an emulated one.

use std::fmt;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::thread;
use std::time::{Duration, Instant};

use dea_driver::wire::BAUD;
use serial2::SerialPort;

use crate::error::{Error, Result};

/// How long a connection may take.
const CONNECTING: Duration = Duration::from_secs(5);
/// How long a board may take to answer: its flash needs two seconds for two sectors.
const OF_A_BOARD: Duration = Duration::from_secs(5);
/// The same for a TCP connection: the peer may be an emulator on a busy machine.
const OF_A_CONNECTION: Duration = Duration::from_secs(10);
/// Bytes per second that are read at the most: ten times what the line brings. A peer that floods a connection is slowed down
/// to this, so that reading it takes a few per cent of a core.
const MAX_BYTES_PER_S: f64 = BAUD as f64;
/// Bytes that are read at once.
const BUFFER: usize = 4096;
/// The least time between two reads. An emulator sends byte by byte: each would cost a system call and a change of task.
const GATHERING: Duration = Duration::from_micros(100);
/// The longest wait of a single read. A wait until a deadline is made of these, so that the port's timeout is rarely set.
const SLICE: Duration = Duration::from_millis(100);

/// Keeps other programs from opening the same port, and fails where one has: two hosts on one line take each other's answers.
#[cfg(unix)]
fn keep_others_out(port: &SerialPort) -> io::Result<()> {
    rustix::fs::flock(port, rustix::fs::FlockOperation::NonBlockingLockExclusive)?;
    // What does not ask for the lock is refused by the system, unless it is root's.
    Ok(rustix::termios::ioctl_tiocexcl(port)?)
}

/// A pseudoterminal outlives its ends, and what was set with it.
#[cfg(unix)]
impl Drop for Port {
    fn drop(&mut self) {
        if let Line::Serial(port) = &self.line {
            let _ = rustix::termios::ioctl_tiocnxcl(port);
        }
    }
}

/// Ports are opened by one program at a time on other systems.
#[cfg(not(unix))]
fn keep_others_out(_: &SerialPort) -> io::Result<()> {
    Ok(())
}

/// A line of bytes to a controller.
pub struct Port {
    name: String,
    line: Line,
    patience: Duration,
    /// The timeout of a read that is set now.
    timeout: Duration,
    buffer: Vec<u8>,
    next: usize,
    /// Bytes that may be read now without exceeding [`MAX_BYTES_PER_S`], as of `read_at`.
    credit: f64,
    read_at: Instant,
}

enum Line {
    Serial(SerialPort),
    Tcp(TcpStream),
}

impl Line {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Serial(port) => port.write_all(bytes),
            Self::Tcp(stream) => stream.write_all(bytes),
        }
    }
}

/// The end of a [`Port`] that writes.
pub(super) struct Writer(Line);

impl Writer {
    /// Sends `bytes`.
    pub(super) fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write(bytes)
    }
}

impl fmt::Debug for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Port").field(&self.name).finish()
    }
}

impl Port {
    /// Opens `name`: a serial port such as /dev/ttyUSB0, or `tcp:HOST:PORT`.
    pub fn open(name: &str) -> Result<Self> {
        Self::open_at(name, BAUD)
    }

    /// The same at `baud` bits per second.
    pub fn open_at(name: &str, baud: u32) -> Result<Self> {
        let fault = |cause: String| Error::Link { port: name.into(), cause };
        if let Some(address) = name.strip_prefix("tcp:") {
            let expected = |e: io::Error| fault(format!("{e}; tcp:HOST:PORT is expected"));
            let mut addresses = address.to_socket_addrs().map_err(expected)?;
            let address = addresses.next().ok_or_else(|| fault("there is no such host".into()))?;
            let stream = TcpStream::connect_timeout(&address, CONNECTING).map_err(expected)?;
            return Self::over_tcp(name, stream, OF_A_CONNECTION);
        }
        let mut port = SerialPort::open(name, baud).map_err(|e| {
            let known = SerialPort::available_ports().unwrap_or_default();
            let known: Vec<String> = known.iter().map(|path| path.display().to_string()).collect();
            let known = match known.as_slice() {
                [] => "this computer has no serial port".into(),
                known => format!("there are {}", known.join(", ")),
            };
            fault(format!("{e}; a serial port is expected ({known}) or tcp:HOST:PORT"))
        })?;
        keep_others_out(&port).map_err(|_| {
            fault("another program has this port open: two hosts on one line end each other's runs; close it".into())
        })?;
        port.set_write_timeout(OF_A_BOARD).and_then(|()| port.discard_buffers()).map_err(|e| fault(e.to_string()))?;
        Ok(Self::new(name, Line::Serial(port), OF_A_BOARD))
    }

    /// An existing connection, to a peer that answers within `patience`.
    pub fn over_tcp(name: &str, stream: TcpStream, patience: Duration) -> Result<Self> {
        stream
            .set_nodelay(true)
            .and_then(|()| stream.set_write_timeout(Some(patience)))
            .map_err(|e| Error::Link { port: name.into(), cause: e.to_string() })?;
        Ok(Self::new(name, Line::Tcp(stream), patience))
    }

    fn new(name: &str, line: Line, patience: Duration) -> Self {
        let (credit, read_at) = (BUFFER as f64, Instant::now());
        let (timeout, buffer) = (Duration::ZERO, Vec::new());
        Self { name: name.into(), line, patience, timeout, buffer, next: 0, credit, read_at }
    }

    /// The same line for another thread, which only writes.
    pub(super) fn writer(&self) -> io::Result<Writer> {
        Ok(Writer(match &self.line {
            Line::Serial(port) => Line::Serial(port.try_clone()?),
            Line::Tcp(stream) => Line::Tcp(stream.try_clone()?),
        }))
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How long an answer may take here.
    pub fn patience(&self) -> Duration {
        self.patience
    }

    /// Sends `bytes`.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] for a line that is cut, or a peer that takes nothing for as long as an answer may take.
    pub fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.line.write(bytes).map_err(|e| self.cut(&e))
    }

    /// The next byte; nothing if none comes before `deadline`. Bytes that have come already are given after it as well.
    pub fn byte(&mut self, deadline: Instant) -> Result<Option<u8>> {
        while self.next == self.buffer.len() {
            let now = Instant::now();
            if now >= deadline {
                return Ok(None);
            }
            self.fill(deadline - now)?;
        }
        let byte = self.buffer.get(self.next).copied();
        self.next += 1;
        Ok(byte)
    }

    /// Reads what has come, waiting for `remaining` at the most.
    fn fill(&mut self, remaining: Duration) -> Result<()> {
        if let Some(rest) = GATHERING.checked_sub(self.read_at.elapsed()) {
            thread::sleep(rest);
        }
        // Ports count milliseconds, and take 0 for no wait at all.
        self.set_timeout(remaining.clamp(Duration::from_millis(1), SLICE)).map_err(|e| self.cut(&e))?;
        self.next = 0;
        self.buffer.resize(BUFFER, 0);
        let read = match &mut self.line {
            Line::Serial(port) => port.read(&mut self.buffer),
            Line::Tcp(stream) => stream.read(&mut self.buffer),
        };
        let length = match read {
            Ok(0) => Err(io::Error::from(ErrorKind::UnexpectedEof)),
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => Ok(0),
            other => other,
        };
        self.buffer.truncate(*length.as_ref().unwrap_or(&0));
        let length = length.map_err(|e| self.cut(&e))?;
        self.slow_down(length);
        Ok(())
    }

    fn set_timeout(&mut self, timeout: Duration) -> io::Result<()> {
        if timeout != self.timeout {
            match &mut self.line {
                Line::Serial(port) => port.set_read_timeout(timeout)?,
                Line::Tcp(stream) => stream.set_read_timeout(Some(timeout))?,
            }
            self.timeout = timeout;
        }
        Ok(())
    }

    /// Sleeps while a peer that sent `length` bytes more is faster than [`MAX_BYTES_PER_S`]: for some 10 ms at the most.
    fn slow_down(&mut self, length: usize) {
        let now = Instant::now();
        let earned = now.duration_since(self.read_at).as_secs_f64() * MAX_BYTES_PER_S;
        self.read_at = now;
        self.credit = (self.credit + earned).min(BUFFER as f64) - length as f64;
        if self.credit < 0.0 {
            thread::sleep(Duration::from_secs_f64(-self.credit / MAX_BYTES_PER_S));
        }
    }

    fn cut(&self, error: &io::Error) -> Error {
        let cause = match error.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut => {
                format!("nothing that is sent is taken within {} s", self.patience.as_secs())
            }
            _ => format!("the connection is gone ({error})"),
        };
        Error::Link { port: self.name.clone(), cause }
    }
}
