//! The film as its own displacement sensor, in the tick.

use crate::safety::Cause;

/// The displacement in a tick, as far as it is known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shown {
    /// By the displacement sensor, or by the film where it takes its place, m.
    pub displacement_m: f32,
    /// Why the film cannot be sensed.
    pub fault: Option<Cause>,
    #[cfg(feature = "self-sensing")]
    own: Own,
}

impl Shown {
    /// By the displacement sensor.
    #[inline]
    fn by_sensor(displacement_m: f32) -> Self {
        Self {
            displacement_m,
            fault: None,
            #[cfg(feature = "self-sensing")]
            own: Own { is_used: false, sample: None },
        }
    }
}

/// The film's own.
#[cfg(feature = "self-sensing")]
#[derive(Clone, Copy, Debug)]
struct Own {
    /// Whether it takes the sensor's place.
    is_used: bool,
    /// A new sample.
    sample: Option<springpot::SensorSample<f32>>,
}

#[cfg(feature = "self-sensing")]
pub(super) use with_current::FilmSensor;
#[cfg(not(feature = "self-sensing"))]
pub(super) use without_current::FilmSensor;

#[cfg(feature = "self-sensing")]
mod with_current {
    #[cfg(feature = "link")]
    use springpot::Numbers;
    use springpot::{FilmReading, SelfSensing, SelfSensingFault, SelfSensingState, SensorSample};

    use super::{Own, Shown};
    use crate::chips::Calibration;
    use crate::parameters::{ControllerMemory, Parameters};
    use crate::safety::{Cause, OnSensorFault};

    /// Blocks after a fall of the monitor's reading in which a fault may be that of an arc.
    const ARC_BLOCKS: u16 = 3;
    /// Standard deviation of a displacement sensor that corrects the film, in the bands of its limits.
    const BANDS: f32 = 5.0;

    /// None for parameters without self-sensing.
    #[derive(Clone, Debug)]
    pub struct FilmSensor(Option<Parts>);

    #[derive(Clone, Debug)]
    struct Parts {
        sensing: SelfSensing<f32>,
        state: SelfSensingState<f32>,
        amplitude_v: f32,
        /// Plausible displacements by the sensor, m, and the variance of one, m².
        range_m: [f32; 2],
        jump_m: f32,
        variance_m2: f32,
        /// Whether the film takes the place of a sensor that is out of its range.
        replaces: bool,
        /// Whether the last command has the tone, and its part of it, V.
        is_on: bool,
        tone_v: f32,
        /// Mean current since the last tick, A.
        current_a: Option<f32>,
        /// NaN until the first sample of a run.
        shown_m: f32,
        /// Falls of the monitor's reading, and the ticks in which a fault may still be that of the last one.
        falls: u16,
        arc_ticks: u16,
        max_arc_ticks: u16,
        /// Whether the last sample was further from the one before than a plausible jump: it is used if the next one is as far.
        is_doubted: bool,
    }

    impl FilmSensor {
        pub fn new<M: ControllerMemory>(parameters: &Parameters<M>) -> Self {
            // A blob's has been checked.
            let sensor = parameters.self_sensing.as_ref();
            let limits = &parameters.limits;
            Self(sensor.and_then(|sensor| Some((sensor, sensor.sensing().ok()?))).map(|(sensor, sensing)| Parts {
                state: sensing.state(),
                amplitude_v: sensor.tone_v(),
                sensing,
                range_m: [limits.sensor.low, limits.sensor.high],
                jump_m: limits.sensor.jump,
                variance_m2: (BANDS * limits.sensor.stuck_band) * (BANDS * limits.sensor.stuck_band),
                replaces: limits.on_sensor_fault == OnSensorFault::OpenLoop,
                is_on: false,
                tone_v: 0.0,
                current_a: None,
                shown_m: f32::NAN,
                falls: 0,
                arc_ticks: 0,
                max_arc_ticks: ARC_BLOCKS * 4 * sensor.options().periods,
                is_doubted: false,
            }))
        }

        /// The mean current since the last tick, by a monitor of that `calibration`.
        pub fn read(&mut self, calibration: &Calibration, adc_v: Option<f32>) {
            if let Some(parts) = &mut self.0 {
                parts.current_a = adc_v.map(|volts| calibration.apply(volts));
            }
        }

        /// Takes the readings of the last tick, of which the sensor shows `displacement_m` (m), and how often that of the monitor has fallen since it
        /// was armed.
        #[inline]
        pub fn sense(&mut self, displacement_m: f32, monitor_v: f32, falls: u16) -> Shown {
            match &mut self.0 {
                Some(parts) if parts.is_on => parts.sense(displacement_m, monitor_v, falls),
                Some(parts) => {
                    (parts.falls, parts.arc_ticks) = (falls, 0);
                    Shown::by_sensor(displacement_m)
                }
                None => Shown::by_sensor(displacement_m),
            }
        }

        /// The sample to be used: that of the film where it `is_plausible` in the sensor's place, otherwise that `by_sensor`, which corrects the film.
        #[inline]
        pub fn choose(
            &mut self,
            shown: Shown,
            by_sensor: Option<SensorSample<f32>>,
            is_plausible: bool,
        ) -> Option<SensorSample<f32>> {
            if shown.own.is_used {
                return shown.own.sample.filter(|_| is_plausible);
            }
            if let (Some(parts), Some(sample)) = (&mut self.0, by_sensor)
                && parts.is_on
            {
                parts.sensing.correct(&mut parts.state, sample, parts.variance_m2);
            }
            by_sensor
        }

