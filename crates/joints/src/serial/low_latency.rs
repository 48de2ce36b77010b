//! The low-latency flag of a serial port, which has no safe interface: `TIOCGSERIAL` and `TIOCSSERIAL` take a
//! `struct serial_struct` (`linux/serial.h`).
//!
//! With the flag, the FTDI driver hands bytes over every millisecond instead of every sixteen.
#![allow(unsafe_code)]

use nix::libc::{c_char, c_int, c_uint, c_ulong, c_ushort, c_void};
use std::io;
use std::os::fd::{AsRawFd, BorrowedFd};

const ASYNC_LOW_LATENCY: c_int = 1 << 13;

/// `struct serial_struct` of `linux/serial.h`.
#[repr(C)]
struct SerialStruct {
    kind: c_int,
    line: c_int,
    port: c_uint,
    irq: c_int,
    flags: c_int,
    xmit_fifo_size: c_int,
    custom_divisor: c_int,
    baud_base: c_int,
    close_delay: c_ushort,
    io_type: c_char,
    reserved_char: [c_char; 1],
    hub6: c_int,
    closing_wait: c_ushort,
    closing_wait2: c_ushort,
    iomem_base: *mut c_void,
    iomem_reg_shift: c_ushort,
    port_high: c_uint,
    iomap_base: c_ulong,
}

nix::ioctl_read_bad!(tiocgserial, 0x541E, SerialStruct);
nix::ioctl_write_ptr_bad!(tiocsserial, 0x541F, SerialStruct);

/// Sets the flag. Fails with `ENOTTY` or `EINVAL` where the driver has none, as a pseudo terminal.
pub(crate) fn set_low_latency(port: BorrowedFd<'_>) -> io::Result<()> {
    let mut serial = SerialStruct {
        kind: 0,
        line: 0,
        port: 0,
        irq: 0,
        flags: 0,
        xmit_fifo_size: 0,
        custom_divisor: 0,
        baud_base: 0,
        close_delay: 0,
        io_type: 0,
        reserved_char: [0],
        hub6: 0,
        closing_wait: 0,
        closing_wait2: 0,
        iomem_base: std::ptr::null_mut(),
        iomem_reg_shift: 0,
        port_high: 0,
        iomap_base: 0,
    };
    // SAFETY: the descriptor is open while it is borrowed, and the kernel writes one serial_struct,
    // whose layout this is, into memory that lives through the call.
    unsafe { tiocgserial(port.as_raw_fd(), &mut serial) }?;
    serial.flags |= ASYNC_LOW_LATENCY;
    // SAFETY: as above; the kernel reads the structure it has filled itself.
    unsafe { tiocsserial(port.as_raw_fd(), &serial) }?;
    Ok(())
}

/// Borrows the descriptor of a port.
pub(crate) fn descriptor(port: &impl AsRawFd) -> BorrowedFd<'_> {
    // SAFETY: the port owns its descriptor and is borrowed as long as the result.
    unsafe { BorrowedFd::borrow_raw(port.as_raw_fd()) }
}
