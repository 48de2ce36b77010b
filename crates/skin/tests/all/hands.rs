//! Hands that are not sixteen by sixteen, through decoder and sweep assembly, up to a thousand modules.

use std::collections::{HashMap, HashSet};
use taxel_can::CanFrame;
use taxel_hand::{Fault, ForceFrame, Freshness, TactileFrame};
use taxel_recordings::schunk_grasps;
use taxel_skin::{
    ConditionConfig, Conditioner, Decoded, Decoder, Layout, Protocol, Readings, SweepAssembler, SweepConfig,
    cyskin_frames, icub_triangle_data,
};

/// Every frame of one sweep of a hand, by bus, in which taxel `n` has the value `value(n)` (z; 12
/// bits for the iCub).
fn sweep_of(layout: &Layout, value: impl Fn(usize) -> u16) -> Vec<(u8, CanFrame)> {
    let mut frames = Vec::new();
    let mut triangles: HashMap<(u16, u8), [u8; 12]> = HashMap::new();
    for (n, taxel) in layout.taxels.iter().enumerate() {
        let (module, k) = (layout.wiring_of(n), layout.k[n]);
        match module.protocol.name() {
            "icub-mtb3" | "icub-mtb4" => {
                let pads = triangles.entry((taxel.module, k as u8 / 12)).or_insert([245; 12]);
                pads[k as usize % 12] = (value(n) >> 4) as u8;
            }
            "cyskin" => {
                let setup = layout.cyskin.as_ref().unwrap();
                let [high, low] = value(n).to_be_bytes();
                let address = setup.hubs[module.hub.unwrap() as usize].address;
                let packet =
                    cyskin_frames(setup, address, 0x43, &[module.board, k as u8, high, low]).unwrap();
                frames.extend(packet.into_iter().map(|frame| (module.bus, frame)));
            }
            _ => {
                let counts = [0x8000, 0x8000, value(n)];
                frames.push((
                    module.bus,
                    module.protocol.frame(module.board, k, counts, 0x82).unwrap(),
                ));
            }
        }
    }
    let mut triangles: Vec<_> = triangles.into_iter().collect();
    triangles.sort();
    for ((m, triangle), pads) in triangles {
        let module = &layout.wiring[m as usize];
        let id = 0x400 | u16::from(module.board) << 4 | u16::from(triangle);
        for data in icub_triangle_data(pads, 0, 0) {
            frames.push((module.bus, CanFrame::standard(id, &data).unwrap()));
        }
    }
    frames
}

/// Three sweeps through the whole path; every taxel must be there with its own value.
fn comes_through(layout: &Layout) {
    let config = SweepConfig {
        settle_ms: 0.0,
        ..SweepConfig::default()
    };
    let mut decoders: Vec<Decoder> = (0..layout.buses.len())
        .map(|bus| Decoder::new(layout, bus as u8))
        .collect();
    let mut sweep = SweepAssembler::new(layout, &config, true);
    let mut tactile = TactileFrame::new(layout.len());
    let mut readings = Readings::new();
    for round in 0..3u64 {
        let value = |n: usize| (n as u16).wrapping_mul(977).wrapping_add(round as u16) % 4000 + 16;
        let t_ns = 1_000_000_000 + round * 50_000_000;
        let mut seen = HashSet::new();
        for (bus, frame) in sweep_of(layout, value) {
            let decoded = decoders[bus as usize].decode_at(t_ns, &frame, &mut readings);
            assert_eq!(decoded, Decoded::Readings, "{frame}");
            for reading in readings.iter() {
                assert!(seen.insert(reading.taxel), "taxel {} came once", reading.taxel);
                sweep.push(reading, t_ns);
            }
        }
        assert_eq!(seen.len(), layout.len(), "{}", layout.name);
        assert!(sweep.is_complete());
        sweep.take(t_ns + 1_000_000, &mut tactile);
        for n in 0..layout.len() {
            assert_eq!(tactile.freshness[n], Freshness::Fresh);
            let expected = if layout.wiring_of(n).icub.is_some() {
                value(n) & !15 | 8
            } else {
                value(n)
            };
            assert_eq!(tactile.counts[n][2], expected, "taxel {n} of {}", layout.name);
        }
    }
}

