"""The control sockets: who may do what, and that nobody keeps others from doing it."""

import fcntl
import json
import os
import socket
import stat
import struct
import subprocess
import sys
import termios
import threading
import time
from contextlib import ExitStack

import pytest
from harness.daemon import HANGS_AFTER_S, Daemon, ask, connect, die_with_parent, eventually, read_reply
from harness.joints import IDS, SCENE, TICK, TORQUE, WRITING, driven, dynamixel, servo

PLACES = 128
# For how long a client is kept until its next line, and in all (daemon/src/clients/places.rs).
UNHEARD_S, KEPT_S = 0.1, 0.4


@pytest.fixture
def daemon(folder):
    with Daemon(folder / "d", SCENE, tick=TICK) as daemon:
        yield daemon


def test_the_connection_that_was_idle_for_longest_makes_room_and_is_told(daemon):
    with ExitStack() as stack:
        idle = [stack.enter_context(connect(daemon.control_path)) for _ in range(PLACES)]
        with connect(daemon.folder / "status.sock") as looker:
            let_in = lambda: ask(looker, {"cmd": "status"})["status"]["control"]["clients"] == PLACES + 1  # noqa: E731
            eventually(let_in, "not all of them are let in")
        # Who has not been heard yet is not idle.
        for client in idle:
            assert ask(client, {"cmd": "profile"})["ok"]
        # The first asks something again, which makes it the last.
        assert ask(idle[0], {"cmd": "status"})["ok"]
        late = [stack.enter_context(connect(daemon.control_path)) for _ in range(3)]
        for client in late:
            assert ask(client, {"cmd": "status"})["ok"]
        for client in idle[1:4]:
            told = read_reply(client)
            assert "made room" in told["error"] and told["ask_again"], told
            assert client.recv(1) == b""
        assert ask(idle[0], {"cmd": "status"})["status"]["control"]["made_room"] == 3


@pytest.mark.parametrize("limits", ["64:1024", "100:100"], ids=["raised", "held back"])
def test_readers_of_images_and_who_only_asks_leave_descriptors_to_those_who_command(folder, limits):
    daemon = Daemon(folder / "d", SCENE, tick=TICK, socket={"max_subscribers": 4096})
    with ExitStack() as stack:
        stack.callback(daemon.kill)
        daemon.spawn(["prlimit", f"--nofile={limits}"])
        eventually(daemon._answers, "it does not start")
        for _ in range(150):
            reader = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET))
            reader.connect(str(daemon.images))
            assert reader.recv(65536), "neither let in nor told why not"
        for _ in range(PLACES + 20):
            stack.enter_context(connect(daemon.folder / "status.sock"))
        with connect(daemon.control_path) as client:
            status = ask(client, {"cmd": "status"})["status"]
        soft, hard = limits.split(":")
        assert (len(status["subscribers"]) == 150) == (soft != hard), "the limit is not raised to the highest allowed"
        eventually(lambda: "files may be open" in daemon.log, lambda: daemon.log)
        assert "cannot accept" not in daemon.log, daemon.log


def test_with_few_files_it_says_so_and_ends_or_a_motor_can_be_switched_off(folder, servos):
    ended = []
    for limit in (4, 5, 8, 12, 16, 18, 19, 20, 22, 24, 26, 28, 30, 32, 40):
        daemon = Daemon(folder / f"{limit}", SCENE, tick=TICK, joints=dynamixel(servos.path, **WRITING))
        with ExitStack() as stack:
            stack.callback(daemon.kill)
            daemon.spawn(["prlimit", f"--nofile={limit}"])
            ready_or_over = lambda: daemon.process.poll() is not None or "ready" in daemon.log  # noqa: B023, E731
            eventually(ready_or_over, "it does not start")
            if daemon.process.poll() is not None:
                ended.append(limit)
                assert daemon.process.returncode == 78 and "LimitNOFILE=" in daemon.log, f"{limit}: {daemon.log}"
                continue
            for _ in range(20):
                reader = stack.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET))
                reader.settimeout(HANGS_AFTER_S)
                reader.connect(str(daemon.images))
                assert reader.recv(65536), "neither let in nor told why not"
            for _ in range(3):
                assert servo(daemon, "joint 5", "--torque", "off") == (0, ""), f"{limit}: {daemon.log}"
    assert 24 in ended and 40 not in ended, ended


