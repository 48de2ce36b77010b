//! Where frames are put: a bus, or a candump log.

use crate::output::output_file::{OutputFile, create_stream};
use anyhow::{Context, bail};
use std::collections::HashMap;
use std::fmt;
use std::fs::File;
use std::io::{BufWriter, LineWriter, Write};
use std::path::Path;
use std::str::FromStr;
use std::time::{Duration, Instant};
use taxel_can::{
    CanFrame, CanSource, LinkState, LogWriter, PressureSender, Received, SendError, SourceAddress,
    SourceOptions,
};
use taxel_hand::plural;
use taxel_skin::Layout;

/// How long a frame waits for a full transmit queue.
const PATIENCE: Duration = Duration::from_millis(200);
const RETRY: Duration = Duration::from_micros(200);
/// Frames taken from a bus at once.
const BATCH: usize = 256;

/// A target as it is written: a CAN source that can be sent to, `log:FILE`, or `-` for candump
/// lines on stdout.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum TargetAddress {
    /// A bus.
    Bus(SourceAddress),
    /// A candump log.
    Log(std::path::PathBuf),
    /// Candump lines on stdout.
    Stdout,
}

impl FromStr for TargetAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "-" {
            return Ok(Self::Stdout);
        }
        match text.parse::<SourceAddress>().map_err(|e| e.to_string())? {
            SourceAddress::Log {
                path,
                interface: None,
            } => Ok(Self::Log(path)),
            SourceAddress::Log { .. } => Err(format!(
                "{text}: a log is written with every interface; leave out ?interface"
            )),
            SourceAddress::Sim { .. } => Err(format!(
                "{text}: a scene takes no frames; write to can:, udp:, log: or -"
            )),
            address => Ok(Self::Bus(address)),
        }
    }
}

impl fmt::Display for TargetAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bus(address) => address.fmt(f),
            Self::Log(path) => write!(f, "log:{}", path.display()),
            Self::Stdout => f.write_str("-"),
        }
    }
}

/// An open target.
struct Target {
    address: TargetAddress,
    end: End,
    /// Frames put there.
    sent: u64,
    /// Frames that could not be put there, and why the first could not.
    failed: u64,
    failure: Option<SendError>,
}

enum End {
    Bus(Box<dyn CanSource>),
    Log(LogWriter<Box<dyn Write>>, Option<OutputFile>),
}

impl Target {
    /// Opens it. A bus that is absent or down is an error: nobody would hear.
    fn open(address: &TargetAddress) -> anyhow::Result<Self> {
        let end = match address {
            TargetAddress::Stdout => {
                let stdout = create_stream(Path::new("-")).context("stdout")?;
                End::Log(LogWriter::new(Box::new(LineWriter::new(stdout))), None)
            }
            TargetAddress::Log(path) => {
                let whole = OutputFile::begin(path)?;
                let file = File::create(whole.path()).with_context(|| path.display().to_string())?;
                End::Log(
                    LogWriter::new(Box::new(BufWriter::with_capacity(1 << 20, file))),
                    Some(whole),
                )
            }
            TargetAddress::Bus(SourceAddress::Pressure { path }) => {
                let sender = PressureSender::open(path).with_context(|| {
                    format!(
                        "nobody takes the frames of an array at {}; start taxeld first",
                        path.display()
                    )
                })?;
                End::Bus(Box::new(sender))
            }
            TargetAddress::Bus(address) => {
                let source = taxel_can::open(address, &SourceOptions::default())?;
                match (address, source.link()) {
                    (_, LinkState::Up) => {}
                    (SourceAddress::Can { interface }, LinkState::Down) => {
                        bail!("{address} is down; `ip link set {interface} up`")
                    }
                    (SourceAddress::Can { interface }, LinkState::Absent) => bail!(
                        "there is no interface {interface}; plug in the adapter, or make a virtual bus with \
                         `ip link add {interface} type vcan && ip link set {interface} up`"
                    ),
                    (_, link) => bail!("{address} is {link}"),
                }
                End::Bus(source)
            }
        };
        Ok(Self {
            address: address.clone(),
            end,
            sent: 0,
            failed: 0,
            failure: None,
        })
    }

    /// Puts a frame there. What a bus does not take is counted; a log that cannot be written is an error.
    fn send(&mut self, t_ns: u64, interface: &str, frame: &CanFrame) -> anyhow::Result<()> {
        match &mut self.end {
            End::Log(log, _) => {
                log.write(t_ns, interface, frame)
                    .with_context(|| self.address.to_string())?;
                self.sent += 1;
            }
            End::Bus(bus) => match send_patiently(bus.as_mut(), frame) {
                Ok(()) => self.sent += 1,
                Err(error) => {
                    self.failed += 1;
                    self.failure.get_or_insert(error);
                }
            },
        }
        Ok(())
    }

