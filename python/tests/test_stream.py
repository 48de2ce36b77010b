"""Images, restarts, refusals and asyncio, against the fake daemon."""

import asyncio
import contextlib
import errno
import socket
import threading
import time

import numpy as np
import pytest
import taxel
from taxel import _reader
from taxel.fake import _event, _message


def test_an_image_comes_as_arrays(daemon):
    with taxel.connect(daemon.path) as hand:
        sent = daemon.press([(1, 2, 1), (3, 0, 4)], joints=[0.5, float("nan")])
        image = hand.next(timeout=300)
    assert image.pixels.tolist() == [[0, 0, 0, 255], [0, 0, 0, 0], [0, 64, 0, 0]]
    assert image.actuators.id.tolist() == [0, 1]
    assert [(a.x, a.y, a.level, a.force) for a in image.actuators] == [(1, 2, 1, 100), (3, 0, 4, 400)]
    assert image.levels.tolist() == [100, 200, 300, 400]
    assert image.joints[0] == 0.5 and np.isnan(image.joints[1])
    assert (image.seq, image.t_ns, image.contacts, image.width, image.height) == (sent.seq, sent.t_ns, 2, 4, 3)
    assert not image.calibrating


def test_an_image_without_contact_has_empty_arrays(daemon):
    with taxel.connect(daemon.path) as hand:
        daemon.press()
        image = hand.next(timeout=300)
    assert len(image.actuators) == len(image.levels) == len(image.joints) == 0
    assert not image.pixels.any()


def test_iterating_goes_on_after_a_restart_of_the_daemon(daemon):
    seen = []
    with taxel.connect(daemon.path, profile={"levels": 4}) as hand:
        daemon.press([(0, 0, 1)])
        for image in hand:
            seen.append(image.actuators.level.tolist())
            if len(seen) == 2:
                break
            daemon.restart()
            daemon.press([(0, 0, 2)])
        assert hand.restarts == 1 and hand.gone == ""
    assert seen == [[1], [2]]
    assert daemon.subscriptions == [{"profile": {"levels": 4}}] * 2, "it subscribes anew"


def test_a_daemon_that_takes_no_connection_is_not_waited_for_without_end(tmp_path, monkeypatch):
    monkeypatch.setattr(_reader, "_PATIENCE_S", 0.05)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as hangs, contextlib.ExitStack() as waiting:
        hangs.bind(str(tmp_path / "images.sock"))
        hangs.listen(1)
        with pytest.raises(TimeoutError, match="takes no connection"):
            for _ in range(9):
                waiting.enter_context(_reader.connect(tmp_path / "images.sock"))


