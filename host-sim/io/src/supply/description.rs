//! The description of a supply, as TOML.

use std::path::Path;

use serde::Deserialize;

use super::template::Template;
use crate::error::{Error, Result};
use crate::files::bounded;

/// Largest description, in bytes.
const MAX_FILE: u64 = 1 << 20;

/// The description of a supply.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Supply {
    /// Its name.
    pub name: String,
    /// Origin of the description, and whether it was tried on the device.
    pub source: String,
    /// Bits per second of its port.
    pub baud: u32,
    /// End of a command. A reply ends with a carriage return, a line feed, or both.
    pub line_end: String,
    /// Whether it sends every command back before the reply.
    #[serde(default)]
    pub echo: bool,
    /// Set-points per second that it keeps up with.
    pub rate_hz: f64,
    /// Longest time to a reply, s: a later one ends the run.
    pub late_s: f64,
    /// Time from a command to its voltage, s: references are taken that much earlier.
    #[serde(default)]
    pub latency_s: f64,
    /// Time in which the read-back follows the command, s.
    pub settle_s: f64,
    /// Time without a command after which it goes to 0 V by itself, s; none: it stays as it is.
    pub watchdog_s: Option<f64>,
    /// Largest voltage, V.
    pub max_voltage_v: f64,
    /// Smallest step of the voltage, V.
    pub step_v: f64,
    /// Error of the read-back, V, beside 2 % of the voltage.
    pub read_band_v: f64,
    /// The command that sets the voltage.
    pub set: Exchange,
    /// The command that reads the voltage back.
    pub read: Exchange,
    /// The command that shows which device is at the port.
    pub identify: Exchange,
    /// Commands that switch the output on at 0 V.
    #[serde(default)]
    pub start: Vec<Exchange>,
    /// Commands that switch the output off.
    #[serde(default)]
    pub stop: Vec<Exchange>,
    /// Beginnings of replies that refuse a command.
    #[serde(default)]
    pub errors: Vec<String>,
}

/// A command and its reply.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exchange {
    /// The command, with `{}` for the number.
    pub command: Template,
    /// The reply; none for a command without a reply.
    pub reply: Option<Template>,
    /// The device's number per volt.
    #[serde(default = "one")]
    pub per_volt: f64,
    /// Decimals of the number.
    #[serde(default)]
    pub decimals: usize,
    /// Time to wait after the reply, s.
    #[serde(default)]
    pub pause_s: f64,
}

fn one() -> f64 {
    1.0
}

/// The descriptions that the tool has, by their names.
const SHIPPED: [(&str, &str); 5] = [
    ("generic", include_str!("shipped/generic.toml")),
    ("hvps-x", include_str!("shipped/hvps-x.toml")),
    ("scpi", include_str!("shipped/scpi.toml")),
    ("shvps", include_str!("shipped/shvps.toml")),
    ("technix-sr", include_str!("shipped/technix-sr.toml")),
];

/// Names of the descriptions that the tool has.
pub fn shipped() -> impl Iterator<Item = &'static str> {
    SHIPPED.iter().map(|(name, _)| *name)
}

impl Supply {
    /// The description of that name, in any case, or in the file of that name.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the file and what is wrong in it.
    pub fn load(name: &str) -> Result<Self> {
        if let Some((_, text)) = SHIPPED.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)) {
            return Self::from_toml(Path::new(name), text);
        }
        let path = Path::new(name);
        if path.extension().is_none() && !path.exists() {
            let known: Vec<&str> = shipped().collect();
            let cause = format!("{name:?} is unknown; use {}, or a file such as supply.toml", known.join(", "));
            return Err(Error::field("supply", cause));
        }
        Self::from_toml(path, &bounded::read_text(path, MAX_FILE, "a description of a supply")?)
    }

    /// The description in `text`; `path` is what errors name.
    pub fn from_toml(path: &Path, text: &str) -> Result<Self> {
        let supply: Self = toml::from_str(text).map_err(|e| {
            let before = e.span().map_or("", |span| text.get(..span.start).unwrap_or_default());
            let line = 1 + before.bytes().filter(|&byte| byte == b'\n').count();
            Error::line(path, line as u64, e.message().replace('\n', "; ").replace('`', "\""))
        })?;
        supply.check().map(|()| supply).map_err(|cause| Error::file(path, cause))
    }

    fn check(&self) -> std::result::Result<(), String> {
        let ranges = [
            ("rate_hz", self.rate_hz, 1.0, 1000.0),
            ("late_s", self.late_s, 1e-3, 2.0),
            ("latency_s", self.latency_s, 0.0, 0.2),
            ("settle_s", self.settle_s, 0.0, 0.5),
            ("watchdog_s", self.watchdog_s.unwrap_or(1.0), 0.05, 60.0),
            ("max_voltage_v", self.max_voltage_v, 1.0, 50e3),
            ("step_v", self.step_v, 1e-3, 0.05 * self.max_voltage_v),
            ("read_band_v", self.read_band_v, 1e-3, 0.02 * self.max_voltage_v),
            ("baud", self.baud.into(), 300.0, 4e6),
        ];
        let outside = ranges.iter().find(|(_, value, low, high)| !(*low..=*high).contains(value));
        if let Some((name, value, low, high)) = outside {
            return Err(format!("{name} = {value} must be from {low} to {high}"));
        }
        if !matches!(self.line_end.as_str(), "\r" | "\n" | "\r\n") {
            return Err("line_end must be \"\\r\", \"\\n\" or \"\\r\\n\"".into());
        }
        if !self.set.command.has_number() || !self.read.reply.as_ref().is_some_and(Template::has_number) {
            return Err("set.command and read.reply need {}, the place of the voltage".into());
        }
        if self.identify.reply.is_none() {
            return Err("identify.reply is needed: another device at the port must be refused".into());
        }
        let scales = [self.set.per_volt, self.read.per_volt];
        if scales.iter().any(|scale| !scale.is_finite() || *scale == 0.0) || self.set.decimals > 9 {
            return Err("per_volt must be a number other than 0, and decimals at most 9".into());
        }
        Ok(())
    }

    /// Whether a reply to `identify` shows which device is at the port: it has text of its own.
    pub fn names_its_device(&self) -> bool {
        self.identify.reply.as_ref().is_some_and(Template::has_text)
    }

    /// `volts` as the supply can give them: in its steps, from 0 V to its largest voltage, rounded down there.
    pub fn in_steps(&self, volts: f64) -> f64 {
        let most = (self.max_voltage_v / self.step_v).floor() * self.step_v;
        ((volts / self.step_v).round() * self.step_v).clamp(0.0, most)
    }
}
