"""The real daemon on real SocketCAN: traffic, links that come and go, full queues."""

import os
import subprocess
import threading
import time
from itertools import islice

import can
import pytest
from conditioning import DAEMON_SETTINGS
from harness.candump import write_candump
from harness.compare import Reference, assert_same
from harness.daemon import eventually
from harness.lockstep import next_image
from harness.touches import Touches, grasp
from sequential_clustering import Profile


def taxel_zero(n):
    """A frame of the first taxel, which passes every filter; `n` makes each different."""
    data = bytes([0x80]) + (n % 60000).to_bytes(2, "big") + bytes([0x7F, 0xFF, 0x32, 0, 1])
    return can.Message(arbitration_id=0, is_extended_id=False, data=data)


def check_grasp(driver, hand, frames=None):
    """The images of a grasp, or of its first frames: a guest without KVM takes half a second for each."""
    reference = Reference(hand, Profile())
    for i, counts in enumerate(islice(grasp(Touches.even(hand)), frames)):
        assert_same(driver.step(counts), reference.image(counts), f"frame {i}")


def test_traffic_from_python_can_becomes_the_references_images(start, lockstep, hand):
    daemon = start(conditioning=DAEMON_SETTINGS)
    driver = lockstep(daemon)
    check_grasp(driver, hand)
    readings = [128 * driver.sweeps, 112 * driver.sweeps]
    status = daemon.wait_status(lambda s: [b["used"] for b in s["buses"]] == readings, f"{readings} readings were sent")
    assert [(b["link"], b["lost_in_kernel"], b["late"]) for b in status["buses"]] == [("up", 0, 0)] * 2


def test_traffic_from_canplayer_becomes_images(start, lockstep, buses, folder, hand):
    log = folder / "grasp.log"
    frames = list(grasp(Touches.even(hand)))
    write_candump(log, hand, frames, start_s=0.1)
    daemon = start(conditioning=DAEMON_SETTINGS)
    driver = lockstep(daemon)
    player = subprocess.Popen(["canplayer", "-I", log, *(f"{n}={b}" for n, b in zip(buses.names, hand.buses))])
    try:
        eventually(lambda: next_image(driver.reader).contacts > 20, "the played grasp is not seen")
        assert player.wait() == 0
    finally:
        player.kill()
    # A player that is held up sends two sweeps at once, and readings of the second are then duplicates.
    sent = len(frames) * len(hand)
    daemon.wait_status(
        lambda s: sum(b["used"] + b["duplicate"] for b in s["buses"]) == sent, f"canplayer sent {sent} readings"
    )


def test_noise_from_cangen_is_accounted_for_and_does_not_disturb(start, lockstep, buses, hand):
    daemon = start(conditioning=DAEMON_SETTINGS)
    cangen = ["cangen", buses.names[0], "-g", "0", "-p", "10", "-L", "8"]
    # Random ids: most belong to no taxel of the hand, and some do.
    subprocess.run([*cangen, "-n", "3000", "-I", "r", "-D", "r"], check=True)
    # A flood on one taxel, of which the kernel keeps nothing back. Each of its frames may end a sweep that lacks the rest of the hand:
    # there must not be the 250 after which the rest is not waited for, since the sweep in which the rest is back is incomplete.
    subprocess.run([*cangen, "-n", "200", "-I", "000", "-D", "i"], check=True)
    kinds = ["used", "unknown", "not_data", "commands", "malformed", "queue_overflows", "duplicate", "late", "settling"]

    def settled(status):
        bus = status["buses"][0]
        return bus["received"] + bus["lost_in_kernel"] >= 3200 and sum(bus[k] for k in kinds) == bus["received"]

    daemon.wait_status(settled, "frames went missing in the account")
    driver = lockstep(daemon)
    driver.rezero()
    check_grasp(driver, hand, frames=8)


@pytest.mark.skipif(os.environ.get("TAXEL_GUEST") != "1", reason="sets the wall clock: a guest's, and not this machine's")
def test_a_wall_clock_that_is_set_moves_no_frame(start, lockstep, hand):
    """The kernel stamps frames with the wall clock, which here goes an hour ahead and two back between sweeps."""
    driver = lockstep(start(conditioning=DAEMON_SETTINGS))
    reference = Reference(hand, Profile())
    ahead_ns = time.clock_gettime_ns(time.CLOCK_REALTIME) - time.monotonic_ns()
    before_ns = time.monotonic_ns()
    try:
        for i, counts in enumerate(islice(grasp(Touches.even(hand)), 12)):
            hours = (0, 1, -1)[i % 3]
            time.clock_settime_ns(time.CLOCK_REALTIME, time.monotonic_ns() + ahead_ns + hours * 3600 * 10**9)
            image = driver.step(counts)
            assert_same(image, reference.image(counts), f"frame {i}")
            assert before_ns < image.t_ns <= time.monotonic_ns(), f"frame {i} is of another time"
            before_ns = image.t_ns
    finally:
        time.clock_settime_ns(time.CLOCK_REALTIME, time.monotonic_ns() + ahead_ns)


