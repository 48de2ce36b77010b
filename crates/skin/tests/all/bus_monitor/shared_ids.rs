//! Boards of different kinds in one hand, some of whose ids are the same.

use super::wrong_bus::hub;
use super::*;
use taxel_skin::{Finding, Layout, Wiring};

/// uSkin boards on two buses, an iCub board on a third and a CySkin hub of this address on a fourth.
fn of_all_kinds(hub: u32) -> Layout {
    let uskin = |(bus, board, column): (&str, u8, u8)| {
        format!(
            "[[module]]\nname = \"u{board}\"\npart = \"{bus}\"\nbus = \"{bus}\"\nboard = {board}\nprotocol = \"uskin-l2\"\n\
             at = [{column}, 4]\n"
        )
    };
    let text = format!(
        "name = \"mixed\"\nbuses = [\"left\", \"right\", \"arm\", \"patch\"]\nimage = {{ width = 20, height = 8 }}\n\
         [[cyskin.hub]]\nname = \"hub\"\nbus = \"patch\"\naddress = {hub}\n{}\
         [[module]]\nname = \"i7\"\npart = \"arm\"\nbus = \"arm\"\nboard = 7\nprotocol = \"icub-mtb4\"\nat = [0, 0]\n\
         order = [[0, 1, 2, 3, 4, 5, 7, 8, 9, 11], [12, 13, 14, 15, 16, 17, 19, 20, 21, 23]]\n\
         [[module]]\nname = \"h2\"\npart = \"patch\"\nbus = \"patch\"\nhub = \"hub\"\nboard = 2\nprotocol = \"cyskin\"\n\
         at = [0, 3]\norder = [[1, 2, 3, 4, 5, 6, 7]]\n",
        [("left", 1, 0), ("left", 4, 4), ("right", 5, 8)]
            .map(uskin)
            .concat()
    );
    Layout::parse(&text, "mixed.toml").unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn of_the_layout(finding: &Finding) -> bool {
    !matches!(finding, Finding::NotInLayout { .. })
}

#[test]
fn what_a_hub_says_on_standard_ids_is_no_other_board() {
    for address in [0x21, 0x91] {
        let layout = of_all_kinds(address);
        // On its own bus, and on that of the iCub board.
        for bus in [3, 2] {
            let traffic = hub(&layout, bus, address, 0x43);
            assert!(traffic.iter().all(|(_, received)| !received.frame.is_extended()));
            let windows = found(&layout, traffic, 1400);
            let told = last(&windows);
            assert!(told.iter().all(of_the_layout), "{address:#x} on {bus}: {told:?}");
        }
    }
}

#[test]
fn boards_on_swapped_buses_are_no_boards_of_other_kinds_too() {
    let layout = of_all_kinds(0x35);
    let is_uskin = |m: &&Wiring| m.bus < 2;
    let traffic = layout.wiring.iter().filter(is_uskin).flat_map(|m| {
        board(
            m,
            1 - m.bus,
            m.board,
            50,
            [0, 1500],
            9_000 + 613 * u16::from(m.board),
        )
    });
    let windows = found(&layout, traffic.collect(), 1400);
    let told = last(&windows);
    let is_swap = |finding: &Finding| matches!(finding, Finding::BusesSwapped { buses: [0, 1], .. });
    assert!(
        told.iter().any(is_swap) && told.iter().all(of_the_layout),
        "{told:?}"
    );
}