    /// The frames that others have put on the bus meanwhile.
    fn receive(&mut self, batch: &mut Vec<Received>) {
        if let End::Bus(bus) = &mut self.end {
            batch.reserve(BATCH);
            bus.receive(taxel_can::monotonic_ns(), batch);
        }
    }

    /// Writes what is buffered, and gives a log its name.
    fn finish(&mut self) -> anyhow::Result<()> {
        let End::Log(log, whole) = &mut self.end else {
            return Ok(());
        };
        log.flush().with_context(|| self.address.to_string())?;
        whole.as_mut().map_or(Ok(()), OutputFile::finish)
    }

    /// An error if any frame could not be sent.
    fn check(&self) -> anyhow::Result<()> {
        match &self.failure {
            Some(failure) => bail!(
                "{}: {} could not be sent: {failure}",
                self.address,
                plural(self.failed, "frame")
            ),
            None => Ok(()),
        }
    }
}

fn send_patiently(bus: &mut dyn CanSource, frame: &CanFrame) -> Result<(), SendError> {
    let deadline = Instant::now() + PATIENCE;
    loop {
        match bus.send(frame) {
            Err(SendError::QueueFull) if Instant::now() < deadline => std::thread::sleep(RETRY),
            result => return result,
        }
    }
}

/// The targets of several buses or recorded interfaces, each known by its name. Several may share one.
pub struct Targets {
    names: Vec<String>,
    of_name: Vec<usize>,
    targets: Vec<Target>,
}

impl Targets {
    /// Opens the target of each name; equal addresses are opened once.
    pub fn open(named: &[(String, TargetAddress)]) -> anyhow::Result<Self> {
        let mut addresses: Vec<&TargetAddress> = Vec::new();
        let mut of_name = Vec::new();
        for (_, address) in named {
            let known = addresses.iter().position(|a| *a == address);
            of_name.push(known.unwrap_or(addresses.len()));
            if known.is_none() {
                addresses.push(address);
            }
        }
        let targets = addresses
            .into_iter()
            .map(Target::open)
            .collect::<Result<_, _>>()?;
        Ok(Self {
            names: named.iter().map(|(name, _)| name.clone()).collect(),
            of_name,
            targets,
        })
    }

    /// Opens one target for whatever has a name.
    pub fn open_one(address: &TargetAddress) -> anyhow::Result<Self> {
        Ok(Self {
            names: Vec::new(),
            of_name: Vec::new(),
            targets: vec![Target::open(address)?],
        })
    }

    /// One more name, of the first target, unless it is known; its index is the number of those before it. Says that buses are
    /// joined where that is one.
    pub(crate) fn add_name(&mut self, name: &str) {
        if self.names.iter().any(|known| known == name) {
            return;
        }
        if let (Some(first), End::Bus(_)) = (self.names.first(), &self.targets[0].end) {
            let address = &self.targets[0].address;
            remark!(
                "taxel: {name} goes to {address} as {first} does, where their boards may share ids; \
                 --interface {name}=SOURCE sends it elsewhere"
            );
        }
        self.names.push(name.into());
        self.of_name.push(0);
    }

    /// Puts a frame where the name with this index goes.
    pub fn send(&mut self, name: usize, t_ns: u64, frame: &CanFrame) -> anyhow::Result<()> {
        self.targets[self.of_name[name]].send(t_ns, &self.names[name], frame)
    }

    /// The frames that others have put on the bus of this name meanwhile.
    pub fn receive(&mut self, name: usize, batch: &mut Vec<Received>) {
        self.targets[self.of_name[name]].receive(batch);
    }

    /// Whether nothing but logs is written, which need not be waited for.
    pub fn are_logs(&self) -> bool {
        self.targets.iter().all(|t| matches!(t.end, End::Log(..)))
    }

    /// Whether nothing but files is written.
    pub(crate) fn are_log_files(&self) -> bool {
        let mut addresses = self.targets.iter().map(|t| &t.address);
        addresses.all(|address| matches!(address, TargetAddress::Log(_)))
    }

    /// Frames put somewhere.
    pub fn sent(&self) -> u64 {
        self.targets.iter().map(|t| t.sent).sum()
    }

    /// Frames that could not be sent.
    pub fn failed(&self) -> u64 {
        self.targets.iter().map(|t| t.failed).sum()
    }

    /// Writes what is buffered and gives logs their names; without it there are none.
    pub fn finish(&mut self) -> anyhow::Result<()> {
        self.targets.iter_mut().try_for_each(Target::finish)
    }

