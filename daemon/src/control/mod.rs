//! The control sockets: one JSON request per line, one JSON reply per line.
//!
//! There are two: one that only tells, for everybody who may see images, and one for those who may change something.
//! Neither can be occupied: whoever comes is let in within a moment, whatever others do, and heard (`places.rs` says why).
//! A client that asks without end is slowed, but to switch off a motor that there is has a pace of its own, which nobody needs
//! more of. Whoever has gone, or had to make room, has the motors switched off that it had asked to be, and nothing else done
//! that was not begun, since nobody would know of it.

mod request;

use crate::clients::{Access, Asker, Doing, Place, Places};
use crate::joints::{Deserted, Hold};
use crate::state::State;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::socket::{MsgFlags, recv};
use request::{Request, abandon, answer, refusal, release, report};
use serde_json::Value;
use std::cell::Cell;
use std::collections::BTreeSet;
use std::convert::Infallible;
use std::future::pending;
use std::os::fd::{AsFd, AsRawFd};
use std::pin::pin;
use std::rc::Rc;
use std::time::Duration;
use taxel_joints::MAX_JOINTS;
use taxel_serve::Allowance;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, BufReader, Interest};
use tokio::net::unix::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{UnixListener, UnixStream};
use tokio::task::yield_now;
use tokio::time::{Instant, sleep, timeout};

/// Longest request line, bytes.
const MAX_REQUEST: u64 = 64 * 1024;
/// A client that does not take its reply for this long is disconnected.
const REPLY_PATIENCE: Duration = Duration::from_secs(5);
/// How often a client that writes no more is looked at, whether it has gone.
const HALF_CLOSED_LOOK: Duration = Duration::from_millis(10);
/// A client that asks nothing for this long is disconnected.
const IDLE_PATIENCE: Duration = Duration::from_secs(300);
/// What a client may ask without being slowed: so many requests at once, and one per interval.
const REQUESTS: u32 = 20;
const REQUEST_INTERVAL: Duration = Duration::from_millis(50);
/// The same of requests to switch a motor off: every joint twice at once.
const RELEASES: u32 = 2 * MAX_JOINTS as u32;
const RELEASE_INTERVAL: Duration = Duration::from_millis(10);

/// Serves the socket that only tells until the daemon ends.
pub(crate) async fn serve_status(listener: UnixListener, state: Rc<State>) {
    serve(listener, state.clone(), Access::Look, &state.looking).await;
}

/// Serves the socket for those who may change something until the daemon ends.
pub(crate) async fn serve_control(listener: UnixListener, state: Rc<State>) {
    serve(listener, state.clone(), Access::Change, &state.changing).await;
}

async fn serve(listener: UnixListener, state: Rc<State>, access: Access, places: &Rc<Places>) {
    let mut failing = false;
    loop {
        match listener.accept().await {
            Ok((stream, _)) => {
                failing = false;
                let asker = Asker::of(&stream, access);
                places.room().await;
                let (state, place) = (state.clone(), places.enter(asker.user, Instant::now()));
                tokio::task::spawn_local(async move {
                    // A client that goes away in the middle of a request is no news.
                    let _ = attend(stream, &state, asker, &place).await;
                });
                // Those that wait to be accepted do not push out one that has not been heard.
                yield_now().await;
            }
            Err(error) => {
                // Out of file descriptors, most likely, of which an idle client has one; or a client that was gone before
                // it was let in. Said once, however long it lasts.
                if error.kind() == std::io::ErrorKind::ConnectionAborted {
                    continue;
                }
                if !std::mem::replace(&mut failing, true) {
                    tracing::warn!(%error, "cannot accept a control connection");
                }
                places.make_room(Instant::now());
                sleep(Duration::from_millis(100)).await;
            }
        }
    }
}

/// Answers a client until it leaves, or has to.
async fn attend(stream: UnixStream, state: &State, asker: Asker, place: &Place) -> std::io::Result<()> {
    let (read, write) = stream.into_split();
    let talk = Talk {
        hold: state.hold(asker),
        write,
        replying: Cell::new(false),
        changing: Cell::new(false),
        state,
        asker,
        place,
    };
    place.hold(talk.hold.motors());
    let (mut read, mut line) = (BufReader::new(read), Vec::new());
    {
        let mut converse = pin!(talk.converse(&mut read, &mut line));
        loop {
            tokio::select! {
                left = &mut converse => return left,
                why = talk.hold.deserted(talk.gone()) => match why {
                    // Behind what it asked before, another motor may be to be switched off.
                    Deserted::Gone => talk.hold.let_go(),
                    Deserted::Silent(patience) => {
                        talk.take_leave(refusal(format!(
                            "nothing was asked for {patience:?}, so the motors that this connection held are switched off"
                        )));
                        return Ok(());
                    }
                },
                () = place.lost() => break,
            }
        }
    }
    talk.release_rest(line, &read);
    talk.take_leave(room_made(talk.changing.get()));
    Ok(())
}

