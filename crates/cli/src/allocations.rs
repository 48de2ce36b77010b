//! Counts allocations where a measurement asks for it.
//!
//! The command's allocator is the system's, with one counter in front of it that is off except
//! while `taxel eval` measures: every other allocation costs one more load and branch.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};
use taxel_eval::Allocations;

/// What `taxel eval` counts with.
pub(crate) const COUNTER: Allocations = Allocations { start, stop };

/// Whether any thread counts; read on every allocation.
static COUNTING: AtomicBool = AtomicBool::new(false);

thread_local! {
    /// Allocations of this thread since it began to count, or `None`.
    static COUNT: Cell<Option<u64>> = const { Cell::new(None) };
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

struct Counting;

impl Counting {
    fn count(&self) {
        if COUNTING.load(Ordering::Relaxed) {
            // A thread that is ending has no counter any more.
            let _ = COUNT.try_with(|count| count.set(count.get().map(|n| n + 1)));
        }
    }
}

// SAFETY: every call is passed on unchanged to the system's allocator, which keeps the contract of
// `GlobalAlloc`; counting neither allocates (the thread-local is constant-initialised and has no
// destructor) nor unwinds.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        self.count();
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        self.count();
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        self.count();
        // SAFETY: the caller's promises are passed on, and `pointer` is from the system's allocator.
        unsafe { System.realloc(pointer, layout, new_size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promises are passed on, and `pointer` is from the system's allocator.
        unsafe { System.dealloc(pointer, layout) }
    }
}

fn start() {
    COUNT.set(Some(0));
    COUNTING.store(true, Ordering::Relaxed);
}

fn stop() -> u64 {
    COUNTING.store(false, Ordering::Relaxed);
    COUNT.take().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::hint::black_box;

    #[test]
    fn allocations_of_this_thread_are_counted_while_asked() {
        black_box(vec![1u8]);
        start();
        let mut grown = black_box(Vec::<u64>::with_capacity(4));
        grown.reserve(100);
        std::thread::scope(|_| black_box(grown[..].len()));
        assert!(stop() >= 2);
        start();
        grown.push(1);
        assert_eq!(stop(), 0);
        black_box(vec![1u8]);
        assert_eq!(stop(), 0);
    }
}