#[test]
fn every_built_in_hand_with_boards_comes_through() {
    for name in Layout::builtin_names() {
        let layout = Layout::builtin(name).unwrap();
        if ["cpm-finger", "schunk-sdh", "cyskin-triangle", "tekscan-6077"].contains(&name) {
            continue;
        }
        comes_through(&layout);
    }
    comes_through(&crate::support::cyskin(crate::support::CYSKIN, 40));
}

#[test]
fn a_thousand_modules_of_four_protocols_come_through() {
    let mut text = String::from("name = \"big\"\nimage = { width = 1000, height = 400 }\n");
    let buses: Vec<String> = (0..100).map(|i| format!("\"can{i}\"")).collect();
    text += &format!(
        "buses = [{}]\n[cyskin]\n{}",
        buses.join(", "),
        crate::support::CYSKIN
    );
    for hub in 0..4 {
        text += &format!(
            "[[cyskin.hub]]\nname = \"hub{hub}\"\nbus = \"can{}\"\naddress = {}\n",
            96 + hub,
            1000 + hub
        );
    }
    let mut count = 0;
    let mut add = |bus: usize, board: usize, protocol: &str, more: &str| {
        let [x, y] = [count % 80 * 12, count / 80 * 17];
        text += &format!(
            "[[module]]\nname = \"m{count}\"\npart = \"p{bus}\"\nbus = \"can{bus}\"\nboard = {board}\n\
             protocol = \"{protocol}\"\nat = [{x}, {y}]\n{more}\n"
        );
        count += 1;
    };
    let pads: Vec<String> = (0..16).map(crate::support::icub_triangle).collect();
    let icub = format!("order = [{}]", pads.join(", "));
    for bus in 0..48 {
        (0..8).for_each(|board| add(bus, board, "uskin-l2", ""));
    }
    for bus in 48..66 {
        (1..15).for_each(|board| add(bus, board, "icub-mtb4", &icub));
    }
    for bus in 66..76 {
        (0..16).for_each(|board| add(bus, board, "uskin-l3", "order = [[0, 1, 2], [16, 17, 18]]"));
    }
    for bus in 96..100 {
        let hub = format!("hub = \"hub{}\"\norder = [[1, 2, 3, 4, 5, 6, 7]]", bus - 96);
        (0..51).for_each(|board| add(bus, board, "cyskin", &hub));
    }
    assert_eq!(count, 1000);
    let layout = Layout::parse(&text, "big.toml").unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(layout.modules.len(), 1000);
    assert_eq!(layout.len(), 384 * 16 + 252 * 160 + 160 * 6 + 204 * 7);
    comes_through(&layout);
}

#[test]
fn more_taxels_than_can_be_numbered_are_refused() {
    let pads: Vec<String> = (0..16).map(crate::support::icub_triangle).collect();
    let buses: Vec<String> = (0..32).map(|i| format!("\"can{i}\"")).collect();
    let mut big = format!(
        "name = \"b\"\nimage = {{ width = 1000, height = 1000 }}\nbuses = [{}]\n",
        buses.join(", ")
    );
    for n in 0..448 {
        big += &format!(
            "[[module]]\nname = \"m{n}\"\npart = \"p\"\nbus = \"can{}\"\nboard = {}\nprotocol = \"icub-mtb3\"\nat = [{}, {}]\norder = [{}]\n",
            n / 14,
            n % 14 + 1,
            n % 100 * 10,
            n / 100 * 16,
            pads.join(", ")
        );
    }
    let error = Layout::parse(&big, "big.toml").unwrap_err().to_string();
    assert!(
        error.contains("module \"m409\" the layout has 65600 taxels, more than 65535"),
        "{error}"
    );
}

#[test]
fn the_hands_have_the_taxels_their_makers_say() {
    let hands = [
        ("allegro-uskin-15", 15, 240, 2),
        ("allegro-xela-18", 18, 11 * 16 + 4 * 24 + 3 * 24, 5),
        ("cpm-finger", 1, 16, 1),
        ("cyskin-triangle", 1, 7, 0),
        ("icub-forearm", 1, 80, 1),
        ("schunk-sdh", 6, 486, 0),
        ("tekscan-6077", 1, 1400, 1),
        ("uskin-fingertip", 2, 24, 1),
        ("uskin-module", 1, 16, 1),
    ];
    assert_eq!(Layout::builtin_names().collect::<Vec<_>>(), hands.map(|h| h.0));
    for (name, modules, taxels, buses) in hands {
        let layout = Layout::builtin(name).unwrap();
        assert_eq!(
            (layout.modules.len(), layout.len(), layout.buses.len()),
            (modules, taxels, buses),
            "{name}"
        );
    }
    // Two frames per triangle; 83 Hz of the busiest XELA bus stay below what a bus carries.
    assert_eq!(Layout::builtin("icub-forearm").unwrap().frames_per_sweep(0), 16);
    let xela = Layout::builtin("allegro-xela-18").unwrap();
    assert!((0..5).all(|bus| xela.frames_per_sweep(bus) * 83 < 7_400));
}