/// Whether the client has closed the connection, and hears no answer. Who only writes no more still waits for one.
fn has_gone(write: &OwnedWriteHalf) -> bool {
    // That both ways are closed is told unasked, and that one is only where it is asked for.
    let mut socket = [PollFd::new(write.as_ref().as_fd(), PollFlags::empty())];
    let told = poll(&mut socket, PollTimeout::ZERO).ok().and(socket[0].revents());
    told.is_some_and(|told| told.contains(PollFlags::POLLHUP))
}

/// Waits until the client has closed the connection, whatever there is to be read before. Who only writes no more has not gone.
async fn hung_up(write: &OwnedWriteHalf) {
    // Of data that comes this is not told, but of the end of it.
    let _ = write.ready(Interest::PRIORITY).await;
    // Of what comes behind that end nobody tells.
    while !has_gone(write) {
        sleep(HALF_CLOSED_LOOK).await;
    }
}

/// A connection to a client.
struct Talk<'a> {
    /// Before `write`, so that its motors are let go before the client sees the end.
    hold: Hold<'a>,
    write: OwnedWriteHalf,
    /// Whether a reply is on its way.
    replying: Cell<bool>,
    /// Whether something is being done that is not to be done twice.
    changing: Cell<bool>,
    state: &'a State,
    asker: Asker,
    place: &'a Place,
}