    /// An error that says what is not written, where that is all there was to do: a log of half of a recording or
    /// scene is given up, what was heard of a bus until then is not.
    pub fn give_up_logs(&self) -> anyhow::Result<()> {
        let mut addresses = self.targets.iter().map(|t| &t.address);
        match addresses.find(|address| matches!(address, TargetAddress::Log(_))) {
            Some(TargetAddress::Log(path)) if self.are_logs() => {
                bail!("stopped; {} was not written", path.display())
            }
            _ => Ok(()),
        }
    }

    /// An error if any frame could not be sent.
    pub fn check(&self) -> anyhow::Result<()> {
        self.targets.iter().try_for_each(Target::check)
    }
}

/// Gives each bus of the layout its target: one for all, or one for each in the layout's order.
pub fn of_buses(
    addresses: &[TargetAddress],
    layout: &Layout,
) -> anyhow::Result<Vec<(String, TargetAddress)>> {
    let buses = layout.buses.len();
    if addresses.len() != 1 && addresses.len() != buses {
        bail!(
            "layout {} has {buses} buses ({}); give --to once for all of them or once for each, in this order",
            layout.name,
            layout.buses.join(", ")
        );
    }
    let address = |bus: usize| addresses.get(bus).unwrap_or(&addresses[0]).clone();
    Ok(layout
        .buses
        .iter()
        .enumerate()
        .map(|(bus, name)| (name.clone(), address(bus)))
        .collect())
}

/// Refuses to join buses on which two boards would send the same ids; a log keeps them apart by name.
pub fn refuse_shared_ids(named: &[(String, TargetAddress)], layout: &Layout) -> anyhow::Result<()> {
    let mut senders: HashMap<(&TargetAddress, u16), &str> = HashMap::new();
    for taxel in 0..layout.len() {
        let (name, address) = &named[usize::from(layout.wiring_of(taxel).bus)];
        let (Some(id), TargetAddress::Bus(_)) = (layout.can_id(taxel), address) else {
            continue;
        };
        if let Some(other) = senders.insert((address, id), name).filter(|other| other != name) {
            bail!(
                "boards of {other} and {name} would both send id {id:03X} on {address}; give each bus its own, such as \
                 udp::43113 and udp::43114"
            );
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_written_to_is_refused_with_what_can() {
        for (text, wanted) in [
            ("sim:tap", "takes no frames"),
            ("log:a.log?interface=can0", "leave out"),
            ("vcan0", "can:INTERFACE"),
        ] {
            let message = text.parse::<TargetAddress>().unwrap_err();
            assert!(message.contains(wanted), "{message}");
        }
        for text in ["-", "log:a.log", "can:vcan0", "udp:239.74.163.2:43113"] {
            assert_eq!(text.parse::<TargetAddress>().unwrap().to_string(), text);
        }
    }

    fn hand() -> Layout {
        Layout::builtin("allegro-uskin-15").unwrap()
    }

    #[test]
    fn buses_whose_boards_share_ids_are_not_joined() {
        let layout = hand();
        let udp = |port: u16| {
            format!("udp:239.74.163.2:{port}")
                .parse::<TargetAddress>()
                .unwrap()
        };
        let log = || TargetAddress::Log("a.log".into());
        for (addresses, refused) in [
            (vec![udp(1)], true),
            (vec![udp(1), udp(1)], true),
            (vec![udp(1), udp(2)], false),
            (vec![log()], false),
        ] {
            let named = of_buses(&addresses, &layout).unwrap();
            let result = refuse_shared_ids(&named, &layout);
            assert_eq!(result.is_err(), refused, "{addresses:?}");
            if let Err(error) = result {
                assert!(error.to_string().contains("would both send id 000"), "{error}");
            }
        }
        let message = of_buses(&[udp(1), udp(2), udp(3)], &layout)
            .unwrap_err()
            .to_string();
        assert!(message.contains("once for each"), "{message}");
    }

    #[test]
    fn a_log_keeps_buses_apart_by_name() {
        let dir = tempfile::TempDir::new().unwrap();
        let path = dir.path().join("both.log");
        let named = of_buses(&[TargetAddress::Log(path.clone())], &hand()).unwrap();
        let mut targets = Targets::open(&named).unwrap();
        let frame = CanFrame::standard(0x123, &[1, 2]).unwrap();
        for name in [0, 1] {
            targets.send(name, 1_500_000, &frame).unwrap();
        }
        targets.finish().unwrap();
        let text = std::fs::read_to_string(path).unwrap();
        assert_eq!(
            text,
            "(0000000000.001500) can0 123#0102\n(0000000000.001500) can1 123#0102\n"
        );
        assert_eq!((targets.targets.len(), targets.sent()), (1, 2));
    }
}
