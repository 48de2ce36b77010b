"""The method `optimal`: every level is the exact optimum's and every actuator where the recipe puts it; places are no worse than the publication's."""

import json
import subprocess

import numpy as np
import pytest
import taxel_reader
from conditioning import DAEMON_SETTINGS, Conditioner
from following_actuators import Follower, heights, next_of
from harness.candump import sweep_times_ns, write_candump
from harness.compare_optimal import Frame
from harness.daemon import Daemon, binary
from harness.recordings import module_counts, tiled
from harness.touches import Touches, edges, grasp
from robust_conditioning import SETTINGS, RobustConditioner
from sequential_clustering import Profile, cluster_level


def optimal(**keys):
    """A profile with what the method implies for the reference's part of it."""
    return Profile(actuator_force="closest", **keys)


PROFILES = {
    "default": optimal(),
    "few of each": optimal(levels=3, actuators=4),
    "one of each": optimal(levels=1, actuators=1),
    "more than taxels": optimal(levels=255, actuators=255),
    "force weighted": optimal(levels=16, actuators=5, force_weighted=True),
    "strongest force": Profile(actuators=5),
}
NOT_OF_OPTIMAL = ("force_iterations", "actuator_iterations")


def in_config(profile, **more):
    keys = {key: value for key, value in vars(profile).items() if key not in NOT_OF_OPTIMAL}
    return {**keys, "codebook": [], "method": "optimal", **more}


def check_every_image(driver, hand, profile, frames, parts=None):
    """Plays the frames and checks; returns how many images had contacts."""
    conditioner = Conditioner()
    touched, costs = 0, []
    for i, counts in enumerate(frames):
        frame = Frame(hand, profile, *conditioner.feed(counts))
        image = driver.step(counts)
        if image.calibrating:  # which taxels are faulty is told when the calibration is done
            assert image.contacts == 0 and len(frame.rho) == 0
            continue
        frame.check(image, f"frame {i}")
        touched += image.contacts > 0
        costs.append(frame.costs(image, parts))
    assert_no_dearer(costs)
    return touched


def assert_no_dearer(costs):
    costs = np.array([c for c in costs if c is not None]).reshape(-1, 2)
    ours, papers = costs.sum(axis=0)
    assert ours <= 1.03 * papers, f"places cost {ours:.1f}, the publication's {papers:.1f}: {costs.tolist()}"


@pytest.mark.parametrize("scene", [grasp, edges])
@pytest.mark.parametrize("name", PROFILES)
def test_every_image_of_a_scene_has_the_least_force_error(start, lockstep, hand, scene, name):
    profile = PROFILES[name]
    daemon = start(conditioning=DAEMON_SETTINGS, profile=in_config(profile))
    assert check_every_image(lockstep(daemon), hand, profile, scene(Touches.even(hand))) >= 6


def test_each_finger_has_actuators_of_its_own(start, lockstep, hand):
    profile = optimal(actuators=9)
    daemon = start(conditioning=DAEMON_SETTINGS, profile=in_config(profile, parts_apart=True))
    fingers = lambda xy: xy[:, 0] // 4
    assert check_every_image(lockstep(daemon), hand, profile, grasp(Touches.even(hand)), fingers) >= 10


def test_a_recorded_trial_on_the_whole_hand_has_the_least_force_error(start, lockstep, hand):
    frames = tiled(module_counts("uskin_pick_and_move.npz", "trial05"), hand)[:250:5]
    daemon = start(conditioning=DAEMON_SETTINGS, profile=in_config(optimal()))
    assert check_every_image(lockstep(daemon), hand, optimal(), frames) > len(frames) // 2


def compressed(folder, hand, frames, conditioning, profile, **more):
    """The image of each frame of a recording, which `taxel compress` plays as the daemon does (test_recordings.py)."""
    log, out = folder / "hand.log", folder / "images.bin"
    write_candump(log, hand, frames, start_s=0.55)
    daemon = Daemon(
        folder / "d",
        [f"log:{log}?interface={bus}" for bus in hand.buses],
        tick={"mode": "sweep"},
        sweep={"board_period_ms": 33.0, "settle_ms": 0.0, "silent_after_sweeps": 250},
        conditioning=conditioning,
        profile=in_config(profile, **more),
    )
    compress = [binary("taxel"), "compress", log, "--config", daemon.config, "--out", out]
    subprocess.run(compress, check=True, capture_output=True)
    data, images = out.read_bytes(), []
    while data:
        image, length = taxel_reader.decode(data)
        data = data[length:]
        if image.missing == 0:
            images.append(image)
    assert len(images) == len(frames)
    return images


def robust_frames(touches):
    """Rest, a grasp, drift at rest for longer than the daemon waits for, and another grasp."""
    drifting = Touches(touches.hand, touches.at_rest)
    yield from touches.resting(16, seed=8)
    yield from grasp(touches)
    for i in range(60):
        living = ~np.all(touches.at_rest == 65535, axis=1)
        drifting.at_rest[living] = touches.at_rest[living] + i // 10
        yield from drifting.resting(1, seed=100 + i)
    yield from grasp(drifting)


