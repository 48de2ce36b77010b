//! CySkin hubs and the published finger: what is on the bus is what the decoders make of it.

use crate::support::{Bench, scene};
use proptest::prelude::*;
use taxel_skin::{Decoded, Decoder, Layout, Readings, cyskin_frames};

const CYSKIN: &str = "ids = \"extended\"\nbyte_order = \"big\"\nchecksum = \"sum\"\nsequence_bytes_above = 5\nsensors_per_module = 12\n";
const START: &str = "start = [{ command = 0x38, data = [50] }, { command = 0x37, data = [1] }]\n\
                     stop = [{ command = 0x37, data = [0] }]\n";

/// Modules with these numbers and sensors 1 to 7 on hub 0x123, or 0x23 where ids are standard.
fn hub(parameters: &str, numbers: &[u32]) -> Layout {
    let address = if parameters.contains("\"extended\"") {
        0x123
    } else {
        0x23
    };
    let mut text = format!(
        "name = \"cy\"\nimage = {{ width = 7, height = 300 }}\nbuses = [\"can0\"]\n[cyskin]\n{parameters}\n\
         [[cyskin.hub]]\nname = \"a\"\nbus = \"can0\"\naddress = {address:#x}\n"
    );
    for (row, m) in numbers.iter().enumerate() {
        text += &format!(
            "[[module]]\nname = \"m{m}\"\npart = \"a\"\nbus = \"can0\"\nhub = \"a\"\nboard = {m}\n\
             protocol = \"cyskin\"\nat = [0, {row}]\norder = [[1, 2, 3, 4, 5, 6, 7]]\n"
        );
    }
    Layout::parse(&text, "cy.toml").unwrap_or_else(|e| panic!("{e}"))
}

/// Sends a packet to all hubs.
fn tell(bench: &mut Bench, layout: &Layout, ms: u64, command: u8, data: &[u8]) {
    let setup = layout.cyskin.as_ref().unwrap();
    for frame in cyskin_frames(setup, setup.ids.everybody(), command, data).unwrap() {
        bench.sim.command(0, &frame, ms * 1_000_000).unwrap();
    }
}

/// How often each taxel came, after checking that every frame was understood and every value is a
/// healthy idle one.
fn taxels_in(layout: &Layout, frames: &[taxel_can::Received]) -> Vec<u32> {
    let mut decoder = Decoder::new(layout, 0);
    let mut readings = Readings::new();
    let mut seen = vec![0; layout.len()];
    for received in frames {
        let decoded = decoder.decode_at(received.t_ns, &received.frame, &mut readings);
        assert!(
            matches!(decoded, Decoded::Readings | Decoded::Partial),
            "{decoded:?}: {}",
            received.frame
        );
        for reading in readings.iter() {
            assert_eq!(reading.status, 0, "{reading:?}");
            assert!((19_900..26_100).contains(&reading.counts[2]), "{reading:?}");
            seen[usize::from(reading.taxel)] += 1;
        }
    }
    assert_eq!(decoder.counters().abandoned, 0);
    seen
}

#[test]
fn a_hub_waits_for_its_start_packets_in_order_and_obeys_its_stop() {
    let layout = hub(&format!("{CYSKIN}{START}"), &[0, 1, 2]);
    let mut bench = Bench::new(&scene(10, ""), &layout);
    tell(&mut bench, &layout, 0, 0x37, &[1]);
    tell(&mut bench, &layout, 100, 0x38, &[50]);
    assert_eq!(bench.until_ms(1000).len(), 0, "the wrong way round");
    tell(&mut bench, &layout, 1000, 0x38, &[50]);
    tell(&mut bench, &layout, 1010, 0x37, &[1]);
    let seen = taxels_in(&layout, bench.until_ms(2020));
    assert!(seen.iter().all(|n| (20..=21).contains(n)), "{seen:?}");
    tell(&mut bench, &layout, 2020, 0x37, &[0]);
    bench.until_ms(2100);
    assert_eq!(bench.until_ms(3000).len(), 0, "stopped");
    // The period is one byte of milliseconds.
    let faster = hub(&format!("{CYSKIN}{}", START.replace("[50]", "[20]")), &[0]);
    let mut bench = Bench::new(&scene(10, ""), &faster);
    tell(&mut bench, &faster, 0, 0x38, &[20]);
    tell(&mut bench, &faster, 10, 0x37, &[1]);
    let seen = taxels_in(&faster, bench.until_ms(1000));
    assert!(seen.iter().all(|n| (48..=50).contains(n)), "{seen:?}");
}

#[test]
fn a_hub_is_started_and_stopped_as_genoa_s_library_does_with_any_period() {
    let layout = hub("", &[0, 1, 2, 7]);
    for (period, times) in [([0, 20], 48..=50), ([1, 0], 3..=4)] {
        let mut bench = Bench::new(&scene(10, ""), &layout);
        tell(&mut bench, &layout, 0, 0x38, &period);
        assert_eq!(bench.until_ms(5).len(), 0, "a period alone starts nothing");
        tell(&mut bench, &layout, 10, 0x37, &[1]);
        let frames = bench.until_ms(1000).to_vec();
        assert!(
            frames
                .iter()
                .all(|f| f.frame.standard_id().is_some_and(|id| id & 0xFF == 0x23))
        );
        let longest = frames
            .iter()
            .filter(|f| f.frame.id() & 0x100 != 0)
            .map(|f| f.frame.data()[1])
            .max();
        assert_eq!(
            longest,
            Some(26),
            "a module a packet: the library was seen to take 40 data bytes"
        );
        let seen = taxels_in(&layout, &frames);
        assert!(seen.iter().all(|n| times.contains(n)), "{period:?}: {seen:?}");
        tell(&mut bench, &layout, 1000, 0x37, &[0]);
        bench.until_ms(1100);
        assert_eq!(bench.until_ms(2000).len(), 0, "stopped");
    }
    // A packet with another checksum is none.
    let mut bench = Bench::new(&scene(10, ""), &layout);
    for data in [[0x38, 2, 0, 20, 0x51], [0x37, 1, 1, 0xE5, 0]] {
        let frame = taxel_can::CanFrame::standard(0x5FF, &data[..data.len()]).unwrap();
        bench.sim.command(0, &frame, 0).unwrap();
    }
    assert_eq!(bench.until_ms(500).len(), 0);
}

