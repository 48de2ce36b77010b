"""Every image of the daemon is the publication's, to the byte."""

import numpy as np
import pytest
from conditioning import DAEMON_SETTINGS
from harness.compare import Reference, assert_same
from harness.recordings import module_counts, tiled
from harness.touches import Touches, edges, grasp
from sequential_clustering import Profile

PROFILES = {
    "default": Profile(),
    "few of each": Profile(levels=3, actuators=4, force_iterations=3, actuator_iterations=2),
    "one of each": Profile(levels=1, actuators=1),
    "more than taxels": Profile(levels=255, actuators=300),
    "grey by centroid, mean force": Profile(grey="centroid", actuator_force="mean", actuators=8),
    "force weighted": Profile(force_weighted=True, actuators=5),
    "constant codebook": Profile(levels=8, codebook=(1e5, 1e6, 1e7, 5e7, 2e8)),
}


def in_config(profile):
    return {**vars(profile), "codebook": list(profile.codebook), "method": "paper"}


def check_every_image(lockstep, daemon, reference, frames):
    """Plays the frames and compares; returns how many images had contacts."""
    touched = 0
    driver = lockstep(daemon)
    for i, counts in enumerate(frames):
        expected = reference.image(counts)
        assert_same(driver.step(counts), expected, f"frame {i}")
        touched += expected.contacts > 0
    return touched


@pytest.mark.parametrize("scene", [grasp, edges])
@pytest.mark.parametrize("name", PROFILES)
def test_every_image_of_a_scene_is_the_references(start, lockstep, hand, scene, name):
    profile = PROFILES[name]
    daemon = start(conditioning=DAEMON_SETTINGS, profile=in_config(profile))
    frames = list(scene(Touches.even(hand)))
    assert check_every_image(lockstep, daemon, Reference(hand, profile), frames) >= 6


@pytest.mark.parametrize("conditioning", [{}, {"preset": "paper", "threshold_margin": 1.0}], ids=["implied", "stated"])
def test_the_method_implies_the_publications_conditioning(start, lockstep, hand, conditioning):
    daemon = start(conditioning=conditioning, profile=in_config(Profile()))
    frames = list(grasp(Touches.even(hand)))
    assert check_every_image(lockstep, daemon, Reference(hand, Profile()), frames) >= 6


def test_every_image_of_an_uneven_hand_with_dead_taxels_is_the_references(start, lockstep, hand):
    daemon = start(conditioning=DAEMON_SETTINGS)
    touches = Touches.uneven(hand, seed=1, dead=[0, 77, 239])
    reference = Reference(hand, Profile())
    assert check_every_image(lockstep, daemon, reference, grasp(touches)) >= 10
    reported = {fault["taxel"] for fault in daemon.status()["faults"]}
    assert reported == set(np.flatnonzero(reference.conditioner.faulty)) >= {0, 77, 239}


def test_the_order_of_the_frames_in_a_sweep_does_not_matter(start, lockstep, hand):
    daemon = start(conditioning=DAEMON_SETTINGS)
    reference = Reference(hand, Profile())
    driver = lockstep(daemon)
    random = np.random.default_rng(7)
    for i, counts in enumerate(grasp(Touches.even(hand))):
        image = driver.step(counts, order=random.permutation(len(hand)))
        assert_same(image, reference.image(counts), f"frame {i}")


@pytest.mark.parametrize("trial", ["trial00", "trial05", "trial11"])
def test_a_pick_and_move_trial_on_the_whole_hand(start, lockstep, hand, trial):
    frames = tiled(module_counts("uskin_pick_and_move.npz", trial), hand)[:250]
    daemon = start(conditioning=DAEMON_SETTINGS)
    assert check_every_image(lockstep, daemon, Reference(hand, Profile()), frames) > len(frames) // 2


@pytest.mark.parametrize("array, begin", [("debug_0B0Z_raw", 0), ("debug_0B2Z_raw", 300), ("LOG6", 0), ("LOG7", 0)])
def test_the_waseda_module_on_the_whole_hand(start, lockstep, hand, array, begin):
    frames = tiled(module_counts("uskin_waseda.npz", array)[begin:], hand)[:300]
    daemon = start(conditioning=DAEMON_SETTINGS)
    assert check_every_image(lockstep, daemon, Reference(hand, Profile()), frames) > 0


def test_a_new_profile_takes_effect_without_a_restart(start, lockstep, hand):
    daemon = start(conditioning=DAEMON_SETTINGS)
    references = [Reference(hand, p) for p in (Profile(), PROFILES["few of each"])]
    driver = lockstep(daemon)
    for i, counts in enumerate(grasp(Touches.even(hand))):
        expected = [reference.image(counts) for reference in references]
        if i == 8:
            reply = daemon.control("profile", profile=in_config(PROFILES["few of each"]))
            assert reply == {"ok": True}
        assert_same(driver.step(counts), expected[i >= 8], f"frame {i}")
    refused = daemon.control("profile", profile={**in_config(Profile()), "levels": 0})
    assert not refused["ok"] and "levels" in refused["error"]
