"""Every system call of the daemon fails once: it goes on, or ends with an error that can be read. Nothing hangs or lies.

    cargo build --workspace --bins --examples
    tests/siege/run syscalls [--only NAME..] [--seconds 1.0] [--deep]

The real daemon reads a simulated hand over udp_multicast and servos on a pseudo terminal under `strace --inject`, which makes the
N-th call of one kind fail in each thread that gets so far: the first three calls after the loader's, one in the middle and one near
the end of what a run without faults makes (`--deep` takes ten places). A fault before the first image may end the daemon, with a status that
is not 0 and one line that says why; after it, images go on, in sequence, the control socket answers, and SIGTERM ends it with 0.
What may end it later all the same: memory that is refused. Prints a table; the exit status is 1 where something hung or lied.
"""

import argparse
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "crates/wire/python")]

import taxel_reader  # noqa: E402
from harness.daemon import must_be_built  # noqa: E402
from harness.siege import Hand  # noqa: E402

# What each call can fail with, as its manual page has it. Calls that cannot fail, or whose failure the kernel does not make, are left out:
# a wake on a futex and a write to an eventfd among them, so that writes fail only on the log and the serial port. brk is left out since
# strace reports its failure in another way than the kernel.
FAULTS = {
    "accept4": ["EINTR", "EMFILE", "ENFILE", "ENOMEM", "ECONNABORTED"],
    "bind": ["EADDRINUSE", "EACCES"],
    "chmod": ["EPERM", "EROFS"],
    "clock_nanosleep": ["EINTR"],
    "clone3": ["EAGAIN", "ENOMEM"],
    "connect": ["EINTR", "EAGAIN"],
    "epoll_create1": ["EMFILE", "ENOMEM"],
    "epoll_ctl": ["ENOMEM", "ENOSPC"],
    "epoll_wait": ["EINTR"],
    "eventfd2": ["EMFILE", "ENOMEM"],
    "fchmod": ["EPERM", "EROFS"],
    "fchown": ["EPERM"],
    "fcntl": ["EINVAL", "EMFILE"],
    "flock": ["EINTR", "ENOLCK"],
    "fstat": ["ENOMEM"],
    "getdents64": ["EIO", "ENOMEM"],
    "getrandom": ["EINTR"],
    "getsockname": ["ENOBUFS"],
    "getsockopt": ["ENOMEM"],
    "ioctl": ["EINTR", "EIO", "ENOTTY"],
    "listen": ["EADDRINUSE"],
    "madvise": ["ENOMEM", "EAGAIN"],
    "mkdir": ["EACCES", "ENOSPC", "EROFS"],
    "mmap": ["ENOMEM"],
    "mprotect": ["ENOMEM"],
    "mremap": ["ENOMEM"],
    "munmap": ["ENOMEM"],
    "newfstatat": ["ENOMEM", "EACCES"],
    "openat": ["EINTR", "EMFILE", "ENFILE", "EACCES"],
    "pipe2": ["EMFILE"],
    "poll": ["EINTR", "ENOMEM"],
    "ppoll": ["EINTR", "ENOMEM"],
    "prctl": ["EINVAL", "EPERM"],
    "prlimit64": ["EPERM"],
    "read": ["EINTR", "EIO"],
    "readlink": ["EACCES", "ENOMEM"],
    "recvfrom": ["EINTR"],
    "recvmmsg": ["EINTR", "ENOMEM", "ENOBUFS"],
    "recvmsg": ["EINTR", "ENOMEM"],
    "rename": ["EACCES", "ENOSPC"],
    "sched_setscheduler": ["EPERM"],
    "sendmmsg": ["EINTR", "ENOBUFS", "ENOMEM"],
    "sendmsg": ["EINTR", "ENOBUFS", "ENOMEM"],
    "sendto": ["EINTR", "ENOBUFS", "ENOMEM"],
    "setpriority": ["EACCES", "EPERM"],
    "setsockopt": ["ENOMEM", "EPERM"],
    "shutdown": ["ENOTCONN", "ENOBUFS"],
    "socket": ["EMFILE", "ENFILE", "ENOBUFS"],
    "socketpair": ["EMFILE"],
    "statx": ["ENOMEM", "EACCES"],
    "unlink": ["EACCES", "EBUSY"],
    "unlinkat": ["EACCES", "EBUSY"],
    "write": ["EINTR", "ENOSPC", "EIO", "EPIPE"],
    "writev": ["EINTR", "ENOSPC", "EPIPE"],
}
MEMORY = {"mmap", "mremap", "mprotect", "clone3"}
# Most threads of a daemon that reads this hand.
THREADS = 10
# The standard library's word where it has no memory for the stack of a signal handler.
NO_STACK = "alternative stack"