def test_displays_that_connect_again_meanwhile_keep_no_start_from_going_well(folder):
    over = threading.Event()
    path = folder / "d" / "images.sock"

    def display():
        while not over.is_set():
            try:
                with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as reader:
                    reader.settimeout(HANGS_AFTER_S)
                    reader.connect(str(path))
                    while reader.recv(65536) and not over.is_set():
                        pass
            except OSError:
                over.wait(0.002)

    def starts(limit):
        daemon = Daemon(folder / "d", SCENE, tick=TICK)
        daemon.log_path.unlink(missing_ok=True)
        daemon.spawn(["prlimit", f"--nofile={limit}"])
        try:
            eventually(lambda: daemon.process.poll() is not None or "ready" in daemon.log, "it does not start")
            return daemon.process.poll() is None
        finally:
            daemon.kill()

    fewest = next(limit for limit in range(19, 60) if starts(limit))
    displays = [threading.Thread(target=display) for _ in range(20)]
    for thread in displays:
        thread.start()
    try:
        assert all(starts(fewest + 1) for _ in range(3))
    finally:
        over.set()
        for thread in displays:
            thread.join()


def test_a_client_that_asks_without_end_is_slowed_and_the_others_are_not(daemon):
    request = b'{"cmd":"profile"}\n'
    replies = []
    with connect(daemon.control_path) as flood, connect(daemon.control_path) as other:
        # Minutes of it.
        flood.sendall(request * 3000)
        reading = threading.Thread(target=lambda: replies.extend(flood.makefile("rb")))
        reading.start()
        for _ in range(10):
            counts = ask(other, {"cmd": "status"})["status"]["control"]
        # The flood's answers still come when the other has all of its own.
        assert counts["clients"] == 2 and counts["slowed"] < 2900, counts
        eventually(lambda: daemon.status()["control"]["slowed"] > 0, "nobody is slowed")
        eventually(lambda: len(replies) >= 100, "who is slowed is not answered")
        flood.shutdown(socket.SHUT_RDWR)
        reading.join()
        assert all(json.loads(reply)["ok"] for reply in replies if reply.endswith(b"\n"))


def test_nothing_keeps_a_motor_from_being_switched_off(folder, servos):
    over = threading.Event()
    requests = [{"cmd": "status"}, {"cmd": "servo", "joint": "joint 5", "pwm_percent": 1.0}, {"cmd": "rezero"}]

    def flood(path, number):
        request = json.dumps(requests[number % len(requests)]).encode() + b"\n"
        while not over.is_set():
            try:
                with connect(path) as client:
                    client.settimeout(0.2)
                    client.sendall(request * 50)
                    while client.recv(65536) and not over.is_set():
                        pass
            except OSError:
                pass

    def storm(path):
        while not over.is_set():
            try:
                connect(path).close()
            except OSError:
                pass
            over.wait(0.005)

    with driven(folder, servos) as daemon, ExitStack() as stack:
        assert servo(daemon, "joint 5", "--torque", "on") == (0, "")
        for _ in range(PLACES + 40):
            stack.enter_context(connect(daemon.control_path))
        threads = [threading.Thread(target=flood, args=(daemon.control_path, n)) for n in range(16)]
        threads.append(threading.Thread(target=storm, args=(daemon.control_path,)))
        stack.callback(lambda: [thread.join() for thread in threads])
        stack.callback(over.set)
        for thread in threads:
            thread.start()
        for _ in range(5):
            assert servo(daemon, "joint 5", "--torque", "off") == (0, "")
            assert servos.register(5, *TORQUE) == 0
        over.set()
        for thread in threads:
            thread.join()
        assert daemon.status()["control"]["made_room"] > 0


