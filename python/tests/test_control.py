"""Requests, against the fake daemon, with asyncio and without."""

import asyncio
import contextlib
import functools
import inspect
import socket
import threading

import pytest
import taxel


class Awaited:
    """A Control of asyncio, as one without."""

    def __init__(self, loop, *arguments, **keys):
        self._control = taxel.aio.Control(*arguments, **keys)
        self._loop = loop

    def __getattr__(self, name):
        return lambda *arguments, **keys: self._run(getattr(self._control, name)(*arguments, **keys))

    def _run(self, asked):
        return self._loop.run_until_complete(asyncio.wait_for(asked, 300))

    def __enter__(self):
        self._run(self._control.__aenter__())
        return self

    def __exit__(self, *exc):
        self._run(self._control.__aexit__(*exc))


@pytest.fixture(params=["plain", "asyncio"])
def control_of(request):
    if request.param == "plain":
        yield taxel.Control
        return
    with contextlib.closing(asyncio.new_event_loop()) as loop:
        yield functools.partial(Awaited, loop)


def test_both_kinds_have_the_same_methods():
    kinds = [dict(inspect.getmembers(kind, inspect.isfunction)) for kind in (taxel.Control, taxel.aio.Control)]
    plain, awaited = ({n: inspect.signature(f) for n, f in kind.items() if not n.startswith("_")} for kind in kinds)
    assert plain == awaited


def test_each_request_is_one_of_the_page(daemon, control_of):
    control = control_of(daemon.control)
    assert control.mark("squeeze 3") == taxel.Mark(0, 0)
    control.rezero()
    control.pause()
    control.resume()
    control.set_profile({"levels": 4})
    control.torque("index 0", False)
    control.torque("index 0", True, pwm_percent=0)
    control.pwm("index 0", -12.5)
    control.pwm_together({"left": 45, "right": -45})
    assert control.status() == {} and control.profile() == {}
    assert daemon.requests == [
        {"cmd": "mark", "text": "squeeze 3"},
        {"cmd": "rezero"},
        {"cmd": "pause"},
        {"cmd": "resume"},
        {"cmd": "profile", "profile": {"levels": 4}},
        {"cmd": "servo", "joint": "index 0", "torque": False},
        {"cmd": "servo", "joint": "index 0", "torque": True, "pwm_percent": 0},
        {"cmd": "servo", "joint": "index 0", "pwm_percent": -12.5},
        {"cmd": "servos", "pwm_percent": {"left": 45, "right": -45}},
        {"cmd": "status"},
        {"cmd": "profile"},
    ]


def test_a_motor_is_held_until_the_block_ends_or_somebody_has_it_switched_off(daemon, control_of):
    with control_of(daemon.control) as control:
        control.torque("left", True, pwm_percent=0, hold_ms=10_000)
        control.torque("right", True, hold_ms=5000)
        control.torque("thumb", True)
        control.keep_alive()
        assert daemon.held == {"left": 10_000, "right": 5000}
        taxel.Control(daemon.control).torque("left", False)
        daemon.wait_until_held("right")
    daemon.wait_until_held()


def test_who_is_silent_holds_nothing_and_is_told_so(daemon, control_of):
    with control_of(daemon.control) as control:
        control.torque("left", True, hold_ms=20)
        daemon.wait_until_held()
        with pytest.raises(taxel.Refused, match="nothing was asked for 20ms"):
            control.keep_alive()
        with pytest.raises(ConnectionError, match="control.sock"):
            control.keep_alive()


def test_a_motor_is_held_in_a_block_alone(daemon, control_of):
    with pytest.raises(RuntimeError, match="with taxel.Control"):
        control_of(daemon.control).torque("left", True, hold_ms=500)
    with control_of(daemon.control) as control, pytest.raises(RuntimeError, match="another Control"):
        control.__enter__()
    assert daemon.requests == []


def test_what_was_not_begun_when_its_connection_made_room_is_asked_for_again_but_not_for_ever(daemon, control_of):
    again = {"ok": False, "error": "it made room", "ask_again": True}
    begun = {"ok": False, "error": "may still be done"}
    control = control_of(daemon.control)
    for replies, wanted in [([again, {"ok": True}], None), ([again, begun], "still"), ([again] * 3, "room")]:
        left = list(replies)
        daemon.answer = lambda _, left=left: left.pop(0)
        with contextlib.nullcontext() if wanted is None else pytest.raises(taxel.Refused, match=wanted):
            control.pause()
        assert left == []
    # A block's connection may hold motors, and another one would not.
    daemon.answer = lambda _: again
    with control_of(daemon.control) as control, pytest.raises(taxel.Refused, match="it made room"):
        control.pause()


def test_motors_are_switched_off_in_a_block_also_when_its_connection_has_made_room(daemon, control_of):
    answers = [{"ok": True}, {"ok": False, "error": "it made room", "ask_again": True}]
    with control_of(daemon.control) as control:
        daemon.answer = lambda _: answers.pop(0) if answers else {"ok": True}
        for joint in ("left", "right", "thumb"):
            control.torque(joint, False)
        with pytest.raises(ConnectionError, match="control.sock"):
            control.torque("left", True)
    asked = [request["joint"] for request in daemon.requests]
    assert asked == ["left", "right", "right", "thumb"]


