//! Which boards that were heard fit a layout.

use crate::recognise::{board, recognise, traffic};
use taxel_skin::{Fit, Layout, Protocol, RecognisedBoard};

#[test]
fn a_board_fits_a_module_of_its_kind_of_whose_taxels_few_are_silent() {
    let fit = |protocol: &str, taxels: Vec<u8>, hand: &str, order: &str| {
        let text = format!(
            "name = \"m\"\nimage = {{ width = 99, height = 9 }}\nbuses = [\"can0\"]\n[[module]]\nname = \"m\"\npart = \"m\"\n\
             at = [0, 0]\nbus = \"can0\"\nboard = 1\nprotocol = \"{hand}\"\norder = [{order}]\n"
        );
        let layout = Layout::parse(&text, "m.toml").unwrap_or_else(|e| panic!("{e}"));
        let board = RecognisedBoard {
            protocol: Protocol::from_name(protocol).unwrap(),
            or_protocol: None,
            board: 3,
            hub: None,
            taxels,
            rate_hz: None,
        };
        board
            .fit(&layout, 0)
            .map(|Fit { silent, unread }| (silent, unread))
    };
    let eight = "[0, 1, 2, 3, 4, 5, 6, 7]";
    for (heard, order, wanted) in [
        ((0..8).collect(), eight, Some((vec![], 0))),
        ((0..16).collect(), eight, Some((vec![], 8))),
        ((2..8).collect(), eight, Some((vec![0, 1], 0))),
        ((3..8).collect(), eight, None),
        // Of a few taxels one may be silent, but not all.
        (vec![0], "[0, 1]", Some((vec![1], 0))),
        (vec![1], "[0]", None),
    ] {
        let told = fit("uskin-l2", heard, "uskin-l2", order);
        assert_eq!(told, wanted, "{order}");
    }
    // A module may have a board with other ids, but none of another kind.
    assert!(fit("uskin-l1", (0..8).collect(), "uskin-l2", eight).is_some());
    for other in ["icub-mtb3", "cpm-finger"] {
        assert_eq!(fit(other, (0..8).collect(), "uskin-l2", eight), None, "{other}");
    }
    // Which pads of a triangle are taxels is a guess; what was heard is the triangle.
    let pads = (0..12).filter(|k| !matches!(k, 6 | 10)).collect::<Vec<u8>>();
    let palm = "[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10]]\nicub = { skin_type = 1 }\nrotation = 0 # [";
    assert_eq!(
        fit("icub-mtb3", pads.clone(), "icub-mtb4", palm),
        Some((vec![], 0))
    );
    let fingertip = "[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]]\nicub = { skin_type = 1 }\nrotation = 0 # [";
    assert_eq!(fit("icub-mtb3", pads, "icub-mtb4", fingertip), Some((vec![], 0)));
    // The last triangle of a palm, without its thermal pad.
    let pads = (132..144).collect::<Vec<u8>>();
    let palm = "[132, 133, 134, 135, 136, 137, 138, 140, 141, 142, 143]]\nicub = { skin_type = 1 }\nrotation = 0 # [";
    assert_eq!(fit("icub-mtb3", pads, "icub-mtb3", palm), Some((vec![], 0)));
}

#[test]
fn buses_are_those_of_a_layout_whose_boards_they_have_however_they_are_named() {
    let hand = Layout::builtin("allegro-uskin-15").unwrap();
    let mut turned = traffic(&hand);
    turned.iter_mut().for_each(|(bus, ..)| *bus = 2 - *bus);
    let found = recognise(3, &turned);
    let names = ["a", "b", "c"].map(String::from);
    assert_eq!(found.wired_as(&hand, &names), Some(vec![2, 1]));
    let last = hand.modules.len() - 1;
    let board = found.board_of(&hand, last, &[2, 1]).unwrap();
    assert_eq!(found.boards().nth(board).unwrap().board, hand.wiring[last].board);
    // The default hand's first bus has the boards of the second one, and one more.
    let second = Layout::parse(
        "name = \"s\"\nimage = { width = 8, height = 4 }\nbuses = [\"x\", \"y\"]\n\
         [[module]]\nname = \"p\"\npart = \"p\"\nbus = \"x\"\nboard = 0\nprotocol = \"uskin-l2\"\nat = [0, 0]\n\
         [[module]]\nname = \"q\"\npart = \"q\"\nbus = \"y\"\nboard = 7\nprotocol = \"uskin-l2\"\nat = [4, 0]\n",
        "s.toml",
    );
    let second = second.unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(
        found.wired_as(&second, &["x", "y", "x"].map(String::from)),
        Some(vec![1, 2])
    );
}

#[test]
fn a_built_in_hand_is_told_where_a_taxel_is_silent_and_not_where_one_is_added() {
    let hand = Layout::builtin("uskin-fingertip").unwrap();
    let heard = |is_there: fn(u32) -> bool, more: &[u8]| {
        let mut traffic = traffic(&hand);
        traffic.retain(|(_, _, frame)| is_there(frame.id()));
        traffic.extend(board(Protocol::USKIN_L2, 5, more, None));
        recognise(1, &traffic)
    };
    let found = heard(|id| id != 0x401 && id != 0x402, &[]);
    assert_eq!(found.builtin(), Some(("uskin-fingertip", 2)));
    let text = found.layout_file("f", &["can0"]).unwrap();
    assert!(text.contains("uskin-fingertip, but for 2 taxels"), "{text}");
    assert_eq!(heard(|id| id & 0xF00 == 0x400, &[]).builtin(), None);
    assert_eq!(heard(|_| true, &[8, 9, 10, 11]).builtin(), None);
}
