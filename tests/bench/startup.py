"""How long taxeld takes from its start to a first subscriber's HELLO.

    cargo build --release --workspace --bins
    TAXEL_BIN_DIR=target/release tests/.cache/venv/bin/python tests/bench/startup.py [--times 50]

Prints a table for docs/benchmarks.md. `tests/run reference` makes the Python environment. The clock begins before the process
is made; who waits tries to connect every 0.2 ms.
"""

import argparse
import statistics
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "crates/wire/python")]

import taxel_reader  # noqa: E402
from harness.bus import GROUP, free_udp_port  # noqa: E402
from harness.daemon import Daemon  # noqa: E402

HANGS_AFTER_S = 20


def hello_after_ms(sources, layout):
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        daemon = Daemon(folder, sources, layout=layout)
        began = time.perf_counter()
        try:
            daemon.spawn()
            while True:
                try:
                    with taxel_reader.connect(daemon.images) as reader:
                        while reader.receive(HANGS_AFTER_S).header.type != taxel_reader.HELLO:
                            pass
                        return 1e3 * (time.perf_counter() - began)
                except (FileNotFoundError, ConnectionRefusedError):
                    assert time.perf_counter() - began < HANGS_AFTER_S and daemon.process.poll() is None, daemon.log
                    time.sleep(0.0002)
        finally:
            daemon.kill()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=50, help="starts of each kind")
    times = parser.parse_args().times
    print("| start to HELLO, ms | least | median | most |\n|---|---|---|---|")
    for name, sources, layout in [
        ("240 taxels on two buses", [f"udp:{GROUP}:{free_udp_port()}?hops=0" for _ in range(2)], "allegro-uskin-15"),
        ("the same, simulated within the daemon", ["sim:ball-grasp", "sim:ball-grasp"], "allegro-uskin-15"),
        ("a pressure array of 1,400 taxels, simulated", ["sim:roll"], "tekscan-6077"),
    ]:
        took = sorted(hello_after_ms(sources, layout) for _ in range(times))
        print(f"| {name} | {took[0]:.1f} | {statistics.median(took):.1f} | {took[-1]:.1f} |", flush=True)


if __name__ == "__main__":
    main()
