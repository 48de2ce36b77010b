//! What can be asked, and the answers.

use crate::clients::{Access, Asker, Change};
use crate::joints::{Hold, NotDone, ServoRequest, ServosRequest, Told};
use crate::state::State;
use crate::supervise::report_releases;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::rc::Rc;
use taxel_hand::{FromMap, Profile};
use taxel_joints::JointsConfig;
use taxel_wire::json_in_words;
use taxel_wire::status::Status;
use tokio::time::Instant;

/// What `cmd` may be.
const COMMANDS: [&str; 8] = [
    "status", "rezero", "pause", "resume", "profile", "servo", "servos", "mark",
];

#[derive(Debug, Deserialize)]
#[serde(tag = "cmd", rename_all = "lowercase", deny_unknown_fields)]
pub(super) enum Request {
    Status {},
    Rezero {},
    Pause {},
    Resume {},
    Profile {
        #[serde(default, deserialize_with = "FromMap::optional")]
        profile: Option<Profile>,
    },
    Servo(ServoRequest),
    Servos(ServosRequest),
    Mark {
        text: String,
    },
}

impl Request {
    /// The error is fit for whoever asked.
    pub(super) fn parse(line: &[u8]) -> Result<Self, String> {
        let read = serde_json::from_slice(line).map(|FromMap(request)| request);
        read.map_err(|error| {
            let said = json_in_words(&error);
            // Who has named a command knows what a request is.
            let named = serde_json::from_slice::<Value>(line).unwrap_or_default();
            match named["cmd"].as_str().is_some_and(|cmd| COMMANDS.contains(&cmd)) {
                true => said,
                false => format!(
                    "{said}; a request is one line such as {{\"cmd\":\"status\"}}, and cmd is one of {}",
                    COMMANDS.join(", ")
                ),
            }
        })
    }

    /// Whether it has a motor of these joints switched off.
    pub(super) fn releases_a_motor(&self, joints: Option<&JointsConfig>) -> bool {
        matches!(self, Self::Servo(request) if request.releases(joints))
    }

    /// Whether it asks to move or change something.
    pub(super) fn changes(&self) -> bool {
        self.change().is_some()
    }

    /// The joint whose motor it has switched on or off, and which of both.
    pub(super) fn switched_motor(&self) -> Option<(&str, bool)> {
        match self {
            Self::Servo(request) => request.switched_motor(),
            _ => None,
        }
    }

    /// What it asks to move or change, and what is said once it is done; none where it only has something told.
    fn change(&self) -> Option<[&'static str; 2]> {
        match self {
            Self::Status {} | Self::Profile { profile: None } => None,
            Self::Rezero {} => Some(["a new baseline", "the baseline is measured anew"]),
            Self::Pause {} => Some(["pause", "paused"]),
            Self::Resume {} => Some(["resume", "resumed"]),
            Self::Profile { profile: Some(_) } => Some(["a new display profile", "display profile replaced"]),
            Self::Servo(_) | Self::Servos(_) => Some(["a servo command", "servo told"]),
            Self::Mark { .. } => Some(["a mark", "marked"]),
        }
    }
}

pub(super) fn refusal(error: String) -> Value {
    json!({ "ok": false, "error": error })
}

/// The reply to `status`, a line.
pub(super) async fn report(state: &State) -> Rc<[u8]> {
    #[derive(Serialize)]
    struct Reply {
        ok: bool,
        status: Status,
    }
    let make = || {
        let status = state.status();
        let reply = Reply { ok: true, status };
        let mut text = serde_json::to_vec(&reply).unwrap_or_default();
        text.push(b'\n');
        text
    };
    let ask = async || {
        state.call_roster().await;
    };
    state.reports.newest(ask, make).await
}

