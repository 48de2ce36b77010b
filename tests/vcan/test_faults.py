"""Buses that fail, on real SocketCAN: the kernel's own states and interfaces, boards that a test unplugs, nodes that babble.

Each test says how long after the end of its cause the daemon was well again; only that it becomes so is asserted.
"""

import math
import time

import can
import pytest
from harness.boards import AllegroFingers, Babbler, Board, BoardsOnTheBus
from harness.daemon import eventually, kinds, problem, told_once_each_time
from harness.slcan import SlcanAdapter

BUSOFF, CRTL, COUNTERS, RESTARTED = 0x040, 0x004, 0x200, 0x100  # linux/can/error.h
PASSIVE, ACTIVE = 0x20, 0x40

FREE_RUNNING = {
    "tick": {"mode": "timer", "rate_hz": 20.0},
    "boards": {"mode": "free-running"},
    "sweep": {},
    "realtime": {"priority": 0},
}

LAYOUT = """
name = "two-buses"
image = { width = 12, height = 8 }
buses = ["left", "right"]
"""
MODULES = [("left", 0), ("left", 1), ("left", 2), ("right", 0), ("right", 1)]


@pytest.fixture
def layout(folder):
    """A small hand of two buses, of which only one has a board 2: a guest without KVM plays it in time."""
    text = LAYOUT
    for bus, board in MODULES:
        x, y = 4 * board, 0 if bus == "left" else 4
        text += f"""
[[module]]
name = "{bus} {board}"
part = "{bus} {board}"
bus = "{bus}"
board = {board}
protocol = "uskin-l2"
at = [{x}, {y}]
"""
    path = folder / "two-buses.toml"
    path.write_text(text)
    return path


def boards_of(layout_buses=("left", "right")):
    return [Board(layout_buses.index(bus), address, 9000 + 700 * i) for i, (bus, address) in enumerate(MODULES)]


@pytest.fixture
def play(buses, start, layout):
    """A daemon and its boards, on the buses of the test or the interfaces given."""
    playing = []

    def play(boards, names=None, living=len(MODULES), **tables):
        names = names or buses.names
        daemon = start(sources=[f"can:{name}" for name in names], layout=str(layout), **FREE_RUNNING, **tables)
        playing.append(BoardsOnTheBus(names, boards).__enter__())
        if living:
            daemon.wait_status(lambda s: count_living(s) == living, "not every board speaks")
        return daemon

    yield play
    for boards in playing:
        boards.__exit__()


def count_living(status):
    return sum(b["state"] == "living" for b in status["boards"])


def comes(daemon, kind, *words):
    """The problem of this kind, once its sentence says all of this: it may know more a moment later."""

    def said(status):
        found = problem(status, kind)
        return found and all(word in found["sentence"] for word in words)

    return problem(daemon.wait_status(said, f"no problem {kind} with {words}"), kind)


def is_well_again(daemon, since, what, living=len(MODULES)):
    """Waits until there is no problem and every board speaks, and says how long that took."""
    daemon.wait_status(
        lambda s: count_living(s) == living and not s["problems"], f"after {what} it is not well again"
    )
    print(f"RECOVERY {what}: {time.monotonic() - since:.2f} s")


def others_go_on(daemon, but=()):
    """Each other board is fed anew."""
    before = {b["module"]: b["used"] for b in daemon.status()["boards"] if b["module"] not in but}
    daemon.wait_status(
        lambda s: all(b["used"] > before[b["module"]] for b in s["boards"] if b["module"] in before),
        "other boards are not fed",
    )


def error_frame(classes, data=bytes(8)):
    return can.Message(arbitration_id=classes, is_error_frame=True, is_extended_id=False, data=data)


