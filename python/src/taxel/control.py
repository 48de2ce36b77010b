"""Requests to the running daemon: its status, re-zero, pause, profile, marks, servos."""

import json
import os
import socket
import warnings
from typing import Any, Dict, NamedTuple, Optional

from .arguments import Path, plain
from .errors import Refused
from .place import running_socket


class Mark(NamedTuple):
    """Where a mark was put."""

    seq: int
    """Number of the newest frame then."""
    t_ns: int
    """The instant, nanoseconds on HELLO's clock."""


class Control:
    """The daemon's control socket; each request is a connection of its own, so that a restart harms none.

    Without a path it is the daemon of this user, or else of the system: what only tells is then asked at the status
    socket, which is open to more users. Each request raises Refused where the daemon says no, OSError where none runs.
    """

    def __init__(self, path: Optional[Path] = None, timeout: float = 10.0) -> None:
        self.path = None if path is None else os.fsdecode(path)
        self.timeout = timeout

    def status(self) -> Dict[str, Any]:
        """Everything the daemon knows of itself and the hand."""
        return dict(self.request({"cmd": "status"})["status"])

    def profile(self) -> Dict[str, Any]:
        """The display profile of subscribers that state none."""
        return dict(self.request({"cmd": "profile"})["profile"])

    def set_profile(self, profile: Dict[str, Any]) -> None:
        """Replaces that profile; keys left out take their defaults."""
        self.request({"cmd": "profile", "profile": profile})

    def rezero(self) -> None:
        """Measures the baseline anew; the hand must not be touched meanwhile."""
        self.request({"cmd": "rezero"})

    def pause(self) -> None:
        """Shows no contact until `resume`, so that every display lets go."""
        self.request({"cmd": "pause"})

    def resume(self) -> None:
        """Shows contacts again."""
        self.request({"cmd": "resume"})

    def mark(self, text: str) -> Mark:
        """Tells every subscriber and recorder that something happened now; 1 to 500 bytes."""
        mark = self.request({"cmd": "mark", "text": text})["mark"]
        return Mark(int(mark["seq"]), int(mark["t_ns"]))

    def torque(self, joint: str, on: bool) -> None:
        """Switches a servo's motor on or off, where `allow_writes = true`; warns where it reports a hardware error."""
        self.request({"cmd": "servo", "joint": joint, "torque": on})

    def pwm(self, joint: str, percent: float) -> None:
        """Gives a servo a PWM, -100 to 100 percent, where `allow_writes = true` and its torque is on."""
        self.request({"cmd": "servo", "joint": joint, "pwm_percent": percent})

    def request(self, request: Dict[str, Any]) -> Dict[str, Any]:
        """Sends one request and returns the answer (docs/wire.md, "The control socket")."""
        line = json.dumps(plain(request)).encode() + b"\n"
        tells = request in ({"cmd": "status"}, {"cmd": "profile"})
        path = self.path or os.fspath(running_socket("status.sock" if tells else "control.sock"))
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
            connection.settimeout(self.timeout)
            try:
                connection.connect(path)
            except OSError as error:
                raise type(error)(error.errno, f"{path}: {error.strerror}; does taxeld run?") from None
            try:
                connection.sendall(line)
                with connection.makefile("rb") as answers:
                    reply = answers.readline()
            except socket.timeout:
                perhaps = "" if tells else "; what it was asked for may still be done, as its status tells"
                raise TimeoutError(f"{path}: taxeld has not answered within {self.timeout} s{perhaps}") from None
        if not reply.endswith(b"\n"):
            raise ConnectionError(f"{path}: taxeld closed the connection before it answered")
        answer: Dict[str, Any] = json.loads(reply)
        if not answer.get("ok"):
            raise Refused(str(answer.get("error", "refused")))
        if "warning" in answer:
            warnings.warn(str(answer["warning"]), RuntimeWarning, stacklevel=3)
        return answer


def status() -> Dict[str, Any]:
    """`Control().status()`."""
    return Control().status()


def profile() -> Dict[str, Any]:
    """`Control().profile()`."""
    return Control().profile()


def rezero() -> None:
    """`Control().rezero()`."""
    Control().rezero()


def pause() -> None:
    """`Control().pause()`."""
    Control().pause()


def resume() -> None:
    """`Control().resume()`."""
    Control().resume()


def mark(text: str) -> Mark:
    """`Control().mark(text)`."""
    return Control().mark(text)
