"""Requests to the running daemon: its status, re-zero, pause, profile, marks, servos."""

import contextlib
import os
import socket
import threading
import time
from typing import Any, Dict, Mapping, Optional

from . import _reader, requests
from .arguments import Path
from .requests import Mark


class Control:
    """The daemon's control socket; each request is a connection of its own, so that a restart harms none.

    Without a path it is the daemon of this user, or else of the system: what only tells is then asked at the status
    socket, which is open to more users. Each request raises Refused where the daemon says no, OSError where none runs,
    TimeoutError where it does not answer within `timeout` seconds.

    Used as a context, all requests go over one connection, from any thread, and motors can be held (`torque`). One that
    was not answered ends it; motors can be switched off all the same, over other connections.
    """

    def __init__(self, path: Optional[Path] = None, timeout: float = 10.0) -> None:
        self.path = None if path is None else os.fsdecode(path)
        self.timeout = timeout
        self._held: Optional[_Connection] = None

    def __enter__(self) -> "Control":
        if self._held:
            raise RuntimeError("it is used as a context already; make another Control")
        self._held = _Connection(requests.place(self.path), self.timeout)
        return self

    def __exit__(self, *_exc: object) -> None:
        held, self._held = self._held, None
        if held:
            held.close()

    def status(self) -> Dict[str, Any]:
        """Everything the daemon knows of itself and the hand."""
        return dict(self.request(requests.STATUS)["status"])

    def profile(self) -> Dict[str, Any]:
        """The display profile of subscribers that state none."""
        return dict(self.request(requests.PROFILE)["profile"])

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
        return requests.mark_of(self.request({"cmd": "mark", "text": text}))

    def torque(
        self, joint: str, on: bool, *, pwm_percent: Optional[float] = None, hold_ms: Optional[float] = None
    ) -> None:
        """Switches a servo's motor on or off, where `allow_writes = true`; warns where it reports a hardware error.

        A motor in PWM mode begins with `pwm_percent`, or else with all that its PWM Limit allows. With `hold_ms`, 20 to
        10,000, in a `with` block alone, it is switched off when the block or this program ends, or asks nothing for so
        long (`keep_alive`). Meanwhile no other program drives it: it is refused with `held_by`, the process of this one.
        It is held also where Refused says that the servo did not confirm. Off ends any hold.
        """
        self.request(requests.torque(joint, on, pwm_percent, hold_ms))

    def keep_alive(self) -> None:
        """Asks something, so that motors stay held: due within each `hold_ms` in which nothing else is asked.

        Not for a thread or task of its own, which goes on when what moves the hand hangs.
        """
        self.request(requests.PROFILE)

    def pwm(self, joint: str, percent: float) -> None:
        """Gives a servo a PWM, -100 to 100 percent, where `allow_writes = true` and its torque is on."""
        self.request({"cmd": "servo", "joint": joint, "pwm_percent": percent})

    def pwm_together(self, percent: Mapping[str, float]) -> None:
        """The same for several servos, by their joints, at one instant; all or none."""
        self.request(requests.pwm_together(percent))

    def request(self, request: Dict[str, Any]) -> Dict[str, Any]:
        """Sends one request and returns the answer (docs/wire.md, "The control socket")."""
        held = self._held
        line = requests.encode(request, held is not None)
        if held:
            reply = held.ask(request, line)
            if not requests.is_to_be_asked_elsewhere(request, reply):
                return requests.decode(reply, held.path)
        for _ in range(requests.TRIES):
            with contextlib.closing(_Connection(requests.place(self.path, request), self.timeout)) as connection:
                reply = connection.ask(request, line)
            if not requests.is_to_be_asked_again(reply):
                break
        return requests.decode(reply, connection.path)


class _Connection:
    def __init__(self, path: str, timeout: float) -> None:
        self.path = path
        self._timeout = timeout
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._replies = self._socket.makefile("rb")
        self._alone = threading.Lock()
        try:
            for seconds in _reader.attempts(self._socket, path, timeout):
                time.sleep(seconds)
        except OSError as error:
            self.close()
            raise requests.no_daemon(error, path) from None
        self._socket.settimeout(timeout)

    def ask(self, request: Dict[str, Any], line: bytes) -> bytes:
        """The reply, nothing where the connection has ended. A time-out ends it: the next would be given its reply."""
        with self._alone:
            if self._replies.closed:
                return requests.reply_behind_the_end(request, self.path)
            try:
                # What has closed the connection may have said why.
                with contextlib.suppress(ConnectionError):
                    self._socket.sendall(line)
                with contextlib.suppress(ConnectionError):
                    return self._replies.readline()
                return b""
            except socket.timeout:
                self.close()
                raise requests.unanswered(request, self.path, self._timeout) from None
            except BaseException:
                self.close()
                raise

    def close(self) -> None:
        # Another thread that waits for a reply is woken.
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._replies.close()
        self._socket.close()


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
