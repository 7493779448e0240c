//! `link adaptation`: whether the law follows a film that changes, and how far it has moved.

use clap::ValueEnum;
use dea_driver::wire::{AdaptationOrder, AdaptationStatus, Answer, Command};
use springpot::Adapting;

use super::{Source, Token};
use crate::commands::options::load_at;
use crate::commands::prelude::*;
use crate::link::Client;

/// Ageing from which a run trips, where none is given.
const TRIP_AT: f64 = 3.0;

#[derive(Debug, Args)]
pub(super) struct Adaptation {
    /// How the law follows its film from now on; without it, the state is shown alone.
    #[arg(value_enum)]
    order: Option<Order>,
    /// With learn: ageing from which a run trips, 1 for a tenth in stiffness. The default is 3.
    #[arg(long, value_name = "AGEING", value_parser = quantity::number)]
    trip_at: Option<f64>,
    /// With temperature: that of the film now, °C. With --params, the file of the parameters that the board runs.
    #[arg(long, value_name = "C", allow_negative_numbers = true, value_parser = quantity::celsius)]
    at: Option<f64>,
    #[command(flatten)]
    source: Source,
    #[command(flatten)]
    token: Token,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Order {
    /// The law follows its film while the sensor shows it, and feedforward goes on with what was learned.
    Learn,
    /// Nothing is learned, and what was learned stays in use.
    Hold,
    /// The law as it was fitted comes back.
    Off,
    /// Forget what was learned, and learn anew.
    Forget,
    /// Store what was learned with the board's parameters: in use, and held, from the next start on. While the amplifier is off.
    Keep,
    /// The film is at another temperature than its parameters: with --at and --params. It stays in use until off, an upload or a restart.
    Temperature,
}

#[derive(Serialize)]
struct Report {
    port: String,
    #[serde(flatten)]
    film: Film,
}

/// How far a film has moved from its law.
#[derive(Serialize)]
pub(super) struct Film {
    adapting: &'static str,
    force_scale: f32,
    uncertainty: f32,
    memory_factor: f32,
    rate_factor: f32,
    order_factor: f32,
    constant_force_n: f32,
    /// The stiffness over the law's, less 1, if nothing else differs; 0 where that may be chance.
    stiffness_change: f32,
    ageing: f32,
    /// None before it was first ordered to learn.
    trip_at: Option<f32>,
    needs_fit: bool,
    /// Factors of stiffness and relaxation times at the temperature that was ordered.
    stiffness_at_temperature: f32,
    times_at_temperature: f32,
}

impl Adaptation {
    /// The blob of the parameters that the board must run, for a temperature.
    pub(super) fn check(&self) -> Result<Option<Vec<u8>>> {
        match (self.trip_at, self.order) {
            (Some(level), Some(Order::Learn)) => quantity::positive("trip_at", level)?,
            (Some(_), _) => {
                return Err(Error::field("trip_at", "is a level of learning: `adaptation learn --trip-at AGEING`"));
            }
            (None, _) => {}
        }
        match self.order {
            Some(Order::Temperature) => {
                self.factors()?;
                self.source.blob()
            }
            _ if self.at.is_some() || self.source.is_given() => {
                Err(Error::field("at", "is of a temperature: `adaptation temperature --at C --params P`"))
            }
            _ => Ok(None),
        }
    }

    /// Factors of the film's stiffness and times at its temperature.
    fn factors(&self) -> Result<AdaptationOrder> {
        let (Some(at), Some(params)) = (self.at, &self.source.params) else {
            let missing = if self.at.is_some() { "params" } else { "at" };
            return Err(Error::field(missing, "is needed: `adaptation temperature --at C --params P`"));
        };
        let parameters = load_at(params, "temperature", self.source.temperature)?;
        let [stiffness, time] = parameters.temperature_factors(at).map_err(|cause| Error::field("at", cause))?;
        Ok(AdaptationOrder::Temperature { stiffness: stiffness as f32, time: time as f32 })
    }

