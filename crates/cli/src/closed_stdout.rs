//! A closed stdout stays one that cannot be written to.
//!
//! Before `main`, the standard library opens /dev/null in the place of a closed stdout, so that no other file gets its number.
//! What is written there would be lost and nobody told. Here a file takes that place first which refuses to be written.
#![allow(unsafe_code)]

use nix::libc;

/// Called before the standard library looks at its streams.
#[used]
#[unsafe(link_section = ".init_array")]
static BEFORE_MAIN: extern "C" fn() = refuse_writes;

extern "C" fn refuse_writes() {
    // SAFETY: the calls take numbers and a constant text that ends with zero; that the file of number 1 is replaced is seen by
    // nobody, since it is closed and no other thread runs yet.
    unsafe {
        if libc::fcntl(libc::STDOUT_FILENO, libc::F_GETFD) != -1 {
            return;
        }
        let file = libc::open(c"/dev/null".as_ptr(), libc::O_RDONLY);
        if file != -1 && file != libc::STDOUT_FILENO {
            libc::dup2(file, libc::STDOUT_FILENO);
            libc::close(file);
        }
    }
}
