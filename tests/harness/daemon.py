"""The real taxeld as a process, and its control socket."""

import ctypes
import json
import os
import signal
import socket
import subprocess
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
import taxel_reader

PR_SET_PDEATHSIG = 1
LIBC = ctypes.CDLL(None, use_errno=True)
REPOSITORY = Path(__file__).resolve().parents[2]


def binary(name):
    """A built binary: from TAXEL_BIN_DIR, else the newest of the debug and release builds."""
    if "TAXEL_BIN_DIR" in os.environ:
        return Path(os.environ["TAXEL_BIN_DIR"]) / name
    built = [REPOSITORY / "target" / profile / name for profile in ("debug", "release")]
    return max((p for p in built if p.exists()), key=lambda p: p.stat().st_mtime, default=built[0])


def must_be_built(*names):
    """Ends the test run at its beginning if one of these is not there."""
    for path in map(binary, names):
        if not path.exists():
            pytest.exit(f"{path} is not built: cargo build --workspace --bins --examples", returncode=3)


def die_with_parent():
    """Run in a new process: the kernel ends it when the test run ends, however that happens."""
    LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


# What has not come by then does not come, however busy the machine is. The longest test may take three times this.
HANGS_AFTER_S = 300


def eventually(condition, what, seconds=HANGS_AFTER_S, rest=0):
    """Waits until `condition()` is truthy and returns it; fails with `what`. The time only bounds a failure.

    Between two looks it rests `rest` times as long as one took, half a second at most: an emulated machine would answer nothing
    but looks.
    """
    end = time.monotonic() + seconds
    began = time.monotonic()
    while not (value := condition()):
        looked = time.monotonic()
        assert looked < end, f"after {seconds} s: {what() if callable(what) else what}"
        time.sleep(max(0.01, min(0.5, rest * (looked - began))))
        began = time.monotonic()
    return value


def reader_of(path):
    """A reader of the messages at a socket, as soon as somebody listens there."""

    def listens():
        try:
            return taxel_reader.connect(path)
        except (FileNotFoundError, ConnectionRefusedError):
            return None

    return eventually(listens, f"nobody listens at {path}")


def gathered(reader, kind):
    """The list that a reader's messages of a kind are added to as they come: the header of each, and what it says."""
    found = []

    def read():
        try:
            while True:
                message = reader.receive()
                if message.header.type == kind:
                    found.append((message.header, message.json()))
        except taxel_reader.Closed:
            pass

    threading.Thread(target=read, daemon=True).start()
    return found