def test_the_daemons_own_conditioning_is_the_references(folder, hand):
    # Times matter to this conditioning, so it is given a recording.
    touches = Touches.uneven(hand, seed=3, dead=[17, 200])
    frames = list(robust_frames(touches))
    images = compressed(folder, hand, frames, SETTINGS, optimal())

    conditioner, costs, touched = RobustConditioner(len(hand)), [], 0
    for i, (image, counts) in enumerate(zip(images, frames)):
        felt = conditioner.feed(counts, *sweep_times_ns(hand, i, start_s=0.55))
        assert image.calibrating == (felt is None), f"frame {i}"
        if felt is None:
            continue
        frame = Frame(hand, optimal(), *felt)
        frame.check(image, f"frame {i}")
        touched += image.contacts > 0
        costs.append(frame.costs(image))
    assert set(np.flatnonzero(conditioner.faulty)) == {17, 200}
    assert np.any(conditioner.baseline != conditioner.rested_at), "nothing drifted"
    assert touched >= 20
    assert_no_dearer(costs)


def restless_frames(touches):
    """Contacts that grow, slide, flicker, jump, hold still for long, go and come back. Starts with two frames at rest."""
    random = np.random.default_rng(5)
    yield touches.frame()
    yield touches.breath()
    one = lambda x, y: np.all(touches.hand.xy == (x, y), axis=1) * 900
    for press in (one(5, 5), one(5, 6), one(5, 6) * 0, one(8, 6), one(13, 6), one(13, 6) + one(9, 6)):
        yield touches.frame(press)
    yield from grasp(touches)
    for step in range(12):  # two balls pass each other
        yield touches.frame(touches.dome(2 + step, 6, 4.0, 900) + touches.dome(14 - step, 11, 3.0, 500))
    held = touches.dome(5, 5, 4.5, 900) + touches.dome(12, 9, 4.0, 700)
    for _ in range(40):
        yield touches.frame(held)
    for _ in range(12):  # taxels at the edge of the threshold
        yield touches.frame(np.where(random.random(len(held)) < 0.1, 0, held))
    for x in (1.5, 13.5, 1.5):  # another finger
        yield touches.frame(touches.dome(x, 3, 3.5, 800))
    for count in (20, 3, 0, 16, 17, 60, 17, 5, 200, 12):  # scattered, more and fewer than there are actuators
        press = np.zeros(len(held), dtype=int)
        press[random.choice(len(held), count, replace=False)] = random.integers(200, 2000, count)
        yield touches.frame(press)
        yield touches.frame(press)
    yield from edges(touches)


@pytest.mark.parametrize(
    "profile, gain",
    [
        (optimal(), 0.02),
        (optimal(levels=3, actuators=4), 0.0),
        (optimal(actuators=1), 0.02),
        (optimal(actuators=31), 1.0),
        (optimal(actuators=80), 0.02),
        (optimal(actuators=9, force_weighted=True), 0.02),
    ],
    ids=lambda value: f"{value.actuators} actuators" if isinstance(value, Profile) else f"gain {value}",
)
def test_every_actuator_is_where_the_recipe_puts_it(folder, hand, profile, gain):
    frames = list(restless_frames(Touches.even(hand)))
    images = compressed(folder, hand, frames, DAEMON_SETTINGS, profile, jump_gain=gain)
    conditioner, follower = Conditioner(), Follower(profile.actuators, gain)
    neighbours = next_of(hand.xy, [(taxel.bus, taxel.board) for taxel in hand.taxels])
    clustered = 0
    for i, (image, counts) in enumerate(zip(images, frames)):
        frame = Frame(hand, profile, *conditioner.feed(counts))
        height = heights(frame.rho, frame.xy, neighbours)
        ids, member = follower.follow(frame.xy, frame.rho if profile.force_weighted else None, height)
        wanted = [(k, *frame.xy[n]) for k, n in sorted(member.items())]
        assert [(a.id, a.x, a.y) for a in image.actuators] == wanted, f"frame {i}"
        if image.contacts:
            levels = frame.check_levels(image, f"frame {i}")
            mu = np.array(frame.levels)
            closest = [cluster_level(levels[ids == k], frame.rho[ids == k], mu, profile) for k, *_ in wanted]
            assert [a.level for a in image.actuators] == closest, f"frame {i}"
        clustered += image.contacts > profile.actuators
    assert clustered > 20


@pytest.mark.parametrize("scene", ["mug", "lemon", "faulty-hand"])
def test_of_a_grip_the_display_shows_the_forces_with_six_tenths_of_the_error_of_paper(scene):
    command = [binary("taxel"), "eval", f"sim:{scene}", "--restarts", "1", "--passes", "1", "--json"]
    judged = subprocess.run([*command, "--method", "paper", "--method", "optimal"], check=True, stdout=subprocess.PIPE)
    paper, optimal = json.loads(judged.stdout)["methods"]
    assert optimal["displayed_nrmse"] <= 0.6 * paper["displayed_nrmse"]
