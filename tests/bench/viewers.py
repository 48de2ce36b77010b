"""What `taxel foxglove` costs beside a daemon at 100 Hz, by how many viewers look at every channel.

    cargo build --release --workspace --features taxel-cli/foxglove --bins
    TAXEL_BIN_DIR=target/release tests/.cache/venv/bin/python tests/bench/viewers.py [--seconds 20]

The hand is the default one, every taxel pressed, an image and a tactile frame a tick. Prints a table for
docs/benchmarks.md; shares of a core are user and system time, the kernel's work for the connections included.
"""

import argparse
import sys
import tempfile
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "crates/wire/python"), str(ROOT / "tests/bench")]

from harness.daemon import Daemon  # noqa: E402
from harness.foxglove import Bridge, frame, let_in, subscription  # noqa: E402
from resources import cpu_seconds, memory_kib  # noqa: E402

TICK = {"mode": "timer", "rate_hz": 100.0}
VIEWERS = (0, 1, 10)


class Reader:
    """A connection that is subscribed to every channel, and takes what comes."""

    def __init__(self, bridge):
        self.client, self.bytes = let_in(bridge), 0
        self.client.sendall(frame(subscription(*range(1, 10))))
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        while part := self.client.recv(1 << 20):
            self.bytes += len(part)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=20)
    seconds = parser.parse_args().seconds
    print("| viewers | daemon, % of a core | bridge, % of a core | bridge's resident MB | MB/s to each | lost |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        folder = Path(folder)
        with Daemon(folder / "daemon", ["sim:worst-case", "sim:worst-case"], tick=TICK) as daemon:
            daemon.wait_status(lambda s: not s["calibrating"] and s["missing"] == 0, "the hand does not come up", 20)
            for viewers in VIEWERS:
                with Bridge(daemon, folder) as bridge:
                    readers = [Reader(bridge) for _ in range(viewers)]
                    time.sleep(2)
                    pids = [daemon.process.pid, bridge.process.pid]
                    before, began = [cpu_seconds(pid) for pid in pids], time.monotonic()
                    bytes_before = sum(reader.bytes for reader in readers)
                    time.sleep(seconds)
                    took = time.monotonic() - began
                    shares = [100 * (cpu_seconds(pid) - was) / took for pid, was in zip(pids, before)]
                    each = (sum(reader.bytes for reader in readers) - bytes_before) / took / max(1, viewers) / 1e6
                    resident = memory_kib(bridge.process.pid, "VmRSS") / 1024
                    lost = bridge.end()["lost"]
                print(f"| {viewers} | {shares[0]:.2f} | {shares[1]:.2f} | {resident:.1f} | {each:.2f} | {lost} |", flush=True)


if __name__ == "__main__":
    main()