def test_a_restart_ends_the_block_s_connection(daemon, control_of):
    with control_of(daemon.control) as control:
        control.torque("left", True, hold_ms=10_000)
        daemon.restart()
        for _ in range(2):
            with pytest.raises(ConnectionError, match="control.sock"):
                control.keep_alive()
    assert daemon.held == {}


def test_a_connection_that_is_closed_over_an_unread_request_is_told_with_its_place(tmp_path, control_of):
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as daemon:
        daemon.bind(str(tmp_path / "control.sock"))
        daemon.listen()
        with control_of(tmp_path / "control.sock") as control:
            accepted, _ = daemon.accept()
            with accepted:
                accepted.sendall(b'{"ok": false, "error": "it ends"}\n')
                with pytest.raises(taxel.Refused, match="it ends"):
                    control.keep_alive()
            for _ in range(2):
                with pytest.raises(ConnectionError, match="control.sock"):
                    control.keep_alive()


def test_a_reply_that_comes_late_is_not_that_of_the_next_request(daemon, control_of):
    with control_of(daemon.control, timeout=0.05) as control:
        late = threading.Event()
        daemon.answer = lambda _: late.wait(300) and {"ok": True}
        with pytest.raises(TimeoutError, match="has not answered"):
            control.rezero()
        late.set()
        with pytest.raises(ConnectionError, match="has ended, and what it held is let go"):
            control.mark("a")


def test_who_holds_a_motor_is_told_to_whoever_may_not_drive_it(daemon, control_of):
    daemon.answer = lambda _: {"ok": False, "error": "left: it is driven by user 0, process 7", "held_by": 7}
    with pytest.raises(taxel.Refused, match="driven by") as refused:
        control_of(daemon.control).torque("left", True)
    assert refused.value.held_by == 7


def test_a_daemon_that_takes_no_connection_is_told_with_its_place(tmp_path, control_of):
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as hangs, contextlib.ExitStack() as waiting:
        hangs.bind(str(tmp_path / "hung.sock"))
        hangs.listen(1)
        with contextlib.suppress(BlockingIOError):
            while True:
                client = waiting.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
                client.setblocking(False)
                client.connect(str(tmp_path / "hung.sock"))
        with pytest.raises(TimeoutError, match="takes no connection.*hung.sock"):
            control_of(tmp_path / "hung.sock", timeout=0.05).status()


def test_the_end_of_a_block_of_asyncio_ends_whoever_waits_in_it(daemon):
    late = threading.Event()
    daemon.answer = lambda _: late.wait(300) and {"ok": True}

    async def ask():
        async with taxel.aio.Control(daemon.control) as control:
            waits = asyncio.ensure_future(control.rezero())
            await asyncio.sleep(0)
            while not daemon.requests:
                await asyncio.sleep(0.001)
        with pytest.raises(ConnectionError, match="before it answered"):
            await waits

    asyncio.run(asyncio.wait_for(ask(), 300))
    late.set()


def test_a_refusal_is_raised_with_its_sentence(daemon, control_of):
    daemon.answer = lambda _: {"ok": False, "error": "this socket only tells"}
    with pytest.raises(taxel.Refused, match="this socket only tells"):
        control_of(daemon.control).rezero()


def test_a_warning_beside_what_was_done_is_given(daemon, control_of):
    daemon.answer = lambda _: {"ok": True, "warning": "index 0: the servo reports a hardware error: overload"}
    with pytest.warns(RuntimeWarning, match="index 0: .* overload"):
        control_of(daemon.control).torque("index 0", True)


def test_no_daemon_is_told_with_its_place(tmp_path, control_of):
    with pytest.raises(FileNotFoundError, match="control.sock.*does taxeld run"):
        control_of(tmp_path / "control.sock").status()


def test_a_daemon_that_does_not_answer_is_told_with_its_place(tmp_path, control_of):
    place = tmp_path / "hung.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as hung:
        hung.bind(str(place))
        hung.listen()
        with pytest.raises(TimeoutError, match="hung.sock: taxeld has not answered within 0.05 s; .* may still be done"):
            control_of(place, timeout=0.05).rezero()
        with pytest.raises(TimeoutError, match="hung.sock: taxeld has not answered within 0.05 s$"):
            control_of(place, timeout=0.05).status()


def test_the_sockets_of_the_own_daemon_come_before_the_systems(tmp_path, monkeypatch):
    monkeypatch.setattr("taxel.place.SYSTEM", tmp_path / "system")
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    own, system = (tmp_path / folder / "images.sock" for folder in ("taxeld", "system"))
    assert taxel.running_socket("images.sock") == own
    system.parent.mkdir()
    monkeypatch.setattr("os.access", lambda *_: False)
    assert taxel.running_socket("images.sock") == system
    own.parent.mkdir()
    own.touch()
    assert taxel.running_socket("images.sock") == own


def test_a_service_of_one_hand_is_never_shown_another_ones(tmp_path, monkeypatch):
    left, system = (tmp_path / folder / "images.sock" for folder in ("taxeld-left", "taxeld"))
    monkeypatch.setattr("taxel.place.SYSTEM", system.parent)
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(left.parent))
    for socket in left, system:
        socket.parent.mkdir()
    # Its own daemon is down, and the other hand's runs.
    system.touch()
    assert taxel.running_socket("images.sock") == left