def test_whoever_makes_room_has_all_motors_switched_off_that_were_to_be(folder, servos):
    off = b"".join(b'{"cmd":"servo","joint":"joint %d","torque":false}\n' % n for n in range(2, 9))
    # However often, and however it is written.
    off += b"".join(b'{"cmd":"servo","joint":"joint %d","torque":false}%s\n' % (n % 7 + 2, b" " * n) for n in range(200))
    daemon = Daemon(folder / "d", SCENE, tick=TICK, joints=dynamixel(servos.path, **WRITING))
    with ExitStack() as stack:
        stack.callback(daemon.kill)
        daemon.spawn(["prlimit", "--nofile=48"])  # fewer places than may wait to be accepted
        eventually(daemon._answers, "it does not start")
        daemon.wait_status(lambda s: s["joints"]["readings"] > 50, "nothing is read")
        client = stack.enter_context(connect(daemon.control_path))
        for n in range(2, 9):
            assert ask(client, {"cmd": "servo", "joint": f"joint {n}", "torque": True})["ok"]
        before = daemon.status()["joints"]["writes_ok"]
        daemon.hold()
        client.sendall(off)
        for _ in range(100):
            stack.enter_context(connect(daemon.control_path))
        daemon.go_on()
        *answered, leave = client.makefile("rb").read().splitlines()
        assert json.loads(leave)["ask_again"], leave
        for n in range(2, 9):
            eventually(lambda n=n: servos.register(n, *TORQUE) == 0, f"the motor of {n} is on")
            # Whoever asked is told nothing of what had come with that line.
            eventually(lambda n=n: f"torque of joint {n} is off" in daemon.log, "the log does not say so")
        # Two writes, of its torque and its watchdog: once for each motor, and for what was answered or begun before.
        told = lambda status: (status["joints"]["writes_ok"] - before) / 2  # noqa: E731
        daemon.wait_status(lambda s: told(s) >= 7, "not each is told")
        daemon.report(1)
        assert told(daemon.status()) <= 7 + len(answered) + 1


OCCUPANT = """
import selectors, socket, sys
path, line, in_flight = sys.argv[1], sys.argv[2].encode() + b"\\n", int(sys.argv[3])
selector = selectors.DefaultSelector()
while True:
    while len(selector.get_map()) < 16:
        client = socket.socket(socket.AF_UNIX)
        client.connect(path)
        try:
            client.sendall(line * in_flight)
        except OSError:
            client.close()
            continue
        selector.register(client, selectors.EVENT_READ)
    for key, _ in selector.select():
        try:
            came = key.fileobj.recv(65536)
            key.fileobj.sendall(line * came.count(b"\\n"))
        except OSError:
            came = b""
        if not came or b"made room" in came:
            selector.unregister(key.fileobj)
            key.fileobj.close()
"""


def occupy(stack, daemon, processes, line="", in_flight=0):
    """So many processes with sixteen connections each, over which they ask the same without end, or nothing."""
    arguments = [sys.executable, "-c", OCCUPANT, daemon.control_path, line, str(in_flight)]
    for _ in range(processes):
        process = subprocess.Popen(arguments, preexec_fn=die_with_parent)
        stack.callback(process.wait)
        stack.callback(process.kill)
    with connect(daemon.folder / "status.sock") as looker:
        clients = lambda: ask(looker, {"cmd": "status"})["status"]["control"]["clients"]  # noqa: E731
        eventually(lambda: clients() == PLACES + 1, "places are free")


def test_processes_that_have_a_silent_motor_switched_off_without_end_keep_nobody_else_out(folder, servos):
    with driven(folder, servos) as daemon, ExitStack() as stack:
        assert daemon.control("servo", joint="joint 5", torque=True)["ok"]
        servos.tell("fault 1 silent")
        occupy(stack, daemon, 8, '{"cmd":"servo","joint":"joint 1","torque":false}', in_flight=100)
        for _ in range(5):
            with connect(daemon.control_path) as client:
                client.settimeout(HANGS_AFTER_S)
                ask(client, {"cmd": "servo", "joint": "joint 5", "torque": False})
            eventually(lambda: servos.register(5, *TORQUE) == 0, "the motor is on")


