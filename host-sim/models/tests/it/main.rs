//! The library behind the commands, against independent answers.

mod amplifier;
mod amplifier_demand;
mod at_hand;
mod bad_recordings;
mod changed_films;
mod commission;
mod commission_ramp;
mod copies;
mod curves;
#[path = "../../../../crates/springpot/tests/it/support/defining_sum.rs"]
mod defining_sum;
mod feasibility;
mod film;
mod fitting;
mod full_memory;
mod hostile_sensors;
mod hours;
mod intervals;
mod late_sensor;
mod measured_curve;
#[path = "../../../../crates/springpot/tests/it/support/models.rs"]
mod models;
mod one_law;
mod periodic;
mod plain_orders;
mod plant;
mod plants;
mod plausibility;
mod random_fits;
mod recorded;
#[path = "../../../../tests/support/recordings.rs"]
mod recordings;
mod reduce;
mod relaxation;
mod same_film;
mod self_sensing;
mod sensor_offset;
mod series;
mod stiffening;
mod supply;
#[allow(dead_code)] // samples of cases are for springpot's own sweeps
#[path = "../../../../crates/springpot/tests/it/support/sweep.rs"]
mod sweep;
mod temperature;
mod tracking;
mod two_curves;