#[test]
fn a_4x6_module_has_the_ids_of_the_manual() {
    let xela = Layout::builtin("allegro-xela-18").unwrap();
    let tip = &xela.modules[0];
    let ids: Vec<u16> = (0..tip.taxels)
        .map(|i| xela.can_id((tip.first_taxel + i) as usize).unwrap())
        .collect();
    let manual: Vec<u16> = (0..4)
        .flat_map(|sda| (0..6).map(move |taxel| sda << 8 | taxel << 4 | 1))
        .collect();
    assert_eq!(
        ids, manual,
        "controller 1: 0x001 to 0x051, 0x101 to 0x151, ... 0x301 to 0x351"
    );
}

#[test]
fn the_template_in_the_cyskin_file_is_a_layout_once_it_is_filled_in() {
    let text = Layout::builtin_text("cyskin-triangle").unwrap();
    let mut filled = String::new();
    let mut skip = false;
    for line in text.lines() {
        skip |= line == "order = [";
        if !skip && line != "protocol = \"offline\"" {
            filled += line.strip_prefix("#!").unwrap_or(line);
            filled.push('\n');
        }
        skip &= line != "]";
    }
    let layout = Layout::parse(&filled, "filled.toml").unwrap_or_else(|e| panic!("{e}\n{filled}"));
    assert_eq!(layout.wiring[0].protocol, Protocol::CYSKIN);
    comes_through(&layout);
    let error = Layout::parse(&filled.replace("address =", "#"), "filled.toml")
        .unwrap_err()
        .to_string();
    assert!(error.contains("lacks its address"), "{error}");
}

#[test]
fn the_cells_of_a_schunk_hand_that_are_always_0_are_the_corners_of_its_tips() {
    let layout = Layout::builtin("schunk-sdh").unwrap();
    let Some(grasps) = schunk_grasps() else { return };
    let mut most = vec![0; 486];
    for (_, grasp) in &grasps {
        for row in grasp.rows() {
            most.iter_mut().zip(row).for_each(|(m, v)| *m = (*m).max(*v));
        }
    }
    let void: HashSet<(u16, u16)> = (0..486)
        .filter(|n| most[*n] == 0)
        .map(|n| (layout.taxels[n].x, layout.taxels[n].y))
        .collect();
    let corners: HashSet<(u16, u16)> = (0..3)
        .flat_map(|finger| (0..5).flat_map(move |y| [(6 * finger, y), (6 * finger + 5, y)]))
        .collect();
    assert_eq!(void, corners);
}

#[test]
fn a_recorded_schunk_grasp_is_conditioned_with_its_void_cells_dead_and_the_rest_alive() {
    let layout = Layout::builtin("schunk-sdh").unwrap();
    let Some(grasps) = schunk_grasps() else { return };
    let (name, grasp) = &grasps[0];
    let mut conditioner = Conditioner::for_layout(&layout, ConditionConfig::robust()).unwrap();
    let (mut tactile, mut force) = (TactileFrame::new(486), ForceFrame::new(486));
    tactile.freshness.fill(Freshness::Fresh);
    tactile.age_ns.fill(0);
    let mut most_contacts = 0;
    for (i, row) in grasp.rows().into_iter().enumerate() {
        tactile.t_ns = i as u64 * 66_000_000;
        tactile
            .counts
            .iter_mut()
            .zip(row)
            .for_each(|(counts, v)| *counts = [0, 0, *v]);
        conditioner.process(&tactile, &mut force);
        most_contacts = most_contacts.max(force.contacts());
    }
    let dead = force.faults.iter().filter(|f| f.contains(Fault::Dead)).count();
    assert_eq!(dead, 30, "{name}");
    assert!(most_contacts > 3, "{name}: the object is felt");
}
