"""Simulated Dynamixel servos behind a pseudo terminal, as a process of their own."""

import json
import subprocess
from pathlib import Path

from harness.daemon import REPOSITORY, die_with_parent

BAUD = 1_000_000


def build_examples():
    """Before any test, so that a cold build is no hanging test."""
    for package, name in [("taxel-sim", "servo_bus"), ("taxel-joints", "read_joints")]:
        subprocess.run(["cargo", "build", "--quiet", "-p", package, "--example", name], cwd=REPOSITORY, check=True)


def example(package, name, *arguments, **options):
    """A built example of one of the crates, started."""
    subprocess.run(
        ["cargo", "build", "--quiet", "-p", package, "--example", name], cwd=REPOSITORY, check=True, timeout=900
    )
    metadata = subprocess.run(
        ["cargo", "metadata", "--format-version=1", "--no-deps"], cwd=REPOSITORY, check=True, capture_output=True
    )
    path = Path(json.loads(metadata.stdout)["target_directory"]) / "debug" / "examples" / name
    return subprocess.Popen(
        [path, *map(str, arguments)], stdout=subprocess.PIPE, text=True, preexec_fn=die_with_parent, **options
    )


class Servos:
    """A bus of servos. `close` pulls its plug."""

    def __init__(self, *arguments):
        self.process = example("taxel-sim", "servo_bus", "--baud", BAUD, *arguments, stdin=subprocess.PIPE)
        self.path = self.process.stdout.readline().strip()

    def tell(self, command):
        self.process.stdin.write(command + "\n")
        self.process.stdin.flush()
        assert self.process.stdout.readline().strip() == "ok", command

    def register(self, id, address, size):
        """What stands in a servo's table."""
        self.process.stdin.write(f"register {id} {address} {size}\n")
        self.process.stdin.flush()
        return int(self.process.stdout.readline())

    def close(self):
        if self.process.poll() is None:
            self.process.stdin.close()
            self.process.wait(10)
            self.process.stdout.close()
