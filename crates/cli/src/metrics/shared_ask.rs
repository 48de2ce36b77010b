//! What the daemon tells, asked once for all who wait for it: a daemon that hangs makes no queue of those who ask.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use taxel_wire::Status;
use tokio::sync::watch;
use tokio::task::spawn_blocking;
use tokio::time::timeout;

/// How long one who asks waits for the daemon: Prometheus gives up after 10 s.
const PATIENCE: Duration = Duration::from_secs(2);

/// The daemon's status; none where it gave none.
type Answer = Option<Arc<Status>>;
/// An answer, once it is there.
type Answered = watch::Receiver<Option<Answer>>;

/// Asks the daemon, one question at a time.
pub(super) struct SharedAsk {
    ask: Arc<dyn Fn() -> Option<Status> + Send + Sync>,
    /// The last that it was asked.
    last: Mutex<Option<Answered>>,
}

impl SharedAsk {
    /// `ask` may wait for the daemon, on a thread of its own.
    pub(super) fn new(ask: impl Fn() -> Option<Status> + Send + Sync + 'static) -> Self {
        Self {
            ask: Arc::new(ask),
            last: Mutex::new(None),
        }
    }

    /// What the daemon tells now; none where it does not within two seconds.
    pub(super) async fn status(&self) -> Answer {
        let mut answered = self.join();
        let answer = timeout(PATIENCE, answered.wait_for(Option::is_some)).await;
        answer.ok()?.ok()?.clone()?
    }

    /// The answer that others wait for already, or one to a question of its own.
    fn join(&self) -> Answered {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let is_open = |answered: &&Answered| answered.borrow().is_none() && answered.has_changed().is_ok();
        if let Some(open) = last.as_ref().filter(is_open) {
            return open.clone();
        }
        let (tell, answered) = watch::channel(None);
        let ask = self.ask.clone();
        spawn_blocking(move || tell.send_replace(Some(ask().map(Arc::new))));
        last.insert(answered).clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
    use std::sync::mpsc;

    #[test]
    fn who_asks_while_the_daemon_hangs_shares_one_question_and_is_answered_without_it() {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .unwrap();
        let (wake, hangs) = mpsc::channel::<()>();
        let (hangs, asked) = (Mutex::new(hangs), Arc::new(AtomicUsize::new(0)));
        let count = asked.clone();
        let daemon = SharedAsk::new(move || {
            count.fetch_add(1, Relaxed);
            // It answers once it need not hang any more.
            let _ = hangs.lock().unwrap().recv();
            Some(Status::default())
        });
        runtime.block_on(async {
            let (a, b, c) = tokio::join!(daemon.status(), daemon.status(), daemon.status());
            assert!(a.or(b).or(c).is_none());
            assert!(daemon.status().await.is_none());
            assert_eq!(asked.load(Relaxed), 1);
            drop(wake);
            assert!(daemon.status().await.is_some());
            // What was told before is not told again.
            let before = asked.load(Relaxed);
            assert!(daemon.status().await.is_some());
            assert_eq!(asked.load(Relaxed), before + 1);
        });
    }
}
