//! The code in `docs/own-board.md` is that of an example, which compiles and runs.

#[test]
fn the_code_in_own_board_is_that_of_the_example() {
    let page = include_str!("../../../../docs/own-board.md");
    let example = include_str!("../../examples/own_converters.rs");
    let blocks: Vec<&str> = page.split("```rust\n").skip(1).filter_map(|rest| rest.split("```").next()).collect();
    assert!(blocks.len() >= 4, "{} blocks", blocks.len());
    // The page may indent a method less than the example does.
    let lines = |text: &str| text.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("\n");
    let example = lines(example);
    for block in blocks {
        assert!(example.contains(&lines(block)), "not in the example:\n{block}");
    }
}