def test_bus_off_and_the_kernels_restart(play, buses):
    boards = boards_of()
    daemon = play(boards)
    buses.send([(1, error_frame(BUSOFF | COUNTERS))])
    for board in boards[3:]:
        board.powered = False  # a controller that is off the bus hears nobody
    found = comes(daemon, "bus-off", "right: the controller is off the bus", "restart-ms 100")
    assert found["severe"] and found["bus"] == "right"
    others_go_on(daemon, but=("right 0", "right 1"))
    # Its boards are not blamed.
    daemon.report(1)
    daemon.wait_status(lambda s: kinds(s) == ["bus-off"], "its boards are told of as well")
    for board in boards[3:]:
        board.powered = True
    since = time.monotonic()
    buses.send([(1, error_frame(RESTARTED))])
    is_well_again(daemon, since, "bus-off and automatic restart")
    errors = daemon.bus(1)["errors"]
    assert (errors["frames"], errors["bus_off"], errors["restarted"]) == (2, 1, 1)
    assert daemon.bus(0)["errors"]["frames"] == 0
    eventually(lambda: "on the bus again" in daemon.log, "the log does not say that it is over")
    assert daemon.log.count(found["sentence"]) == 1


def test_error_passive_flapping_is_counted_and_said_once(play, buses):
    daemon = play(boards_of())
    changes = 0

    def is_told():
        nonlocal changes
        began = time.monotonic()
        while time.monotonic() < began + 0.5:
            buses.send([(0, error_frame(CRTL | COUNTERS, bytes([0, PASSIVE, 0, 0, 0, 0, 0, 130])))])
            buses.send([(0, error_frame(CRTL | COUNTERS, bytes([0, ACTIVE, 0, 0, 0, 0, 0, 0])))])
            changes += 2
            time.sleep(0.004)
        return problem(daemon.status(), "flapping")

    found = eventually(is_told, "flapping is not told")
    assert "left: the controller changes its error state" in found["sentence"] and "termination" in found["sentence"], found
    is_well_again(daemon, time.monotonic(), "flapping")
    bus = daemon.bus(0)
    assert bus["state_changes"] == changes and bus["errors"]["frames"] == changes
    assert told_once_each_time(daemon.log, "changes its error state")
    said = [line for line in daemon.log.splitlines() if "left:" in line]
    assert len(said) <= 6, said


def test_a_babbling_node_is_named_and_the_boards_go_on(play, buses):
    daemon = play(boards_of())
    # Well above the fifth of a bus from which on an id babbles, and not more than a slow guest can send.
    with Babbler(buses.names[0], 0x005, 3000):
        found = comes(daemon, "babbling", "id 005", "nobody's in the layout", "% of a bus of 1 Mbit/s")
        assert found["bus"] == "left"
        others_go_on(daemon)
        daemon.wait_status(lambda s: s["buses"][0]["unknown"] > 1000, "what it sends is not counted")
        print(found["sentence"])
    since = time.monotonic()
    is_well_again(daemon, since, "a babbling node")


def test_a_board_of_the_hand_that_babbles_is_named(play, buses):
    daemon = play(boards_of())
    with Babbler(buses.names[0], 0x111, 3000):
        found = comes(daemon, "babbling", "id 111 of left 1 (left board 1) babbles")
        others_go_on(daemon, but=("left 1",))
        print(found["sentence"])
    since = time.monotonic()
    is_well_again(daemon, since, "a babbling board")


def test_a_board_without_power_comes_back_unstarted_and_is_started(play):
    boards = boards_of()
    daemon = play(boards)
    for away_s in (0.4, 1.2):
        boards[1].powered = False
        boards[1].reboot()
        if away_s > 1:
            comes(daemon, "board-silent", "left 1 (left board 1) is silent")
            others_go_on(daemon, but=("left 1",))
        time.sleep(away_s)
        since = time.monotonic()
        boards[1].powered = True
        eventually(lambda: boards[1].started, "it is not started again")
        print(f"RECOVERY start command after {away_s} s without power: {time.monotonic() - since:.2f} s")
        is_well_again(daemon, since, f"a board without power for {away_s} s")


