//! CySkin hubs from their traffic: what is not public of their packets is found in them.

use super::comes_back;
use taxel_can::Received;
use taxel_skin::{Layout, Recogniser, cyskin_frames};

#[test]
fn cyskin_hubs_come_back_with_what_is_not_public_about_them() {
    for (checksum, above) in [
        ("sum", 5),
        ("xor", 0),
        ("crc8", 255),
        ("inverted-sum", 5),
        ("sum-to-zero", 8),
    ] {
        let parameters = format!(
            "ids = \"extended\"\nbyte_order = \"big\"\nchecksum = \"{checksum}\"\nsequence_bytes_above = {above}\nsensors_per_module = 12\n"
        );
        comes_back(&crate::support::cyskin(&parameters, 5));
    }
}

#[test]
fn the_parameters_of_long_cyskin_packets_are_found() {
    for (order, above, sensors) in [("big", 0, 8), ("little", 255, 7), ("little", 12, 12)] {
        let parameters = format!(
            "ids = \"extended\"\nbyte_order = \"{order}\"\nchecksum = \"xor\"\nsequence_bytes_above = {above}\nsensors_per_module = {sensors}\n"
        );
        let layout = crate::support::cyskin(&parameters, 4);
        let setup = layout.cyskin.as_ref().unwrap();
        let mut recogniser = Recogniser::new(1);
        for round in 0..20u64 {
            // Four modules, in packets of ten and of five values.
            let (mut place, all) = (0usize, 4 * sensors);
            while place < all {
                let count = if (place + round as usize).is_multiple_of(2) {
                    10
                } else {
                    5
                }
                .min(all - place);
                let mut data = vec![(place / sensors) as u8, (place % sensors) as u8];
                for n in place..place + count {
                    let value = 9_000 + 300 * n as u16 + (round % 3) as u16;
                    let bytes = if order == "big" {
                        value.to_be_bytes()
                    } else {
                        value.to_le_bytes()
                    };
                    data.extend(bytes);
                }
                for frame in cyskin_frames(setup, 0x123, 0x43, &data).unwrap() {
                    let t_ns = round * 50_000_000;
                    recogniser.handle_frame(0, &Received { t_ns, frame });
                }
                place += count;
            }
        }
        let found = recogniser.finish();
        let guess = found.cyskin.expect("packets of values");
        assert_eq!(usize::from(guess.sensors_per_module), sensors, "{parameters}");
        assert_eq!(format!("{:?}", guess.byte_order).to_lowercase(), order);
        let modules = &found.buses[0].boards;
        assert_eq!(modules.len(), 4);
        assert_eq!(
            modules[0].taxels.len(),
            sensors - 1,
            "sensor 0 is the temperature"
        );
        let text = found.layout_file("c", &["can0"]).unwrap();
        Layout::parse(&text, "c.toml").unwrap_or_else(|e| panic!("{e}\n{text}"));
    }
}

#[test]
fn cyskin_modules_that_are_not_there_make_no_smaller_modules() {
    let parameters = "ids = \"standard\"\nbyte_order = \"big\"\nchecksum = \"crc8-ff\"\nsequence_bytes_above = 255\nsensors_per_module = 12\n";
    let layout = crate::support::cyskin(parameters, 4);
    let setup = layout.cyskin.as_ref().unwrap();
    for (modules, is_sure) in [
        (&[0, 1, 2][..], true),
        (&[0, 2], false),
        (&[0, 3], false),
        (&[0, 4], false),
        (&[1, 3, 5], false),
    ] {
        let mut recogniser = Recogniser::new(1);
        for round in 0..20u64 {
            for module in modules {
                let values = (0..12u16).flat_map(|n| (9_000 + 300 * n + (round % 3) as u16).to_be_bytes());
                let data: Vec<u8> = [*module, 0].into_iter().chain(values).collect();
                for frame in cyskin_frames(setup, 0x23, 0x43, &data).unwrap() {
                    let t_ns = round * 50_000_000;
                    recogniser.handle_frame(0, &Received { t_ns, frame });
                }
            }
        }
        let found = recogniser.finish();
        assert_eq!(found.cyskin.expect("packets of values").sensors_per_module, 12);
        let boards = &found.buses[0].boards;
        assert_eq!(
            boards.iter().map(|board| board.board).collect::<Vec<_>>(),
            modules
        );
        assert!(boards.iter().all(|board| board.taxels.len() == 11));
        let text = found.layout_file("c", &["can0"]).unwrap();
        assert_eq!(
            !text.contains("sensors_per_module = 12 is a guess"),
            is_sure,
            "{modules:?}: {text}"
        );
    }
}
