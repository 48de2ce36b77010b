"""Start, stop, configuration, and a bus that says nothing."""

import os
import shutil
import signal
import subprocess
from contextlib import suppress

import can
import pytest
import taxel_reader
from conditioning import DAEMON_SETTINGS
from harness.compare import Reference, assert_same
from harness.daemon import HANGS_AFTER_S, Daemon, binary, eventually
from harness.lockstep import next_image
from harness.touches import Touches, grasp
from sequential_clustering import Profile


@pytest.mark.parametrize("by", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_cleanly(start, by):
    daemon = start()
    with taxel_reader.connect(daemon.images) as reader:
        next_image(reader)
        assert daemon.stop(by) == 0, daemon.log
        with pytest.raises(taxel_reader.Closed):
            while True:
                assert reader.receive(HANGS_AFTER_S) is not None, "a subscriber is not told that the daemon is gone"
    assert not daemon.images.exists() and not daemon.control_path.exists()


def test_a_socket_left_behind_by_a_killed_daemon_is_replaced(start, folder, buses):
    killed = start()
    killed.process.kill()
    killed.process.wait()
    assert killed.images.exists(), "nothing was left behind, so this test tests nothing"
    with pytest.raises(ConnectionRefusedError):
        taxel_reader.connect(killed.images)
    with Daemon(killed.folder, buses.sources), taxel_reader.connect(killed.images) as reader:
        next_image(reader)


def test_whose_status_socket_alone_is_another_daemons_is_told_which_key_it_is(start, buses):
    first = start()
    at = first.images.parent
    own = {"images": at / "own-images.sock", "control": at / "own-control.sock"}
    second = Daemon(first.folder / "second", buses.sources, socket=own).spawn()
    assert second.process.wait() != 0
    assert f"{at / 'status.sock'} is in use by another taxeld" in second.log and "[socket] images, control and status" in second.log


def test_a_second_daemon_on_the_same_socket_is_refused_and_the_first_goes_on(start, buses):
    first = start()
    with taxel_reader.connect(first.images) as reader:
        second = Daemon(first.folder, buses.sources).spawn()
        assert second.process.wait() != 0
        assert "in use by another taxeld" in second.log
        before = next_image(reader).seq
        assert next_image(reader).seq > before
    assert first.status()["images"]["made"] > 0


def shared(daemon):
    return [p["sentence"] for p in daemon.status()["problems"] if p["kind"] == "bus-shared"]


def test_two_daemons_of_one_bus_both_say_so_until_one_of_them_ends(start):
    first = start()
    assert shared(first) == []
    second = start()
    for one, other in ((first, second), (second, first)):
        eventually(lambda one=one: shared(one), "it is content", rest=2)
        for sentence in shared(one):
            assert f"process {other.process.pid}," in sentence and str(other.config) in sentence, sentence
        one.report(2)
        assert one.log.count("another taxeld on this machine reads udp:") == len(shared(one)), one.log
    assert second.stop() == 0
    eventually(lambda: shared(first) == [], "it is never over", rest=2)


def test_a_command_to_a_board_that_the_daemon_has_not_sent_is_told_once(start, buses):
    daemon = start(boards={"mode": "free-running"})
    daemon.report(2)
    assert shared(daemon) == [], "its own commands are taken for another's"
    start_of_board_1 = can.Message(arbitration_id=0x201, data=[7, 0], is_extended_id=False)
    buses.send((0, start_of_board_1) for _ in range(3))
    told = eventually(lambda: shared(daemon), "it is content", rest=2)
    assert len(told) == 1 and "another program on the bus tells its boards what to do" in told[0], told
    daemon.report(2)
    assert daemon.log.count("tells its boards what to do") == 1, daemon.log


SPOILT = {
    "the control socket is removed": lambda daemon, _: daemon.control_path.unlink(),
    "the socket of images is removed": lambda daemon, _: daemon.images.unlink(),
    # At once, or the daemon might make a part of it while another one is being removed.
    "the folder is removed": lambda daemon, aside: shutil.rmtree(daemon.images.parent.rename(aside)),
    "the folder is renamed": lambda daemon, aside: daemon.images.parent.rename(aside),
}


@pytest.mark.parametrize("what", SPOILT)
def test_sockets_that_somebody_removes_are_made_again_and_said_and_nobody_is_let_go(folder, buses, what):
    at = folder / "run" / "taxeld"
    sockets = {name: at / f"{name}.sock" for name in ("images", "control")}
    with Daemon(folder / "d", buses.sources, socket=sockets) as daemon, taxel_reader.connect(daemon.images) as reader:
        next_image(reader)
        SPOILT[what](daemon, folder / "aside")
        eventually(lambda: "is made again" in daemon.log, lambda: f"not made again\n{daemon.log}")
        for asked in ("pause", "resume"):
            daemon.control(asked)
        with taxel_reader.connect(daemon.images) as late:
            next_image(late)
        said = []
        while not any("is made again" in text for text in said):
            message = reader.receive(HANGS_AFTER_S)
            assert message is not None, said
            if message.header.type == taxel_reader.EVENT:
                said.append(message.json()["message"])
        assert daemon.log.count("is made again") == 1 and "sockets-lost" not in str(daemon.status()["problems"]), daemon.log
        second = Daemon(folder / "second", buses.sources, socket=sockets).spawn()
        assert second.process.wait() != 0 and "in use by another taxeld" in second.log
    assert not at.exists()


def test_what_takes_the_place_of_a_socket_is_left_alone_and_a_problem_until_it_is_gone(start):
    daemon = start()
    with taxel_reader.connect(daemon.images, image=False, status=True) as reader:
        (daemon.folder / "precious").write_text("precious")
        os.replace(daemon.folder / "precious", daemon.images)  # at once, or a socket is there again before

        def lost():
            return [p["sentence"] for p in daemon.status()["problems"] if p["kind"] == "sockets-lost"]

        eventually(lambda: lost() and daemon.log.count("ERROR"), lambda: f"not told\n{daemon.log}")
        [said] = lost()
        assert str(daemon.images) in said and "is not a socket" in said, said
        assert daemon.images.read_text() == "precious" and reader.receive(HANGS_AFTER_S) is not None
        daemon.images.unlink()
        eventually(lambda: not lost(), lambda: f"it stays\n{daemon.log}")
        assert daemon.log.count("is not a socket") == 1, daemon.log
    with taxel_reader.connect(daemon.images) as late:
        next_image(late)


def test_a_daemon_that_ends_leaves_the_sockets_of_one_alone_that_came_into_its_folder(folder, buses):
    at = folder / "run" / "taxeld"
    sockets = {name: at / f"{name}.sock" for name in ("images", "control")}
    with Daemon(folder / "first", buses.sources, socket=sockets) as first:
        # It does not look before it goes on, and then it is too late.
        first.hold()
        shutil.rmtree(at)
        with Daemon(folder / "second", buses.sources, socket=sockets) as second:
            first.go_on()
            eventually(lambda: "in use by another taxeld" in first.log, lambda: f"not told\n{first.log}")
            assert first.stop() == 0, first.log
            made = second.status()["images"]["made"]
            second.wait_status(lambda s: s["images"]["made"] > made, "it makes no images any more")
            with taxel_reader.connect(second.images) as reader:
                next_image(reader)


def test_what_is_no_socket_is_left_alone(folder, buses):
    daemon = Daemon(folder / "d", buses.sources)
    daemon.images.write_text("precious")
    daemon.spawn()
    assert daemon.process.wait() != 0
    assert daemon.images.read_text() == "precious" and str(daemon.images) in daemon.log


BUSES = '[[bus]]\nsource = "udp:239.74.163.2:43113"\n[[bus]]\nsource = "udp:239.74.163.2:43114"\n'
BAD_CONFIGURATIONS = {
    "not toml": ("layout = \n", 1, ""),
    "unknown key": ("layuot = 'x'\n" + BUSES, 1, "layuot"),
    "unknown key in a table": (BUSES + "[tick]\nmode = 'timer'\nrate = 30\n", 7, "rate"),
    "unknown layout": ("layout = 'no-such-hand'\n" + BUSES, 1, "no-such-hand"),
    "too few buses": ('[[bus]]\nsource = "can:can0"\n', 1, "2 buses"),
    "no such source": (BUSES.replace("udp:239.74.163.2:43114", "tcp:1.2.3.4"), 4, "tcp"),
    "wrong type": (BUSES + "[tick]\nrate_hz = 'fast'\n", 6, ""),
    "rate out of range": (BUSES + "[tick]\nrate_hz = 100000.0\n", 6, "rate_hz"),
    "no levels": (BUSES + "\n[profile]\nlevels = 0\n", 7, "levels"),
    "falling codebook": (BUSES + "[profile]\ncodebook = [2.0, 1.0]\n", 6, "codebook"),
    "margin out of range": (BUSES + "[conditioning]\nthreshold_margin = 0.5\n", 6, "threshold_margin"),
    "mode is no mode": (BUSES + "[socket]\nmode = 'rw'\n", 6, "socket.mode"),
    "mode of control is no mode": (BUSES + "[control]\nmode = '0999'\n", 6, "control.mode"),
    "one path twice": (BUSES + "[socket]\nstatus = 'a'\ncontrol = 'a'\n", 7, "socket.control and socket.status are both a"),
}


@pytest.mark.parametrize("name", BAD_CONFIGURATIONS)
def test_a_bad_configuration_is_refused_with_its_place(folder, name):
    text, line, about = BAD_CONFIGURATIONS[name]
    config = folder / "taxeld.toml"
    config.write_text(text)
    ended = subprocess.run([binary("taxeld"), "--config", config], capture_output=True, text=True)
    assert ended.returncode == 78, "systemd starts it again unless it says that its configuration is wrong"
    assert f"{config}:{line}: " in ended.stderr, ended.stderr
    assert about in ended.stderr, ended.stderr


def test_reload_takes_up_the_profile_names_what_needs_a_restart_and_lets_nobody_go(start):
    daemon = start(profile={"levels": 8, "actuators": 16})

    def reload(text, said):
        daemon.config.write_text(text)
        daemon.process.send_signal(signal.SIGHUP)
        eventually(lambda: said in daemon.log, lambda: f"not said: {said}\n{daemon.log}")

    with taxel_reader.connect(daemon.images) as reader:
        next_image(reader)
        text = daemon.config.read_text()
        reload(text.replace("levels = 8", "levels = 3"), "[profile] is taken up")
        assert daemon.control("profile")["profile"]["levels"] == 3
        reload(text.replace("levels = 8", "levels = 0"), f"{daemon.config}:")
        reload(text.replace("levels = 8", "levels = 3") + "\n[can]\nreceive_buffer_kib = 128\n", "only by a restart: [can]")
        assert daemon.control("profile")["profile"]["levels"] == 3
        before = next_image(reader).seq
        assert next_image(reader).seq > before


def test_a_refused_reload_is_a_problem_until_one_is_taken_up_and_a_storm_of_it_one_line(start):
    daemon = start()
    good = daemon.config.read_text()

    def refused():
        return [p["sentence"] for p in daemon.status()["problems"] if p["kind"] == "reload-refused"]

    def hang_up(text):
        daemon.config.write_text(text)
        daemon.process.send_signal(signal.SIGHUP)

    hang_up(good + "\nrate = 3\n")
    eventually(refused, lambda: f"no problem:\n{daemon.log}")
    (sentence,) = refused()
    assert f"{daemon.config}:" in sentence and "rate" in sentence
    for _ in range(20):
        daemon.process.send_signal(signal.SIGHUP)
        assert refused()
    hang_up(good + "\npace = 3\n")
    eventually(lambda: "pace" in refused()[0], refused)
    eventually(lambda: "still refused" in daemon.log, lambda: daemon.log)
    assert daemon.log.count("is refused: ") == 1, daemon.log
    hang_up(good)
    eventually(lambda: not refused(), refused)


def test_a_file_that_does_not_end_is_read_beside_all_else_and_told_and_the_next_reload_is_kept(start, folder):
    daemon = start(profile={"levels": 8, "actuators": 16})
    good = daemon.config.read_text()

    def refused():
        return [p["sentence"] for p in daemon.status()["problems"] if p["kind"] == "reload-refused"]

    def read_without_end():
        """The end of the pipe that taxeld reads."""
        os.mkfifo(folder / "pipe")
        os.replace(folder / "pipe", daemon.config)
        daemon.process.send_signal(signal.SIGHUP)
        ends = []

        def opened():
            with suppress(OSError):  # ENXIO until somebody reads
                ends.append(os.open(daemon.config, os.O_WRONLY | os.O_NONBLOCK))
            return ends

        eventually(opened, "it is not read")
        return ends[0]

    end = read_without_end()
    (folder / "next").write_text(good.replace("levels = 8", "levels = 3"))
    os.replace(folder / "next", daemon.config)
    daemon.process.send_signal(signal.SIGHUP)
    eventually(refused, lambda: f"not told:\n{daemon.log}")
    assert "has not been read for" in refused()[0] and "is refused" not in refused()[0]
    os.close(end)
    eventually(lambda: "[profile] is taken up" in daemon.log, lambda: f"the second is lost:\n{daemon.log}")
    eventually(lambda: not refused(), refused)
    assert daemon.control("profile")["profile"]["levels"] == 3
    end = read_without_end()
    assert daemon.stop() == 0
    os.close(end)


def test_each_baseline_that_is_measured_is_told_however_soon_it_is(folder):
    # Two frames, 10 ms, where it is looked at each 100 ms.
    tables = {"tick": {"mode": "timer", "rate_hz": 100.0}, "conditioning": {"preset": "paper"}}
    with Daemon(folder / "d", ["sim:idle"], layout="uskin-module", **tables) as daemon:
        with taxel_reader.connect(daemon.images, image=False) as reader:
            for n in range(10):
                assert daemon.control("rezero")["ok"]
                told = []
                while not told or told[-1] != "calibrated":
                    message = reader.receive(HANGS_AFTER_S)
                    assert message is not None, f"it is not told: {told}"
                    if message.header.type == taxel_reader.EVENT:
                        told.append(message.json()["event"])
                # The first may be that of the start, which begins before anybody is told.
                assert n == 0 or told[-2:] == ["calibrating", "calibrated"]


def test_a_configuration_that_is_not_there_is_named(folder):
    missing = folder / "no.toml"
    ended = subprocess.run([binary("taxeld"), "--config", missing], capture_output=True, text=True)
    assert ended.returncode == 78 and str(missing) in ended.stderr


def test_a_silent_bus_is_degraded_not_dead(start, lockstep, hand):
    daemon = start(conditioning=DAEMON_SETTINGS)
    driver = lockstep(daemon)
    for _ in range(3):
        image = next_image(driver.reader)
        assert image.missing == len(hand) and not any(image.pixels) and not image.actuators
    boards = daemon.status()["boards"]
    assert {b["state"] for b in boards} == {"unheard"} and {b["used"] for b in boards} == {0}

    reference = Reference(hand, Profile())
    for i, counts in enumerate(grasp(Touches.even(hand))):
        assert_same(driver.step(counts), reference.image(counts), f"frame {i}")

    def all_living():
        driver.step(counts)
        return {b["state"] for b in daemon.status()["boards"]} == {"living"}

    eventually(all_living, "boards that speak are not said to")

    eventually(lambda: next_image(driver.reader).missing == len(hand), "a hand that fell silent is not shown as missing")
    assert daemon.process.poll() is None


def test_a_bus_of_other_boards_than_the_layout_has_points_to_the_layout(start, buses):
    daemon = start()
    buses.send([(0, can.Message(arbitration_id=0x044 + n % 4, is_extended_id=False, data=bytes(8))) for n in range(16)])
    told = lambda: [p["sentence"] for p in daemon.status()["problems"] if p["bus"] == "can0"]
    eventually(lambda: told() and "taxel doctor --scan 'udp:" in told()[0], told)
    assert "no board of layout allegro-uskin-15 speaks, and 16 frames have ids of nobody" in told()[0]
    status = subprocess.run([binary("taxel"), "status", "--socket", daemon.control_path], capture_output=True, text=True)
    assert told()[0] in status.stdout


def test_in_timer_mode_images_come_while_the_bus_is_silent(start, hand):
    daemon = start(tick={"mode": "timer", "rate_hz": 50.0})
    with taxel_reader.connect(daemon.images) as reader:
        images = [next_image(reader) for _ in range(10)]
    assert all(i.missing == len(hand) and not any(i.pixels) for i in images)
    numbers = [i.seq for i in images]
    assert numbers == sorted(set(numbers))