def test_two_boards_with_one_address(play):
    boards = boards_of()
    daemon = play(boards)
    boards[2].address = 1
    found = comes(daemon, "two-boards-one-address", "two boards answer as board 1 of left", "left 2 (left board 2) is silent")
    assert found["module"] == "left 1"
    others_go_on(daemon, but=("left 1", "left 2"))
    print(found["sentence"])
    since = time.monotonic()
    boards[2].address = 2
    is_well_again(daemon, since, "two boards with one address")


def test_swapped_buses_and_swapped_back(play, buses):
    boards = boards_of(("right", "left"))
    # Board 2 is on the bus that has none of its number: it would never be started there if nobody looked for it.
    daemon = play(boards, living=0)
    found = comes(daemon, "buses-swapped", "left and right look swapped", "left 2 (left board 2)", f"can:{buses.names[0]}")
    assert found["severe"]
    for board in boards:
        board.bus = 1 - board.bus
    since = time.monotonic()
    is_well_again(daemon, since, "swapped buses")


def test_an_interface_that_vanishes_and_returns_with_another_index(play, buses):
    boards = boards_of()
    daemon = play(boards)

    def index():
        with open(f"/sys/class/net/{buses.names[1]}/ifindex") as f:
            return int(f.read())

    before = index()
    buses.delete(1)
    found = comes(daemon, "link-absent", f"right: there is no interface {buses.names[1]}")
    daemon.wait_status(lambda s: kinds(s) == ["link-absent"], "its boards are told of as well")
    others_go_on(daemon, but=("right 0", "right 1"))
    for board in boards[3:]:
        board.reboot()  # an adapter that is pulled takes the power with it
    time.sleep(0.3)
    buses.create(1)
    since = time.monotonic()
    is_well_again(daemon, since, "an interface that vanished")
    assert index() != before
    assert daemon.log.count(found["sentence"]) == 1

    buses.set(1, "down")
    comes(daemon, "link-down", f"`ip link set {buses.names[1]} up`")
    buses.set(1, "up")
    is_well_again(daemon, time.monotonic(), "an interface that was down")


def test_a_hand_without_power_is_one_problem(play):
    boards = boards_of()
    daemon = play(boards)
    for board in boards[:3]:
        board.powered = False
        board.reboot()
    comes(daemon, "bus-silent", "left: no board speaks")
    daemon.wait_status(lambda s: kinds(s) == ["bus-silent"], "its boards are told of as well")
    others_go_on(daemon, but=("left 0", "left 1", "left 2"))
    since = time.monotonic()
    for board in boards[:3]:
        board.powered = True
    is_well_again(daemon, since, "a bus without power")


def test_a_hand_on_the_bus_of_its_skin_comes_back_with_it(play, buses):
    counts = [[500 * finger + 40 * j for j in range(4)] for finger in range(4)]
    angles = [math.radians(333.3 / 65536) * c for finger in counts for c in finger]
    fingers = AllegroFingers(0, counts)
    joints = {"source": f"allegro:can:{buses.names[0]}", "allegro": {"version": 3}}
    daemon = play([*boards_of(), fingers], joints=joints)

    def angles_of(status):
        return [joint["angle_rad"] for joint in status["joints"]["joints"]]

    status = daemon.wait_status(lambda s: None not in angles_of(s), "the hand is not heard")
    assert angles_of(status) == pytest.approx(angles, abs=1e-6)
    assert status["buses"][0]["unknown"] == 0 and status["buses"][0]["joints"] > 0 == status["buses"][1]["joints"]

    fingers.powered = False
    found = comes(daemon, "hand-silent", f"the Allegro hand on can:{buses.names[0]} sends no angles", "power and cable")
    assert found["severe"]
    daemon.wait_status(lambda s: set(angles_of(s)) == {None}, "angles of a silent hand stay known")
    others_go_on(daemon)
    fingers.powered = True
    is_well_again(daemon, time.monotonic(), "an Allegro hand without power")

    buses.set(0, "down")
    comes(daemon, "link-down")
    daemon.wait_status(lambda s: set(angles_of(s)) == {None}, "angles stay known without their bus")
    daemon.wait_status(lambda s: kinds(s) == ["link-down"], "hand or boards are told of as well")
    buses.set(0, "up")
    is_well_again(daemon, time.monotonic(), "the bus of hand and skin")
    daemon.wait_status(lambda s: angles_of(s) == pytest.approx(angles, abs=1e-6), "its angles do not come back")


