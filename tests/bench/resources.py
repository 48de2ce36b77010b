"""What the daemon costs: CPU time, memory, overruns, with a simulated hand on udp_multicast and one subscriber.

    cargo build --release --workspace --bins
    TAXEL_BIN_DIR=target/release tests/.cache/venv/bin/python tests/bench/resources.py [--seconds 60] [--fifo]

Prints a table for docs/benchmarks.md. `tests/run reference` makes the Python environment. The share of a core counts
the daemon's user and system time, the kernel's work for its datagrams included; a socket of SocketCAN is cheaper. With
`--fifo` (root) hand and daemon have real-time priority: a hand that shares its core is held up and then sends in
handfuls, as no bus does, and in `sweep` mode the daemon is woken more often by it.
"""

import argparse
import contextlib
import fcntl
import os
import pty
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "crates/wire/python")]

import taxel_reader  # noqa: E402
from harness.bus import MulticastBuses  # noqa: E402
from harness.candump import write_candump  # noqa: E402
from harness.daemon import Daemon, binary, die_with_parent  # noqa: E402
from harness.hand import Hand  # noqa: E402
from harness.touches import Touches, grasp  # noqa: E402

TIMER = {"mode": "timer", "rate_hz": 30.0}
SWEEP = {"mode": "sweep"}
# Name, tick, period of the boards, what they send: a recorded grasp at 30 sweeps/s, or a scene with boards that run
# freely at 100 Hz, as far as two buses of 1 Mbit/s carry that; and whether programs of all kinds run beside the daemon.
CASES = [
    ("timer 30 Hz, boards at 30 Hz", TIMER, 33.0, "recording", False),
    ("sweep, boards at 30 Hz", SWEEP, 33.0, "recording", False),
    ("timer 30 Hz, buses full", TIMER, 10.0, "ball-grasp", False),
    ("timer 30 Hz, buses full, every taxel pressed", TIMER, 10.0, "worst-case", False),
    ("sweep, buses full", SWEEP, 10.0, "ball-grasp", False),
    ("timer 200 Hz, buses full", {"mode": "timer", "rate_hz": 200.0}, 10.0, "ball-grasp", False),
    ("timer 200 Hz, buses full, view, recorder and ten more", {"mode": "timer", "rate_hz": 200.0}, 10.0, "ball-grasp", True),
    ("timer 1000 Hz, buses full", {"mode": "timer", "rate_hz": 1000.0}, 10.0, "ball-grasp", False),
]
SUBSCRIBERS = 10


def cpu_seconds(pid):
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def memory_kib(pid, key):
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith(key + ":"):
            return int(line.split()[1])
    raise KeyError(key)


def traffic(hand, sources, scene, folder):
    """The command that puts it onto the buses."""
    if scene != "recording":
        return ["sim", scene, *(a for source in sources for a in ("--to", source))]
    log = Path(folder) / "grasp.log"
    touches = Touches.even(hand)
    write_candump(log, hand, [f for _ in range(4) for f in grasp(touches)], start_s=0.0)
    return ["replay", log, "--loop", *(a for pair in zip(hand.buses, sources) for a in ("--interface", "=".join(pair)))]


@contextlib.contextmanager
def programs_beside(daemon):
    """The view on a terminal of 80 x 24, a recorder, and subscribers that read every image."""
    terminal, terminal_of_view = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    sockets = ["--socket", daemon.images]
    view = subprocess.Popen(
        [binary("taxel"), "view", *sockets],
        stdin=terminal_of_view,
        stdout=terminal_of_view,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "TERM": "xterm-256color"},
        preexec_fn=die_with_parent,
    )
    record = subprocess.Popen(
        [binary("taxel"), "record", daemon.folder / "all.mcap", *sockets], stderr=subprocess.DEVNULL, preexec_fn=die_with_parent
    )
    watches = [
        subprocess.Popen([binary("taxel"), "watch", "--json", *sockets], stdout=subprocess.DEVNULL, preexec_fn=die_with_parent)
        for _ in range(SUBSCRIBERS)
    ]
    drawn = []
    threading.Thread(target=lambda: drawn.extend(iter(lambda: len(os.read(terminal, 65536)), 0)), daemon=True).start()
    try:
        daemon.wait_status(lambda s: s["images"]["sent"]["subscribers"] >= SUBSCRIBERS + 2, "they do not all subscribe", 20)
        yield
        assert sum(drawn) > 1000 and all(p.poll() is None for p in (view, record, *watches)), "one of them has ended"
    finally:
        for process in (view, record, *watches):
            process.kill()
            process.wait()


