//! A film in a circuit: what the monitors of an amplifier show under a tone, and under whatever can break.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{SelfSensingOptions, SensorSample};

use crate::films::Sensed;
use crate::job::Input;

/// Readings of a film that lengthens as `recorded` (V, m), with noise and some that are not finite, jumps of the drive and samples of a second
/// sensor. Within every 240 blocks each part breaks in every way that is a fault, after which sensing begins anew.
pub fn readings(sensed: &Sensed, recorded: &[(f32, f32)]) -> Vec<Input> {
    let Sensed { relation, options, .. } = sensed;
    let SelfSensingOptions { step_s, tone_v, periods, cable_f, .. } = *options;
    // Six blocks.
    let part_ticks = 24 * usize::from(periods);
    let mut random = Pcg64::seed_from_u64(33);
    let (mut before_v, mut before_c) = (0.0, 0.0);
    let mut tick = |(k, &(voltage, displacement)): (usize, &(f32, f32))| {
        let part = k / part_ticks % 40;
        let noise = random.random_range(-1.0..1.0);
        let stretched = f64::from(displacement) / 2e-3;
        let capacitance_f = match part {
            7 => cable_f + 0.3 * (relation.rest_f - cable_f),
            9 => 3.0 * relation.max_f,
            _ => relation.rest_f + (relation.max_f - relation.rest_f) * stretched,
        };
        let jump_v = if k / 3000 % 2 == 1 { 400.0 } else { 0.0 };
        let tone_v = |k: usize| tone_v * [0.0, 1.0, 0.0, -1.0][k % 4];
        let with_tone_v = if matches!(part, 1 | 13) { 0.0 } else { tone_v(k) };
        let voltage_v = f64::from(voltage) + jump_v + with_tone_v + options.voltage_noise_v * noise;
        let charging_a = (capacitance_f * voltage_v - before_c * before_v) / step_s;
        (before_v, before_c) = (voltage_v, capacitance_f);
        let current_a = match part {
            3 | 10 => 0.0,
            5 | 13 => charging_a + (1000.0 + voltage_v) / 3e6,
            // Through a resistance.
            15 => 0.7 * relation.rest_f / step_s * tone_v(k + 3),
            _ => charging_a + options.current_noise_a * noise,
        };
        let rare = |value: f64, of: usize| if k % 1700 == of { f32::NAN } else { value as f32 };
        let sample = (k % 31 == 7).then_some(SensorSample {
            displacement_m: if k % 217 == 7 { f32::INFINITY } else { displacement + 1e-5 * noise as f32 },
            age_ticks: k / 31 % 300,
        });
        let is_renewed = k % part_ticks == 0 && matches!(part, 2 | 4 | 6 | 8 | 11 | 14 | 16);
        Input { a: rare(voltage_v, 5), b: rare(current_a, 6), sample, flags: u32::from(is_renewed) }
    };
    recorded.iter().enumerate().map(&mut tick).collect()
}
