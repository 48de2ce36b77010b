"""Requests as the daemon reads them, and what it replies (docs/wire.md, "The control socket")."""

import json
import os
import warnings
from typing import Any, Dict, Mapping, NamedTuple, Optional

from .arguments import plain
from .errors import Refused
from .place import running_socket

STATUS = {"cmd": "status"}
PROFILE = {"cmd": "profile"}
TRIES = 3
"""How often something is asked for whose connection has to make room for others before it is begun."""


class Mark(NamedTuple):
    """Where a mark was put."""

    seq: int
    """Number of the newest frame then."""
    t_ns: int
    """The instant, nanoseconds on HELLO's clock."""


def torque(joint: str, on: bool, pwm_percent: Optional[float], hold_ms: Optional[float]) -> Dict[str, Any]:
    """Switches a motor."""
    more = {"pwm_percent": pwm_percent, "hold_ms": hold_ms}
    given = {key: value for key, value in more.items() if value is not None}
    return {"cmd": "servo", "joint": joint, "torque": on, **given}


def pwm_together(percent: Mapping[str, float]) -> Dict[str, Any]:
    """Gives several motors their PWM."""
    return {"cmd": "servos", "pwm_percent": dict(percent)}


def mark_of(answer: Dict[str, Any]) -> Mark:
    """The mark that was put."""
    return Mark(int(answer["mark"]["seq"]), int(answer["mark"]["t_ns"]))


def place(path: Optional[str], request: Optional[Dict[str, Any]] = None) -> str:
    """The socket that takes a request; without one that which takes all."""
    return path or os.fspath(running_socket("status.sock" if request in (STATUS, PROFILE) else "control.sock"))


def encode(request: Dict[str, Any], is_held: bool) -> bytes:
    """The line. `is_held` says whether its connection outlives it."""
    if isinstance(request, dict) and "hold_ms" in request and not is_held:
        raise RuntimeError("a motor is held as long as its connection: `with taxel.Control() as control:`")
    return json.dumps(plain(request)).encode() + b"\n"


def _is_off(request: Dict[str, Any]) -> bool:
    """Whether it has a motor switched off, which depends on no connection and may be asked for twice."""
    # Whatever else it may be is the daemon's to refuse.
    return isinstance(request, dict) and request.keys() == {"cmd", "joint", "torque"} and not request["torque"]


def is_to_be_asked_elsewhere(request: Dict[str, Any], reply: bytes) -> bool:
    """Whether the connection of a `with` block left unanswered what may be asked over others."""
    return _is_off(request) and (not reply or is_to_be_asked_again(reply))


def is_to_be_asked_again(reply: bytes) -> bool:
    """Whether the connection had to make room for another, and nothing was begun that must not be done twice."""
    return b'"ask_again"' in reply and json.loads(reply).get("ask_again") is True


def decode(reply: bytes, path: str) -> Dict[str, Any]:
    """The answer. Raises Refused where it is no."""
    line, end, _ = reply.partition(b"\n")
    if not end:
        raise ConnectionError(f"{path}: taxeld closed the connection before it answered")
    answer: Dict[str, Any] = json.loads(line)
    if not answer.get("ok"):
        raise Refused(str(answer.get("error", "refused")), answer.get("held_by"))
    if "warning" in answer:
        warnings.warn(str(answer["warning"]), RuntimeWarning, stacklevel=4)
    return answer


def no_daemon(error: OSError, path: str) -> OSError:
    """The same, with the place and a question."""
    if isinstance(error, TimeoutError):
        return error
    return type(error)(error.errno, f"{path}: {error.strerror}; does taxeld run?")


def unanswered(request: Dict[str, Any], path: str, timeout: float) -> TimeoutError:
    """No answer has come in time."""
    perhaps = "" if request in (STATUS, PROFILE) else "; what it was asked for may still be done, as its status tells"
    return TimeoutError(f"{path}: taxeld has not answered within {timeout} s{perhaps}")


def reply_behind_the_end(request: Dict[str, Any], path: str) -> bytes:
    """None, of a connection that is over; raises ConnectionError for what is not asked elsewhere."""
    if is_to_be_asked_elsewhere(request, b""):
        return b""
    raise ConnectionError(f"{path}: the connection has ended, and what it held is let go; begin another `with`")
