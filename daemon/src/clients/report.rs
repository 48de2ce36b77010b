//! The reply to `status`, made once for all who wait for one.

use std::cell::Cell;
use std::rc::Rc;
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

impl Reports {
    /// The reply, of a report that was begun after this was called and after the last change. However many ask at once, one
    /// report is made for all of them while another one is, and this thread does other things for as long as the last one
    /// took: who asks without end costs half of it, and torque off waits for one report. `ask` asks other threads first.
    pub(crate) async fn newest(&self, ask: impl AsyncFnOnce(), make: impl FnOnce() -> Vec<u8>) -> Rc<[u8]> {
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
        ask().await;
        let making = Instant::now();
        let line: Rc<[u8]> = make().into();
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

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn nine_hundred_who_ask_at_once_share_the_report_under_way_and_the_next() {
        let reports = Rc::new(Reports::default());
        let made = Rc::new(Cell::new(0_u8));
        let local = tokio::task::LocalSet::new();
        let asked: Vec<_> = (0..900)
            .map(|_| {
                let (reports, made) = (reports.clone(), made.clone());
                local.spawn_local(async move {
                    let make = || {
                        made.set(made.get() + 1);
                        vec![made.get()]
                    };
                    // Everybody has asked by the time that the other threads have answered.
                    reports.newest(tokio::task::yield_now, make).await
                })
            })
            .collect();
        local.await;
        assert_eq!(made.get(), 2);
        let mut replies = Vec::new();
        for asked in asked {
            replies.push(asked.await.unwrap());
        }
        assert_eq!(*replies[0], [1]);
        assert!(replies[1..].iter().all(|reply| **reply == [2]));
        assert!(replies[2..].iter().all(|reply| Rc::ptr_eq(reply, &replies[1])));

        // What was changed since is in a reply of its own.
        reports.outdate();
        assert_eq!(*reports.newest(async || (), || vec![3]).await, [3]);
    }
}
