//! Tests of the driver, without the host tool.

#[path = "../../examples/mock_bench.rs"]
mod mock_bench;
#[path = "../../examples/own_converters.rs"]
mod own_converters;

mod arcs;
mod bench;
mod blob_bytes;
mod board;
mod chips;
mod control;
mod converters;
mod cycles;
mod documents;
mod estimation;
mod fault_injection;
mod film_bench;
mod flash;
mod host;
mod inspection;
mod lag;
mod lean;
mod limits;
mod link;
mod link_page;
mod loop_test;
mod monitor;
mod parameters;
mod plausibility;
mod safety;
mod sensor_faults;
mod session;
mod setpoints;
mod store;
mod supervisor_bench;
mod swing;

#[test]
fn examples_run() {
    mock_bench::main();
    own_converters::main().expect("it tracks");
}
