//! What the thread of a reader shows to other threads: something behind a mutex, with the readings that are kept.

use crate::synchrony::JointHistory;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

/// What is shown. A thread that panicked leaves what can still be read.
pub(crate) fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Copies the readings that are kept, if more were published than `seen`; `published` grows while `shared` is locked.
/// Returns how many were published when it copied, which is `seen` where it did not. Never waits: where the mutex is
/// taken nothing is copied. Allocates nothing where `into` has the memory.
pub(crate) fn history_since<T>(
    shared: &Mutex<T>,
    published: &AtomicU64,
    history: impl FnOnce(&T) -> &JointHistory,
    seen: u64,
    into: &mut JointHistory,
) -> u64 {
    if published.load(Ordering::Acquire) == seen {
        return seen;
    }
    let shared = match shared.try_lock() {
        Ok(shared) => shared,
        Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
        Err(TryLockError::WouldBlock) => return seen,
    };
    into.copy_from(history(&shared));
    published.load(Ordering::Acquire)
}
