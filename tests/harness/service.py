"""taxeld as a service of a real systemd, on a machine of which nothing is kept."""

import ctypes
import json
import os
import shutil
import subprocess
import threading
from pathlib import Path

from harness.daemon import HANGS_AFTER_S, ask, connect, eventually, toml

UNITS = Path("/etc/systemd/system")
DATABASE = Path("/var/lib/taxel-dpkg")
PTRACE_INTERRUPT, PTRACE_SEIZE, WALL = 0x4207, 0x4206, 0x40000000

LAYOUT = """
name = "two-buses"
image = { width = 8, height = 4 }
buses = ["left", "right"]
"""
MODULE = """
[[module]]
name = "{bus} 0"
part = "{bus}"
bus = "{bus}"
board = 0
protocol = "uskin-l2"
at = [{x}, 0]
"""


def run(*command, check=False):
    ended = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    assert not check or ended.returncode == 0, f"{command}: {ended.stdout}{ended.stderr}"
    return ended


def systemctl(*words, check=False):
    return run("systemctl", "--no-pager", *words, check=check)


def is_active():
    return systemctl("is-active", "taxeld.service").stdout.strip() == "active"


def dpkg(*words):
    """dpkg with a database of its own: it would read the lists of all that this machine has installed each time."""
    for folder in ("info", "updates"):
        (DATABASE / folder).mkdir(parents=True, exist_ok=True)
    (DATABASE / "status").touch()
    run("dpkg", "--admindir", DATABASE, "--force-depends", "--force-unsafe-io", *words, check=True)


def install(package):
    dpkg("--install", package)


def configure():
    """What dpkg runs once it has unpacked a package that was there before: unpacking takes an emulated machine long."""
    run(DATABASE / "info/taxeld.postinst", "configure", "0", check=True)


class Service:
    """A unit of the package, its configuration, and what an administrator adds to it."""

    def __init__(self, name):
        self.unit = f"{name}.service"
        self.instance = name.partition("@")[2]
        self.config = Path(f"/etc/taxeld/{self.instance or 'taxeld'}.toml")
        self.runtime = Path(f"/run/{name.replace('@', '-')}")
        self.additions = UNITS / f"{self.unit}.d"
        self.shipped = self.config.read_text() if self.config.exists() else None

    def configure(self, sources, profile=None, layout="two-buses.toml", **tables):
        """Another hand and other buses; who may do what stays as it is installed."""
        text = LAYOUT + "".join(MODULE.format(bus=bus, x=4 * i) for i, bus in enumerate(("left", "right")))
        self.config.with_name("two-buses.toml").write_text(text)
        buses = "".join(f"[[bus]]\nsource = {toml(source)}\n" for source in sources)
        tables = {
            # An emulated machine that is busy with something else takes a tenth of a second for an image and longer.
            "tick": {"mode": "timer", "rate_hz": 2.0},
            "profile": {"levels": 4, "actuators": 2, **(profile or {})},
            "profiles": {"budget_percent": 100.0},
            "socket": {"mode": "0660", "group": "tactile"},
            "control": {"mode": "0660", "group": "tactile-control"},
            "realtime": {"priority": 10, "lock_memory": True},
            **tables,
        }
        self.config.write_text(f"layout = {toml(layout)}\n{buses}\n{toml(tables)}\n")

    def add(self, **settings):
        """A drop-in of the administrator."""
        self.add_text("[Service]\n" + "".join(f"{key}={value}\n" for key, value in settings.items()))

    def add_text(self, text, name="test.conf"):
        self.additions.mkdir(exist_ok=True)
        (self.additions / name).write_text(text)
        systemctl("daemon-reload", check=True)

    def clean(self):
        if self.additions.exists():
            shutil.rmtree(self.additions)
            systemctl("daemon-reload", check=True)
        if self.shipped is None:
            self.config.unlink(missing_ok=True)
        elif self.config.parent.exists():
            self.config.write_text(self.shipped)

    def start(self, check=True):
        ended = systemctl("start", self.unit)
        assert not check or ended.returncode == 0, f"{ended.stderr}\n{self.newest()}"
        return ended

    def stop(self):
        systemctl("stop", self.unit, check=True)

    def show(self, name):
        return systemctl("show", "--value", "--property", name, self.unit).stdout.strip()

    @property
    def pid(self):
        return int(self.show("MainPID"))

    def wait(self, name, value):
        eventually(
            lambda: self.show(name) == value,
            lambda: f"{name} is {self.show(name)}, not {value}\n{self.newest()}",
            rest=2,
        )

    def wait_restarts(self, count):
        """Until systemd has started it again, and it is ready."""
        self.wait("NRestarts", str(count))
        self.wait("ActiveState", "active")

    def journal(self, *options):
        return run("journalctl", "--no-pager", "--unit", self.unit, "--output", "cat", *options).stdout

    def newest(self):
        """The end of its journal, for the message of a test that fails."""
        return self.journal("--lines", "40")

    def wait_journal(self, words, *options):
        """Waits for words in its journal, and returns the whole of it."""
        eventually(lambda: words in self.journal(*options), lambda: f"not said: {words}\n{self.newest()}", rest=2)
        return self.journal(*options)

    @property
    def images(self):
        return self.runtime / "images.sock"

    def control(self, cmd, **arguments):
        with connect(self.runtime / "control.sock") as connection:
            reply = ask(connection, {"cmd": cmd, **arguments})
            assert reply["ok"], reply
            return reply

    def status(self):
        return self.control("status")["status"]

    def wait_status(self, condition, what):
        eventually(lambda: condition(self.status()), lambda: f"{what}: {json.dumps(self.status())[:3000]}", rest=2)

    def thread(self, name):
        """The id of the thread of this name."""
        for task in Path(f"/proc/{self.pid}/task").iterdir():
            if (task / "comm").read_text().strip() == name:
                return int(task.name)
        raise AssertionError(f"no thread {name}")


class Held:
    """A thread of another process that is stopped alone, as one that hangs; the others run on."""

    def __init__(self, thread):
        self.thread = thread
        self.let_go = threading.Event()
        self.is_held = threading.Event()
        self.holder = threading.Thread(target=self._hold, daemon=True)

    def _hold(self):
        libc = ctypes.CDLL(None, use_errno=True)
        libc.ptrace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
        for request in (PTRACE_SEIZE, PTRACE_INTERRUPT):
            if libc.ptrace(request, self.thread, None, None) != 0:
                raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
        self.is_held.set()
        # The thread goes on when whoever traces it ends. Killed, it is gone only when that has been taken note of.
        while not self.let_go.wait(0.05):
            try:
                os.waitpid(self.thread, os.WNOHANG | WALL)
            except ChildProcessError:
                return

    def __enter__(self):
        self.holder.start()
        assert self.is_held.wait(HANGS_AFTER_S), "the thread cannot be held"
        return self

    def __exit__(self, *_):
        self.let_go.set()
        self.holder.join()
