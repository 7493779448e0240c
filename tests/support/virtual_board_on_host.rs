//! A board that runs in this process, for tests that are not in Rust: prints its port, and ends with its standard input. With the word `changes` it
//! also prints when its enable output changes, by the clock on the wall in ns.

use std::io::{Read, stdin};
use std::sync::Arc;
use std::thread;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use tests::virtual_board::{Scene, VirtualBoard};

fn main() {
    let board = Arc::new(VirtualBoard::start(Scene::CALM));
    println!("{}", board.port);
    if std::env::args().any(|argument| argument == "changes") {
        let board = Arc::clone(&board);
        let now = || SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        thread::spawn(move || {
            loop {
                board.wait_for_enabled();
                println!("1 {}", now().as_nanos());
                let fell = board.wait_for_disabled().unwrap_or_else(Instant::now);
                println!("0 {}", (now() - fell.elapsed()).as_nanos());
            }
        });
    }
    let mut rest = Vec::new();
    // Nothing is expected but its end.
    let _ = stdin().read_to_end(&mut rest);
}
