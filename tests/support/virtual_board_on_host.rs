//! A board that runs in this process, for tests that are not in Rust: prints its port, and ends with its standard input.

use std::io::{Read, stdin};

use tests::virtual_board::{Scene, VirtualBoard};

fn main() {
    let board = VirtualBoard::start(Scene::CALM);
    println!("{}", board.port);
    let mut rest = Vec::new();
    // Nothing is expected but its end.
    let _ = stdin().read_to_end(&mut rest);
}
