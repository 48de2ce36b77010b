//! Two daemons that read one bus: each says so, and both go on, since several readers of one multicast group are what tests
//! want.
//!
//! Who reads a bus first listens at an abstract Unix socket of the bus's name, and whoever comes later stays connected to it
//! as long as it runs. So each knows of the other and when it ends, and a daemon that was killed leaves nothing behind. Such
//! names are those of a network namespace, as interfaces and multicast groups are.

use crate::state::State;
use nix::errno::Errno;
use nix::sys::socket::{
    AddressFamily, Backlog, SockFlag, SockType, UnixAddr, bind, connect, getsockopt, listen, socket, sockopt,
};
use std::io::{ErrorKind, Read};
use std::os::fd::AsRawFd;
use std::os::unix::net::{UnixListener, UnixStream};
use std::rc::Rc;
use std::time::Duration;
use taxel_can::SourceAddress;
use taxel_hand::shell_word;
use tokio::time::{MissedTickBehavior, interval};

const PERIOD: Duration = Duration::from_secs(1);
/// Those that wait to be seen: one is enough to be told of.
const WAITING: i32 = 16;
/// Bytes of a command line that are told.
const TOLD: usize = 120;

/// Looks every second who else reads the buses.
pub(crate) async fn watch(state: Rc<State>) {
    let mut claims: Vec<Option<Claim>> = state.config.sources.iter().map(Claim::of).collect();
    if claims.iter().all(Option::is_none) {
        return;
    }
    let mut period = interval(PERIOD);
    period.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        period.tick().await;
        let others = claims.iter_mut().map(|claim| claim.as_mut()?.look());
        let others = others.map(|process| process.map(in_words)).collect();
        state.other_daemons.replace(others);
    }
}

/// A bus that this daemon reads.
struct Claim {
    name: String,
    standing: Standing,
}

enum Standing {
    /// Nobody is known to read it.
    Alone,
    /// This daemon was first. The other is one of those that came later.
    First {
        listener: UnixListener,
        other: Option<UnixStream>,
    },
    /// Another one was.
    Later(UnixStream),
}

impl Claim {
    /// A claim on a bus that several can read.
    fn of(address: &SourceAddress) -> Option<Self> {
        let shown = match address {
            SourceAddress::Can { .. } => address.to_string(),
            // How far its datagrams go makes it no other group.
            SourceAddress::Udp {
                group,
                port,
                interface,
                ..
            } => format!("udp:{group}:{port}?{}", interface.as_deref().unwrap_or_default()),
            SourceAddress::Log { .. } | SourceAddress::Sim { .. } | SourceAddress::Pressure { .. } => {
                return None;
            }
        };
        Some(Self {
            name: format!("taxeld/{shown}"),
            standing: Standing::Alone,
        })
    }

    /// The process of another daemon that reads it now, 0 where the kernel does not say which.
    fn look(&mut self) -> Option<i32> {
        if let Standing::Later(first) = &self.standing
            && has_ended(first)
        {
            self.standing = Standing::Alone;
        }
        if let Standing::Alone = self.standing {
            self.standing = stand(&self.name).unwrap_or(Standing::Alone);
        }
        match &mut self.standing {
            Standing::Alone => None,
            Standing::Later(first) => Some(process(first)),
            Standing::First { listener, other } => {
                // Some of those that wait may have ended meanwhile.
                for _ in 0..=WAITING {
                    if other.as_ref().is_some_and(|other| !has_ended(other)) {
                        break;
                    }
                    *other = accept(listener);
                }
                other.as_ref().map(process)
            }
        }
    }
}

