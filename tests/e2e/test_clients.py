"""Clients that misbehave harm nobody but themselves."""

import json
import os
import signal
import socket
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest
import taxel_reader
from conditioning import DAEMON_SETTINGS
from harness.compare import Reference, assert_same
from harness.daemon import HANGS_AFTER_S, Programs, ask, connect, die_with_parent, eventually, read_reply
from harness.lockstep import NEVER_SILENT, next_image
from harness.recorder import taxel
from harness.touches import Touches, grasp
from sequential_clustering import Profile


def raw_client(daemon):
    client = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    client.connect(str(daemon.images))
    return client


@pytest.fixture
def daemon(start, request):
    """Its parameter is how long a client may take nothing, ms; by default longer than any test."""
    return start(conditioning=DAEMON_SETTINGS, socket={"stall_ms": getattr(request, "param", 60_000)})


@pytest.fixture
def healthy(daemon, lockstep, hand):
    """Call it to see that another client is given every image of a grasp, unharmed."""
    driver = lockstep(daemon)
    reference = Reference(hand, Profile())

    def healthy():
        for i, counts in enumerate(grasp(Touches.even(hand))):
            assert_same(driver.step(counts), reference.image(counts), f"frame {i}")

    return healthy


def only_the_healthy_one_is_left(daemon):
    daemon.wait_status(lambda s: len(s["subscribers"]) == 1, "clients that are gone are still listed")


@pytest.mark.parametrize("daemon", [500], indirect=True)
def test_clients_that_never_read_are_let_go(daemon, healthy):
    idle = [raw_client(daemon) for _ in range(20)]
    healthy()
    only_the_healthy_one_is_left(daemon)
    healthy()
    for client in idle:
        client.close()


def test_a_client_that_reads_one_byte_at_a_time(daemon, healthy):
    # A packet read with a buffer of one byte loses the rest: the client's loss alone.
    with raw_client(daemon) as client:
        assert client.recv(1) == b"T"
        healthy()
        for _ in range(5):
            assert client.recv(1) == b"T"
    only_the_healthy_one_is_left(daemon)


NONSENSE = {
    "one byte": b"\0",
    "text": b"GET / HTTP/1.1\r\n\r\n",
    "noise": bytes(range(256)) * 8,
    "right header, wrong version": b"TCT1\x63\0" + bytes(34),
    "a length that lies": taxel_reader.encode_subscribe({})[:-1],
    "an image, as if it were a daemon": b"TCT1\x01\0(\0\x02\0\0\0\0\0\0\0" + bytes(24),
}


@pytest.mark.parametrize("name", NONSENSE)
def test_a_client_that_sends_nonsense_is_told_and_let_go(daemon, healthy, name):
    with raw_client(daemon) as client:
        client.send(NONSENSE[name])
        reader = taxel_reader.Reader(client)
        with pytest.raises(taxel_reader.Closed) as closed:
            while True:
                assert reader.receive(HANGS_AFTER_S) is not None, "neither an answer nor the end"
        assert closed.value.reason, "it was cut off without a reason"
    healthy()
    only_the_healthy_one_is_left(daemon)


def test_a_subscription_that_is_refused_is_told_why_and_can_be_corrected(daemon, healthy):
    with taxel_reader.connect(daemon.images, max_rate_hz=-1) as reader:
        eventually(lambda: (reader.receive(HANGS_AFTER_S), reader.event)[1], "no event tells that the subscription was refused")
        assert reader.event["event"] == "refused" and "max_rate_hz" in reader.event["message"]
        reader.subscribe(raw=True, image=False)
        eventually(lambda: isinstance(reader.receive(HANGS_AFTER_S), taxel_reader.Raw), "no raw frame after a good subscription")
    healthy()


DISAPPEARING = """
import signal, socket, sys
client = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
client.connect(sys.argv[1])
client.recv(9)
signal.pause()
"""


@pytest.mark.parametrize("end", ["killed", "closed without reading", "shut down"])
def test_a_client_that_disappears_in_the_middle(daemon, healthy, end):
    if end == "killed":
        clients = [
            subprocess.Popen([sys.executable, "-c", DISAPPEARING, daemon.images], preexec_fn=die_with_parent) for _ in range(3)
        ]
        daemon.wait_status(lambda s: len(s["subscribers"]) == 4, "the clients do not connect")
        for client in clients:
            os.kill(client.pid, signal.SIGKILL)
            client.wait()
    else:
        clients = [raw_client(daemon) for _ in range(10)]
        daemon.wait_status(lambda s: len(s["subscribers"]) == 11, "the clients do not connect")
        for client in clients:
            if end == "shut down":
                client.shutdown(socket.SHUT_RDWR)
            client.close()
    healthy()
    only_the_healthy_one_is_left(daemon)