impl Talk<'_> {
    /// Says why the client has to leave. Who does not read is not told.
    fn take_leave(&self, why: Value) {
        // Not into the middle of a reply.
        if !self.replying.get() {
            let _ = self.write.try_write(&line_of(&why));
        }
    }

    /// Waits until the client has gone, who keeps no place then.
    async fn gone(&self) {
        hung_up(&self.write).await;
        self.place.set(Doing::Gone, Instant::now());
    }

    fn has_gone(&self) -> bool {
        self.hold.has_let_go() || has_gone(&self.write)
    }

    /// Whether a request is let through to have a motor switched off.
    fn releases(&self, request: &Result<Request, String>) -> bool {
        self.asker.access == Access::Change
            && (request.as_ref())
                .is_ok_and(|request| request.releases_a_motor(self.state.config.joints.as_ref()))
    }

    /// Has the motors switched off that are to be by what has come and was not answered, `line` before what is still to be
    /// read. Its place is another's by now, so that is not waited for.
    fn release_rest(&self, mut line: Vec<u8>, read: &BufReader<OwnedReadHalf>) {
        if self.asker.access == Access::Look || line.len() as u64 > MAX_REQUEST {
            return;
        }
        line.extend(read.buffer());
        // Of the socket itself, which may have more than the runtime knows of.
        let mut rest = vec![0; MAX_REQUEST as usize];
        let come = recv(self.write.as_ref().as_raw_fd(), &mut rest, MsgFlags::MSG_DONTWAIT).unwrap_or(0);
        line.extend(&rest[..come]);
        // Each motor once, however often it was asked for.
        let mut released = BTreeSet::new();
        for line in line.split(|byte| *byte == b'\n') {
            let request = Request::parse(line);
            if self.releases(&request)
                && let Ok(request) = &request
                && let Some((joint, _)) = request.switched_motor()
                && released.insert(joint.to_owned())
            {
                release(request, self.state, &self.asker, &self.hold);
            }
        }
    }

    /// Answers what is asked. What `line` has when this is dropped was begun to be read, or is not answered.
    async fn converse(&self, read: &mut BufReader<OwnedReadHalf>, line: &mut Vec<u8>) -> std::io::Result<()> {
        let mut requests = Allowance::new(REQUESTS, REQUEST_INTERVAL);
        let mut released = Allowance::new(RELEASES, RELEASE_INTERVAL);
        while read_line(read, line).await? {
            // A blank line asks nothing.
            let is_blank = line.iter().all(u8::is_ascii_whitespace);
            if !is_blank {
                self.hold.serve();
            }
            let too_long = line.len() as u64 > MAX_REQUEST;
            let request = match too_long {
                true => Err(format!("a request has at most {MAX_REQUEST} bytes")),
                false => Request::parse(line),
            };
            let releases = self.releases(&request);
            let allowance = match releases {
                true => &mut released,
                false => &mut requests,
            };
            let pause = allowance.take(Instant::now());
            if !pause.is_zero() && (releases || !self.has_gone()) {
                self.place.slowed(Instant::now());
                sleep(pause).await;
            }
            if !releases && self.has_gone() {
                if self.asker.access == Access::Look {
                    return Ok(());
                }
                // Behind it, a motor may be to be switched off.
                if let Ok(request) = &request {
                    abandon(request, self.state, &self.asker);
                }
                yield_now().await;
                continue;
            }
            if is_blank {
                continue;
            }
            let reply = tokio::select! {
                reply = self.obey(request, releases) => reply,
                never = self.watch_for_more(read) => match never {},
            };
            let then = if releases { Doing::Unheard } else { Doing::Nothing };
            self.place.set(then, Instant::now());
            if !self.reply(&reply).await? || too_long {
                return Ok(());
            }
            line.clear();
            // Who asks without end is idle for a moment, or nobody who waits for a place would ever have one.
            yield_now().await;
        }
        Ok(())
    }

    /// Notes that there is more to be read, while a request is carried out.
    async fn watch_for_more(&self, read: &mut BufReader<OwnedReadHalf>) -> Infallible {
        if let Ok([_, ..]) = read.fill_buf().await {
            self.hold.press();
        }
        pending().await
    }

    /// Carries out a request, and gives the line that answers it.
    async fn obey(&self, request: Result<Request, String>, releases: bool) -> Rc<[u8]> {
        let doing = if releases {
            Doing::Releasing
        } else {
            Doing::Obeying
        };
        self.place.set(doing, Instant::now());
        match request {
            Ok(Request::Status {}) => report(self.state).await,
            Ok(request) => {
                self.changing.set(request.changes() && !releases);
                let reply = answer(request, self.state, &self.asker, &self.hold).await;
                self.changing.set(false);
                line_of(&reply).into()
            }
            Err(error) => line_of(&refusal(error)).into(),
        }
    }

    /// Whether the client has taken its reply, or has gone.
    async fn reply(&self, reply: &[u8]) -> std::io::Result<bool> {
        self.replying.set(true);
        self.hold.await_client();
        match timeout(REPLY_PATIENCE, self.write_all(reply)).await {
            Ok(Err(error)) if !self.has_gone() => return Err(error),
            Ok(_) => {}
            Err(_) => return Ok(false),
        }
        self.hold.await_client();
        self.replying.set(false);
        Ok(true)
    }

    async fn write_all(&self, mut bytes: &[u8]) -> std::io::Result<()> {
        while !bytes.is_empty() {
            match self.write.try_write(bytes) {
                Ok(written) => bytes = &bytes[written..],
                Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {
                    self.write.writable().await?;
                }
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

/// Why a connection ends that makes room for another, in the middle of a change or not. Otherwise whatever it has asked for and
/// was not answered may be asked for again.
fn room_made(is_changing: bool) -> Value {
    let next = match is_changing {
        true => "what it asked for last may still be done, as the status tells",
        false => "connect again",
    };
    let mut reply = refusal(format!(
        "all places are taken, and this connection made room for another; {next}"
    ));
    if !is_changing {
        reply["ask_again"] = true.into();
    }
    reply
}

/// Reads the next request, or as much of it as may be; false where the client asks nothing more.
async fn read_line(read: &mut BufReader<OwnedReadHalf>, line: &mut Vec<u8>) -> std::io::Result<bool> {
    line.clear();
    let mut limited = read.take(MAX_REQUEST + 1);
    match timeout(IDLE_PATIENCE, limited.read_until(b'\n', line)).await {
        Ok(read) => read.map(|bytes| bytes > 0),
        Err(_) => Ok(false),
    }
}

fn line_of(reply: &Value) -> Vec<u8> {
    let mut text = reply.to_string().into_bytes();
    text.push(b'\n');
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_makes_room_in_the_middle_of_a_change_is_not_told_to_ask_for_it_again() {
        for (is_changing, words) in [(false, "connect again"), (true, "may still be done")] {
            let reply = room_made(is_changing);
            assert!(reply["error"].as_str().unwrap().contains(words), "{reply}");
            assert_eq!(
                reply["ask_again"].as_bool(),
                (!is_changing).then_some(true),
                "{reply}"
            );
        }
    }
}
