"""How long after the end of a touch its category is told: a simulated phantom on udp_multicast, the daemon, `taxel categorize --live`.

    cargo build --release -p taxeld -p taxel-cli
    TAXEL_BIN_DIR=target/release tests/.cache/venv/bin/python tests/bench/touches.py [--touches 16]

Prints a line for docs/palpation.md. A touch ends with the mark that the daemon stamps; it is told when its line is written.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "crates/wire/python")]

from harness.bus import MulticastBuses  # noqa: E402
from harness.daemon import Daemon, binary, die_with_parent  # noqa: E402

SCENE = "phantom-1"


def taxel(*arguments, **options):
    return [binary("taxel"), *map(str, arguments)], {"text": True, "preexec_fn": die_with_parent, **options}


def measure(count, folder, buses):
    """Latencies of `count` touches, microseconds."""
    layout, kept = folder / "probe.toml", folder / "map.json"
    command, options = taxel("sim", SCENE, "--layout", "cyskin-triangle", "--show", check=True, capture_output=True)
    layout.write_text(subprocess.run(command, **options).stdout)
    command, options = taxel("categorize", f"sim:{SCENE}", "--classes", 5, "--save", kept, check=True, capture_output=True)
    subprocess.run(command, **options)
    with Daemon(folder / "d", buses.sources, layout=layout) as daemon:
        arguments = ["--live", kept, "--socket", daemon.images, "--publish", folder / "touches.sock"]
        command, options = taxel("categorize", *arguments, stdout=subprocess.PIPE)
        live = subprocess.Popen(command, **options)
        command, options = taxel("sim", SCENE, "--to", buses.sources[0], "--control", daemon.control_path, stderr=subprocess.DEVNULL)
        sim = subprocess.Popen(command, **options)
        try:
            return [json.loads(live.stdout.readline())["latency_us"] for _ in range(count)]
        finally:
            for process in (sim, live):
                process.kill()
                process.wait()


parser = argparse.ArgumentParser()
parser.add_argument("--touches", type=int, default=16)
count = parser.parse_args().touches
with tempfile.TemporaryDirectory(prefix="taxel-") as made, MulticastBuses(1) as buses:
    latencies = sorted(measure(count, Path(made), buses))
print(f"{count} touches: median {latencies[count // 2]:.0f} us, most {latencies[-1]:.0f} us after the end of the touch")