def test_a_hundred_clients_at_once_all_see_the_grasp(daemon, healthy):
    clients = [taxel_reader.connect(daemon.images) for _ in range(100)]
    daemon.wait_status(lambda s: len(s["subscribers"]) == 101, "not all of a hundred clients are served")
    # None of them reads while the healthy one is looked at; afterwards each finds what its socket still holds.
    healthy()
    for client in clients:
        message = client.receive(HANGS_AFTER_S)
        assert isinstance(message, taxel_reader.Text) and client.hello is not None
        client.close()
    only_the_healthy_one_is_left(daemon)


def test_one_client_too_many_is_turned_away_with_a_reason(start):
    daemon = start(socket={"max_subscribers": 3})
    clients = [taxel_reader.connect(daemon.images) for _ in range(3)]
    daemon.wait_status(lambda s: len(s["subscribers"]) == 3, "three clients are not served")
    with taxel_reader.connect(daemon.images) as extra, pytest.raises(taxel_reader.Closed, match="3 subscribers"):
        while True:
            assert extra.receive(HANGS_AFTER_S) is not None, "the fourth client is neither served nor turned away"
    clients.pop().close()
    daemon.wait_status(lambda s: len(s["subscribers"]) == 2, "the place is not free again")
    with taxel_reader.connect(daemon.images) as again:
        assert again.receive(HANGS_AFTER_S) is not None


def test_who_wants_no_images_makes_room_for_a_display_and_who_is_turned_away_is_a_problem(start):
    daemon = start(socket={"max_subscribers": 3})
    with ExitStack() as stack:
        display = stack.enter_context(taxel_reader.connect(daemon.images))
        display.receive(HANGS_AFTER_S)
        onlookers = [stack.enter_context(taxel_reader.connect(daemon.images, image=False, status=True)) for _ in range(2)]
        for onlooker in onlookers:
            while onlooker.receive(HANGS_AFTER_S).header.type != taxel_reader.STATUS:
                pass
        for onlooker in onlookers:
            another = stack.enter_context(taxel_reader.connect(daemon.images))
            assert another.receive(HANGS_AFTER_S) is not None, "a display is not let in"
            with pytest.raises(taxel_reader.Closed, match="made room"):
                while True:
                    assert onlooker.receive(HANGS_AFTER_S) is not None, "it keeps its place"
        # Three displays: the next is turned away.
        with taxel_reader.connect(daemon.images) as extra, pytest.raises(taxel_reader.Closed, match="3 subscribers"):
            while True:
                assert extra.receive(HANGS_AFTER_S) is not None, "the fourth display is neither served nor turned away"
        crowded = lambda s: [p["sentence"] for p in s["problems"] if p["kind"] == "readers-turned-away"]  # noqa: E731
        [said] = crowded(daemon.wait_status(crowded, "nothing is said of it"))
        assert f"process {os.getpid()} of user {os.getuid()} has 3" in said
        assert display.receive(HANGS_AFTER_S) is not None


def test_the_process_with_most_readers_makes_room_for_a_display_of_another(start):
    daemon = start(socket={"max_subscribers": 3})
    with ExitStack() as stack:
        readers = [stack.enter_context(taxel_reader.connect(daemon.images)) for _ in range(3)]
        for reader in readers:
            assert reader.receive(HANGS_AFTER_S).header.type == taxel_reader.HELLO
        taxel = stack.enter_context(Programs())
        watch = taxel("watch", "--socket", daemon.images, stdout=subprocess.DEVNULL)
        with pytest.raises(taxel_reader.Closed, match="made room"):
            while True:
                assert watch.poll() is None, "a display of another process is not let in"
                assert readers[0].receive(HANGS_AFTER_S) is not None, "the oldest keeps its place"
        for reader in readers[1:]:
            assert reader.receive(HANGS_AFTER_S) is not None


