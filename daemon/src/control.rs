//! The control socket: one JSON request per line, one JSON reply per line.

use crate::joints::ServoRequest;
use crate::state::State;
use serde::Deserialize;
use serde_json::{Value, json};
use std::rc::Rc;
use std::time::Duration;
use taxel_hand::Profile;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::{UnixListener, UnixStream};
use tokio::sync::Semaphore;

/// Longest request line, bytes.
const MAX_REQUEST: u64 = 64 * 1024;
/// Most control connections at once; further ones wait to be accepted.
const MAX_CONNECTIONS: usize = 32;
/// A client that does not take its reply for this long is disconnected.
const REPLY_PATIENCE: Duration = Duration::from_secs(5);

#[derive(Deserialize)]
#[serde(tag = "cmd", rename_all = "lowercase", deny_unknown_fields)]
enum Request {
    Status {},
    Rezero {},
    Pause {},
    Resume {},
    Profile { profile: Option<Profile> },
    Servo(ServoRequest),
    Mark { text: String },
}

/// Serves control connections until the daemon ends.
pub(crate) async fn serve(listener: UnixListener, state: Rc<State>) {
    let places = std::sync::Arc::new(Semaphore::new(MAX_CONNECTIONS));
    let mut failing = false;
    loop {
        let Ok(place) = places.clone().acquire_owned().await else {
            return;
        };
        match listener.accept().await {
            Ok((stream, _)) => {
                failing = false;
                let state = state.clone();
                tokio::task::spawn_local(async move {
                    let _place = place;
                    // A client that goes away in the middle of a request is no news.
                    let _ = converse(stream, &state).await;
                });
            }
            Err(error) => {
                // Out of file descriptors, most likely: try again when some are free. Said once,
                // however long it lasts.
                if !std::mem::replace(&mut failing, true) {
                    tracing::warn!(%error, "cannot accept a control connection");
                }
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        }
    }
}

async fn converse(stream: UnixStream, state: &State) -> std::io::Result<()> {
    let (read, mut write) = stream.into_split();
    let mut read = BufReader::new(read);
    let mut line = Vec::new();
    loop {
        line.clear();
        (&mut read)
            .take(MAX_REQUEST + 1)
            .read_until(b'\n', &mut line)
            .await?;
        if line.is_empty() {
            return Ok(());
        }
        let too_long = line.len() as u64 > MAX_REQUEST;
        if line.iter().all(u8::is_ascii_whitespace) {
            continue;
        }
        let reply = if too_long {
            refusal(format!("a request has at most {MAX_REQUEST} bytes"))
        } else {
            answer(&line, state).await
        };
        let mut text = reply.to_string();
        text.push('\n');
        match tokio::time::timeout(REPLY_PATIENCE, write.write_all(text.as_bytes())).await {
            Ok(written) => written?,
            Err(_) => return Ok(()),
        }
        if too_long {
            return Ok(());
        }
    }
}

fn refusal(error: String) -> Value {
    json!({ "ok": false, "error": error })
}

async fn answer(line: &[u8], state: &State) -> Value {
    let request = match serde_json::from_slice::<Request>(line) {
        Ok(request) => request,
        Err(error) => {
            return refusal(format!(
                "{error}; a request is one line such as {{\"cmd\":\"status\"}}, and cmd is one of status, rezero, pause, resume, profile, servo, mark"
            ));
        }
    };
    let done = match request {
        Request::Status {} => {
            state.call_roster().await;
            return json!({ "ok": true, "status": state.status() });
        }
        Request::Profile { profile: None } => {
            state.call_roster().await;
            return json!({ "ok": true, "profile": state.roster().own_profile() });
        }
        Request::Profile {
            profile: Some(profile),
        } => state.server.set_own_profile(profile).await,
        Request::Servo(request) => state.write(&request).await,
        Request::Mark { text } => {
            return match state.mark(&text) {
                Ok((seq, t_ns)) => json!({ "ok": true, "mark": { "seq": seq, "t_ns": t_ns } }),
                Err(error) => refusal(error),
            };
        }
        Request::Rezero {} => state.rezero(),
        Request::Pause {} => state.pause(true),
        Request::Resume {} => state.pause(false),
    };
    match done {
        Ok(()) => json!({ "ok": true }),
        Err(error) => refusal(error),
    }
}
