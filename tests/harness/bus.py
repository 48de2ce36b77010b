"""Buses between python-can and the daemon."""

import collections
import socket
import subprocess
import time

import can

GROUP = "239.74.163.2"  # python-can's IPv4 default
BURST = 150  # a python-can receiver holds 256 datagrams, of which one must not count on all


# Of <linux/in.h>; without it a socket hears the groups that others on this machine have joined.
IP_MULTICAST_ALL = 49

# Sockets whose ports this process has taken; more than a test needs.
TAKEN = collections.deque(maxlen=64)


def free_udp_ports(count):
    """UDP ports nobody uses, each another. Groups leak between sockets on one port, so a test isolates itself by port.

    A socket of every address, which hears nothing of groups, keeps each from being given to anybody else who asks for any, be
    it on one address alone; who names it may use it as well.
    """
    for _ in range(count):
        taken = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        taken.setsockopt(socket.IPPROTO_IP, IP_MULTICAST_ALL, 0)
        taken.bind(("", 0))
        taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        TAKEN.append(taken)
    return [taken.getsockname()[1] for taken in list(TAKEN)[-count:]]


def free_udp_port():
    """One of them."""
    return free_udp_ports(1)[0]


class MulticastBuses:
    """Stock python-can on `udp_multicast`, one port per bus of the hand, kept on this machine (hop limit 0)."""

    def __init__(self, count):
        self.ports = free_udp_ports(count)
        self.sources = [f"udp:{GROUP}:{port}?hops=0" for port in self.ports]
        self.buses = []

    def __enter__(self):
        for port in self.ports:
            self.buses.append(can.Bus(GROUP, interface="udp_multicast", port=port, hop_limit=0))
        return self

    def __exit__(self, *_):
        for bus in self.buses:
            bus.shutdown()

    def send(self, frames):
        """Sends (bus, message) pairs in bursts that fit into a default receive buffer."""
        for i, (bus, message) in enumerate(frames, 1):
            self.buses[bus].send(message)
            if i % BURST == 0:
                time.sleep(0.002)

    def send_datagram(self, bus, payload):
        """Sends bytes that need not be a frame."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            sender.sendto(payload, (GROUP, self.ports[bus]))


class VcanBuses:
    """Stock python-can on SocketCAN, on virtual interfaces made for the test; needs root."""

    def __init__(self, count):
        self.names = [f"hand{n}" for n in range(count)]
        self.sources = [f"can:{name}" for name in self.names]
        self.buses = [None] * count

    def __enter__(self):
        for n in range(len(self.names)):
            self.create(n)
        return self

    def __exit__(self, *_):
        for n, bus in enumerate(self.buses):
            if bus:
                self.delete(n)

    def ip(self, *arguments):
        subprocess.run(["ip", "link", *arguments], check=True, capture_output=True)

    def create(self, n):
        self.ip("add", self.names[n], "type", "vcan")
        self.set(n, "up")

    def set(self, n, state):
        """Sets the link up or down; python-can opens it anew, since its socket fails once after a link was down."""
        self.ip("set", self.names[n], state)
        if state == "up":
            if self.buses[n]:
                self.buses[n].shutdown()
            self.buses[n] = can.Bus(self.names[n], interface="socketcan")

    def delete(self, n):
        self.buses[n].shutdown()
        self.buses[n] = None
        self.ip("delete", self.names[n])

    def send(self, frames):
        for bus, message in frames:
            self.buses[bus].send(message)
