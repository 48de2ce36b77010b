//! How large a hand may be.

use super::*;

/// `count` modules of one board each, side by side in rows; eight L2 boards to a bus.
fn many_modules(count: usize, order: &str) -> String {
    let buses: Vec<String> = (0..count.div_ceil(8)).map(|i| format!("\"can{i}\"")).collect();
    let mut text = format!(
        "name = \"many\"\nimage = {{ width = 1024, height = 1024 }}\nbuses = [{}]\n",
        buses.join(", ")
    );
    for i in 0..count {
        text += &module(
            &format!("m{i}"),
            &[
                &format!("bus = \"can{}\"", i / 8),
                &format!("board = {}", i % 8),
                &format!("at = [{}, {}]", i % 64 * 16, i / 64 * 16),
                order,
            ],
        );
    }
    text
}

#[test]
fn a_thousand_modules_fit_and_one_more_does_not() {
    let order = "order = [[0]]";
    assert_eq!(
        Layout::parse(&many_modules(1000, order), "big").unwrap().len(),
        1000
    );
    let message = error(&many_modules(1001, order));
    assert!(
        message.contains("number of modules is 1001, and must be 1 to 1000"),
        "{message}"
    );
}

#[test]
fn the_largest_hand_is_a_thousand_boards_of_64_taxels() {
    let order: Vec<String> = (0..8)
        .map(|row| {
            let cells: Vec<String> = (0..8).map(|column| (8 * row + column).to_string()).collect();
            format!("[{}]", cells.join(", "))
        })
        .collect();
    let text = many_modules(1000, &format!("order = [{}]", order.join(", "))).replace("uskin-l2", "uskin-l3");
    let hand = Layout::parse(&text, "big").unwrap();
    assert_eq!(hand.len(), 64_000);
    assert_eq!(hand.modules[999].first_taxel, 63_936);
}

#[test]
fn a_module_of_an_array_has_as_many_taxels_as_a_layout_may() {
    let order: Vec<Vec<u32>> = (0..255)
        .map(|row| (0..257).map(|n| row * 257 + n).collect())
        .collect();
    let hand = |order: &[Vec<u32>]| {
        let module = "[[module]]\nname = \"m\"\npart = \"m\"\nprotocol = \"offline\"\nat = [0, 0]\n";
        format!("name = \"big\"\nimage = {{ width = 257, height = 256 }}\n{module}order = {order:?}\n")
    };
    let layout = Layout::parse(&hand(&order), "big.toml").unwrap();
    assert_eq!((layout.len(), layout.k[65_534]), (65_535, 65_534));
    for (again, wanted) in [
        (
            65_535,
            "its order has taxel 65535, but the taxels of offline are 0 to 65534",
        ),
        (
            65_000,
            "hand.toml:8: module \"m\": its order has taxel 65000 twice, in rows 252 and 254",
        ),
    ] {
        let mut order = order.clone();
        order[254][256] = again;
        let message = error(&hand(&order));
        assert!(message.contains(wanted), "{message}");
    }
}