        /// Whether the film takes the place of a sensor that is missing.
        pub fn replaces(&self) -> bool {
            self.0.as_ref().is_some_and(|parts| parts.replaces)
        }

        /// The tone's part of the last command, V.
        #[inline]
        pub fn tone_v(&self) -> f32 {
            self.0.as_ref().map_or(0.0, |parts| parts.tone_v)
        }

        /// `wanted_v` (V) with the tone, within 0 V and `most_v` (V), where the sensor `is_used`; the run of the tone ends elsewhere.
        #[inline]
        pub fn drive(&mut self, is_used: bool, wanted_v: f32, most_v: f32) -> f32 {
            match &mut self.0 {
                Some(parts) if is_used => parts.drive(wanted_v, most_v),
                _ => {
                    self.end_run();
                    wanted_v
                }
            }
        }

        /// The command is 0 V: the next run begins with a film of which nothing was sensed.
        #[inline]
        pub fn end_run(&mut self) {
            if let Some(parts) = &mut self.0
                && parts.is_on
            {
                parts.state = parts.sensing.state();
                (parts.is_on, parts.tone_v, parts.shown_m, parts.is_doubted) = (false, 0.0, f32::NAN, false);
            }
        }

        /// Visits all that does not change.
        #[cfg(feature = "link")]
        pub fn numbers(&self, take: &mut impl Numbers<f32>) {
            if let Some(parts) = &self.0 {
                parts.sensing.numbers(take);
                take.array("limits", [parts.amplitude_v, parts.variance_m2, parts.jump_m], "");
                take.array("range", parts.range_m, "");
                take.count("replaces", parts.replaces.into(), "");
                take.count("arc", parts.max_arc_ticks.into(), "");
            }
        }
    }

    impl Parts {
        #[inline(never)] // for films that are sensed
        fn sense(&mut self, displacement_m: f32, monitor_v: f32, falls: u16) -> Shown {
            let current_a = self.current_a.take().unwrap_or(f32::NAN);
            let sensed = self.sensing.sense(&mut self.state, FilmReading { voltage_v: monitor_v, current_a });
            let sample = sensed.map(|sensed| sensed.sample).filter(|sample| self.is_believed(sample.displacement_m));
            self.shown_m = sample.map_or(self.shown_m, |sample| sample.displacement_m);
            let ticks = if falls == self.falls { self.arc_ticks.saturating_sub(1) } else { self.max_arc_ticks };
            (self.falls, self.arc_ticks) = (falls, ticks);
            if self.state.fault().is_some() && self.arc_ticks > 0 {
                // An arc, which may heal: sensing begins anew.
                (self.state, self.arc_ticks) = (self.sensing.state(), 0);
            }
            let fault = self.state.fault().map(|fault| match fault {
                SelfSensingFault::NoTone => Cause::NoTone,
                SelfSensingFault::Shorted => Cause::FilmShorted,
                SelfSensingFault::CurrentMonitor => Cause::CurrentMonitor,
                _ => Cause::Electrode,
            });
            let [low, high] = self.range_m;
            let is_used = self.replaces && !(low..=high).contains(&displacement_m);
            let displacement_m = if is_used { self.shown_m } else { displacement_m };
            Shown { displacement_m, fault, own: Own { is_used, sample } }
        }

        /// In a block within which something breaks, the film seems to jump.
        fn is_believed(&mut self, displacement_m: f32) -> bool {
            let jumps = (displacement_m - self.shown_m).abs() > self.jump_m;
            self.is_doubted = jumps && !self.is_doubted;
            !self.is_doubted
        }

        #[inline(never)] // likewise
        fn drive(&mut self, wanted_v: f32, most_v: f32) -> f32 {
            self.is_on = true;
            let highest_v = most_v - self.amplitude_v;
            let bounded_v = if wanted_v < highest_v { wanted_v } else { highest_v };
            let middle_v = if bounded_v > self.amplitude_v { bounded_v } else { self.amplitude_v };
            let command_v = self.sensing.drive(&self.state, middle_v);
            self.tone_v = command_v - middle_v;
            command_v
        }
    }
}

#[cfg(not(feature = "self-sensing"))]
mod without_current {
    #[cfg(feature = "link")]
    use springpot::Numbers;
    use springpot::SensorSample;

    use super::Shown;
    use crate::parameters::{ControllerMemory, Parameters};

    /// A film that is not sensed.
    #[derive(Clone, Debug)]
    pub struct FilmSensor;

    #[allow(clippy::unused_self)] // as the other one
    impl FilmSensor {
        pub fn new<M: ControllerMemory>(_: &Parameters<M>) -> Self {
            Self
        }

        #[inline]
        pub fn sense(&mut self, displacement_m: f32, _: f32, _: u16) -> Shown {
            Shown::by_sensor(displacement_m)
        }

        #[inline]
        pub fn choose(&mut self, _: Shown, by_sensor: Option<SensorSample<f32>>, _: bool) -> Option<SensorSample<f32>> {
            by_sensor
        }

        #[allow(clippy::unused_self)] // as the other one
        pub fn replaces(&self) -> bool {
            false
        }

        #[inline]
        pub fn tone_v(&self) -> f32 {
            0.0
        }

        #[inline]
        pub fn drive(&mut self, _: bool, wanted_v: f32, _: f32) -> f32 {
            wanted_v
        }

        #[inline]
        pub fn end_run(&mut self) {}

        #[cfg(feature = "link")]
        pub fn numbers(&self, _: &mut impl Numbers<f32>) {}
    }
}