def test_who_only_looks_in_puts_no_display_out(start):
    daemon = start(socket={"max_subscribers": 8}, tick={"mode": "timer", "rate_hz": 50.0})
    with ExitStack() as stack:
        displays = [stack.enter_context(taxel_reader.connect(daemon.images)) for _ in range(8)]
        for display in displays:
            assert display.receive(HANGS_AFTER_S).header.type == taxel_reader.HELLO
        # Others, that come, look and go; and one that stays and is to be shown nothing.
        for _ in range(3):
            taxel("watch", "--count", "1", "--socket", daemon.images)
        onlooker = (
            "import sys, taxel_reader\n"
            "with taxel_reader.connect(sys.argv[1], image=False, status=True) as onlooker:\n"
            "    while onlooker.receive(None) is not None: pass\n"
        )
        ended = subprocess.run(
            [sys.executable, "-c", onlooker, daemon.images],
            env=os.environ | {"PYTHONPATH": str(Path(taxel_reader.__file__).parent)},
            capture_output=True,
            text=True,
            timeout=HANGS_AFTER_S,
        )
        assert "8 subscribers are connected already" in ended.stderr, ended.stderr
        assert {reader["pid"] for reader in daemon.status()["subscribers"]} == {os.getpid()}
        for display in displays:
            assert display.receive(HANGS_AFTER_S) is not None


def test_a_slow_reader_is_given_the_newest_image_and_the_count_of_what_it_missed(start, lockstep, hand):
    daemon = start(conditioning=DAEMON_SETTINGS, tick=NEVER_SILENT)
    driver = lockstep(daemon)
    reference = Reference(hand, Profile())
    with taxel_reader.connect(daemon.images) as slow:
        while slow.hello is None:
            assert slow.receive(HANGS_AFTER_S) is not None, "the hand is not described"
        first, *frames = list(grasp(Touches.even(hand))) * 4
        reference.image(first)
        driver.step(first)
        seen = [next_image(slow)]
        for counts in frames:
            expected = reference.image(counts)
            newest = driver.step(counts)
        while seen[-1].seq < newest.seq:
            message = slow.receive(HANGS_AFTER_S)
            assert message is not None, "the newest image never comes"
            if isinstance(message, taxel_reader.Image):
                seen.append(message)
    image = next(i for i in seen if i.seq == newest.seq)
    assert_same(image, expected, "the newest image")
    # Every image is accounted for: either seen, or in a count of skipped ones.
    assert sum(i.skipped for i in seen[1:]) + len(seen) - 1 == seen[-1].seq - seen[0].seq
    assert sum(i.skipped for i in seen) > 0
    # What waited in its socket meanwhile would drive a display late: two images, and then the newest.
    assert len(seen) <= 4, [i.seq for i in seen]


@pytest.mark.parametrize(
    "line",
    [b"status\n", b"{}\n", b'{"cmd":"explode"}\n', b'{"cmd":"status","x":1}\n', b"\xff\xfe\n", b"[" * 10000 + b"\n"],
    ids=["no json", "no command", "unknown command", "unknown key", "no text", "deep"],
)
def test_a_bad_control_request_is_refused_and_the_next_one_served(daemon, line):
    with connect(daemon.control_path) as client:
        client.sendall(line)
        reply = read_reply(client)
        assert reply["ok"] is False and reply["error"]
        assert ask(client, {"cmd": "status"})["ok"] is True


def test_a_control_request_without_end_is_refused(daemon, healthy):
    with connect(daemon.control_path) as client:
        try:
            client.sendall(b"x" * 1_000_000)
        except (BrokenPipeError, ConnectionResetError):
            pass  # it was refused before the rest was sent
        else:
            assert read_reply(client)["ok"] is False
    healthy()


def test_a_control_request_may_come_in_pieces_and_several_at_once(daemon):
    request = json.dumps({"cmd": "status"}).encode() + b"\n"
    with connect(daemon.control_path) as client:
        for byte in request:
            client.sendall(bytes([byte]))
        assert read_reply(client)["ok"]
        client.sendall(request * 3)
        received = b""
        while received.count(b"\n") < 3:
            part = client.recv(65536)
            assert part, "closed before the third reply"
            received += part
        assert [json.loads(reply)["ok"] for reply in received.splitlines()] == [True] * 3


def test_control_clients_that_hang_do_not_hold_up_the_others(daemon, healthy):
    hanging = [connect(daemon.control_path) for _ in range(20)]
    for client in hanging:
        client.sendall(b'{"cmd":"sta')
    with connect(daemon.control_path) as client:
        assert ask(client, {"cmd": "status"})["ok"]
    healthy()
    for client in hanging:
        client.close()
