//! The commands as scripts call them: what they compute and write, and how they refuse bad input.

mod amplifier;
mod bad_input;
mod cases;
mod commission;
mod control_commands;
mod degenerate_input;
mod demo;
mod excitation;
mod export;
mod export_c;
mod export_fmu;
mod export_sfunction;
mod fit_commands;
mod help;
mod manners;
mod plots;
mod replay_and_record;
mod report_page;
mod self_sensing;
mod start;

use tests::tool::Tool;

const TOOL: Tool = Tool(env!("CARGO_BIN_EXE_host-sim-under-test"));
