//! Counts what a thread allocates, for tests that there is nothing to count.
//!
//! A test makes [`Counting`] its `#[global_allocator]`; without that, [`during`] panics instead of
//! counting nothing.
#![allow(unsafe_code)] // An allocator can only be counted by implementing `GlobalAlloc`.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// The system's allocator with a counter per thread in front of it.
pub struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// What `work` gives, and how often this thread asked for memory or gave it back meanwhile: both
/// can take long.
pub fn during<T>(work: impl FnOnce() -> T) -> (T, u64) {
    let start = ALLOCATIONS.get();
    drop(std::hint::black_box(Box::new(1)));
    let before = ALLOCATIONS.get();
    assert_eq!(
        before - start,
        2,
        "Counting is not the global allocator of this test"
    );
    let result = work();
    (result, ALLOCATIONS.get() - before)
}

fn count() {
    ALLOCATIONS.set(ALLOCATIONS.get() + 1);
}

// SAFETY: every call is handed on to the system's allocator unchanged; counting touches only a
// number of this thread, which needs neither memory nor a destructor.
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
