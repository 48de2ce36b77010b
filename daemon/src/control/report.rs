//! The reply to `status`, made once for all who ask within a moment.

use super::line_of;
use crate::state::State;
use serde_json::json;
use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;
use tokio::sync::Mutex;
use tokio::time::Instant;

/// How long a report is told again. Clients that ask without end cost one report in that time, and the thread that sends
/// images one look at who is connected.
const FRESH: Duration = Duration::from_millis(20);

/// The newest reply, and how many changes there were before it.
#[derive(Debug, Default)]
pub(crate) struct Reports {
    newest: Mutex<Option<Report>>,
    changes: Cell<u64>,
}

#[derive(Debug)]
struct Report {
    made: Instant,
    changes: u64,
    line: Rc<[u8]>,
}

impl Reports {
    /// The reply: at most [`FRESH`] old, and from after the last change.
    pub(super) async fn line(&self, state: &State) -> Rc<[u8]> {
        let mut newest = self.newest.lock().await;
        let changes = self.changes.get();
        if let Some(report) = newest
            .as_ref()
            .filter(|r| r.changes == changes && r.made.elapsed() < FRESH)
        {
            return report.line.clone();
        }
        state.call_roster().await;
        // The tree of a report of many subscribers is several times its text, and gone before anybody takes that.
        let line: Rc<[u8]> = line_of(&json!({ "ok": true, "status": state.status() })).into();
        *newest = Some(Report {
            made: Instant::now(),
            changes,
            line: line.clone(),
        });
        line
    }

    /// Something was changed, which the next reply is to show.
    pub(super) fn outdate(&self) {
        self.changes.set(self.changes.get() + 1);
    }
}
