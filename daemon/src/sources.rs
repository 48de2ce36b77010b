//! The buses of a configuration, opened.

use crate::StartError;
use crate::sockets::ArraySocket;
use nix::sys::socket::SockType;
use std::any::Any;
use std::os::fd::OwnedFd;
use std::path::Path;
use taxel_can::{CanSource, PressureSocket, SourceAddress, SourceOptions};
use taxel_config::Config;
use taxel_serve::SocketPath;

/// So many interfaces of a recording are named; a whole vehicle has hundreds.
const MOST_NAMED: usize = 12;

/// Whether every bus is a recording: then time is the recordings' own and starts at zero.
pub(crate) fn are_recorded(config: &Config) -> bool {
    let joints = config.joints.as_ref();
    let joints_bus = joints.and_then(|joints| joints.source.config().can_bus());
    let mut sources = config.sources.iter().chain(joints_bus);
    sources.all(|s| matches!(s, SourceAddress::Log { .. }))
}

/// Buses, opened.
pub(crate) struct Sources {
    /// Those of the skin in the layout's order, then that of joints on a bus of their own.
    pub(crate) buses: Vec<Box<dyn CanSource>>,
    /// The sockets of those that are pressure arrays.
    pub(crate) arrays: Vec<ArraySocket>,
}

/// Opens the buses. Scenes and recordings begin at `start_ns`.
pub(crate) fn open(config: &Config, start_ns: u64) -> Result<Sources, StartError> {
    let mut arrays = Vec::new();
    let own = config.joints_bus().filter(|bus| !bus.shared);
    let own = own.as_ref();
    let joints_name = "joints".to_string();
    let skin = config.sources.iter().zip(&config.layout.buses);
    let buses = skin.chain(own.map(|bus| (&bus.address, &joints_name)));
    let open = |(bus, (address, name)): (usize, (&SourceAddress, &String))| {
        // Of a bus of the skin everything: a node that babbles is to be seen, and what is nobody's counted.
        let filters = own
            .filter(|_| bus >= config.layout.buses.len())
            .map_or_else(Vec::new, |own| own.filters.clone());
        let options = SourceOptions {
            bus: name.clone(),
            filters,
            receive_buffer: config.can.receive_buffer_kib as usize * 1024,
            start_ns,
        };
        let source = match address {
            SourceAddress::Pressure { path } => {
                let (source, array) = open_kept_array(config, bus, path, name)?;
                arrays.push(array);
                source
            }
            _ => open_one(config, bus, address, name, &options)?,
        };
        if let Some(sentence) = left_out(config, address, &*source) {
            tracing::info!("{name}: {sentence}");
        }
        if let Some(sentence) = untimed(&*source) {
            tracing::warn!("{name}: {sentence}");
        }
        Ok(source)
    };
    let buses = buses.enumerate().map(open).collect::<Result<_, StartError>>()?;
    Ok(Sources { buses, arrays })
}

/// Which interfaces of a recording no bus of the hand plays, in a sentence.
pub fn left_out(config: &Config, address: &SourceAddress, source: &dyn CanSource) -> Option<String> {
    let SourceAddress::Log { path, .. } = address else {
        return None;
    };
    let of_interface = |name: &&str| SourceAddress::Log {
        path: path.clone(),
        interface: Some((*name).to_owned()),
    };
    let joints = config.joints.as_ref();
    let joints = joints.and_then(|joints| joints.source.config().can_bus());
    let is_read = |address: SourceAddress| config.sources.contains(&address) || joints == Some(&address);
    let names = source.left_out().iter().map(|name| &**name);
    let names: Vec<&str> = names.filter(|name| !is_read(of_interface(name))).collect();
    let address = of_interface(names.first()?);
    Some(format!(
        "the recording's frames of {} are left out, which is another bus; {address} plays one of these",
        names.join(", ")
    ))
}

/// That the times of a recording are made up, in a sentence, where they are.
pub fn untimed(source: &dyn CanSource) -> Option<&'static str> {
    (!source.has_times()).then_some(
        "the recording has no times, and its frames are taken to follow each other on a full bus; `candump -l` keeps times",
    )
}

/// Whether the recordings and scenes can be opened; buses are left alone.
pub(crate) fn check(config: &Config) -> Result<(), StartError> {
    let options = |bus: &str| SourceOptions {
        bus: bus.to_owned(),
        ..SourceOptions::default()
    };
    for (bus, (address, name)) in config.sources.iter().zip(&config.layout.buses).enumerate() {
        if matches!(address, SourceAddress::Log { .. } | SourceAddress::Sim { .. }) {
            open_one(config, bus, address, name, &options(name))?;
        }
    }
    match config.joints_bus() {
        Some(bus) if !bus.shared && matches!(bus.address, SourceAddress::Log { .. }) => open_one(
            config,
            bus.index.into(),
            &bus.address,
            "joints",
            &options("joints"),
        )
        .map(drop),
        _ => Ok(()),
    }
}