def test_a_link_that_goes_down_and_up_again(start, lockstep, buses, hand):
    daemon = start(conditioning=DAEMON_SETTINGS)
    driver = lockstep(daemon)
    check_grasp(driver, hand, frames=4)
    buses.set(0, "down")
    daemon.wait_status(lambda s: s["buses"][0]["link"] == "down", "the lost link is not told")
    assert eventually(lambda: next_image(driver.reader).missing == len(hand), "a lost link is not shown as missing")
    assert daemon.bus(1)["link"] == "up"
    buses.set(0, "up")
    daemon.wait_status(lambda s: s["buses"][0]["link"] == "up", "the link that is back is not told")
    assert daemon.bus()["link_losses"] == 1
    driver.rezero()
    check_grasp(driver, hand, frames=8)


def test_an_interface_deleted_and_made_again_under_load(start, lockstep, buses, hand):
    daemon = start(conditioning=DAEMON_SETTINGS)
    driver = lockstep(daemon)
    check_grasp(driver, hand, frames=4)
    stop = threading.Event()

    def load():
        n = 0
        sender = can.Bus(buses.names[0], interface="socketcan")
        while not stop.is_set():
            n += 1
            try:
                sender.send(taxel_zero(n))
            except can.CanError:
                break  # the interface is gone
        sender.shutdown()

    thread = threading.Thread(target=load)
    thread.start()
    try:
        received = daemon.bus()["received"]
        daemon.wait_status(lambda s: s["buses"][0]["received"] > received + 200, "the load does not arrive")
        buses.delete(0)
        daemon.wait_status(lambda s: s["buses"][0]["link"] == "absent", "the deleted interface is not told")
    finally:
        stop.set()
        thread.join()
    assert next_image(driver.reader).missing > 0
    buses.create(0)
    status = daemon.wait_status(lambda s: s["buses"][0]["link"] == "up", "the interface that is back is not opened")
    assert status["buses"][0]["reopens"] == 1 and status["buses"][1]["reopens"] == 0
    driver.rezero()
    check_grasp(driver, hand, frames=8)


def test_a_daemon_started_before_its_interfaces_exist(start, lockstep, buses, hand):
    for n in range(len(hand.buses)):
        buses.delete(n)
    daemon = start(conditioning=DAEMON_SETTINGS)
    driver = lockstep(daemon)
    assert next_image(driver.reader).missing == len(hand)
    assert {b["link"] for b in daemon.status()["buses"]} == {"absent"}
    for n in range(len(hand.buses)):
        buses.create(n)
    daemon.wait_status(lambda s: all(b["link"] == "up" for b in s["buses"]), "new interfaces are not found")
    check_grasp(driver, hand, frames=8)


@pytest.fixture
def stopped(start):
    """A daemon that is stopped while frames come, and goes on afterwards."""

    def flood(buses, frames, **tables):
        daemon = start(conditioning=DAEMON_SETTINGS, **tables)
        daemon.hold()
        buses.send((0, taxel_zero(n)) for n in range(frames))
        daemon.go_on()
        return daemon

    return flood


def test_a_burst_larger_than_the_default_receive_buffer_is_not_lost(stopped, buses):
    # The default buffer holds 278 frames (ecosystem: SO_RCVBUF 212992).
    daemon = stopped(buses, 4000)
    bus = daemon.wait_status(lambda s: s["buses"][0]["received"] == 4000, "4000 frames were sent")["buses"][0]
    assert bus["lost_in_kernel"] == 0


def test_what_the_kernel_drops_is_counted_to_the_frame(stopped, buses):
    daemon = stopped(buses, 4000, can={"receive_buffer_kib": 64})
    daemon.wait_status(lambda s: s["buses"][0]["received"] > 0, "nothing is received")
    # The kernel tells how many it dropped with the next frame that it queues.
    sent = 4000

    def told(status):
        nonlocal sent
        buses.send([(0, taxel_zero(sent))])
        sent += 1
        bus = status["buses"][0]
        return bus["lost_in_kernel"] > 0 and bus

    daemon.wait_status(told, "the dropped frames are not counted")
    bus = daemon.wait_status(
        lambda s: s["buses"][0]["received"] + s["buses"][0]["lost_in_kernel"] == sent, f"{sent} frames were sent"
    )["buses"][0]
    assert bus["lost_in_kernel"] > 1000
