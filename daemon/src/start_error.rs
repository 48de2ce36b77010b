//! Why a daemon does not start.

use crate::SocketPathError;
use crate::descriptors::TooFewFiles;
use taxel_engine::EngineError;
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
    /// There is nothing to be read.
    #[error(
        "no module of {0} has a board (`protocol = \"offline\"`), so that nothing of it can be read live; its recordings are \
         read by `taxel compress`, `view` and the like, with `--config` or `--layout`"
    )]
    NoBoard(String),
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
    /// Nobody could connect.
    #[error(transparent)]
    TooFewFiles(#[from] TooFewFiles),
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
            Self::SocketPath(error) => error.is_lasting(),
            Self::JointsBeside(_)
            | Self::Engine(_)
            | Self::NoBoard(_)
            | Self::ProfileUnfit(_)
            | Self::TooFewFiles(_) => true,
            Self::Source { is_lasting, .. } => *is_lasting,
            Self::At { error, .. } => error.is_lasting(),
            // A profile may be too dear only while the machine is busy.
            Self::Joints(_) | Self::Profile(_) | Self::System { .. } => false,
        }
    }
}