fn open_one(
    config: &Config,
    bus: usize,
    address: &SourceAddress,
    name: &str,
    options: &SourceOptions,
) -> Result<Box<dyn CanSource>, StartError> {
    let fail = |is_lasting, error| StartError::Source {
        bus: name.to_owned(),
        is_lasting,
        error,
    };
    if let SourceAddress::Log { path, .. } = address
        && let Some(sentence) = sought_in_vain(path)
    {
        return Err(fail(true, sentence.into()));
    }
    match address {
        SourceAddress::Sim { scene } => {
            open_scene(scene, config, bus as u8, options.start_ns).map_err(|error| fail(true, error))
        }
        SourceAddress::Log {
            path,
            interface: Some(interface),
        } => {
            // Neither a recording nor what is not in it comes by itself.
            let source = taxel_can::open(address, options).map_err(|error| fail(true, error.into()))?;
            if source.is_finished() {
                let (path, has) = (path.display(), interfaces(path));
                let nothing = format!("{path} has no frame on interface {interface}; it has {has}");
                return Err(fail(true, nothing.into()));
            }
            Ok(source)
        }
        _ => taxel_can::open(address, options).map_err(|error| {
            let is_lasting = matches!(address, SourceAddress::Log { .. }) || error.is_lasting();
            fail(is_lasting, error.into())
        }),
    }
}

/// Where a recording was looked for that is named without its folder and is not there, in a sentence.
fn sought_in_vain(path: &Path) -> Option<String> {
    let is_there = path.is_absolute() || path.try_exists().unwrap_or(true);
    let folder = std::env::current_dir().ok().filter(|_| !is_there)?;
    Some(format!(
        "there is no {} in {}, the folder in which this was started: a recording is looked for there, and not beside the \
         configuration; write its whole path",
        path.display(),
        folder.display()
    ))
}

/// The interfaces of a recording, the first of them where there are many.
fn interfaces(path: &Path) -> String {
    let mut names = taxel_can::interfaces(path).unwrap_or_default();
    names.sort_unstable();
    names.truncate(MOST_NAMED);
    names.join(", ")
}

/// Makes the socket that the frames of the pressure array on a bus (index) are sent to, with the owner and mode of the
/// control socket: who sends touch changes what is felt. It is there as long as the source.
pub fn open_array(config: &Config, bus: usize, path: &Path) -> Result<Box<dyn CanSource>, StartError> {
    let (socket, place) = bind_array(config, path)?;
    Ok(Box::new(array(config, bus, socket, place)?))
}

/// The same of one whose socket is made again where somebody removes it.
fn open_kept_array(
    config: &Config,
    bus: usize,
    path: &Path,
    name: &str,
) -> Result<(Box<dyn CanSource>, ArraySocket), StartError> {
    let open = || {
        let (socket, place) = bind_array(config, path)?;
        let mut source = array(config, bus, socket, ())?;
        let renewal = source.renewal();
        Ok((
            Box::new(source) as Box<dyn CanSource>,
            ArraySocket { place, renewal },
        ))
    };
    open().map_err(|error: StartError| StartError::Source {
        bus: name.to_owned(),
        is_lasting: error.is_lasting(),
        error: error.into(),
    })
}

fn bind_array(config: &Config, path: &Path) -> Result<(OwnedFd, SocketPath), StartError> {
    let mode = config.control.mode_bits().unwrap_or(0o600);
    let mut place = SocketPath::take(path, mode, &config.control.group)?;
    Ok((place.bind(SockType::Datagram)?, place))
}

fn array(
    config: &Config,
    bus: usize,
    socket: OwnedFd,
    place: impl Any + Send,
) -> Result<PressureSocket, StartError> {
    // The configuration was checked.
    let size = config.layout.array_on(bus).unwrap_or([1, 1]);
    PressureSocket::new(socket, size, place).map_err(|error| StartError::System {
        what: "read the socket of a pressure array",
        error,
    })
}

type Refusal = Box<dyn std::error::Error + Send + Sync>;

#[cfg(feature = "sim")]
fn open_scene(scene: &str, config: &Config, bus: u8, start_ns: u64) -> Result<Box<dyn CanSource>, Refusal> {
    let source = taxel_sim::SimSource::open(scene, Some(&config.layout), bus, start_ns)?;
    Ok(Box::new(source))
}

#[cfg(not(feature = "sim"))]
fn open_scene(scene: &str, _: &Config, _: u8, _: u64) -> Result<Box<dyn CanSource>, Refusal> {
    Err(
        format!("sim:{scene} needs the simulator, which this taxeld was built without; `taxel demo` has it")
            .into(),
    )
}