@pytest.fixture
def full(tmp_path):
    """The listener of a daemon that takes no connection, with no room for another one that waits."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as hangs, contextlib.ExitStack() as waiting:
        hangs.bind(str(tmp_path / "images.sock"))
        hangs.listen(1)
        hangs.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while True:
                client = waiting.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET))
                client.setblocking(False)
                client.connect(str(tmp_path / "images.sock"))
        yield hangs


@pytest.fixture
def never_sleeps(monkeypatch):
    monkeypatch.setattr(time, "sleep", lambda _: pytest.fail("it sleeps"))


def test_asyncio_goes_on_while_the_daemon_takes_no_connection(full, never_sleeps):
    async def follow():
        with contextlib.ExitStack() as taken:
            hand = taken.enter_context(contextlib.closing(taxel.aio.connect(full.getsockname())))
            reader = asyncio.ensure_future(hand.next())
            for _ in range(10):
                await asyncio.sleep(0)
            assert not reader.done() and not hand.hello
            while not hand.hello:
                with contextlib.suppress(BlockingIOError):
                    taken.enter_context(full.accept()[0]).send(_message(_reader.HELLO, b'{"width":4}'))
                await asyncio.sleep(0)
            hand.close()
            return await reader

    assert asyncio.run(asyncio.wait_for(follow(), 300)) is None


def test_asyncio_is_told_that_the_daemon_takes_no_connection_and_may_give_up(full, never_sleeps, monkeypatch):
    async def follow():
        async with taxel.aio.connect(full.getsockname()) as hand:
            with pytest.raises(asyncio.TimeoutError):
                await asyncio.wait_for(hand.next(), 0.05)
            monkeypatch.setattr(_reader, "_PATIENCE_S", 0.0)
            reader = asyncio.ensure_future(hand.next())
            while "takes no connection" not in hand.gone:
                await asyncio.sleep(0)
            hand.close()
            return await reader

    assert asyncio.run(asyncio.wait_for(follow(), 300)) is None


def test_a_time_out_is_kept_while_the_daemon_takes_no_connection(full, never_sleeps):
    hand = taxel.Stream(full.getsockname(), {})
    assert hand.next(timeout=0) is None and not hand.gone


def test_a_daemon_that_was_waited_for_has_not_restarted(daemon):
    daemon.stop()
    with taxel.connect(daemon.path, wait=True) as hand:
        assert hand.next(timeout=0) is None and hand.gone
        daemon.restart()
        daemon.press([(0, 0, 1)])
        assert hand.next(timeout=300) is not None
        assert hand.restarts == 0 and hand.gone == ""
        daemon.restart()
        daemon.press([(0, 0, 2)])
        assert hand.next(timeout=300) is not None
        assert hand.restarts == 1


def test_who_is_turned_away_or_let_go_has_seen_no_restart(daemon):
    full = "16 subscribers are connected already"
    daemon.stop()
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(str(daemon.path))
        listener.listen()
        hand = taxel.connect(daemon.path)
        for _ in range(3):
            client, _ = listener.accept()
            client.send(_event("disconnect", full))
            client.close()
            assert hand.message(timeout=300).message == full
            # Finds the connection ended, and connects anew.
            assert hand.message(timeout=0.0) is None and hand.gone == full
            assert hand.message(timeout=0.0) is None
    daemon.path.unlink()
    daemon.start()
    daemon.press([(0, 0, 1)])
    assert hand.next(timeout=300) is not None
    assert hand.restarts == 0 and hand.gone == ""
    daemon.event("disconnect", "it made room")
    daemon.restart()
    daemon.press([(0, 0, 2)])
    assert hand.next(timeout=300) is not None
    assert hand.restarts == 0
    daemon.restart()
    daemon.press([(0, 0, 3)])
    assert hand.next(timeout=300) is not None
    assert hand.restarts == 1
    hand.close()


def test_a_display_learns_that_no_image_comes(daemon):
    with taxel.connect(daemon.path) as hand:
        images = hand.images(timeout=0.05)
        assert next(images) is None
        daemon.stop()
        assert next(images) is None, "nor while the daemon is gone"
        assert hand.gone


def test_a_refused_subscription_says_why(daemon):
    daemon.refuses = "the profile costs too much"
    refused = pytest.raises(taxel.Refused, match="costs too much")
    with taxel.connect(daemon.path, profile={"levels": 200}) as hand, refused:
        hand.next(timeout=300)


def test_no_daemon_is_told_with_its_place_unless_it_is_waited_for(tmp_path):
    path = tmp_path / "images.sock"
    with pytest.raises(FileNotFoundError, match="no taxeld listens at .*images.sock"):
        taxel.connect(path)
    with taxel.connect(path, wait=True) as hand:
        assert hand.next(timeout=0.05) is None


@pytest.mark.parametrize("said, reason", [("all places are taken", "all places are taken"), ("", "")])
@pytest.mark.parametrize("is_read", [True, False])
def test_who_was_let_go_before_it_subscribes_is_told_why(said, reason, is_read):
    here, daemon = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with _reader.Reader(here) as reader:
        daemon.send(_message(_reader.HELLO, b"{}"))
        if not is_read:
            reader.subscribe(raw=True)
        if said:
            daemon.send(_event("disconnect", said))
        daemon.close()
        with pytest.raises(_reader.Closed) as closed:
            if is_read:
                reader.subscribe(raw=True)
            for _ in range(3):
                reader.receive(timeout=0)
    assert closed.value.reason == reason


def test_a_daemon_that_has_ceased_to_read_is_waited_for_to_say_why(monkeypatch):
    here, daemon = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with _reader.Reader(here) as reader:
        daemon.shutdown(socket.SHUT_RD)

        def says_why(seconds):
            if seconds:
                daemon.send(_event("disconnect", "all places are taken"))
                monkeypatch.undo()
            return bool(seconds)

        monkeypatch.setattr(reader, "_wait", says_why)
        with pytest.raises(_reader.Closed, match="all places are taken"):
            try:
                reader.subscribe(raw=True)
            finally:
                daemon.close()


def test_a_daemon_without_a_place_is_told_with_its_reason_unless_it_is_waited_for(tmp_path, monkeypatch):
    path = tmp_path / "images.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as full:
        full.bind(str(path))
        full.listen()
        encode = _reader.encode_subscribe

        def turned_away(wanted):
            client, _ = full.accept()
            client.send(_event("disconnect", "8 subscribers are connected already"))
            client.close()
            return encode(wanted)

        monkeypatch.setattr(_reader, "encode_subscribe", turned_away)
        with pytest.raises(_reader.Closed, match="8 subscribers are connected already"):
            taxel.connect(path, raw=True)
        with taxel.connect(path, raw=True, wait=True) as hand:
            assert hand.gone == "8 subscribers are connected already"


def test_the_socket_that_takes_requests_is_told_from_that_of_the_images(daemon):
    with pytest.raises(OSError, match="images come from images.sock beside it") as refused:
        taxel.connect(daemon.control)
    assert refused.value.errno == errno.EPROTOTYPE


def test_what_was_asked_for_comes_beside_images(daemon):
    with taxel.connect(daemon.path, raw=True) as hand:
        daemon.wait_for_subscription()
        daemon.event("mark", "cup 3")
        daemon.press()
        everything = iter(hand)
        assert next(everything) == taxel.Event("mark", "cup 3", 0, 0)
        assert isinstance(next(everything), taxel.Image)
        assert hand.hello["joints"] == ["a", "b"]


def test_a_closed_stream_ends(daemon):
    hand = taxel.connect(daemon.path)
    hand.close()
    assert list(hand) == [] and hand.next() is None


def test_images_come_to_asyncio_across_a_restart(daemon):
    async def follow():
        seen = []
        async with taxel.aio.connect(daemon.path) as hand:
            daemon.press([(0, 0, 1)])
            async for image in hand:
                seen.append(image.actuators.level.tolist())
                if len(seen) == 2:
                    return seen, hand.restarts
                daemon.restart()
                daemon.press([(0, 0, 2)])

    assert asyncio.run(asyncio.wait_for(follow(), 300)) == ([[1], [2]], 1)


def test_nothing_is_lost_by_a_wait_that_is_given_up(daemon):
    async def follow():
        async with taxel.aio.connect(daemon.path) as hand:
            with pytest.raises(asyncio.TimeoutError):
                await asyncio.wait_for(hand.next(), 0.05)
            daemon.press([(0, 0, 3)])
            return (await asyncio.wait_for(hand.next(), 300)).actuators.level.tolist()

    assert asyncio.run(follow()) == [3]


def test_images_of_before_the_answer_are_not_taken_for_what_was_asked(daemon):
    daemon.answers = False
    with taxel.connect(daemon.path, profile={"levels": 2}) as hand:
        daemon.press([(0, 0, 4)])
        assert hand.next(timeout=0.2) is None
        daemon.answers = True
        daemon.wait_for_subscription()
        daemon.press([(0, 0, 2)])
        assert hand.next(timeout=300).actuators.level.tolist() == [2]


def test_a_daemon_that_answers_no_plain_subscription_is_not_waited_for(daemon):
    del daemon.hello["subscription"]
    daemon.answers = False
    with taxel.connect(daemon.path, max_rate_hz=10) as hand:
        daemon.press([(0, 0, 1)])
        assert hand.next(timeout=300).actuators.level.tolist() == [1]


def test_closing_ends_whoever_waits_and_nothing_opens_the_stream_again(daemon):
    for iterate in (iter, taxel.Stream.images, lambda hand: hand.images(timeout=600)):
        hand = taxel.connect(daemon.path)
        seen = []
        reader = threading.Thread(target=lambda images: seen.extend(images), args=(iterate(hand),))
        reader.start()
        daemon.press([(0, 0, 1)])
        while not seen:
            time.sleep(0.001)
        hand.close()
        reader.join(300)
        assert not reader.is_alive() and len(seen) == 1

    async def follow():
        hand = taxel.aio.connect(daemon.path)

        async def iterate():
            return [image async for image in hand]

        reader = asyncio.ensure_future(iterate())
        await asyncio.sleep(0)
        hand.close()
        assert await asyncio.wait_for(reader, 300) == []
        assert await hand.next() is None and await hand.message() is None

    asyncio.run(asyncio.wait_for(follow(), 300))


def test_a_second_reader_of_a_stream_is_told_so(daemon):
    async def follow():
        async with taxel.aio.connect(daemon.path) as hand:
            first = asyncio.ensure_future(hand.next())
            await asyncio.sleep(0)
            with pytest.raises(RuntimeError, match="connect once for each reader"):
                await hand.next()
            daemon.press([(0, 0, 3)])
            return (await first).actuators.level.tolist()

    assert asyncio.run(asyncio.wait_for(follow(), 300)) == [3]
    hand = taxel.connect(daemon.path)
    first = threading.Thread(target=hand.next)
    first.start()
    while not hand.hello:
        time.sleep(0.001)
    with hand, pytest.raises(RuntimeError, match="connect once for each reader"):
        hand.next()
    first.join(300)


def test_a_refused_stream_asks_again_when_it_is_read_on(daemon):
    daemon.refuses = "the hand has no part `index`"
    with taxel.connect(daemon.path, region=["index"]) as hand:
        for _ in range(2):
            with pytest.raises(taxel.Refused, match="no part"):
                hand.next(timeout=300)
        daemon.refuses = None
        assert hand.next(timeout=0.05) is None
        daemon.press([(0, 0, 1)])
        assert hand.next(timeout=300).actuators.level.tolist() == [1]
