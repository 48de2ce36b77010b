"""Levels in steps and levels that are learned: those of every frame are the recipe's to the bit, and so is each contact's level."""

import math
import subprocess

import numpy as np
import pytest
from harness.daemon import binary
from level_codebooks import (
    Learned,
    equal_steps,
    just_distinguishable,
    lifted,
    nearest,
    nearest_in_ratio,
    weber_steps,
)

SHAPE = (6, 8)
CONFIG = """layout = "allegro-uskin-15"
[[bus]]
source = "can:can0"
[[bus]]
source = "can:can1"
[profile]
actuators = 48
"""
STEPS = {"weber": (weber_steps, nearest_in_ratio), "equal": (equal_steps, nearest)}


def compressed(folder, frames, profile, actuators=48):
    """The levels of each frame, and the level of each of its contacts in the order of the list."""
    np.save(folder / "forces.npy", frames)
    (folder / "own.toml").write_text(CONFIG + profile)
    files = [folder / "forces.npy", "--config", folder / "own.toml", "--out", folder / "images.npz"]
    size = ["--actuators", str(actuators)]
    subprocess.run([binary("taxel"), "compress", *files, *size], check=True, capture_output=True)
    images = np.load(folder / "images.npz")
    for levels, actuators in zip(images["levels"], images["actuators"]):
        listed = actuators[~np.isnan(actuators[:, 0])]
        order = np.lexsort((listed[:, 1], listed[:, 2]))
        yield levels[~np.isnan(levels)].tolist(), listed[order, 3].astype(int).tolist()


def contacts(frame):
    return frame[frame > 0].tolist()


def around(forces):
    """Each force, the double before it and the one after it."""
    return [v for f in forces for v in (math.nextafter(f, 0), f, math.nextafter(f, math.inf))]


def in_frames(forces):
    size = SHAPE[0] * SHAPE[1]
    padded = np.zeros(-(-len(forces) // size) * size)
    padded[: len(forces)] = forces
    return padded.reshape(-1, *SHAPE)


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("m, big_m", [(2.0, 200.0), (1.0, 50.0), (0.3, 0.7), (1e-38, 1e38)])
@pytest.mark.parametrize("size", ["levels = 18", "levels = 1", "levels = 39", "levels = 255", "jnd = 0.07"])
def test_constant_steps_are_the_recipes_to_the_bit(folder, steps, m, big_m, size):
    make, number = STEPS[steps]
    key, value = size.split(" = ")
    k = int(value) if key == "levels" else just_distinguishable(float(value), m, big_m)
    levels = make(k, m, big_m)
    # On the borders, beside them, and elsewhere: 20.0 is one of a level of its own where K = 18.
    border = math.sqrt if steps == "weber" else (lambda v: v)
    pairs = list(zip(levels, levels[1:]))
    borders = [border(a) * border(b) if steps == "weber" else 0.5 * (a + b) for a, b in pairs]
    forces = [20.0, m, big_m, *around(levels[:20]), *around(borders[:40])]
    frames = in_frames([f for f in forces if 1e-38 <= f <= 1e38])
    profile = f'{size}\nlevel_steps = "{steps}"\nforce_min = {m!r}\nforce_max = {big_m!r}\n'
    for i, (got, numbers) in enumerate(compressed(folder, frames, profile)):
        assert got == levels, i
        assert numbers == [number(f, levels) for f in contacts(frames[i])], i


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("k", [1, 7, 18])
def test_steps_over_the_forces_of_a_frame_are_the_recipes_to_the_bit(folder, steps, k):
    make, number = STEPS[steps]
    random = np.random.default_rng(k)
    frames = np.where(random.random((30, *SHAPE)) < 0.5, random.gamma(2, 30, (30, *SHAPE)) + 1, 0)
    frames[7] = 0
    frames[8] = 5.0
    for i, (got, numbers) in enumerate(compressed(folder, frames, f'levels = {k}\nlevel_steps = "{steps}"\n')):
        forces = contacts(frames[i])
        levels = make(k, min(forces), max(forces)) if forces else []
        assert got == levels, i
        assert numbers == lifted(forces, [number(f, levels) for f in forces], k), i


def learned_frames(name):
    random = np.random.default_rng(3)
    shape = (10, *SHAPE)
    touched = random.random(shape) < 0.3
    touched[5] = False
    gamma = np.where(touched, random.gamma(2, 30, shape) + 1, 0)
    at_border = np.exp2(random.integers(-4, 5, shape)) * (1 + random.integers(-1, 17, shape) / 16)
    return {
        "forces of a skin": gamma,
        "whole counts": np.round(gamma),
        "in small units": gamma * 1e-30,
        "in large units": gamma * 1e30,
        "of every size": np.where(touched, 10.0 ** random.uniform(-37.9, 37.9, shape), 0),
        "at the borders of bins": np.where(touched, at_border, 0),
    }[name]


@pytest.mark.parametrize("forgetting", [0.0, 0.1, 1.0])
@pytest.mark.parametrize(
    "name, k",
    [
        ("forces of a skin", 8),
        ("forces of a skin", 1),
        ("forces of a skin", 200),
        ("whole counts", 3),
        ("in small units", 4),
        ("in large units", 4),
        ("of every size", 4),
        ("at the borders of bins", 5),
    ],
)
def test_learned_levels_are_the_recipes_to_the_bit(folder, name, k, forgetting):
    frames = learned_frames(name)
    learned, levels = Learned(k, forgetting), []
    profile = f"levels = {k}\ncodebook_learning = {{ forgetting = {forgetting} }}\n"
    for i, (got, numbers) in enumerate(compressed(folder, frames, profile)):
        forces = contacts(frames[i])
        if forces:
            learned.learn(forces)
            possible = learned.levels()
            assert got in possible, (i, got, possible)
            levels = got
        assert got == levels, i
        assert numbers == [nearest(f, levels) for f in forces], i


def test_learned_levels_of_more_contacts_than_weights_have_room_for_are_the_recipes(folder):
    # The weight of a million contacts fills the solver's range, and the least bins then lose theirs.
    random = np.random.default_rng(4)
    frames = np.exp2(random.uniform(0, 3, (300, 60, 60)))
    frames[0, 0, 0] = 1e-3
    learned = Learned(4, 0.0)
    for frame in frames:
        learned.learn(contacts(frame))
    *_, (got, _) = compressed(folder, frames, "levels = 4\ncodebook_learning = { forgetting = 0.0 }\n", actuators=1)
    assert got in learned.levels()
    assert sum(learned.weighted()[1]) > 2**30 * 0.999