def toml(value, within=""):
    """A value, or a dict of tables and keys, as TOML; `within` names the table it stands in, with a dot."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (str, Path)):
        return json.dumps(str(value))
    if isinstance(value, (list, tuple)) and any(isinstance(v, dict) for v in value):
        return "[" + ", ".join("{" + ", ".join(f"{k} = {toml(v)}" for k, v in row.items()) + "}" for row in value) + "]"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml(v) for v in value) + "]"
    if isinstance(value, dict):
        keys = [f"{k} = {toml(v)}" for k, v in value.items() if not isinstance(v, dict)]
        tables = [f"\n[{within}{k}]\n{toml(v, f'{within}{k}.')}" for k, v in value.items() if isinstance(v, dict)]
        return "\n".join(keys + tables)
    return repr(value)


class Programs:
    """`taxel`, as often as it is started; every one is gone at the end."""

    def __init__(self):
        self.running = []

    def __call__(self, *arguments, **pipes):
        process = subprocess.Popen(
            [binary("taxel"), *map(str, arguments)], preexec_fn=die_with_parent, text=True, **pipes
        )
        self.running.append(process)
        return process

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in self.running:
            process.kill()
            process.wait()


class Daemon:
    """A running taxeld. Use it as a context: the process is gone afterwards, whatever happened.

    `tables` are the tables of its configuration; sockets go into `folder` unless they say otherwise.
    """

    def __init__(self, folder, sources, layout="allegro-uskin-15", environment=None, **tables):
        self.folder = Path(folder)
        self.folder.mkdir(exist_ok=True)
        self.config = self.folder / "taxeld.toml"
        self.log_path = self.folder / "taxeld.log"
        self.environment = environment or {}
        # A test that looks at something else for a while has not stopped reading.
        sockets = {name: self.folder / f"{name}.sock" for name in ("images", "control")}
        tables["socket"] = {**sockets, "stall_ms": 60_000, **tables.get("socket", {})}
        self.images, self.control_path = (Path(tables["socket"][name]) for name in sockets)
        buses = "".join(f"\n[[bus]]\nsource = {toml(s)}\n" for s in sources)
        self.config.write_text(f"layout = {toml(layout)}\n{buses}\n{toml(tables)}\n")
        self.process = None

    def __enter__(self):
        try:
            return self.start()
        except BaseException:
            self.kill()
            raise

    def __exit__(self, kind, _value, _trace):
        if kind is not None:
            print(f"--- log of {self.config}\n{self.log}", flush=True)
        if self.process and self.process.poll() is None:
            status = self.stop()
            assert kind is not None or status == 0, f"taxeld ended with {status}:\n{self.log}"

    def spawn(self, under=()):
        """Starts the process, `under` a command such as strace, and does not wait for its sockets."""
        with self.log_path.open("ab") as log:
            self.process = subprocess.Popen(
                [*under, binary("taxeld"), "--config", self.config],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                preexec_fn=die_with_parent,
                env={**os.environ, "RUST_LOG": "info", "RUST_BACKTRACE": "1", **self.environment},
            )
        return self

    def start(self):
        self.spawn()
        eventually(self._answers, lambda: f"taxeld does not answer; its log:\n{self.log}", rest=2)
        return self

    def _answers(self):
        assert self.process.poll() is None, f"taxeld ended with {self.process.returncode}:\n{self.log}"
        try:
            return self.control("status")["ok"]
        except (FileNotFoundError, ConnectionRefusedError):
            return False

    def stop(self, by=signal.SIGTERM, seconds=HANGS_AFTER_S):
        """Asks it to end and returns its exit status; one that does not end is killed, and that is a failure."""
        self.process.send_signal(by)
        try:
            return self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.kill()
            raise AssertionError(f"taxeld did not end within {seconds} s of {by!r}:\n{self.log}") from None

    def hold(self):
        """Stops it, as a machine that is held up; it is when this returns."""
        self.process.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, self.process.pid, os.WSTOPPED)

    def go_on(self):
        """Ends that."""
        self.process.send_signal(signal.SIGCONT)

    def kill(self):
        if self.process and self.process.poll() is None:
            self.process.kill()
            self.process.wait()

    @property
    def log(self):
        return self.log_path.read_text(errors="replace") if self.log_path.exists() else ""

    def control(self, cmd, **arguments):
        """One request on the control socket; its reply."""
        with connect(self.control_path) as connection:
            connection.settimeout(HANGS_AFTER_S)
            return ask(connection, {"cmd": cmd, **arguments})

    def status(self):
        reply = self.control("status")
        assert reply["ok"], reply
        return reply["status"]

    def bus(self, index=0):
        return self.status()["buses"][index]

    def wait_status(self, condition, what, seconds=HANGS_AFTER_S):
        """Waits until `condition(status)` is truthy; fails with the last status."""
        last = {}

        def met():
            last.clear()
            last.update(self.status())
            return condition(last)

        eventually(met, lambda: f"{what}; status: {json.dumps(last)[:4000]}", seconds, rest=2)
        return last

    def report(self, times):
        """Waits until it has said this often what is wrong, once a second: what is not told by then, it does not tell."""
        with taxel_reader.connect(self.images, image=False, status=True) as reader:
            reports = 0
            # The first comes at once, of a look at the hand that may be over.
            while reports <= times:
                message = reader.receive(HANGS_AFTER_S)
                assert message is not None, f"no report within {HANGS_AFTER_S} s:\n{self.log}"
                reports += message.header.type == taxel_reader.STATUS


def kinds(status):
    """The kinds of what is wrong."""
    return sorted({p["kind"] for p in status["problems"]})


def problem(status, kind):
    """The first problem of this kind, None where there is none."""
    return next((p for p in status["problems"] if p["kind"] == kind), None)


def connect(path):
    """A connection to a socket that takes requests. It waits where more come at once than are let in."""
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connection.connect(str(path))
    return connection


@contextmanager
def asking_on(connection):
    """Something is asked on a connection time and again, so that nothing is let go for its silence."""
    over = threading.Event()

    def ask_on():
        while not over.wait(0.2):
            ask(connection, {"cmd": "status"})

    thread = threading.Thread(target=ask_on)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def told_once_each_time(log, said):
    """Whether a log that says something more than once says that it was over in between, or that it left that out."""
    behind = log.split(said)[1:]
    again = [" (after " in before or "in between were not told" in after.split("\n")[0] for before, after in zip(behind, behind[1:])]
    return bool(behind) and all(again)


def ask(connection, request):
    """Sends one line on a control connection and reads one."""
    connection.sendall(json.dumps(request).encode() + b"\n")
    return read_reply(connection)


def read_reply(connection):
    line = b""
    while not line.endswith(b"\n"):
        part = connection.recv(65536)
        assert part, f"the control connection closed in the middle of a reply: {line!r}"
        line += part
    # Behind it may stand why the connection is closed.
    return json.loads(line.splitlines()[0])
