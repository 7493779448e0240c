//! The electrical side of a simulated film: capacitance, electrodes, leak and cable on an amplifier, with monitors of voltage and current.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use springpot::{CapacitanceRelation, FilmReading, SelfSensingOptions};

use crate::simulation::film::Film;
use crate::simulation::plant::Plant;

/// A film in circuit. docs/self-sensing.md has the sources of its numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmCircuit {
    /// Capacitance of the film at rest, F.
    pub rest_f: f64,
    /// Length of the film at rest, m: its stretch grows with the displacement over it.
    pub length_m: f64,
    /// Power of the stretch with which the capacitance grows: 2 for electrodes of constant width.
    pub exponent: f64,
    /// Share by which the displacement that the capacitance shows is larger once a stretch has been held for half an hour: the permittivity follows
    /// the stretch with five time constants, from 0.1 s to 1000 s, by as much in each decade.
    pub creep: f64,
    /// Resistance of the electrodes at rest, Ω; it grows with the square of the stretch.
    pub electrodes_ohm: f64,
    /// Resistance of the film, Ω.
    pub leak_ohm: f64,
    /// Capacitance of the cable, F.
    pub cable_f: f64,
}

impl FilmCircuit {
    /// The strip of `film`: its geometry, a permittivity that creeps by 5 %, 50 kΩ of electrodes, a leak of 5 GΩ, and a metre of cable.
    #[must_use]
    pub fn of_film(film: &Film) -> Self {
        Self {
            rest_f: film.capacitance_f(),
            length_m: film.length_m(),
            exponent: 2.0,
            creep: 0.05,
            electrodes_ohm: 50e3,
            leak_ohm: 5e9,
            cable_f: 100e-12,
        }
    }

    /// The capacitance (F) of film and cable at the displacement `x_m`, of a film whose permittivity has not changed.
    #[must_use]
    pub fn capacitance_f(&self, x_m: f64) -> f64 {
        self.rest_f * (1.0 + x_m / self.length_m).powf(self.exponent) + self.cable_f
    }

    /// The relation of a film that is used up to `max_m`, as its sizes say it: without creep.
    #[must_use]
    pub fn relation_of_sizes(&self, max_m: f64) -> CapacitanceRelation {
        let [rest_f, max_f] = [0.0, max_m].map(|x_m| self.capacitance_f(x_m));
        let relation = CapacitanceRelation::of_geometry(self.rest_f, self.length_m, self.exponent, max_f);
        // The cable makes the same change a smaller one.
        let growth = rest_f / self.rest_f;
        let [a, b, c] = relation.stroke_m;
        CapacitanceRelation {
            rest_f,
            stroke_m: [growth * a, growth * growth * b, growth.powi(3) * c],
            uncertainty_m: 0.05 * max_m,
            ..relation
        }
    }
}

/// Amplifier and monitors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Monitors {
    /// Time constant of the amplifier, s.
    pub lag_s: f64,
    /// Its largest slope, V/s.
    pub slew_v_per_s: f64,
    /// Its largest current, A.
    pub limit_a: f64,
    /// Bits of the converters.
    pub bits: u32,
    /// Range of the voltage monitor, V, from 0.
    pub range_v: f64,
    /// Range of the current monitor, A, half of it on each side of 0.
    pub range_a: f64,
    /// Standard deviation of the noise, in least significant bits.
    pub noise_bits: f64,
    /// Offset of the current monitor, A.
    pub offset_a: f64,
}

impl Default for Monitors {
    fn default() -> Self {
        Self {
            lag_s: 1e-4,
            slew_v_per_s: 500e3,
            limit_a: 0.5e-3,
            bits: 16,
            range_v: 6000.0,
            range_a: 0.5e-3,
            noise_bits: 2.0,
            offset_a: 1e-6,
        }
    }
}

impl Monitors {
    /// Least significant bits, V and A.
    fn bits(&self) -> [f64; 2] {
        let counts = f64::from(self.bits).exp2();
        [self.range_v / counts, self.range_a / counts]
    }

    /// The options of self-sensing on these monitors, with a tone of `tone_v` (V) at a tick of `step_s` (s), for `circuit`.
    #[must_use]
    pub fn options(&self, circuit: &FilmCircuit, tone_v: f64, step_s: f64) -> SelfSensingOptions {
        // Rounding adds a twelfth of a square bit.
        let [voltage_noise_v, current_noise_a] =
            self.bits().map(|bit| bit * (self.noise_bits.powi(2) + 1.0 / 12.0).sqrt());
        SelfSensingOptions {
            step_s,
            tone_v,
            voltage_noise_v,
            current_noise_a,
            max_current_a: 0.4 * self.range_a,
            cable_f: circuit.cable_f,
            ..SelfSensingOptions::BENCH
        }
    }
}

/// A fault of the electrical side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ElectricalFault {
    /// An electrode has lost its lead.
    LostElectrode,
    /// The film conducts with this resistance, Ω.
    Shorted(f64),
    /// The current monitor shows this, A.
    CurrentMonitor(f64),
}

/// Parts of a tick in which the circuit is integrated.
const PARTS: usize = 48;
/// Time constants of the permittivity, s.
const CREEP_S: [f64; 5] = [0.1, 1.0, 10.0, 100.0, 1000.0];