/// Does what is asked, but for `status`, and says so in the log where it changes something. Motors that run only as long
/// as the asker is there are noted in `hold`.
pub(super) async fn answer(request: Request, state: &State, asker: &Asker, hold: &Hold<'_>) -> Value {
    let Some([kind, changed]) = request.change() else {
        state.call_roster().await;
        return json!({ "ok": true, "profile": state.roster().own_profile().in_force() });
    };
    if asker.access == Access::Look {
        return refusal(format!(
            "this socket only tells (status, profile); what changes something is asked at {}, which is open to whom \
             [control] mode and group in the configuration let in",
            state.config.socket.control.display()
        ));
    }
    let done = match &request {
        Request::Servo(servo) => state.write(servo, hold).await.map(Done::Told),
        Request::Servos(servos) => state.write_together(servos, hold).await.map(Done::Told),
        Request::Profile { profile } => {
            let profile = profile.clone().unwrap_or_default();
            let replaced = state.server.set_own_profile(profile).await;
            replaced.map(|()| Done::Plain).map_err(NotDone::from)
        }
        Request::Mark { text } => (state.mark(text))
            .map(|(seq, t_ns)| Done::Marked(seq, t_ns))
            .map_err(NotDone::from),
        Request::Rezero {} => state.rezero().map(Done::Rezeroed).map_err(NotDone::from),
        Request::Pause {} => state.pause(true).map(|()| Done::Plain).map_err(NotDone::from),
        _ => state.pause(false).map(|()| Done::Plain).map_err(NotDone::from),
    };
    let (said, reply) = match done {
        Ok(Done::Plain) => (changed.to_owned(), json!({ "ok": true })),
        Ok(Done::Told(Told { said, warning: None })) => (said, json!({ "ok": true })),
        Ok(Done::Told(Told {
            said,
            warning: Some(warning),
        })) => (
            format!("{said}; {warning}"),
            json!({ "ok": true, "warning": warning }),
        ),
        Ok(Done::Marked(seq, t_ns)) => (
            changed.to_owned(),
            json!({ "ok": true, "mark": { "seq": seq, "t_ns": t_ns } }),
        ),
        Ok(Done::Rezeroed(contacts)) => {
            let said = match contacts {
                0 => changed.to_owned(),
                contacts => format!("{changed}, with {contacts} taxels in contact before"),
            };
            (said, json!({ "ok": true, "contacts": contacts }))
        }
        Err(NotDone { why, held_by }) => {
            let said = format!("refused: {kind}: {why}");
            let mut reply = refusal(why);
            if let Some(holder) = held_by {
                reply["held_by"] = holder.pid().into();
            }
            (said, reply)
        }
    };
    let refused = reply["ok"] == false;
    let (change, now) = (Change { kind, refused }, Instant::now());
    // The log has what became of a motor in the order in which its servo was told.
    report_releases(state);
    match request.switched_motor().filter(|_| !refused) {
        Some(motor) => state.changes.note_motor(change, motor, &said, asker, now),
        None => state.changes.note(change, &said, asker, now),
    }
    state.reports.outdate();
    reply
}

/// Has a motor switched off for a client that is told nothing of it any more: the log says so, and whether its servo has
/// confirmed it, which is not waited for.
pub(super) fn release(request: &Request, state: &State, asker: &Asker, hold: &Hold<'_>) {
    let Request::Servo(servo) = request else {
        return;
    };
    let released = state.release(servo, hold);
    let (kind, now) = ("a servo command", Instant::now());
    let change = Change {
        kind,
        refused: released.is_err(),
    };
    match (released, request.switched_motor()) {
        (Ok(()), Some(motor)) => {
            let (joint, _) = motor;
            let said = format!(
                "joints: torque of {joint} is to be off; whoever asked for it had to make room meanwhile"
            );
            state.changes.note_motor(change, motor, &said, asker, now);
        }
        (Err(why), _) => {
            let said = format!("refused: {kind}: {why}");
            state.changes.note(change, &said, asker, now);
        }
        _ => {}
    }
}

/// Says in the log that something is not changed, since who asked for it has gone.
pub(super) fn abandon(request: &Request, state: &State, asker: &Asker) {
    if let Some([kind, _]) = request.change() {
        let change = Change { kind, refused: true };
        let said = format!("refused: {kind}: whoever asked for it had gone before it was begun");
        state.changes.note(change, &said, asker, Instant::now());
    }
}

