//! What docs/wire.md says is what the code does.

mod vectors;

use std::fs;
use std::path::Path;
use taxel_hand::Fault;
use taxel_wire::{
    Flags, HEADER_LEN, Hello, Kind, MAX_MARK, MAX_MESSAGE, MAX_SUBSCRIBE, Subscription, TEXT_PART,
    image_payload_len, raw_payload_len,
};

fn page() -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/wire.md")).unwrap()
}

fn block<'a>(page: &'a str, language: &str) -> &'a str {
    let start = page.split_once(&format!("```{language}\n")).unwrap().1;
    start.split_once("```").unwrap().0
}

fn with_commas(number: usize) -> String {
    if number < 1000 {
        return number.to_string();
    }
    format!("{},{:03}", number / 1000, number % 1000)
}

#[test]
fn the_annotated_hexdump_is_the_example_image() {
    let page = page();
    let mut bytes = Vec::new();
    for line in block(&page, "hexdump").lines() {
        let (offset, rest) = line.split_once("  ").unwrap();
        assert_eq!(
            usize::from_str_radix(offset, 16).unwrap(),
            bytes.len(),
            "offset of `{line}`"
        );
        let hex = rest.split("  ").next().unwrap();
        bytes.extend(hex.split(' ').map(|byte| u8::from_str_radix(byte, 16).unwrap()));
    }
    assert_eq!(bytes, vectors::image_packet(&vectors::example(), 0));
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("vectors/image_minor_1.bin");
    assert_eq!(bytes, fs::read(file).unwrap());
}

#[test]
fn the_hello_shown_is_one_that_is_sent() {
    assert_eq!(
        Hello::parse(block(&page(), "json").as_bytes()).unwrap(),
        Hello {
            subscription: Some(Subscription::default()),
            ..vectors::hello()
        }
    );
}

#[test]
fn every_error_flag_and_fault_is_explained() {
    let page = page();
    for vector in vectors::all() {
        if let Err(error) = taxel_wire::decode_packet(&vector.packet) {
            assert!(
                page.contains(&format!("`{}`: ", error.name())),
                "{}",
                error.name()
            );
        }
    }
    for (name, flag) in [
        ("MISSING", Flags::MISSING),
        ("FAULTY", Flags::FAULTY),
        ("CALIBRATING", Flags::CALIBRATING),
        ("REPAIRED", Flags::REPAIRED),
        ("GAP", Flags::GAP),
        ("SATURATED", Flags::SATURATED),
        ("MORE", Flags::MORE),
    ] {
        assert!(page.contains(&format!("| 0x{:04x} | {name} |", flag.0)), "{name}");
    }
    for kind in (0..32).map(Kind::from_number) {
        let Kind::Other(_) = kind else {
            let row = format!("| {} | {} |", kind.number(), format!("{kind:?}").to_uppercase());
            assert!(page.contains(&row), "{row}");
            continue;
        };
    }
    for fault in Fault::ALL {
        let row = format!("| {} | {}:", (fault as u16).trailing_zeros(), fault.name());
        assert!(page.contains(&row), "{row}");
    }
}

#[test]
fn the_sizes_are_those_of_the_encoder() {
    let page = page();
    for (what, bytes) in [
        ("bytes**, header included", MAX_MESSAGE),
        ("bytes |", TEXT_PART + HEADER_LEN),
        (
            "(16x16, 8 levels",
            HEADER_LEN + image_payload_len(16, 16, 8, 16, 16),
        ),
        (
            "(128x128,",
            HEADER_LEN + image_payload_len(128, 128, 255, 1024, 27),
        ),
        ("(240 taxels", HEADER_LEN + raw_payload_len(240, 16)),
        ("(16,000 taxels", HEADER_LEN + raw_payload_len(16_000, 27)),
    ] {
        let text = format!("{} {what}", with_commas(bytes));
        assert!(page.contains(&text), "docs/wire.md does not say `{text}`");
    }
    assert!(page.contains(&format!("at most {} bytes", with_commas(MAX_SUBSCRIBE))));
    assert!(page.contains(&format!("a text of 1 to {MAX_MARK} bytes")));
}