    pub(super) fn run(&self, mut client: Client, blob: Option<&[u8]>, port: String, json: bool) -> Result<()> {
        if let Some(expected) = blob.and_then(<[u8]>::last_chunk) {
            client.expect_parameters(u32::from_le_bytes(*expected))?;
        }
        if let Some(order) = self.order {
            client.go_on(self.token.token);
            client.order(Command::Adapt(match order {
                Order::Learn => AdaptationOrder::Learn { trip_at: self.trip_at.unwrap_or(TRIP_AT) as f32 },
                Order::Hold => AdaptationOrder::Hold,
                Order::Off => AdaptationOrder::Off,
                Order::Forget => AdaptationOrder::Forget,
                Order::Keep => AdaptationOrder::Keep,
                Order::Temperature => self.factors()?,
            }))?;
        }
        let report = Report { port, film: Film::from_board(&mut client)? };
        terminal::report(json, &report, || format!("{}: {}", report.port, report.film.text()))
    }
}

impl Film {
    /// As the controller has learned it.
    pub(super) fn from_board(client: &mut Client) -> Result<Self> {
        let AdaptationStatus { adapting, adapted, stiffness_change, trip_at, stiffness, time } =
            match client.ask(Command::Adaptation)? {
                Answer::Adaptation(status) => status,
                other => return Err(client.unexpected(&other)),
            };
        Ok(Self {
            adapting: match adapting {
                Adapting::Off => "off",
                Adapting::Hold => "hold",
                Adapting::Learn => "learn",
            },
            force_scale: adapted.force_scale,
            uncertainty: adapted.uncertainty,
            memory_factor: adapted.memory.exp(),
            rate_factor: adapted.rate.exp(),
            order_factor: 1.0 / (1.0 + adapted.stretch),
            constant_force_n: adapted.bias_n,
            stiffness_change,
            ageing: adapted.ageing,
            trip_at: Some(trip_at).filter(|level| level.is_finite()),
            needs_fit: adapted.needs_fit(),
            stiffness_at_temperature: stiffness,
            times_at_temperature: time,
        })
    }

    /// Whether the law is, or becomes, another one than was fitted.
    pub(super) fn is_followed(&self) -> bool {
        let factors = [self.memory_factor, self.rate_factor, self.order_factor];
        self.adapting != "off" || self.constant_force_n != 0.0 || factors.iter().any(|factor| *factor != 1.0)
    }

    /// The change that a user should know, if there is one.
    pub(super) fn change(&self) -> Option<String> {
        let fit = "the film is no longer the one that was fitted: if it stays so, fit it again";
        let softer = if self.stiffness_change < 0.0 { "softer" } else { "stiffer" };
        match (self.needs_fit, self.stiffness_change) {
            (false, 0.0) => None,
            (true, 0.0) => Some(fit.to_owned()),
            (needs_fit, change) => {
                let fit = if needs_fit { format!("; {fit}") } else { String::new() };
                Some(format!(
                    "the film acts as if it were {:.1} % {softer} than its parameters: it has changed, or its load, its temperature or the sensor's scale{fit}",
                    100.0 * change.abs()
                ))
            }
        }
    }

    fn text(&self) -> String {
        if !self.is_followed() {
            return "off, the law is as it was fitted; `adaptation learn` follows the film".to_owned();
        }
        let trip = self.trip_at.map_or(String::new(), |level| format!(", a run trips at {level}"));
        let change = self.change().map_or(String::new(), |change| format!("; {change}"));
        let at = match (self.stiffness_at_temperature, self.times_at_temperature) {
            (1.0, 1.0) => String::new(),
            (stiffness, times) => format!("; at its temperature stiffness × {stiffness:.3}, times × {times:.3}"),
        };
        format!(
            "{}; force scale {:.3} ± {:.3}, what relaxes × {:.2}, its rates × {:.2}, orders × {:.3}, {:.3} N{at}\n\
             ageing {:.2}{trip}{change}",
            self.adapting,
            self.force_scale,
            self.force_scale * self.uncertainty,
            self.memory_factor,
            self.rate_factor,
            self.order_factor,
            self.constant_force_n,
            self.ageing
        )
    }
}
