//! The reply to `status`, made once for all who wait for one.

use super::line_of;
use crate::state::State;
use serde_json::json;
use std::cell::Cell;
use std::rc::Rc;
use tokio::sync::Mutex;
use tokio::time::Instant;

/// The newest reply, and how many changes there were before it.
#[derive(Debug, Default)]
pub(crate) struct Reports {
    newest: Mutex<Option<Report>>,
    changes: Cell<u64>,
}

#[derive(Debug)]
struct Report {
    begun: Instant,
    changes: u64,
    line: Rc<[u8]>,
}

impl Reports {
    /// The reply, of a report that was begun after this was called and after the last change. However many ask at once, one
    /// report is made for all of them while another one is: who asks without end costs no more than that.
    pub(super) async fn line(&self, state: &State) -> Rc<[u8]> {
        let asked = Instant::now();
        let mut newest = self.newest.lock().await;
        let changes = self.changes.get();
        let is_new = |report: &&Report| report.begun >= asked && report.changes == changes;
        if let Some(report) = newest.as_ref().filter(is_new) {
            return report.line.clone();
        }
        let begun = Instant::now();
        state.call_roster().await;
        // The tree of a report of many subscribers is several times its text, and gone before anybody takes that.
        let line: Rc<[u8]> = line_of(&json!({ "ok": true, "status": state.status() })).into();
        *newest = Some(Report {
            begun,
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