#[test]
fn a_hub_without_start_packets_sends_from_power_up_on() {
    let layout = hub(CYSKIN, &[0, 1, 2]);
    let mut bench = Bench::new(&scene(10, ""), &layout);
    let seen = taxels_in(&layout, bench.until_ms(1000));
    assert!(seen.iter().all(|n| (19..=20).contains(n)), "{seen:?}");
}

#[test]
fn a_module_without_power_is_left_out_and_a_hub_without_any_has_to_be_started_again() {
    let layout = hub(&format!("{CYSKIN}{START}"), &[0, 1, 2]);
    let silent = |on: &str| format!("[[fault]]\nkind = \"silent\"\non = {on}\nfrom = 1.0\nto = 2.0\n");
    for (on, first, during, after) in [
        ("[\"m1\"]", [20, 0, 20], true, true),
        ("[\"all\"]", [0, 0, 0], false, false),
    ] {
        let mut bench = Bench::streaming(&scene(10, &silent(on)), &layout);
        if !after {
            bench = Bench::new(&scene(10, &silent(on)), &layout);
            tell(&mut bench, &layout, 0, 0x38, &[50]);
            tell(&mut bench, &layout, 10, 0x37, &[1]);
        }
        bench.until_ms(1010);
        let frames = bench.until_ms(2000).to_vec();
        assert_eq!(!frames.is_empty(), during, "{on}");
        let seen = taxels_in(&layout, &frames);
        for (m, n) in first.into_iter().enumerate() {
            assert!(seen[7 * m].abs_diff(n) <= 1, "{on}: {seen:?}");
        }
        let frames = bench.until_ms(3000).to_vec();
        assert_eq!(!frames.is_empty(), after, "{on}");
    }
}

#[test]
fn a_hub_whose_checksum_is_not_known_cannot_be_simulated() {
    let layout = hub(&CYSKIN.replace("\"sum\"", "\"unchecked\""), &[0]);
    let error = scene(1, "").fits(&layout).unwrap_err().to_string();
    assert!(
        error.contains("hub `a`: with checksum = \"unchecked\" no packet"),
        "{error}"
    );
}

#[test]
fn the_finger_sends_five_frames_a_sweep_from_power_up_on() {
    let layout = Layout::builtin("cpm-finger").unwrap();
    let mut bench = Bench::new(&scene(2, ""), &layout);
    let frames = bench.until_ms(1000).to_vec();
    assert!((245..=250).contains(&frames.len()), "{}", frames.len());
    let ids: Vec<u32> = frames[..5].iter().map(|f| f.frame.id()).collect();
    assert_eq!(ids, [0x405, 0x407, 0x409, 0x40B, 0x601]);
    let seen = taxels_in(&layout, &frames);
    assert!(seen.iter().all(|n| (49..=50).contains(n)), "{seen:?}");
}

#[test]
fn faults_of_values_are_what_these_boards_can_say() {
    let fault = |kind: &str| format!("[[fault]]\nkind = \"{kind}\"\non = [\"finger\"]\ntaxels = [5]\n");
    let layout = Layout::builtin("cpm-finger").unwrap();
    for (kind, value) in [("dead", 0xFFFF), ("not-connected", 0xFFFF), ("status", 0)] {
        let mut bench = Bench::new(&scene(2, &fault(kind)), &layout);
        let mut decoder = Decoder::new(&layout, 0);
        let mut readings = Readings::new();
        for received in bench.until_ms(100).to_vec() {
            decoder.decode(&received.frame, &mut readings);
            for reading in readings.iter().filter(|r| layout.k[usize::from(r.taxel)] == 5) {
                assert_eq!(reading.counts[2], value, "{kind}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Whatever the unpublished parameters are, the decoder understands the hub.
    #[test]
    fn any_setup_is_understood(
        order in prop::sample::select(vec!["big", "little"]),
        checksum in prop::sample::select(vec!["sum", "sum-to-zero", "inverted-sum", "xor", "crc8"]),
        numbered_above in prop::sample::select(vec![0u8, 5, 6, 30, 255]),
        sensors in 8u8..=12,
        numbers in prop::collection::btree_set(0u32..248, 1..12),
    ) {
        let parameters = format!(
            "ids = \"extended\"\nbyte_order = \"{order}\"\nchecksum = \"{checksum}\"\nsequence_bytes_above = {numbered_above}\n\
             sensors_per_module = {sensors}\n"
        );
        let numbers: Vec<u32> = numbers.into_iter().collect();
        let layout = hub(&parameters, &numbers);
        let mut bench = Bench::new(&scene(1, ""), &layout);
        let seen = taxels_in(&layout, bench.until_ms(500));
        prop_assert!(seen.iter().all(|n| (9..=10).contains(n)), "{seen:?}");
    }
}