def measure(tick, board_period_ms, scene, beside, seconds, fifo):
    hand = Hand()
    ports = MulticastBuses(len(hand.buses))  # its ports only: python-can would be one more receiver
    tables = {"tick": tick, "sweep": {"board_period_ms": board_period_ms}}
    if fifo:
        tables["realtime"] = {"priority": 40}
    if scene == "recording":
        tables["boards"] = {"mode": "passive"}
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder, Daemon(folder, ports.sources, **tables) as daemon:
        command = [binary("taxel"), *traffic(hand, ports.sources, scene, folder)]
        simulator = subprocess.Popen(command, stderr=subprocess.DEVNULL, preexec_fn=die_with_parent)
        if fifo:
            os.sched_setscheduler(simulator.pid, os.SCHED_FIFO, os.sched_param(30))
        try:
            stop = threading.Event()
            with taxel_reader.connect(daemon.images) as reader:

                def read():
                    while not stop.is_set():
                        reader.receive(0.2)

                thread = threading.Thread(target=read)
                thread.start()
                daemon.wait_status(lambda s: not s["calibrating"] and all(b["state"] == "living" for b in s["boards"]), "the hand does not come up", 20)
                pid = daemon.process.pid
                with programs_beside(daemon) if beside else contextlib.nullcontext():
                    before, began = daemon.status(), time.monotonic()
                    cpu = cpu_seconds(pid)
                    time.sleep(seconds)
                    cpu, took = cpu_seconds(pid) - cpu, time.monotonic() - began
                    after = daemon.status()
                stop.set()
                thread.join()
            received, lost = (sum(b[key] for b in after["buses"]) for key in ("received", "lost_in_kernel"))
            return {
                "frames/s": f"{(received - sum(b['received'] for b in before['buses'])) / took:.0f}",
                "images/s": f"{(after['images']['made'] - before['images']['made']) / took:.1f}",
                "% of a core": f"{100 * cpu / took:.2f}",
                "resident MB": f"{memory_kib(pid, 'VmRSS') / 1024:.1f}",
                "peak MB": f"{memory_kib(pid, 'VmHWM') / 1024:.1f}",
                "overruns": str(after["images"]["overruns"] - before["images"]["overruns"]),
                "lost": str(lost),
                "tick p99, p99.9 us": "{p99:.0f}, {p999:.0f}".format(**after["images"]["lateness_us"]),
                "age at send p50, p99 us": "{p50:.0f}, {p99:.0f}".format(**after["images"]["sent"]["age_us"]),
            }
        finally:
            simulator.kill()
            simulator.wait()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0, help="length of each measurement")
    parser.add_argument("--only", default="", help="only the measurements with this in their name, such as '1000 Hz'")
    parser.add_argument("--fifo", action="store_true", help="real-time priority for hand and daemon")
    arguments = parser.parse_args()
    seconds = arguments.seconds
    columns = None
    for name, *case in (c for c in CASES if arguments.only in c[0]):
        row = measure(*case, seconds, arguments.fifo)
        if columns is None:
            columns = list(row)
            print("| " + " | ".join(["", *columns]) + " |\n" + "|---" * (len(columns) + 1) + "|")
        print("| " + " | ".join([name, *row.values()]) + " |", flush=True)


if __name__ == "__main__":
    main()
