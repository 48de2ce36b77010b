"""What `taxel view` costs on a terminal of 80 x 24: its share of a core, and the bytes that go over ssh.

    cargo build --release --workspace --bins
    TAXEL_BIN_DIR=target/release tests/.cache/venv/bin/python tests/bench/view.py [--seconds 30]

Prints a table for docs/benchmarks.md. `tests/run reference` makes the Python environment. The daemon simulates the hand
itself, at 30 images a second; the terminal takes all that it is sent at once.
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

from harness.daemon import Daemon, binary, die_with_parent  # noqa: E402

OVER_SSH = {"SSH_CONNECTION": "192.0.2.1 50000 192.0.2.2 22"}
# Layout, scene, and what else is in the view's environment.
CASES = [
    ("a grasp", "allegro-uskin-15", "ball-grasp", {}),
    ("a grasp, over ssh", "allegro-uskin-15", "ball-grasp", OVER_SSH),
    ("every taxel pressed", "allegro-uskin-15", "worst-case", {}),
    ("every taxel pressed, over ssh", "allegro-uskin-15", "worst-case", OVER_SSH),
]


def cpu_seconds(pid):
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextlib.contextmanager
def view(daemon, environment):
    """The view on a terminal of its own, and what it has drawn so far, bytes."""
    terminal, of_view = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("SSH_")}
    process = subprocess.Popen(
        [binary("taxel"), "view", "--socket", daemon.images],
        stdin=of_view,
        stdout=of_view,
        stderr=subprocess.DEVNULL,
        env={**inherited, "TERM": "xterm-256color", **environment},
        preexec_fn=die_with_parent,
    )
    os.close(of_view)
    drawn = []

    def read():
        with contextlib.suppress(OSError):
            while data := os.read(terminal, 65536):
                drawn.append(len(data))

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    try:
        yield process.pid, lambda: sum(drawn)
        assert process.poll() is None, "the view has ended"
    finally:
        process.kill()
        process.wait()
        reader.join()
        os.close(terminal)


def measure(layout, scene, environment, seconds):
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder, Daemon(folder, [f"sim:{scene}"] * 2, layout=layout) as daemon:
        daemon.wait_status(lambda s: not s["calibrating"], "the hand is not calibrated", 20)
        with view(daemon, environment) as (pid, drawn):
            daemon.wait_status(lambda s: s["images"]["sent"]["subscribers"] >= 1, "the view does not subscribe", 20)
            before, cpu, began = drawn(), cpu_seconds(pid), time.monotonic()
            time.sleep(seconds)
            cpu, took = cpu_seconds(pid) - cpu, time.monotonic() - began
            return 100 * cpu / took, (drawn() - before) / took / 1e3


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0, help="length of each measurement")
    seconds = parser.parse_args().seconds
    print("| view, 80 x 24 | % of a core | kB/s |\n|---|---|---|")
    for name, *case in CASES:
        share, rate = measure(*case, seconds)
        print(f"| {name} | {share:.2f} | {rate:.1f} |", flush=True)


if __name__ == "__main__":
    main()