/// A plant in its circuit, in motion.
pub struct ElectricalBench<'a> {
    circuit: FilmCircuit,
    monitors: Monitors,
    plant: &'a mut dyn Plant,
    /// Advances of the plant in a tick, and a tick, s.
    substeps: usize,
    step_s: f64,
    amplifier_v: f64,
    film_v: f64,
    /// Displacements that the parts of the permittivity have followed, m.
    followed_m: [f64; CREEP_S.len()],
    fault: Option<ElectricalFault>,
    random: Pcg64,
}

impl<'a> ElectricalBench<'a> {
    /// `plant` at rest, which advances `substeps` times in a tick of `step_s` (s), in `circuit` with `monitors`; noise from `seed`.
    pub fn new(
        circuit: FilmCircuit,
        monitors: Monitors,
        plant: &'a mut dyn Plant,
        (substeps, step_s): (usize, f64),
        seed: u64,
    ) -> Self {
        Self {
            circuit,
            monitors,
            plant,
            substeps,
            step_s,
            amplifier_v: 0.0,
            film_v: 0.0,
            followed_m: [0.0; CREEP_S.len()],
            fault: None,
            random: Pcg64::seed_from_u64(seed),
        }
    }

    /// The plant.
    #[must_use]
    pub fn plant(&self) -> &dyn Plant {
        self.plant
    }

    /// Voltage of the amplifier, V.
    #[must_use]
    pub fn amplifier_v(&self) -> f64 {
        self.amplifier_v
    }

    /// From now on this is broken.
    pub fn break_down(&mut self, fault: ElectricalFault) {
        self.fault = Some(fault);
    }

    /// Advances by a tick under `commanded_v` (V), and reads the monitors at its end: of the current the mean.
    pub fn tick(&mut self, commanded_v: f64) -> FilmReading<f64> {
        let Self { circuit, monitors, .. } = *self;
        let parts = PARTS / self.substeps * self.substeps;
        let part_s = self.step_s / parts as f64;
        let (lag, most_v) = (-(-part_s / monitors.lag_s).exp_m1(), monitors.slew_v_per_s * part_s);
        let (mut charge, mut squares) = (0.0, 0.0);
        let x_m = self.plant.displacement_m();
        for (followed, time_s) in self.followed_m.iter_mut().zip(CREEP_S) {
            *followed += (x_m - *followed) * self.step_s / time_s;
        }
        let crept_m = circuit.creep / CREEP_S.len() as f64 * self.followed_m.iter().sum::<f64>();
        let mut film_f = self.film_f(crept_m);
        for part in 1..=parts {
            let before_v = self.amplifier_v;
            self.amplifier_v += (lag * (commanded_v - before_v)).clamp(-most_v, most_v);
            let stretch = 1.0 + self.plant.displacement_m() / circuit.length_m;
            let electrodes = match self.fault {
                Some(ElectricalFault::LostElectrode) => 1e12,
                _ => circuit.electrodes_ohm * stretch * stretch,
            };
            let leak = match self.fault {
                Some(ElectricalFault::Shorted(ohm)) => ohm,
                _ => circuit.leak_ohm,
            };
            // Towards the divider of electrodes and leak, exactly under this voltage; then the charge stays while the capacitance changes.
            let share = leak / (leak + electrodes);
            let (settled_v, time_s) = (share * self.amplifier_v, share * electrodes * film_f);
            let film_v = settled_v + (self.film_v - settled_v) * (-part_s / time_s).exp();
            let mean_v = settled_v + (self.film_v - settled_v) * time_s / part_s * -(-part_s / time_s).exp_m1();
            let mut current =
                (self.amplifier_v - mean_v) / electrodes + circuit.cable_f * (self.amplifier_v - before_v) / part_s;
            self.film_v = film_v;
            if current.abs() > monitors.limit_a {
                // The voltage is what the limited current leaves.
                let excess = current - monitors.limit_a.copysign(current);
                self.amplifier_v -= (excess * electrodes).abs().min(self.amplifier_v.abs()).copysign(self.amplifier_v);
                current -= excess;
            }
            charge += current * part_s;
            squares += film_v * film_v;
            if part.is_multiple_of(parts / self.substeps) {
                let mean = squares * self.substeps as f64 / parts as f64;
                self.plant.advance(mean.sqrt());
                squares = 0.0;
                let moved_f = self.film_f(crept_m);
                self.film_v *= film_f / moved_f;
                film_f = moved_f;
            }
        }
        let [bit_v, bit_a] = monitors.bits();
        let mut converted = |value: f64, bit: f64, [low, high]: [f64; 2]| {
            let unit: f64 = StandardNormal.sample(&mut self.random);
            let noisy = value + monitors.noise_bits * bit * unit;
            ((noisy / bit).round() * bit).clamp(low, high)
        };
        let half_a = 0.5 * monitors.range_a;
        let voltage_v = converted(self.amplifier_v, bit_v, [0.0, monitors.range_v]);
        let current_a = converted(charge / self.step_s + monitors.offset_a, bit_a, [-half_a, half_a]);
        match self.fault {
            Some(ElectricalFault::CurrentMonitor(stuck)) => FilmReading { voltage_v, current_a: stuck },
            _ => FilmReading { voltage_v, current_a },
        }
    }

    /// Capacitance of the film, F, of which the permittivity makes it longer by `crept_m` (m).
    fn film_f(&self, crept_m: f64) -> f64 {
        self.circuit.capacitance_f(self.plant.displacement_m() + crept_m) - self.circuit.cable_f
    }
}
