//! Scheduling of the threads: the calls that `nix` does not offer.

#![allow(unsafe_code)]

use std::io;

/// Puts the calling thread under `SCHED_FIFO` at `priority` (1 to 99), and not those that it starts. Needs
/// `LimitRTPRIO` or `CAP_SYS_NICE`.
///
/// # Errors
/// The system does not allow it.
pub fn set_fifo(priority: u8) -> io::Result<()> {
    set_policy(nix::libc::SCHED_FIFO, priority)
}

/// Gives the calling thread ten times the share of the processor that a program has, and not those that it starts. Needs
/// `LimitNICE=-10` or `CAP_SYS_NICE`.
pub(crate) fn set_nice() -> io::Result<()> {
    set_policy(nix::libc::SCHED_OTHER, 0)?;
    // SAFETY: setpriority takes no pointer; 0 names the calling thread.
    match unsafe { nix::libc::setpriority(nix::libc::PRIO_PROCESS, 0, -10) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

fn set_policy(policy: nix::libc::c_int, priority: u8) -> io::Result<()> {
    // The kernel's `struct sched_param` is this number. musl's is longer, and its function of this name does nothing.
    let priority = nix::libc::c_int::from(priority);
    let policy = policy | nix::libc::SCHED_RESET_ON_FORK;
    // SAFETY: `priority` lives across the call, and pid 0 names the calling thread.
    match unsafe { nix::libc::syscall(nix::libc::SYS_sched_setscheduler, 0, policy, &raw const priority) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

/// Keeps every page that is in use, now and later, from being paged out, without reading in the rest.
/// Needs `LimitMEMLOCK=infinity`.
pub(crate) fn lock_memory() -> io::Result<()> {
    let flags = nix::libc::MCL_CURRENT | nix::libc::MCL_FUTURE | nix::libc::MCL_ONFAULT;
    // SAFETY: mlockall takes no pointer and changes only the paging of this process.
    match unsafe { nix::libc::mlockall(flags) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}
