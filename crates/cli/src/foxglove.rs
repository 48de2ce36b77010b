//! `taxel foxglove`: a running hand live in Foxglove and Lichtblick.

use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;

/// Show a running hand live in Foxglove, Lichtblick and what else speaks their WebSocket protocol.
///
/// The topics and messages are those that `taxel record` writes, without raw CAN: the image, every taxel, the joints, what
/// is wrong, marks and events. A program beside the daemon, which subscribes to what its clients look at and can change
/// nothing. It waits for the daemon, and for the next one, and says so; the topics stay. A client that is slow loses the
/// oldest messages.
///
/// Whoever can connect sees the hand, and so does any web page that is open in a browser on this machine. Nobody can change
/// anything.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
In Foxglove or Lichtblick: Open connection, Foxglove WebSocket, ws://localhost:8765. The panel Image shows
/tactile_image, Plot /joint_states.position[0] or /taxel/frames.force[0], Diagnostics and Log what is wrong and
what was marked.

Examples:
  taxel foxglove
  taxel foxglove --listen 0.0.0.0:8765                       for other machines, too
  taxel foxglove --socket /run/taxeld-left/images.sock --listen 127.0.0.1:8766

With --json, in the end:
  {\"clients\",\"refused\",\"let_go\",\"faults\",\"messages\",\"bytes\",\"lost\",\"skipped\",\"daemons\"}
clients were let in and refused were not; let_go are those that were put out, since they took nothing or sent what is
not theirs to send, and faults what clients said that cannot be done. lost are messages that a client was too slow for,
skipped what the daemon passed over since this program was, daemons how often it connected to one.")]
pub(crate) struct Args {
    /// Where clients connect; port 0 takes a free one
    #[arg(long, value_name = "ADDRESS:PORT", value_parser = address, default_value = "127.0.0.1:8765")]
    listen: SocketAddr,
    /// The daemon's image socket [default: where the daemon of this user, or of the system, puts it]
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    /// One JSON object on stdout in the end: clients, messages, and what was lost or refused
    #[arg(long)]
    json: bool,
}

fn address(text: &str) -> Result<SocketAddr, String> {
    let named = text.to_socket_addrs().ok().and_then(|mut named| named.next());
    named.ok_or_else(|| "give an address and a port, such as 127.0.0.1:8765".into())
}

#[cfg(not(feature = "foxglove"))]
pub(crate) fn run(_: &Args) -> anyhow::Result<()> {
    anyhow::bail!(
        "this taxel was built without it: `cargo build --release -p taxel-cli --features foxglove` builds one that has it, \
         and the packages have it"
    )
}

#[cfg(feature = "foxglove")]
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    use crate::client::hands;
    use crate::{notices, stdout};
    use anyhow::Context;
    use std::net::TcpListener;
    use taxel_playback::interrupt::Interrupt;

    let listener = TcpListener::bind(args.listen)
        .with_context(|| format!("cannot listen at {}; --listen names another address", args.listen))?;
    let bound = listener.local_addr()?;
    let interrupt = Interrupt::install()?;
    say!("the hand is at ws://{bound}, for Foxglove and Lichtblick; Ctrl-C stops it");
    if args.socket.is_none() {
        hands::warn_of_others(&taxeld::config::running_socket("images.sock"));
    }
    let socket = args.socket.clone();
    let counts = taxel_foxglove::serve(taxel_foxglove::Plan {
        listener,
        name: format!("taxel {}", env!("TAXEL_VERSION")),
        socket: Box::new(move || {
            let socket = socket.clone();
            socket.unwrap_or_else(|| taxeld::config::running_socket("images.sock"))
        }),
        stop: Box::new(move || interrupt.is_set()),
        say: Box::new(|priority, line| notices::tell(priority, &format!("taxel: {line}"))),
    })?;
    if args.json {
        let counts = serde_json::json!({
            "clients": counts.clients,
            "refused": counts.refused,
            "let_go": counts.let_go,
            "faults": counts.faults,
            "messages": counts.messages,
            "bytes": counts.bytes,
            "lost": counts.lost,
            "skipped": counts.skipped,
            "daemons": counts.daemons,
        });
        stdout::print(&format!("{counts}\n"))?;
    }
    Ok(())
}
