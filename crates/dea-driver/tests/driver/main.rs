//! Tests of the driver, without the host tool.

#[path = "../../examples/own_converters.rs"]
mod own_converters;

mod adaptation;
mod arcing;
mod arcs;
mod bench;
mod blob_bytes;
mod board;
mod ceilings;
mod chips;
mod circuit;
mod control;
mod converters;
mod cycles;
mod documents;
mod estimation;
mod fault_injection;
mod film_bench;
mod flight_recorder;
mod host;
mod in_series;
mod inspection;
mod lag;
mod lean;
mod limits;
mod link;
mod link_page;
mod loop_test;
mod memory;
mod monitor;
mod parameters;
mod plausibility;
mod resolution;
mod safety;
mod self_sensing;
mod self_test;
mod sensor_faults;
mod session;
mod setpoints;
mod store;
mod supervisor_bench;
mod swing;

#[test]
fn the_example_runs() {
    own_converters::main().expect("it tracks");
}
