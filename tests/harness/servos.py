"""Simulated Dynamixel servos behind a pseudo terminal, as a process of their own."""

import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import NamedTuple

from harness.daemon import binary, die_with_parent, eventually

BAUD = 1_000_000


def example(name, *arguments, **options):
    """A built example of one of the crates, started."""
    return subprocess.Popen(
        [binary(f"examples/{name}"), *map(str, arguments)],
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=die_with_parent,
        **options,
    )


class Traffic(NamedTuple):
    """Bytes that the bus has heard, has said and has still to say, and whether its client has hung up."""

    heard: int
    said: int
    due: int
    hung_up: int


class Servos:
    """A bus of servos. `close` pulls its plug.

    Their bus watchdogs stand still until the test has them run: none acts only because the machine was held up.
    """

    def __init__(self, *arguments, watchdogs="hold"):
        # A link of its own: the number of a terminal that is closed is soon that of another test's.
        self._folder = Path(tempfile.mkdtemp(prefix="taxel-servos-"))
        link = self._folder / "servos"
        linked = () if "--link" in arguments else ("--link", link)
        self.process = example("servo_bus", "--baud", BAUD, *arguments, *linked, stdin=subprocess.PIPE)
        terminal = self.process.stdout.readline().strip()
        self.path = str(link) if linked else terminal
        self.written = 0  # bytes that ports of this test have sent
        self.tell(f"watchdogs {watchdogs}")

    def _ask(self, command):
        self.process.stdin.write(command + "\n")
        self.process.stdin.flush()
        return self.process.stdout.readline().strip()

    def tell(self, command):
        assert self._ask(command) == "ok", command

    def register(self, id, address, size):
        """What stands in a servo's table."""
        return int(self._ask(f"register {id} {address} {size}"))

    def let_go(self, id):
        """Waits until a servo's motor is off and its bus watchdog cleared, of which nobody is told."""
        registers = lambda: (self.register(id, 98, 1), self.register(id, 64, 1))
        eventually(lambda: registers() == (0, 0), lambda: f"watchdog and torque of {id} are {registers()}")

    def stopped_ns(self, id):
        """When a servo's bus watchdog stopped it, `time.monotonic_ns`; 0 for never."""
        return int(self._ask(f"stopped {id}"))

    def traffic(self):
        return Traffic(*map(int, self._ask("traffic").split()))

    def free(self):
        """Waits until the bus has heard whoever used it last to the end, and its traffic by then."""

        def nobody():
            traffic = self.traffic()
            return traffic.heard >= self.written and traffic.hung_up and traffic

        return eventually(nobody, "the bus does not see that its client has hung up")

    def quiet(self):
        """Waits until the bus has answered all that it was sent, and its traffic by then."""

        def answered():
            traffic = self.traffic()
            return traffic.heard == self.written and traffic.due == 0 and traffic

        return eventually(answered, lambda: f"the bus does not come to rest: {self.traffic()}")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        if self.process.poll() is None:
            self.process.stdin.close()
            self.process.wait()
            self.process.stdout.close()
        shutil.rmtree(self._folder, ignore_errors=True)
