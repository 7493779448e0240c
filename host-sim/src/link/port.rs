//! Where a controller is: a serial port, or a TCP connection to an emulated one.

use std::fmt;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use dea_driver::link::BAUD;
use serial2::SerialPort;

use crate::error::{Error, Result};

/// For so long a connection may take.
const PATIENCE: Duration = Duration::from_secs(5);
/// After so long without a byte the line is silent.
const SILENCE: Duration = Duration::from_millis(5);

/// A line of bytes to a controller.
pub struct Port {
    name: String,
    line: Line,
    buffer: Vec<u8>,
    next: usize,
}

enum Line {
    Serial(SerialPort),
    Tcp(TcpStream),
}

impl fmt::Debug for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Port").field(&self.name).finish()
    }
}

impl Port {
    /// Opens `name`: a serial port such as /dev/ttyUSB0, or `tcp:HOST:PORT`.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] where that fails.
    pub fn open(name: &str) -> Result<Self> {
        let fault = |cause: String| Error::Link { port: name.into(), cause };
        if let Some(address) = name.strip_prefix("tcp:") {
            let expected = |e: io::Error| fault(format!("{e}; tcp:HOST:PORT is expected"));
            let mut addresses = address.to_socket_addrs().map_err(expected)?;
            let address = addresses.next().ok_or_else(|| fault("there is no such host".into()))?;
            let stream = TcpStream::connect_timeout(&address, PATIENCE).map_err(expected)?;
            return Self::over_tcp(name, stream);
        }
        let mut port = SerialPort::open(name, BAUD).map_err(|e| {
            let known = SerialPort::available_ports().unwrap_or_default();
            let known: Vec<String> = known.iter().map(|path| path.display().to_string()).collect();
            let known =
                if known.is_empty() { "there is none here".into() } else { format!("there are {}", known.join(", ")) };
            fault(format!("{e}; a serial port is expected ({known}) or tcp:HOST:PORT"))
        })?;
        port.set_read_timeout(SILENCE).and_then(|()| port.discard_buffers()).map_err(|e| fault(e.to_string()))?;
        Ok(Self::new(name, Line::Serial(port)))
    }

    /// A connection that stands already.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] where it cannot be set up.
    pub fn over_tcp(name: &str, stream: TcpStream) -> Result<Self> {
        stream
            .set_nodelay(true)
            .and_then(|()| stream.set_read_timeout(Some(SILENCE)))
            .map_err(|e| Error::Link { port: name.into(), cause: e.to_string() })?;
        Ok(Self::new(name, Line::Tcp(stream)))
    }

    fn new(name: &str, line: Line) -> Self {
        Self { name: name.into(), line, buffer: Vec::new(), next: 0 }
    }

    /// What it is called.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Sends `bytes`.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] for a line that is cut.
    pub fn write(&mut self, bytes: &[u8]) -> Result<()> {
        let written = match &mut self.line {
            Line::Serial(port) => port.write_all(bytes),
            Line::Tcp(stream) => stream.write_all(bytes),
        };
        written.map_err(|e| self.cut(&e))
    }

    /// The next byte; nothing if the line is silent for a moment.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] for a line that is cut.
    pub fn byte(&mut self) -> Result<Option<u8>> {
        if self.next == self.buffer.len() {
            self.next = 0;
            self.buffer.resize(4096, 0);
            let read = match &mut self.line {
                Line::Serial(port) => port.read(&mut self.buffer),
                Line::Tcp(stream) => stream.read(&mut self.buffer),
            };
            let length = match read {
                Ok(0) => Err(io::Error::from(ErrorKind::UnexpectedEof)),
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => {
                    Ok(0)
                }
                other => other,
            };
            let length = length.map_err(|e| self.cut(&e))?;
            self.buffer.truncate(length);
        }
        let byte = self.buffer.get(self.next).copied();
        self.next += usize::from(byte.is_some());
        Ok(byte)
    }

    fn cut(&self, error: &io::Error) -> Error {
        Error::Link { port: self.name.clone(), cause: format!("the connection is gone ({error})") }
    }
}