def test_who_has_motors_switched_off_without_end_that_are_off_keeps_no_other_from_being_driven(folder, servos):
    for id in IDS:
        servos.tell(f"fault {id} late:30")
    over, answers = threading.Event(), [0, 0]

    def flood(path, number):
        with connect(path) as client:
            while not over.is_set():
                ask(client, {"cmd": "servo", "joint": f"joint {number + 1}", "torque": False})
                answers[number] += 1

    with driven(folder, servos) as daemon, ExitStack() as stack:
        threads = [threading.Thread(target=flood, args=(daemon.control_path, number)) for number in range(2)]
        stack.callback(lambda: [thread.join() for thread in threads])
        stack.callback(over.set)
        for thread in threads:
            thread.start()
        eventually(lambda: min(answers) > 3, "nobody has a motor switched off")
        before = daemon.status()["joints"]["cycles"]
        with connect(daemon.control_path) as client:
            client.settimeout(HANGS_AFTER_S)
            for share in (5, 10, 0):
                request = {"cmd": "servo", "joint": "joint 5", "torque": True, "pwm_percent": share}
                assert ask(client, request)["ok"]
                request.pop("torque")
                assert ask(client, request)["ok"]
            assert ask(client, {"cmd": "servo", "joint": "joint 5", "torque": False})["ok"]
        assert servos.register(5, *TORQUE) == 0
        # They go on with it, and the others are read meanwhile.
        more = min(answers) + 3
        eventually(lambda: min(answers) > more, "nobody has a motor switched off any more")
        assert daemon.status()["joints"]["cycles"] > before + 3


def test_who_has_motors_switched_off_one_after_the_other_is_not_put_out_in_between(folder, servos):
    with driven(folder, servos) as daemon, ExitStack() as stack:
        occupy(stack, daemon, 20)

        def is_put_out_too_soon():
            begun = time.monotonic()
            taken = []
            with connect(daemon.control_path) as client:
                for n in range(2, 9):
                    try:
                        taken.append(taken_from(client, b'{"cmd":"servo","joint":"joint %d","torque":false}\n' % n))
                        is_done = read_reply(client)["ok"]
                    except (AssertionError, ConnectionError):
                        is_done = False
                    if not is_done:
                        ended = time.monotonic()
                        return n > 2 and ended - begun < KEPT_S and ended - taken[n - 3] < UNHEARD_S
            return False

        # On a machine that is held up its time may be over, as that of all others.
        assert not any(is_put_out_too_soon() for _ in range(12))


def taken_from(client, line):
    """Sends a line, and waits until it is taken from the socket: a time at which it was not yet."""
    unread = time.monotonic()
    client.sendall(line)
    while True:
        looked = time.monotonic()
        if struct.unpack("i", fcntl.ioctl(client, termios.TIOCOUTQ, bytes(4))) == (0,):
            return unread
        unread = looked
        time.sleep(0.001)


CHANGES = [
    {"cmd": "rezero"},
    {"cmd": "pause"},
    {"cmd": "resume"},
    {"cmd": "mark", "text": "now"},
    {"cmd": "profile", "profile": {"levels": 4}},
    {"cmd": "servo", "joint": "joint 5", "torque": False},
]