/// How a change was done.
enum Done {
    Plain,
    /// Servos were told it.
    Told(Told),
    /// Behind which frame, and when, nanoseconds.
    Marked(u64, u64),
    /// With so many taxels in contact before.
    Rezeroed(usize),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_and_a_profile_are_keys_and_values_and_no_lists() {
        for line in [
            r#"["status"]"#,
            r#"["profile",{"levels":4}]"#,
            r#"{"cmd":"profile","profile":[]}"#,
            r#"{"cmd":"profile","profile":["paper",3]}"#,
            r#"{"cmd":"profile","profile":{"codebook_learning":[0.5]}}"#,
        ] {
            let error = Request::parse(line.as_bytes()).unwrap_err();
            assert!(
                error.contains("an object in { } is wanted here, not a list"),
                "{line}: {error}"
            );
        }
        for line in [r#"{"cmd":"profile","profile":null}"#, r#"{"cmd":"profile"}"#] {
            let request = Request::parse(line.as_bytes()).unwrap();
            assert!(matches!(request, Request::Profile { profile: None }), "{line}");
        }
    }

    #[test]
    fn how_to_ask_is_told_to_who_has_named_no_command_and_never_where_in_a_line_that_a_program_wrote() {
        for (line, hint) in [
            (r#"{"cmd":"profile","profile":{"level":4}}"#, false),
            (r#"{"cmd":"profile","profile":{"levels":"four"}}"#, false),
            (r#"{"cmd":"mark"}"#, false),
            (r#"{"cmd":"status","verbose":true}"#, false),
            (r#"{"cmd":"reboot"}"#, true),
            (r#"{"levels":4}"#, true),
            (r#"["status"]"#, true),
        ] {
            let error = Request::parse(line.as_bytes()).unwrap_err();
            assert_eq!(
                error.contains("a request is one line such as"),
                hint,
                "{line}: {error}"
            );
            assert!(!error.contains("column"), "{line}: {error}");
        }
        let error = Request::parse(b"status").unwrap_err();
        assert!(error.contains("line 1") && error.contains("such as"), "{error}");
        for cmd in COMMANDS {
            let error = Request::parse(format!("{{\"cmd\":\"{cmd}\",\"no\":1}}").as_bytes()).unwrap_err();
            assert!(!error.contains("unknown word"), "{cmd}: {error}");
        }
    }

    #[test]
    fn what_moves_or_changes_something_is_told_from_what_only_tells() {
        let cases = [
            (r#"{"cmd":"status"}"#, false, false),
            (r#"{"cmd":"profile"}"#, false, false),
            (r#"{"cmd":"profile","profile":{"levels":4}}"#, true, false),
            (r#"{"cmd":"rezero"}"#, true, false),
            (r#"{"cmd":"pause"}"#, true, false),
            (r#"{"cmd":"resume"}"#, true, false),
            (r#"{"cmd":"mark","text":"a"}"#, true, false),
            (r#"{"cmd":"servo","joint":"a","torque":true}"#, true, false),
            (r#"{"cmd":"servo","joint":"a","pwm_percent":0.0}"#, true, false),
            (r#"{"cmd":"servos","pwm_percent":{"a":0.0,"b":1}}"#, true, false),
            (r#"{"cmd":"servo","joint":"servo 1","torque":true}"#, true, false),
            (r#"{"cmd":"servo","joint":"servo 1","torque":false}"#, true, true),
            (r#"{"cmd":"servo","joint":"nobody","torque":false}"#, true, false),
            (
                r#"{"cmd":"servo","joint":"servo 1","torque":false,"hold_ms":100}"#,
                true,
                false,
            ),
            (
                r#"{"cmd":"servo","joint":"servo 1","torque":false,"pwm_percent":1.0}"#,
                true,
                false,
            ),
        ];
        let joints = JointsConfig::dynamixel("/dev/servos", [1]);
        for (line, changes, releases) in cases {
            let request = Request::parse(line.as_bytes()).unwrap();
            assert_eq!(
                (
                    request.change().is_some(),
                    request.releases_a_motor(Some(&joints))
                ),
                (changes, releases),
                "{line}"
            );
            assert!(!request.releases_a_motor(None), "{line}");
        }
    }
}