/// Listens at a name, or is connected to who does.
fn stand(name: &str) -> nix::Result<Standing> {
    let address = UnixAddr::new_abstract(name.as_bytes())?;
    let flags = SockFlag::SOCK_NONBLOCK | SockFlag::SOCK_CLOEXEC;
    let new = || socket(AddressFamily::Unix, SockType::Stream, flags, None);
    let socket = new()?;
    match bind(socket.as_raw_fd(), &address) {
        Ok(()) => {
            listen(&socket, Backlog::new(WAITING)?)?;
            Ok(Standing::First {
                listener: socket.into(),
                other: None,
            })
        }
        Err(Errno::EADDRINUSE) => {
            let socket = new()?;
            connect(socket.as_raw_fd(), &address)?;
            Ok(Standing::Later(socket.into()))
        }
        Err(error) => Err(error),
    }
}

fn accept(listener: &UnixListener) -> Option<UnixStream> {
    let (accepted, _) = listener.accept().ok()?;
    accepted.set_nonblocking(true).ok()?;
    Some(accepted)
}

/// Whether the other end is closed. Nobody has anything to say.
fn has_ended(mut peer: &UnixStream) -> bool {
    match peer.read(&mut [0; 64]) {
        Ok(bytes) => bytes == 0,
        Err(error) => !matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted),
    }
}

fn process(peer: &UnixStream) -> i32 {
    getsockopt(peer, sockopt::PeerCredentials).map_or(0, |of| of.pid())
}

/// A process, with its command line where that may be seen.
fn in_words(process: i32) -> String {
    if process == 0 {
        return "a process that cannot be seen from here".into();
    }
    let line = std::fs::read(format!("/proc/{process}/cmdline")).unwrap_or_default();
    let words = line.split(|byte| *byte == 0).filter(|word| !word.is_empty());
    let words: Vec<String> = words
        .map(|word| shell_word(String::from_utf8_lossy(word)))
        .collect();
    let line: String = words
        .join(" ")
        .chars()
        .filter(|c| !c.is_control())
        .take(TOLD)
        .collect();
    match line.is_empty() {
        true => format!("process {process}"),
        false => format!("process {process}, `{line}`"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claim(address: &str) -> Option<Claim> {
        Claim::of(&address.parse().unwrap())
    }

    #[test]
    fn each_of_two_readers_knows_of_the_other_until_it_ends() {
        // A name of this test's own: of a port that nobody binds.
        let bus = format!("udp:239.74.163.9:{}", 1 + std::process::id() % 65535);
        let own = std::process::id() as i32;
        let [mut first, mut second, mut third] = [(); 3].map(|()| claim(&bus).unwrap());
        assert_eq!(first.look(), None);
        assert_eq!(second.look(), Some(own));
        assert_eq!(first.look(), Some(own));
        assert_eq!(third.look(), Some(own));
        drop(second);
        assert_eq!(first.look(), Some(own), "the third is forgotten");
        drop(third);
        assert_eq!(first.look(), None);

        let mut heir = claim(&format!("{bus}?hops=0")).unwrap();
        assert_eq!(heir.look(), Some(own), "another reach makes it another bus");
        drop(first);
        assert_eq!(heir.look(), None);
        assert_eq!(claim(&bus).unwrap().look(), Some(own));
    }

    #[test]
    fn more_readers_than_can_wait_hold_up_nobody() {
        let bus = format!("udp:239.74.163.8:{}", 1 + std::process::id() % 65535);
        let mut all: Vec<Claim> = (0..3 * WAITING).map(|_| claim(&bus).unwrap()).collect();
        let told: Vec<bool> = all.iter_mut().map(|claim| claim.look().is_some()).collect();
        assert_eq!(told[..3], [false, true, true]);
        assert!(all[0].look().is_some());
    }

    #[test]
    fn what_one_program_alone_reads_is_not_claimed() {
        for address in ["log:a.log", "sim:grasp", "pressure:/run/taxeld/touch.sock"] {
            assert!(claim(address).is_none(), "{address}");
        }
    }

    #[test]
    fn a_process_is_told_with_its_command_line() {
        let own = std::process::id() as i32;
        let words = in_words(own);
        assert!(words.starts_with(&format!("process {own}, `")), "{words}");
        assert!(in_words(0).contains("cannot be seen"));
    }
}
