"""What recordings cost: the recorder beside a daemon at 100 Hz, and how fast a recording is converted.

    cargo build --release --workspace --bins
    TAXEL_BIN_DIR=target/release tests/.cache/venv/bin/python tests/bench/recordings.py [--seconds 30] [--minutes 10]

The hand is the default one, every taxel at 100 Hz: 24,000 CAN frames, 100 tactile frames and 100 images a second. Prints
two tables for docs/benchmarks.md; shares of a core are user and system time, the kernel's work for datagrams included.
"""

import argparse
import itertools
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "crates/wire/python"), str(ROOT / "tests/bench")]

from harness.bus import MulticastBuses  # noqa: E402
from harness.daemon import Daemon, binary, die_with_parent  # noqa: E402
from harness.hand import Hand  # noqa: E402
from harness.touches import Touches, grasp  # noqa: E402
from resources import cpu_seconds, memory_kib  # noqa: E402

RATE_HZ = 100
DAEMON = {"tick": {"mode": "timer", "rate_hz": float(RATE_HZ)}, "sweep": {"board_period_ms": 10.0}, "boards": {"mode": "passive"}}


def write_recording(path, hand, seconds):
    """A grasp again and again as candump writes it, the frames of a sweep evenly over its 10 ms."""
    frames = list(grasp(Touches.even(hand)))
    sweeps = [[f" {hand.buses[b]} {m.arbitration_id:03X}#{m.data.hex().upper()}\n" for b, m in hand.sweep(f)] for f in frames]
    between_us = 1_000_000 / RATE_HZ / len(hand)
    with path.open("w") as log:
        for number, lines in zip(range(round(seconds * RATE_HZ)), itertools.cycle(sweeps)):
            second, part = divmod(number, RATE_HZ)
            first_us = part * 1_000_000 // RATE_HZ
            times = (f"({1_700_000_000 + second}.{first_us + int(i * between_us):06d})" for i in range(len(lines)))
            log.writelines(time + line for time, line in zip(times, lines))


def live(hand, seconds, folder):
    """Shares of a core of daemon and recorder, by turns with and without the recorder."""
    log = folder / "grasp.log"
    write_recording(log, hand, 10)
    ports = MulticastBuses(len(hand.buses))  # its ports only: python-can would be one more receiver
    with Daemon(folder / "daemon", ports.sources, **DAEMON) as daemon:
        interfaces = [a for pair in zip(hand.buses, ports.sources) for a in ("--interface", "=".join(pair))]
        command = [binary("taxel"), "replay", log, "--loop", *interfaces]
        player = subprocess.Popen(command, stderr=subprocess.DEVNULL, preexec_fn=die_with_parent)
        recorder = None
        try:
            daemon.wait_status(lambda s: not s["calibrating"] and s["missing"] == 0, "the hand does not come up", 20)
            alone = shares(daemon, [daemon.process.pid], seconds)
            out = folder / "live.mcap"
            record = [binary("taxel"), "record", out, "--config", daemon.config]
            recorder = subprocess.Popen(record, stderr=subprocess.PIPE, text=True, preexec_fn=die_with_parent)
            daemon.wait_status(lambda s: s["subscribers"], "taxel record does not subscribe")
            both = shares(daemon, [daemon.process.pid, recorder.pid], seconds)
            resident = memory_kib(recorder.pid, "VmRSS")
            recorder.terminate()
            said = recorder.communicate()[1]
        finally:
            for process in (player, recorder):
                if process and process.poll() is None:
                    process.kill()
                    process.wait()
    print("| CAN frames/s | daemon alone, % of a core | daemon, recorded | recorder | its resident MB | overruns |")
    print("|---|---|---|---|---|---|")
    (rate, (without,), _), (_, (beside, its), overruns) = alone, both
    print(f"| {rate:.0f} | {without:.2f} | {beside:.2f} | {its:.2f} | {resident / 1024:.1f} | {overruns} |")
    print(said)


def shares(daemon, pids, seconds):
    """Frames a second, the share of a core of each process, and the daemon's overruns, over so many seconds."""
    before, began = daemon.status(), time.monotonic()
    cpu = [cpu_seconds(pid) for pid in pids]
    time.sleep(seconds)
    cpu, took = [cpu_seconds(pid) - c for pid, c in zip(pids, cpu)], time.monotonic() - began
    after = daemon.status()
    received = sum(b["received"] for b in after["buses"]) - sum(b["received"] for b in before["buses"])
    overruns = after["images"]["overruns"] - before["images"]["overruns"]
    return received / took, [100 * c / took for c in cpu], overruns


def offline(hand, minutes, folder):
    """How many times faster than real time each command is, by the wall and by its processor time."""
    log, mcap, frames = folder / "grasp.log", folder / "grasp.mcap", folder / "frames.npz"
    write_recording(log, hand, 60 * minutes)
    taxel = binary("taxel")
    steps = [
        ("convert", ".log", ".mcap", ["convert", log, mcap]),
        ("convert", ".mcap", ".log", ["convert", mcap, folder / "again.log"]),
        ("convert", ".mcap", ".mcap", ["convert", mcap, folder / "again.mcap"]),
        ("convert", ".mcap", ".npz", ["convert", mcap, frames]),
        ("convert", ".mcap", ".csv", ["convert", mcap, folder / "frames.csv"]),
        ("convert", ".npz", ".log", ["convert", frames, folder / "again.log"]),
        ("replay --speed inf", ".mcap", "log:", ["replay", mcap, "--to", f"log:{folder / 'replayed.log'}"]),
        ("replay --speed inf", ".log", "log:", ["replay", log, "--to", f"log:{folder / 'replayed.log'}"]),
        ("compress", ".mcap", ".npz", ["compress", mcap, "--out", folder / "images.npz"]),
        ("compress", ".log", ".npz", ["compress", log, "--out", folder / "images.npz"]),
        ("compress", ".npz", ".npz", ["compress", frames, "--out", folder / "images.npz"]),
    ]
    print(f"{minutes:g} minutes, {round(60 * minutes * RATE_HZ) * len(hand)} CAN frames; .log {log.stat().st_size / 1e6:.0f} MB")
    print("| command | from | to | times real time | by processor time | MB out |")
    print("|---|---|---|---|---|---|")
    for name, source, to, words in steps:
        os.sync()  # what others wrote is on the disk: each command waits for its own bytes alone
        began, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run([taxel, *words], capture_output=True, text=True)
        took, after = time.monotonic() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode:
            print(f"| `{name}` | {source} | {to} | failed: {done.stderr.strip().splitlines()[-1]} | | |", flush=True)
            continue
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        out = Path(str(words[-1]).removeprefix("log:"))
        size = out.stat().st_size / 1e6
        if out not in (mcap, frames):
            out.unlink()
        print(f"| `{name}` | {source} | {to} | {60 * minutes / took:.0f} | {60 * minutes / cpu:.0f} | {size:.0f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0, help="length of each measurement of the recorder; 0 leaves it out")
    parser.add_argument("--minutes", type=float, default=10.0, help="length of the recording that is converted; 0 leaves it out")
    arguments = parser.parse_args()
    hand = Hand()
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        if arguments.seconds:
            live(hand, arguments.seconds, Path(folder))
        if arguments.minutes:
            offline(hand, arguments.minutes, Path(folder))


if __name__ == "__main__":
    main()
