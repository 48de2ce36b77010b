//! Whether a configuration is that of the running daemon: a recording tells by it whose hand it is, and reads the
//! buses that it names.

use anyhow::bail;
use std::path::Path;
use taxel_can::SourceAddress;
use taxel_wire::status::Status;
use taxeld::Config;

/// Buses by name, each with the address that frames can be read from besides the daemon; none where that cannot be
/// done.
type Buses = Vec<(String, Option<SourceAddress>)>;

/// Refuses the configuration in `file` where the daemon reads another hand than it names; other buses too, where
/// `with_buses`.
pub(super) fn check(config: &Config, file: &Path, status: &Status, with_buses: bool) -> anyhow::Result<()> {
    let name = &config.layout.name;
    let differ = match (*name == status.layout, with_buses) {
        (false, _) => [format!("layout {name}"), format!("layout {}", status.layout)],
        (true, true) if configured(config) != read(status) => {
            [words(&configured(config)), words(&read(status))]
        }
        _ => return Ok(()),
    };
    let [says, reads] = differ;
    bail!(
        "{} is not the configuration of the daemon that runs: it says {says}, and the daemon reads {reads}; name the \
         file that the daemon was started with, or leave --config out",
        file.display()
    )
}

/// The address, where it is of a bus that several may read.
pub(super) fn bus(address: SourceAddress) -> Option<SourceAddress> {
    let is_bus = matches!(address, SourceAddress::Can { .. } | SourceAddress::Udp { .. });
    is_bus.then_some(address)
}

fn configured(config: &Config) -> Buses {
    let sources = config.sources.iter().cloned().map(bus);
    config.layout.buses.iter().cloned().zip(sources).collect()
}

fn read(status: &Status) -> Buses {
    let of =
        |bus: &taxel_wire::status::BusStatus| (bus.name.clone(), bus.source.parse().ok().and_then(self::bus));
    status.buses.iter().map(of).collect()
}

fn words(buses: &Buses) -> String {
    let of = |(name, address): &(String, Option<SourceAddress>)| match address {
        Some(address) => format!("{name} from {address}"),
        None => format!("{name} from neither can: nor udp:"),
    };
    let words: Vec<String> = buses.iter().map(of).collect();
    words.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_skin::Layout;
    use taxel_wire::status::BusStatus;

    #[test]
    fn a_configuration_of_another_hand_or_of_other_buses_is_refused_by_what_differs() {
        let config = |sources: [&str; 2]| {
            let sources = sources.map(|source| source.parse().unwrap()).to_vec();
            Config::new(Layout::builtin("allegro-uskin-15").unwrap(), sources)
        };
        let status = |layout: &str, sources: [&str; 2]| Status {
            layout: layout.into(),
            buses: (["can0", "can1"].iter().zip(sources))
                .map(|(name, source)| BusStatus {
                    name: (*name).into(),
                    source: source.into(),
                    ..BusStatus::default()
                })
                .collect(),
            ..Status::default()
        };
        let (hand, live) = ("allegro-uskin-15", ["udp:239.74.163.2:43113", "can:can1"]);
        let refused = |sources, status: &Status, with_buses| {
            let checked = check(&config(sources), Path::new("hand.toml"), status, with_buses);
            checked.map_err(|error| error.to_string()).err()
        };
        // The shortest form of an address is that address, and what is no bus is compared by that alone.
        let same = ["udp:", "can:can1"];
        assert_eq!(refused(same, &status(hand, live), true), None);
        assert_eq!(
            refused(["sim:tap"; 2], &status(hand, ["log:a.log"; 2]), true),
            None
        );
        for (sources, status, with_buses, parts) in [
            (
                same,
                status("uskin-module", live),
                false,
                ["says layout allegro-uskin-15", "reads layout uskin-module"],
            ),
            (
                ["udp:", "can:can7"],
                status(hand, live),
                true,
                ["can1 from can:can7", "can1 from can:can1"],
            ),
            (
                ["sim:tap"; 2],
                status(hand, live),
                true,
                [
                    "can0 from neither can: nor udp:",
                    "can0 from udp:239.74.163.2:43113",
                ],
            ),
        ] {
            let said = refused(sources, &status, with_buses).unwrap();
            assert!(said.starts_with("hand.toml is not the configuration"), "{said}");
            assert!(parts.iter().all(|part| said.contains(part)), "{said}");
        }
        // Other buses matter only where they are read.
        assert_eq!(refused(["sim:tap"; 2], &status(hand, live), false), None);
    }
}
