#![allow(dead_code, unused, clippy::all)]
mod cycle;
mod harmonic;
mod learning;
use learning::{Learning, LearningOptions, LearningState};
use host_sim::bench::closed_loop::{self, BenchModel, LoopRun};
use host_sim::bench::controllers::{Controller, ControllerOutput};
use host_sim::bench::film::{Film, Plant as Kind};
use host_sim::bench::plant::{NonlinearPlant, Plant};
use host_sim::files::parameters::Parameters;
use host_sim::grid::Grid;
use host_sim::references::{Reference, Shape};
use host_sim::replay::memory::compressed_law;
use indicatif::ProgressBar;
use rayon::prelude::*;
use springpot::*;
use std::path::Path;

struct Stiff { e: [(f64, f64); 3], s: [f64; 5] }
impl Stiff {
    fn slope(&self, volts: f64, [x, speed, e0, e1, e2]: [f64; 5]) -> [f64; 5] {
        let spring = x - e0 - e1 - e2;
        let force = 9e3 * spring + 6e8 * spring * spring * spring;
        let pull = EPSILON_0 * 4.7 * 6e-4 / 1e-8 * volts * volts * (1.0 + 40.0 * x);
        let flow = |(k, v): (f64, f64), e: f64| (force - k * e) / v;
        [speed, (pull - force - 2.0 * speed) / 0.1, flow(self.e[0], e0), flow(self.e[1], e1), flow(self.e[2], e2)]
    }
}
impl Plant for Stiff {
    fn displacement_m(&self) -> f64 { self.s[0] }
    fn advance(&mut self, volts: f64) {
        let h = 0.5e-3;
        let ahead = |d: [f64; 5], by: f64| std::array::from_fn(|i| self.s[i] + by * d[i]);
        let a = self.slope(volts, self.s);
        let b = self.slope(volts, ahead(a, 0.5 * h));
        let c = self.slope(volts, ahead(b, 0.5 * h));
        let d = self.slope(volts, ahead(c, h));
        self.s = std::array::from_fn(|i| self.s[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]));
    }
    fn holds(&self) -> bool { self.s[0].is_finite() }
}
struct Ff { f: Feedforward<f32>, s: FeedforwardState<f32>, l: Option<(Learning<f32>, LearningState<f32>)>, free: bool, k: usize, trace: bool }
impl Controller for Ff {
    fn tick(&mut self, a: Applied<f64>, sample: Option<SensorSample<f64>>, r: f64) -> ControllerOutput {
        self.k += 1;
        let x = self.f.apply(&mut self.s, Applied::as_commanded(a.commanded as f32));
        let mut t = r as f32;
        if let Some((l, s)) = &mut self.l {
            let sample = sample.map(|s| SensorSample { displacement: s.displacement as f32, age_ticks: s.age_ticks });
            t = l.advance(s, t, sample, self.free);
            
        }
        let c = self.f.command(&mut self.s, t);
        self.free = c.limited.is_none();
        ControllerOutput { voltage_v: c.voltage as f64, reference_m: None, limited: c.limited, ..Default::default() }
    }
}
struct Tr { f: Tracking<f32>, s: TrackingState<f32>, l: Option<(Learning<f32>, LearningState<f32>)>, free: bool }
impl Controller for Tr {
    fn tick(&mut self, a: Applied<f64>, sample: Option<SensorSample<f64>>, r: f64) -> ControllerOutput {
        let sample = sample.map(|s| SensorSample { displacement: s.displacement as f32, age_ticks: s.age_ticks });
        self.f.observe(&mut self.s, Applied::as_commanded(a.commanded as f32), sample);
        let mut t = r as f32;
        if let Some((l, s)) = &mut self.l { t = l.advance(s, t, sample, self.free); }
        let c = self.f.command(&mut self.s, t);
        self.free = c.limited.is_none();
        ControllerOutput { voltage_v: c.voltage as f64, reference_m: None, limited: c.limited, ..Default::default() }
    }
}
fn window(run: &LoopRun, from: f64, to: f64) -> [f64; 2] {
    let range = (from * 1000.0) as usize..(to * 1000.0) as usize;
    let (low, high) = run.asked_m[100_000..].iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &x| (l.min(x), h.max(x)));
    let e: Vec<f64> = range.map(|k| run.displacement_m[k] - run.asked_m[k]).collect();
    let rms = (e.iter().map(|e| e * e).sum::<f64>() / e.len() as f64).sqrt();
    [100.0 * rms / (high - low), 100.0 * e.iter().fold(0.0, |l: f64, e| l.max(e.abs())) / (high - low)]
}
fn main() {
    let env = |n: &str, d: f64| std::env::var(n).ok().and_then(|v| v.parse().ok()).unwrap_or(d);
    let rate = env("MU", 1.0);
    let only = std::env::var("ONLY").unwrap_or_default();
    let trace = std::env::var("TRACE").is_ok();
    let mut jobs = Vec::new();
    for film in ["stiffening", "hossain", "wang"] {
        for period in [10.0, 3.0, 1.0, 0.5, 0.2, 0.1] {
            for tracking in [false, true] {
                let name = format!("{film} {period} {}", if tracking { "tr" } else { "ff" });
                if name.contains(&only) { jobs.push((film, period, tracking, name)); }
            }
        }
    }
    let rows: Vec<String> = jobs.par_iter().map(|(film, period, tracking, name)| {
        let p = Parameters::read(Path::new(&format!("/tmp/pf/{film}.toml"))).expect("toml");
        let grid = Grid::covering(155.0, 1000.0).unwrap();
        let (low, high) = match *film { "wang" => (0.6e-3, 1.2e-3), "hossain" => (2e-3, 3.5e-3), _ => (1e-3, 2.6e-3) };
        let values = Reference::new(Shape::Sine, low, high, *period).on(grid).unwrap();
        let limits = CommandLimits { max_acceleration_m_per_s2: 20.0, max_velocity_m_per_s: 0.5, max_slew_v_per_s: 5e5, ..CommandLimits::BENCH };
        let law = compressed_law::<f32>(p.film(), 1000.0).unwrap();
        let mut text = format!("{name:22}");
        for mode in 0..3 {
            let options = match mode { 0 => None, 1 => Some(None), _ => Some(Some(*period)) };
            let l = options.map(|period_s| { let l = Learning::new(&law, &p.actuator, 6000.0, LearningOptions { period_s, ..LearningOptions::BENCH }).unwrap(); let s = l.state(0.0); if trace && mode == 1 { println!("{name} {l:?}"); } (l, s) });
            let mut c: Box<dyn Controller> = if *tracking {
                let f = Tracking::new(law.clone(), &p.actuator, limits, ObserverOptions::at_bandwidth(0.6)).unwrap();
                let s = f.state(law.state()); Box::new(Tr { f, s, l, free: true })
            } else {
                let f = Feedforward::new(law.clone(), &p.actuator, limits).unwrap();
                let s = f.state(law.state()); Box::new(Ff { f, s, l, free: true, k: 0, trace: trace && mode == 2 })
            };
            let film_ = Film::new(if *film == "wang" { Kind::Wang } else { Kind::Hossain });
            let mut plant: Box<dyn Plant> = if *film == "stiffening" { Box::new(Stiff { e: [(200e3, 60e3), (150e3, 600e3), (150e3, 6e6)], s: [0.0; 5] }) } else { Box::new(NonlinearPlant::at_rest(&film_, 0.5e-3)) };
            let bench = BenchModel { sensor_noise_m: 4e-6, ..BenchModel::default() };
            match closed_loop::track_plant(plant.as_mut(), &bench, c.as_mut(), &values, grid, &ProgressBar::hidden()) {
                Ok(r) => {
                    let (all, last) = (window(&r, period.max(2.0), 150.0), window(&r, 100.0, 150.0));
                    text += &format!(" | {:8.3} {:8.3} {:8.3}", all[0], last[0], last[1]);
                }
                Err(e) => text += &format!(" | {e}"),
            }
        }
        text
    }).collect();
    for r in rows { println!("{r}"); }
}