def test_who_has_gone_before_it_was_begun_has_a_motor_switched_off_and_nothing_else_done(folder, servos):
    torque = lambda joint, on: {"cmd": "servo", "joint": joint, "torque": on}  # noqa: E731
    with driven(folder, servos) as daemon:
        holder = connect(daemon.control_path)
        assert ask(holder, {**torque("joint 7", True), "hold_ms": 10_000})["ok"]
        for joint in ("joint 5", "joint 8"):
            assert ask(holder, torque(joint, True))["ok"]
        profile = daemon.control("profile")
        asked = [
            *[(request, None) for request in CHANGES if request["cmd"] != "servo"],
            (torque("joint 5", False), "torque of joint 5 is off, by request of"),
            (torque("joint 6", True), None),
            ({"cmd": "servos", "pwm_percent": {"joint 8": 50}}, None),
        ]
        daemon.hold()
        for request, _ in asked:
            with connect(daemon.control_path) as client:
                client.sendall(json.dumps(request).encode() + b"\n")
        # What is behind a request that is not carried out, beyond what a client may ask at once.
        requests = [{"cmd": "pause"}] * 60 + [torque("joint 8", False)]
        holder.sendall(b"".join(json.dumps(request).encode() + b"\n" for request in requests))
        holder.close()
        daemon.go_on()
        kinds = ["a new baseline", "pause", "resume", "a mark", "a new display profile", "a servo command"]
        for words in [f"refused: {kind}: whoever asked for it had gone" for kind in kinds] + [w for _, w in asked if w]:
            eventually(lambda words=words: words in daemon.log, f"the log does not say: {words}")
        for servo_id in (5, 7, 8):
            eventually(lambda servo_id=servo_id: servos.register(servo_id, *TORQUE) == 0, f"the motor of {servo_id} is on")
        eventually(lambda: daemon.status()["control"]["clients"] == 1, "who has gone is kept")
        assert servos.register(6, *TORQUE) == 0
        assert daemon.control("profile") == profile and not daemon.status()["paused"]
        done = ["measured anew", "paused, by", "resumed, by", "marked, by", "replaced, by", "joint 6 is on", "given PWM"]
        assert not [words for words in done if words in daemon.log]


def test_who_only_writes_no_more_is_answered(daemon):
    with connect(daemon.control_path) as client:
        client.sendall(b'{"cmd":"profile","profile":{"levels":4}}\n{"cmd":"profile"}')
        client.shutdown(socket.SHUT_WR)
        replies = client.makefile("rb").read().splitlines()
    changed, told = map(json.loads, replies)
    assert changed == {"ok": True} and told["profile"]["levels"] == 4


def test_the_status_socket_tells_and_changes_nothing(daemon):
    with connect(daemon.folder / "status.sock") as client:
        before = ask(client, {"cmd": "profile"})["profile"]
        assert ask(client, {"cmd": "status"})["status"]["paused"] is False
        for request in CHANGES:
            refused = ask(client, request)
            assert refused["ok"] is False and str(daemon.control_path) in refused["error"], refused
        assert ask(client, {"cmd": "profile"})["profile"] == before


def test_the_log_says_who_has_changed_something_but_not_without_end(daemon):
    assert daemon.control("pause") == {"ok": True}
    who = f"by request of user {os.getuid()}, process {os.getpid()}"
    eventually(lambda: f"paused, {who}" in daemon.log, "the log does not say who")
    assert "one line" in daemon.control("mark", text="now\x1b[2J")["error"]
    assert "one line" in daemon.control("mark", text="now\nERROR all is lost")["error"]
    assert daemon.control("mark", text="")["ok"] is False
    eventually(lambda: f"refused: a mark: a mark has 1 to 500 bytes of text; this one has 0, {who}" in daemon.log, "nor who failed")
    for n in range(100):
        assert daemon.control("resume") == {"ok": True}
    assert daemon.log.count(who) < 60
    assert daemon.control("status")["status"]["paused"] is False


@pytest.mark.parametrize(
    "tables, modes",
    [
        ({}, (0o660, 0o660, 0o600)),
        ({"socket": {"mode": "0666"}}, (0o666, 0o666, 0o600)),
        ({"socket": {"mode": "0600"}, "control": {"mode": "0660"}}, (0o600, 0o600, 0o660)),
    ],
)
def test_each_socket_has_its_configured_mode(folder, tables, modes):
    with Daemon(folder / "d", SCENE, tick=TICK, **tables) as daemon:
        paths = (daemon.images, daemon.folder / "status.sock", daemon.control_path)
        assert tuple(stat.S_IMODE(os.stat(path).st_mode) for path in paths) == modes
    assert not any(path.exists() for path in paths)
