//! Counts what a thread allocates, for tests that there is nothing to count.
//!
//! A test makes [`Counting`] its `#[global_allocator]`; without that, [`during`] panics instead of
//! counting nothing.
#![allow(unsafe_code)] // An allocator can only be counted by implementing `GlobalAlloc`.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};

/// The system's allocator with a counter per thread in front of it.
pub struct Counting;

/// Of each thread, by the lower bits of its id.
static ALLOCATIONS: [AtomicU64; 1 << 16] = [const { AtomicU64::new(0) }; 1 << 16];

thread_local! {
    /// The id of this thread; 0 before it is asked for.
    static THREAD: Cell<usize> = const { Cell::new(0) };
}

/// What `work` gives, and how often this thread asked for memory or gave it back meanwhile: both
/// can take long.
pub fn during<T>(work: impl FnOnce() -> T) -> (T, u64) {
    let start = of_thread(this_thread());
    drop(std::hint::black_box(Box::new(1)));
    let before = of_thread(this_thread());
    assert_eq!(
        before - start,
        2,
        "Counting is not the global allocator of this test"
    );
    let result = work();
    (result, of_thread(this_thread()) - before)
}

/// How often the thread of this id has asked for memory or given it back. Threads whose ids differ by a multiple of 65,536
/// share a count.
pub fn of_thread(id: usize) -> u64 {
    ALLOCATIONS[id % ALLOCATIONS.len()].load(Ordering::Relaxed)
}

fn this_thread() -> usize {
    if THREAD.get() == 0 {
        THREAD.set(nix::unistd::gettid().as_raw() as usize);
    }
    THREAD.get()
}

fn count() {
    ALLOCATIONS[this_thread() % ALLOCATIONS.len()].fetch_add(1, Ordering::Relaxed);
}

// SAFETY: every call is handed on to the system's allocator unchanged; counting touches only
// numbers that need neither memory nor a destructor.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller's promises are passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
}
