"""A CAN adapter of the serial-line kind: the kernel's `slcan` on a pty of which the test is the adapter.

It is a real CAN device of the kernel: with bit rate, error state, bus-off and loss of carrier. What it has not is the
automatic restart after bus-off, which the kernel refuses for this driver.
"""

import fcntl
import os
import pty
import struct
import subprocess
import termios
import threading
import time
import tty

N_SLCAN = 17
SIOCGIFNAME = 0x8910


class SlcanAdapter:
    """An adapter that is plugged in as interface `name`, down. `line` writes to the host what an adapter would."""

    def __init__(self, name):
        self.name = name
        self.heard = bytearray()
        self.master, self.slave = pty.openpty()
        tty.setraw(self.master)
        tty.setraw(self.slave)
        threading.Thread(target=self._drain, args=(self.master,), daemon=True).start()
        fcntl.ioctl(self.slave, termios.TIOCSETD, struct.pack("i", N_SLCAN))
        given = fcntl.ioctl(self.slave, SIOCGIFNAME, bytes(16)).split(b"\0")[0].decode()
        if given != name:
            self._ip(f"set {given} name {name}")
        self._ip(f"set {name} type can bitrate 1000000")

    def _drain(self, master):
        # The kernel waits until the adapter has taken its commands.
        while True:
            try:
                self.heard += os.read(master, 4096)
            except OSError:
                return

    def _ip(self, arguments):
        subprocess.run(["ip", "link", *arguments.split()], check=True, capture_output=True)

    def up(self):
        self._ip(f"set {self.name} up")

    def down(self):
        self._ip(f"set {self.name} down")

    def index(self):
        with open(f"/sys/class/net/{self.name}/ifindex") as f:
            return int(f.read())

    def line(self, text):
        os.write(self.master, text.encode() + b"\r")

    def state(self, letter, tx=0, rx=0):
        """The controller's state: a(ctive), w(arning), p(assive), b(us off), and its error counters."""
        self.line(f"s{letter}{rx:03}{tx:03}")

    def frame(self, frame):
        """A frame as `harness.boards.FRAME` packs it."""
        id, length, data = struct.unpack("=IB3x8s", frame)
        self.line(f"t{id:03X}{length}{data[:length].hex().upper()}")

    def unplug(self):
        """The adapter is pulled: the kernel removes the interface."""
        if self.master is None:
            return
        os.close(self.slave)
        os.close(self.master)
        self.master = None
        end = time.monotonic() + 10
        while os.path.exists(f"/sys/class/net/{self.name}"):
            assert time.monotonic() < end, "the interface of an unplugged adapter stays"
            time.sleep(0.01)