@pytest.fixture
def adapter():
    adapters = []

    def plug(name):
        adapters.append(SlcanAdapter(name))
        return adapters[-1]

    yield plug
    for one in adapters:
        one.unplug()


def test_the_states_of_a_real_controller(play, buses, adapter):
    """The kernel's own state machine (slcan): warning, passive, bus-off with loss of carrier, restart by hand."""
    slcan = adapter("adapter0")
    slcan.up()
    daemon = play(boards_of()[3:], names=["adapter0", buses.names[1]], living=2)
    others = ("left 0", "left 1", "left 2")
    comes(daemon, "bus-silent")

    def state(expected):
        daemon.wait_status(lambda s: s["buses"][0]["state"] == expected, f"the state is not {expected}")

    slcan.state("w", rx=100)
    state("error-warning")
    comes(daemon, "error-warning", "0 sending, 100 receiving", "bit rate")
    daemon.report(1)  # slower than flapping
    slcan.state("p", tx=135)
    state("error-passive")
    comes(daemon, "error-passive", "135 sending, 0 receiving", "not acknowledged")
    daemon.report(1)
    slcan.state("a")
    state("error-active")
    daemon.report(1)
    slcan.state("b", tx=255)
    state("bus-off")
    comes(daemon, "bus-off", "`ip link set adapter0 down")
    others_go_on(daemon, but=others)

    # By hand, as the sentence says; the kernel sends no error frame then.
    slcan.down()
    slcan.up()
    since = time.monotonic()
    state("error-active")
    daemon.wait_status(lambda s: not problem(s, "bus-off"), "bus-off is never over")
    print(f"RECOVERY bus-off restarted by hand: {time.monotonic() - since:.2f} s")


def test_a_daemon_started_while_the_controller_is_bus_off_sees_it(play, buses, adapter):
    slcan = adapter("adapter0")
    slcan.up()
    slcan.state("b", tx=255)
    eventually(lambda: open("/sys/class/net/adapter0/carrier").read().strip() == "0", "it keeps its carrier")
    daemon = play(boards_of()[3:], names=["adapter0", buses.names[1]], living=2)
    comes(daemon, "bus-off", "left: the controller is off the bus")
    slcan.down()
    slcan.up()
    daemon.wait_status(lambda s: s["buses"][0]["state"] == "error-active", "bus-off is never over")


def test_an_adapter_unplugged_and_back_as_another_device(play, buses, adapter):
    slcan = adapter("adapter0")
    slcan.up()
    daemon = play(boards_of()[3:], names=["adapter0", buses.names[1]], living=2)
    board = Board(0, 0)
    for frame in board.frames():
        slcan.frame(frame)
    daemon.wait_status(lambda s: s["buses"][0]["received"] >= 16, "frames of the adapter do not arrive")
    # Half a frame and the plug is out.
    slcan.line("t1118AABB")
    before = slcan.index()
    slcan.unplug()
    comes(daemon, "link-absent", "left: there is no interface adapter0")
    others_go_on(daemon, but=("left 0", "left 1", "left 2"))
    again = adapter("adapter0")
    again.up()
    since = time.monotonic()
    daemon.wait_status(lambda s: s["buses"][0]["link"] == "up", "the adapter that is back is not opened")
    print(f"RECOVERY an adapter plugged in again: {time.monotonic() - since:.2f} s")
    assert again.index() != before
    received = daemon.bus(0)["received"]
    eventually(lambda: b"t20020700\r" in again.heard, "its boards are not started")
    for frame in board.frames():
        again.frame(frame)
    daemon.wait_status(lambda s: s["buses"][0]["received"] >= received + 16, "its frames do not arrive")
