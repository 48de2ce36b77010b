//! A serial port that is opened again and again, and the thread that reads one.

mod low_latency;
mod port;
mod port_status;
mod reading_thread;
mod shown;

pub(crate) use port::{Port, Terminal};
pub use port::{PortError, PortLatency};
pub use port_status::{PortState, PortStatus};
pub(crate) use reading_thread::ReadingThread;
pub use reading_thread::{ReadingThreadError, StartError};
pub(crate) use shown::{history_since, lock};