class Lie(Exception):
    """What the daemon must not do."""


def images(path, seconds, at_most=10.0):
    """Reads images for `seconds` after the first, which must come within `at_most`. Returns how many; fails where one is missing without a word."""
    count, last, end = 0, None, time.monotonic() + at_most
    with taxel_reader.connect(path) as reader:
        while time.monotonic() < end:
            message = reader.receive(timeout=max(end - time.monotonic(), 0.01))
            if not isinstance(message, taxel_reader.Image):
                continue
            header = message.header
            if last is not None and header.seq != last + 1 + header.skipped:
                raise Lie(f"image {header.seq} after {last} says that {header.skipped} were skipped")
            if count == 0:
                end = time.monotonic() + seconds
            count, last = count + 1, header.seq
    return count


def run(hand, seconds, call=None, fault=None):
    """One daemon under strace. Returns what became of it, whether the fault was made, and the trace."""
    with tempfile.TemporaryDirectory(prefix="siege-") as folder:
        trace = Path(folder) / "trace"
        daemon = hand.daemon(folder)
        daemon.environment["RUST_BACKTRACE"] = "0"
        strace = ["strace", "-D", "-f", "-qq", "-o", trace]
        if fault:
            strace += ["-e", f"trace={call}", "-e", f"inject={fault}"]
        if call == "write":
            strace += ["-P", daemon.log_path, "-P", Path(hand.servos.path).resolve()]
        daemon.spawn(under=strace)
        try:
            outcome = watch(daemon, seconds, call)
        finally:
            daemon.kill()
        log = daemon.log
        if "panicked" in log and NO_STACK not in log:
            raise Lie(f"it panicked: {log[log.index('panicked') - 60 :][:400]}")
        # The tracer may still be writing.
        text = trace.read_text(errors="replace") if trace.exists() else ""
        return outcome, "(INJECTED)" in text, text


def watch(daemon, seconds, call):
    end = time.monotonic() + 15
    while True:
        status = daemon.process.poll()
        if status is not None:
            return refused(daemon, status)
        try:
            if images(daemon.images, seconds) > 0:
                break
        except (OSError, EOFError):
            time.sleep(0.02)
        if time.monotonic() > end:
            if daemon.process.poll() is None:
                raise Lie(f"neither images nor an end within 15 s; its log:\n{daemon.log[-1500:]}")
    try:
        after = once_more(lambda: images(daemon.images, seconds))
        reply = asked(daemon)
    except (OSError, EOFError, AssertionError) as error:
        time.sleep(0.3)
        if daemon.process.poll() is not None:
            return "ended later: " + refused(daemon, daemon.process.poll())
        raise Lie(f"it does not serve: {error!r}; its log:\n{daemon.log[-1500:]}") from None
    if not after or not reply["ok"]:
        raise Lie(f"{after} images after the first, control says {str(reply)[:200]}; its log:\n{daemon.log[-1500:]}")
    # A signal wakes its thread by a send, from whichever thread the kernel has take it. One whose wake-up the fault took is
    # sent again, and another thread may take that, with a fault of its own.
    for _ in range(THREADS if call == "sendto" else 0):
        daemon.process.send_signal(signal.SIGTERM)
        try:
            daemon.process.wait(2)
            break
        except subprocess.TimeoutExpired:
            pass
    status = daemon.stop()
    if status != 0:
        raise Lie(f"SIGTERM ends it with {status}:\n{daemon.log[-1500:]}")
    return "went on"


