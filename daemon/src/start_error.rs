//! Why a daemon does not start, also as far as that can be told beforehand.

use crate::image_maker::check_profile;
use crate::{Config, SocketPathError, sources};
use std::path::Path;
use taxel_engine::{Engine, EngineError};
use taxel_joints::JointsError;

/// Why the daemon did not start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// A socket path cannot be had.
    #[error(transparent)]
    SocketPath(#[from] SocketPathError),
    /// A CAN source could not be opened.
    #[error("bus {bus}: {error}")]
    Source {
        /// Name of the bus in the layout.
        bus: String,
        /// Whether it would fail the next time as well.
        is_lasting: bool,
        /// What is wrong with its source.
        error: Box<dyn std::error::Error + Send + Sync>,
    },
    /// Joints could not be read.
    #[error(transparent)]
    Joints(#[from] taxel_joints::StartError),
    /// The joints do not fit the skin.
    #[error(transparent)]
    JointsBeside(#[from] JointsError),
    /// The hand cannot be read as configured.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// The daemon's own display profile does not fit the hand.
    #[error("{0}")]
    ProfileUnfit(String),
    /// The daemon's own display profile cannot be served.
    #[error("{0}")]
    Profile(String),
    /// What a line of the configuration file says cannot be had.
    #[error("{file}:{line}: {error}")]
    At {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// What is wrong.
        error: Box<StartError>,
    },
    /// The operating system refused something the daemon cannot do without.
    #[error("cannot {what}: {error}")]
    System {
        /// What was tried.
        what: &'static str,
        /// What the system said.
        error: std::io::Error,
    },
}

impl StartError {
    /// Whether to start again would not help, since the configuration is at fault.
    pub fn is_lasting(&self) -> bool {
        match self {
            Self::SocketPath(error) => matches!(
                error,
                SocketPathError::UnknownGroup { .. } | SocketPathError::NotASocket { .. }
            ),
            Self::JointsBeside(_) | Self::Engine(_) | Self::ProfileUnfit(_) => true,
            Self::Source { is_lasting, .. } => *is_lasting,
            Self::At { error, .. } => error.is_lasting(),
            // A profile may be too dear only while the machine is busy.
            Self::Joints(_) | Self::Profile(_) | Self::System { .. } => false,
        }
    }
}

/// Whether a daemon could start on this machine, as far as that can be told without its buses and sockets: groups,
/// recordings, scenes, and what hand and display ask of each other. `text` is that of the configuration, in `file`, to tell
/// the line.
pub fn check(config: &Config, text: &str, file: &Path) -> Result<(), StartError> {
    let at = |table, names: &str, error: StartError| match taxel_config::line_of(text, table, names) {
        Some(line) => StartError::At {
            file: file.display().to_string(),
            line,
            error: error.into(),
        },
        None => error,
    };
    for (table, group) in [
        ("socket", &config.socket.group),
        ("control", &config.control.group),
    ] {
        taxel_serve::check_group(group).map_err(|error| at(table, "group", error.into()))?;
    }
    sources::check(config).map_err(|error| {
        let of = |name: &String| matches!(&error, StartError::Source { bus, .. } if bus == name);
        match config.layout.buses.iter().position(of) {
            Some(bus) => at("bus", &format!("bus[{bus}].source"), error),
            None => at("joints", "source", error),
        }
    })?;
    check_profile(&config.layout, &config.profile)
        .map_err(|message| at("profile", &message, StartError::ProfileUnfit(message.clone())))?;
    Engine::new(&config.engine(true)?, 0)?;
    Ok(())
}
