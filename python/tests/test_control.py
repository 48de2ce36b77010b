"""Requests, against the fake daemon."""

import socket

import pytest
import taxel


def test_each_request_is_one_of_the_page(daemon):
    control = taxel.Control(daemon.control)
    assert control.mark("squeeze 3") == taxel.Mark(0, 0)
    control.rezero()
    control.pause()
    control.resume()
    control.set_profile({"levels": 4})
    control.torque("index 0", False)
    control.pwm("index 0", -12.5)
    assert control.status() == {} and control.profile() == {}
    assert daemon.requests == [
        {"cmd": "mark", "text": "squeeze 3"},
        {"cmd": "rezero"},
        {"cmd": "pause"},
        {"cmd": "resume"},
        {"cmd": "profile", "profile": {"levels": 4}},
        {"cmd": "servo", "joint": "index 0", "torque": False},
        {"cmd": "servo", "joint": "index 0", "pwm_percent": -12.5},
        {"cmd": "status"},
        {"cmd": "profile"},
    ]


def test_a_refusal_is_raised_with_its_sentence(daemon):
    daemon.answer = lambda _: {"ok": False, "error": "this socket only tells"}
    with pytest.raises(taxel.Refused, match="this socket only tells"):
        taxel.Control(daemon.control).rezero()


def test_a_warning_beside_what_was_done_is_given(daemon):
    daemon.answer = lambda _: {"ok": True, "warning": "index 0: the servo reports a hardware error: overload"}
    with pytest.warns(RuntimeWarning, match="index 0: .* overload"):
        taxel.Control(daemon.control).torque("index 0", True)


def test_no_daemon_is_told_with_its_place(tmp_path):
    with pytest.raises(FileNotFoundError, match="control.sock.*does taxeld run"):
        taxel.Control(tmp_path / "control.sock").status()


def test_a_daemon_that_does_not_answer_is_told_with_its_place(tmp_path):
    place = tmp_path / "hung.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as hung:
        hung.bind(str(place))
        hung.listen()
        with pytest.raises(TimeoutError, match="hung.sock: taxeld has not answered within 0.05 s; .* may still be done"):
            taxel.Control(place, timeout=0.05).rezero()
        with pytest.raises(TimeoutError, match="hung.sock: taxeld has not answered within 0.05 s$"):
            taxel.Control(place, timeout=0.05).status()


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
