"""`taxel setup` on a hand whose boards nobody has written down: modules are placed by pressing them, and the daemon that
the written configuration starts shows each press where it was said to be."""

import os
import random
import socket
import subprocess
import tomllib

import numpy as np
import pytest
import taxel_reader
from can.interfaces.udp_multicast.utils import pack_message
from harness.beside import Beside
from harness.bus import GROUP, MulticastBuses
from harness.daemon import HANGS_AFTER_S, Daemon, binary, die_with_parent, eventually
from harness.hand import Hand
from harness.lockstep import next_image
from harness.touches import Touches

PERIOD_S = 0.05
PRESS = 2000  # counts


class ShuffledHand(Beside):
    """The default hand, its boards in an order of their own, speaking by themselves while it is used as a context."""

    def __init__(self, ports, seed=7):
        super().__init__()
        self.hand = Hand()
        addresses = sorted({(t.bus, t.board) for t in self.hand.taxels})
        shuffled = random.Random(seed).sample(addresses, len(addresses))
        self.address = dict(zip(self.hand.modules, shuffled))
        self.hand.taxels = [
            t._replace(bus=shuffled[n // 16][0], board=shuffled[n // 16][1]) for n, t in enumerate(self.hand.taxels)
        ]
        touches = Touches.uneven(self.hand, seed)
        resting = list(touches.resting(8, seed))
        pressed = np.tile([0, 0, PRESS], (len(self.hand), 1))
        self.at_rest = [self.packed(ports, counts) for counts in resting]
        self.pressed_frames = [self.packed(ports, counts + pressed) for counts in resting]
        self.pressed = None

    def packed(self, ports, counts):
        return [(pack_message(message), (GROUP, ports[bus])) for bus, message in self.hand.sweep(counts)]

    def run(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            count = 0
            while not self.stop.wait(PERIOD_S):
                count += 1
                turn = count % len(self.at_rest)
                # Again and again for a second: a press that was begun before it was asked for does not count.
                pressed = self.pressed if count % 30 < 20 else None
                first = None if pressed is None else self.hand.modules.index(pressed) * 16
                for n, frame in enumerate(self.at_rest[turn]):
                    # The middle four taxels of a module are pressed.
                    if first is not None and n - first in (5, 6, 9, 10):
                        frame = self.pressed_frames[turn][n]
                    sender.sendto(*frame)


class Setup:
    """`taxel setup` as a process, and what it has said so far; its answers are `typed` at a terminal, or lines of a pipe."""

    def __init__(self, folder, *arguments, answers="", typed=False):
        self.log = folder / "setup.log"
        self.terminal, stdin = os.openpty() if typed else (None, subprocess.PIPE)
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [binary("taxel"), "setup", *map(str, arguments)],
                cwd=folder,
                stdin=stdin,
                stdout=subprocess.PIPE,
                stderr=log,
                preexec_fn=die_with_parent,
                env={**os.environ, "RUNTIME_DIRECTORY": str(folder / "none")},
            )
        if typed:
            os.close(stdin)
            os.write(self.terminal, answers.encode())
        else:
            self.process.stdin.write(answers.encode())
            self.process.stdin.close()

    @property
    def said(self):
        return self.log.read_text()

    def wait_for(self, text):
        def is_said():
            assert text in self.said or self.process.poll() is None, f"it ended:\n{self.said}"
            return text in self.said

        eventually(is_said, lambda: f"`{text}` is not said:\n{self.said}")

    def end(self):
        status = self.process.wait()
        if self.terminal is not None:
            os.close(self.terminal)
        return status, self.process.stdout.read().decode()


@pytest.fixture
def shuffled(buses):
    with ShuffledHand(buses.ports) as hand:
        yield hand


def press(shuffled, setup, module):
    """Presses a module once it is asked for, until it is named, and lets go."""
    setup.wait_for(f"Press the {module} (")
    shuffled.pressed = module
    bus, board = shuffled.address[module]
    setup.wait_for(f"can{bus} board {board}, which")
    shuffled.pressed = None


def test_the_daemon_of_the_written_configuration_shows_a_press_where_it_was_said_to_be(buses, shuffled, folder):
    by_touch, by_word = shuffled.hand.modules[:3], shuffled.hand.modules[3:]
    words = "".join("can{}/{}\n".format(*shuffled.address[module]) for module in by_word)
    options = ["--layout", "allegro-uskin-15", "--touch", "--joints", "none", "--out", "left.toml"]
    setup = Setup(folder, *buses.sources, *options, answers="\n" * len(by_touch) + words + "\n")
    for module in by_touch:
        press(shuffled, setup, module)
    status, _ = setup.end()
    assert status == 0, setup.said
    assert sorted(p.name for p in folder.glob("*.toml")) == ["hand.toml", "left.toml"]

    run = folder / "run"
    run.mkdir()
    daemon = Daemon(folder / "d", buses.sources, environment={"RUNTIME_DIRECTORY": str(run)})
    daemon.config = folder / "left.toml"
    daemon.images, daemon.control_path = run / "images.sock", run / "control.sock"
    with daemon, taxel_reader.connect(daemon.images) as reader:

        def image_of(is_wanted, what):
            def wanted():
                image = next_image(reader)
                return not image.calibrating and is_wanted(image) and image

            return np.frombuffer(eventually(wanted, what).pixels, np.uint8).reshape(shuffled.hand.shape)

        for module in ["index tip", "ring middle", "thumb tip"]:
            image_of(lambda image: image.contacts == 0, "the hand is not at rest")
            shuffled.pressed = module
            image = image_of(lambda image: image.contacts >= 4, f"nobody feels the {module}")
            shuffled.pressed = None
            first = shuffled.hand.modules.index(module) * 16
            wanted = {shuffled.hand.taxels[first + k][3:] for k in (5, 6, 9, 10)}
            lit = {(int(x), int(y)) for y, x in np.argwhere(image)}
            assert lit == wanted, f"{module}: {sorted(lit)} instead of {sorted(wanted)}"


def test_a_wrong_press_is_asked_for_again_where_nobody_types_too(buses, shuffled, folder):
    first, second = shuffled.hand.modules[:2]
    by_word = shuffled.hand.modules[2:]
    words = "".join("can{}/{}\n".format(*shuffled.address[module]) for module in by_word)
    options = ["--layout", "allegro-uskin-15", "--touch", "--joints", "none", "--dry-run"]
    setup = Setup(folder, *buses.sources, *options, answers="\n\n" + words + "\n")
    press(shuffled, setup, first)
    setup.wait_for(f"Press the {second} (")
    shuffled.pressed = first
    setup.wait_for(f"which is the {first} already")
    press(shuffled, setup, second)
    status, _ = setup.end()
    assert status == 0, setup.said


def test_nothing_is_written_over_a_file_or_after_an_answer_is_missing(buses, shuffled, folder):
    (folder / "taxeld.toml").write_text("mine")
    setup = Setup(folder, *buses.sources, "--yes")
    status, _ = setup.end()
    assert status == 1 and "--force" in setup.said, setup.said
    setup = Setup(folder, *buses.sources, "--out", "other.toml")
    status, _ = setup.end()
    assert status == 1 and "--yes" in setup.said, setup.said
    setup = Setup(folder, *buses.sources, "--out", "other.toml", "--layout", "allegro-uskin-15", "--touch", answers="\n")
    setup.wait_for("Press the index tip (")
    setup.process.terminate()
    status, _ = setup.end()
    assert status == 1 and "nothing was written" in setup.said, setup.said
    assert [p.name for p in folder.glob("*.toml*")] == ["taxeld.toml"]
    assert (folder / "taxeld.toml").read_text() == "mine"


def test_who_types_a_device_that_is_not_there_is_asked_again_and_nothing_is_lost(folder):
    taxel = binary("taxel")
    scene = ["sim", "roll", "--layout", "uskin-module", "--to", "log:hand.log", "--seconds", "1"]
    subprocess.run([taxel, *scene], cwd=folder, check=True)
    options = ["log:hand.log", "--layout", "new", "--no-touch", "--out", "left.toml"]
    wrong = ["servos", "allegro:a b", "dynamixel:/dev/nosuch", "dynamixel:/dev/null"]
    setup = Setup(folder, *options, answers="\n".join([*wrong, "none", "", ""]), typed=True)
    status, _ = setup.end()
    said = " ".join(setup.said.split())
    assert status == 0, said
    assert "cannot open /dev/nosuch: No such file" in said, "without a bit rate that nobody gave"
    assert said.count("`none` leaves the joints out") == len(wrong), said
    assert (folder / "left.toml").exists() and (folder / "hand.toml").exists(), setup.said


def test_a_device_that_is_stated_is_looked_at_before_anything_is_pressed(buses, shuffled, folder):
    options = ["--layout", "new", "--touch", "--joints", "dynamixel:/dev/nosuch"]
    setup = Setup(folder, *buses.sources, *options)
    status, _ = setup.end()
    assert status == 1 and "/dev/nosuch" in setup.said and "Press" not in setup.said, setup.said


def hub_text(bus, address, taxels):
    """A layout of a CySkin hub with a module of so many taxels for each number."""
    text = f'name = "hub"\nbuses = ["{bus}"]\nimage = {{ width = 11, height = {len(taxels)} }}\n'
    text += f'[[cyskin.hub]]\nname = "mine"\nbus = "{bus}"\naddress = {address}\n'
    for row, count in enumerate(taxels):
        text += f'[[module]]\nname = "m{row}"\npart = "p"\nbus = "{bus}"\nhub = "mine"\nboard = {row}\n'
        text += f'protocol = "cyskin"\nat = [0, {row}]\norder = [{list(range(1, count + 1))}]\n'
    return text


def test_modules_of_fewer_taxels_than_their_hub_sends_are_placed_on_the_hub_that_is_there(folder, play):
    there, wanted = folder / "there.toml", folder / "wanted.toml"
    there.write_text(hub_text("can0", 0x21, [11, 11]))
    wanted.write_text(hub_text("palm", 0x33, [7, 5]))
    with MulticastBuses(1) as buses:
        play("idle", buses.sources, "--layout", there, "--autostart")
        assert buses.buses[0].recv(HANGS_AFTER_S) is not None
        options = ["--layout", wanted, "--touch", "--joints", "none", "--out", "left.toml"]
        answers = "can0/0x21/1\ncan0/0x21/0\nhand.toml\n"
        setup = Setup(folder, *buses.sources, *options, answers=answers)
        status, _ = setup.end()
    assert status == 0, setup.said
    assert "4 taxels of can0 hub 0x21 module 1, 6 taxels of can0 hub 0x21 module 0" in " ".join(setup.said.split())
    written = tomllib.loads((folder / "hand.toml").read_text())
    assert written["cyskin"]["hub"] == [{"name": "can0 hub 0x21", "bus": "can0", "address": 0x21}]
    assert [(m["name"], m["board"]) for m in written["module"]] == [("m0", 1), ("m1", 0)]
