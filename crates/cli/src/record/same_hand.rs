//! Whether a configuration is that of the running daemon: a recording tells by it whose hand it is, and reads the
//! buses that it names.

use anyhow::bail;
use std::path::Path;
use std::time::{Duration, Instant};
use taxel_can::SourceAddress;
use taxel_playback::head::is_of;
use taxel_wire::status::Status;
use taxel_wire::{Hello, Received, Subscribe, Subscriber};
use taxeld::Config;

/// How long a daemon has to describe its hand.
const PATIENCE: Duration = Duration::from_secs(5);

/// Buses by name, each with the address that frames can be read from besides the daemon; none where that cannot be
/// done.
type Buses = Vec<(String, Option<SourceAddress>)>;

/// The description of the hand that the daemon with this image socket reads; none where none answers.
pub(super) fn hello(socket: &Path) -> Option<Hello> {
    let mut subscriber = Subscriber::connect(socket).ok()?;
    let nothing = Subscribe {
        image: false,
        ..Subscribe::default()
    };
    subscriber.subscribe(&nothing).ok()?;
    let until = Instant::now() + PATIENCE;
    while subscriber.hello().is_none() {
        let left = until.checked_duration_since(Instant::now())?;
        if let Some(Received::Hello(hello)) = subscriber.next_timeout(left).ok()? {
            return Some(hello.clone());
        }
    }
    subscriber.hello().cloned()
}

/// Refuses the configuration in `file` where the daemon reads another hand than it names.
pub(super) fn check(config: &Config, file: &Path, hello: &Hello) -> anyhow::Result<()> {
    let (name, reads) = (&config.layout.name, &hello.layout);
    match (is_of(hello, &config.layout), name == reads) {
        (true, _) => Ok(()),
        (false, false) => refuse(file, &format!("layout {name}"), &format!("layout {reads}")),
        (false, true) => refuse(
            file,
            &format!("layout {name}"),
            "one of that name with other modules or places",
        ),
    }
}

/// Refuses it where the daemon reads other buses.
pub(super) fn check_buses(config: &Config, file: &Path, status: &Status) -> anyhow::Result<()> {
    match configured(config) == read(status) {
        true => Ok(()),
        false => refuse(file, &words(&configured(config)), &words(&read(status))),
    }
}

fn refuse(file: &Path, says: &str, reads: &str) -> anyhow::Result<()> {
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
    use taxel_hand::Profile;
    use taxel_skin::Layout;
    use taxel_wire::status::BusStatus;
    use taxel_wire::{Clock, HelloRate};

    #[test]
    fn a_configuration_of_another_hand_or_of_other_buses_is_refused_by_what_differs() {
        let config = |sources: [&str; 2]| {
            let sources = sources.map(|source| source.parse().unwrap()).to_vec();
            Config::new(Layout::builtin("allegro-uskin-15").unwrap(), sources)
        };
        let status = |sources: [&str; 2]| Status {
            buses: (["can0", "can1"].iter().zip(sources))
                .map(|(name, source)| BusStatus {
                    name: (*name).into(),
                    source: source.into(),
                    ..BusStatus::default()
                })
                .collect(),
            ..Status::default()
        };
        let hello = |layout: &Layout| {
            let (mode, hz) = ("timer".into(), None);
            let rate = HelloRate { mode, hz };
            Hello::new(
                "taxeld",
                &layout.geometry,
                &Profile::default(),
                rate,
                Clock::Monotonic,
            )
        };
        let file = Path::new("hand.toml");
        let is_refused = |checked: anyhow::Result<()>, parts: [&str; 2]| {
            let said = checked.unwrap_err().to_string();
            assert!(said.starts_with("hand.toml is not the configuration"), "{said}");
            assert!(parts.iter().all(|part| said.contains(part)), "{said}");
        };
        let live = ["udp:239.74.163.2:43113", "can:can1"];
        // The shortest form of an address is that address, and what is no bus is compared by that alone.
        let same = ["udp:", "can:can1"];
        check_buses(&config(same), file, &status(live)).unwrap();
        check_buses(&config(["sim:tap"; 2]), file, &status(["log:a.log"; 2])).unwrap();
        is_refused(
            check_buses(&config(["udp:", "can:can7"]), file, &status(live)),
            ["can1 from can:can7", "can1 from can:can1"],
        );
        is_refused(
            check_buses(&config(["sim:tap"; 2]), file, &status(live)),
            [
                "can0 from neither can: nor udp:",
                "can0 from udp:239.74.163.2:43113",
            ],
        );
        let hand = Layout::builtin("allegro-uskin-15").unwrap();
        check(&config(same), file, &hello(&hand)).unwrap();
        is_refused(
            check(
                &config(same),
                file,
                &hello(&Layout::builtin("uskin-module").unwrap()),
            ),
            ["says layout allegro-uskin-15", "reads layout uskin-module"],
        );
        // The name alone makes no hand.
        let moved = |change: fn(&mut Hello)| {
            let mut moved = hello(&hand);
            change(&mut moved);
            moved
        };
        for moved in [
            moved(|hello| hello.taxels.swap(0, 1)),
            moved(|hello| hello.taxels[7].position_mm = Some([0.0, 0.0, 1.5])),
            moved(|hello| hello.modules[2].joint = Some("thumb".into())),
        ] {
            is_refused(
                check(&config(same), file, &moved),
                [
                    "says layout allegro-uskin-15",
                    "reads one of that name with other modules or places",
                ],
            );
        }
    }
}