def once_more(read):
    """What a client reads; whose own connection the fault broke may make it once more."""
    try:
        return read()
    except (OSError, EOFError):
        return read()


def asked(daemon):
    """The control socket's answer; a connection that failed, or made room for another, may be made once more."""
    try:
        reply = daemon.control("status")
        if reply["ok"]:
            return reply
    except (OSError, AssertionError):
        pass
    return daemon.control("status")


def refused(daemon, status):
    log = daemon.log.strip()
    if status == 0:
        raise Lie(f"it ended by itself with 0:\n{log[-1500:]}")
    if status > 0 and not log:
        raise Lie(f"it ended with {status} without a word")
    if status < 0 and "memory allocation" not in log and NO_STACK not in log:
        raise Lie(f"signal {-status} ended it:\n{log[-1500:]}")
    return f"refused ({status})"


def calls(trace):
    """For each call, how often the loader makes it and how often the thread that makes it most often."""
    counts, loader, started = Counter(), Counter(), False
    for line in trace.splitlines():
        thread, _, call = line.partition(" ")
        name = call.strip().split("(", 1)[0]
        if not name.isidentifier():
            continue
        # The first thing that a program in Rust does is to poll its standard streams.
        started = started or name == "poll"
        if not started:
            loader[name] += 1
        counts[name, thread] += 1
    most = Counter()
    for (name, _), n in counts.items():
        most[name] = max(most[name], n)
    return {name: (loader[name], n) for name, n in most.items() if n > loader[name]}


def places(first, last, deep):
    count = last - first
    wanted = {1, 2, 3, count // 2, count * 9 // 10}
    if deep:
        wanted |= {count * k // 10 for k in range(1, 10)} | set(range(1, 9))
    return sorted(first + n for n in wanted if 1 <= n <= count)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", help="these calls alone")
    parser.add_argument("--seconds", type=float, default=0.4, help="how long images are read before and after")
    parser.add_argument("--deep", action="store_true", help="more places a call")
    options = parser.parse_args()
    must_be_built("taxeld", "taxel", "examples/servo_bus")
    failures, outcomes, unreached = [], Counter(), 0
    with Hand() as hand:
        outcome, _, trace = run(hand, options.seconds)
        if outcome != "went on":
            sys.exit(f"without any fault: {outcome}")
        most = calls(trace)
        untested = sorted(name for name in most if name not in FAULTS)
        print(f"{sum(name in most for name in FAULTS)} calls are made to fail; without a fault to make: {', '.join(untested)}")
        for name, errors in FAULTS.items():
            if name not in most or options.only and name not in options.only:
                continue
            row = Counter()
            for error in errors:
                for when in places(*most[name], options.deep):
                    fault = f"{name}:error={error}:when={when}"
                    try:
                        outcome, made, _ = run(hand, options.seconds, name, fault)
                        unreached += not made
                        row[outcome if made else "not reached"] += 1
                        if made and outcome.startswith("ended later") and name not in MEMORY:
                            raise Lie(f"it {outcome} after it had served images")
                    except (Lie, AssertionError) as lie:
                        row["FAILED"] += 1
                        failures.append(f"{fault}: {lie}")
            outcomes += row
            print(f"{name:20} {', '.join(f'{n} {what}' for what, n in row.most_common())}", flush=True)
    print("\n".join(["", *failures]))
    print(f"{sum(outcomes.values()) - unreached} faults made: {len(failures)} of them hung or lied")
    sys.exit(bool(failures))


if __name__ == "__main__":
    main()
