//! The reply to `status`, made once for all who wait for one.

use crate::state::State;
use serde::Serialize;
use std::cell::Cell;
use std::rc::Rc;
use taxel_wire::status::Status;
use tokio::sync::Mutex;
use tokio::time::{Instant, sleep_until};

/// The newest reply, and how many changes there were before it.
#[derive(Debug, Default)]
pub(crate) struct Reports {
    newest: Mutex<Option<Report>>,
    changes: Cell<u64>,
}

#[derive(Debug)]
struct Report {
    begun: Instant,
    /// When this thread has done other things for as long as the report took it.
    paid: Instant,
    changes: u64,
    line: Rc<[u8]>,
}

#[derive(Serialize)]
struct Reply {
    ok: bool,
    status: Status,
}

impl Reports {
    /// The reply, of a report that was begun after this was called and after the last change. However many ask at once, one
    /// report is made for all of them while another one is, and this thread does other things for as long as the last one
    /// took: who asks without end costs half of it, and torque off waits for one report.
    pub(super) async fn line(&self, state: &State) -> Rc<[u8]> {
        let asked = Instant::now();
        let mut newest = self.newest.lock().await;
        let changes = self.changes.get();
        let is_new = |report: &&Report| report.begun >= asked && report.changes == changes;
        if let Some(report) = newest.as_ref().filter(is_new) {
            return report.line.clone();
        }
        if let Some(last) = newest.as_ref() {
            sleep_until(last.paid).await;
        }
        let (begun, changes) = (Instant::now(), self.changes.get());
        state.call_roster().await;
        let making = Instant::now();
        let reply = Reply {
            ok: true,
            status: state.status(),
        };
        let mut text = serde_json::to_vec(&reply).unwrap_or_default();
        text.push(b'\n');
        let line: Rc<[u8]> = text.into();
        *newest = Some(Report {
            begun,
            paid: Instant::now() + making.elapsed(),
            changes,
            line: line.clone(),
        });
        line
    }

    /// Something was changed, which the next reply is to show.
    pub(crate) fn outdate(&self) {
        self.changes.set(self.changes.get() + 1);
    }
}
