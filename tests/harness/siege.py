"""What the campaigns of tests/siege share: a hand that outlives daemons, and figures."""

import socket
import subprocess
import sys

from harness.bus import GROUP, free_udp_ports
from harness.daemon import Daemon, binary, die_with_parent
from harness.servos import Servos


class Hand:
    """A simulated hand on two buses of udp_multicast, and four servos. It outlives the daemons that read it."""

    def __init__(self, scene="roll", servos=4):
        self.sources = [f"udp:{GROUP}:{port}?hops=0" for port in free_udp_ports(2)]
        self.ids = range(1, servos + 1)
        self.servos = Servos("--ids", f"1-{servos}", watchdogs="run")
        self.scene = scene
        self.come()

    def come(self):
        """Its boards are switched on: they wait for start commands."""
        self.process = subprocess.Popen(
            [binary("taxel"), "sim", self.scene, *(a for source in self.sources for a in ("--to", source))],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            preexec_fn=die_with_parent,
        )

    def leave(self):
        """Its boards are switched off."""
        self.process.kill()
        self.process.wait()

    def disturb(self, datagrams):
        """Bytes on its first bus that need not be frames."""
        group, port = self.sources[0].removeprefix("udp:").split("?")[0].split(":")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            for datagram in datagrams:
                sender.sendto(datagram, (group, int(port)))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.leave()
        self.servos.close()

    def daemon(self, folder, tables=None, **joints):
        """A daemon for it, not started, with further `tables`; `joints` are further keys of its table `[joints]`."""
        servos = [{"id": id, "name": f"joint {id}"} for id in self.ids]
        patient = {"answer_margin_ms": 100.0, "hold_ms": 2000.0}
        table = {"source": f"dynamixel:{self.servos.path}", **patient, **joints, "servo": servos}
        return Daemon(folder, self.sources, joints=table, **(tables or {}))


def percentiles(values):
    """The distribution of a measurement in one line."""
    if not values:
        return "nothing measured"
    ordered = sorted(values)
    at = lambda share: ordered[min(int(share * len(ordered)), len(ordered) - 1)]  # noqa: E731
    return f"p50 {at(0.5):.2f}, p99 {at(0.99):.2f}, p99.9 {at(0.999):.2f}, max {ordered[-1]:.2f}"


def progress(items):
    """The items, and on a terminal how many of them are done."""
    items = list(items)
    for done, item in enumerate(items):
        if sys.stderr.isatty():
            print(f"\r{done} of {len(items)}", end="", file=sys.stderr, flush=True)
        yield item
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr)
