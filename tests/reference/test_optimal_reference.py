"""The references of exact levels, of actuators that follow, and of the daemon's own conditioning against cases computed by hand."""

import itertools

import numpy as np
import pytest
from exact_levels import Forces, optimal_levels
from following_actuators import Follower, heights, neighbour_distance, next_of
from robust_conditioning import MS, Rest, RobustConditioner, judge_movement, steps_of, upper_spread


def test_the_levels_are_the_means_of_the_cut_with_the_least_error():
    # {0} {9 10 11 12} {20}: 2.25 + 0.25 + 0.25 + 2.25 = 5.
    (levels, numbers), = optimal_levels([0, 9, 10, 11, 12, 20], 3)
    assert levels == [0.0, 10.5, 20.0]
    assert numbers.tolist() == [1, 2, 2, 2, 2, 3]


def test_contacts_keep_their_order_and_equal_forces_stay_together():
    (levels, numbers), = optimal_levels([7.0, 1.0, 7.0, 2.0], 2)
    assert levels == [1.5, 7.0]
    assert numbers.tolist() == [2, 1, 2, 1]


def test_there_are_no_more_levels_than_different_forces():
    assert optimal_levels([3.0, 3.0, 5.0], 8)[0][0] == [3.0, 5.0]
    assert optimal_levels([3.0, 3.0], 8)[0][0] == [3.0]


def test_partitions_of_equal_error_are_all_told():
    assert sorted(levels for levels, _ in optimal_levels([1.0, 2.0, 3.0], 2)) == [[1.0, 2.5], [1.5, 3.0]]


def test_a_difference_that_doubles_cannot_hold_decides():
    # Squares of these need 107 bits, and their errors differ by 6. The mean, 2^53 + 1, rounds to even.
    base = 2.0**53
    (levels, numbers), = optimal_levels([base, base + 2, base + 6], 2)
    assert levels == [base, base + 6] and numbers.tolist() == [1, 1, 2]


@pytest.mark.parametrize("seed", range(5))
def test_no_other_way_of_cutting_has_less_error(seed):
    random = np.random.default_rng(seed)
    forces = np.sort(random.integers(0, 40, 9) / 8.0)
    n, k = len(forces), 4

    def error(cuts):
        parts = [forces[i:j] for i, j in zip((0, *cuts), (*cuts, n))]
        return sum(np.sum((p - p.mean()) ** 2) for p in parts)

    least = min(error(cuts) for cuts in itertools.combinations(range(1, n), k - 1))
    of = Forces(forces)
    found = [error(p[1:]) for p in of.partitions(k)]
    assert found and found == pytest.approx([least] * len(found), abs=1e-9)


def test_heights_are_measured_by_how_forces_of_neighbours_differ():
    # Two rows of 1, 1, 5: of seven pairs of neighbours two differ, by 4. The pixel between taxels of a row does not matter.
    places, forces = [(0, 0), (2, 0), (4, 0), (0, 1), (2, 1), (4, 1)], [1, 1, 5, 1, 1, 5]
    tall = 4 / (4.75 * 8 / 7)
    assert heights(forces, places, next_of(places)) == pytest.approx([0, 0, tall, 0, 0, tall])
    turned = [(y, x) for x, y in places]
    assert heights(forces, turned, next_of(turned)) == pytest.approx([0, 0, tall, 0, 0, tall])
    # In two modules no neighbours differ: they count as differing by a sixth of the range.
    tall = 4 / (4.75 * 4 / 6)
    assert heights(forces, places, next_of(places, [0, 0, 1, 0, 0, 1])) == pytest.approx([0, 0, tall, 0, 0, tall])
    assert heights([3, 3], places[:2], next_of(places)) is None


def test_contacts_that_do_not_hang_together_have_heights_by_how_forces_differ_from_their_mean():
    places = [(x, y) for y in range(3) for x in range(3)]
    # Two of 1 beside each other, and a 4 alone: one pair that does not differ, and one that lacks. The mean is 2.
    apart, spread = [(0, 0), (1, 0), (2, 2)], (1 + 1 + 2) / 3
    assert heights([1, 1, 4], apart, next_of(places)) == pytest.approx([0, 0, 3 / (4.75 * max(spread / 2, 3 / 3))])
    assert heights([1, 2, 6], [(0, 0), (2, 0), (1, 2)], next_of(places)) == pytest.approx([0, 1 / (4.75 * 2), 5 / (4.75 * 2)])


def stands(follower, *xy):
    """Where each id stands, after a frame with these contacts."""
    _, member = follower.follow(xy)
    return {i: xy[n] for i, n in member.items()}


def test_an_actuator_goes_with_its_contact_within_reach_and_another_takes_what_is_farther():
    follower = Follower(3)
    assert stands(follower, (0, 0), (9, 0)) == {0: (0, 0), 1: (9, 0)}
    assert stands(follower, (2, 0), (9, 1)) == {0: (2, 0), 1: (9, 1)}
    assert stands(follower, (5, 0), (9, 1)) == {2: (5, 0), 1: (9, 1)}
    # It rests where it stood, and returns when a contact comes within twice the reach of that.
    assert stands(follower, (9, 1)) == {1: (9, 1)}
    assert stands(follower, (0, 3), (9, 1)) == {0: (0, 3), 1: (9, 1)}


def test_groups_of_contacts_have_an_actuator_each_in_their_middle():
    row = [(x, 0) for x in (0, 1, 2, 10, 11, 12)]
    follower = Follower(2)
    assert sorted(stands(follower, *row).values()) == [(1, 0), (11, 0)]
    # To stay where they stood is worth half a square pixel (an eighth of 2 x 2) to them, and would cost a whole one.
    before = stands(follower, *row)
    aside = stands(follower, *[(x + 1, y) for x, y in row])
    assert aside == {i: (x + 1, y) for i, (x, y) in before.items()}


def test_a_contact_among_many_costs_a_jump_only_if_that_saves_enough():
    # All three are in use when a contact comes far from them: one of them has to be dissolved and jump there.
    near = [(0, 0), (3, 0), (20, 0), (23, 0)]
    for gain, other, jumps in ((0.02, (20, 9), True), (1.0, (20, 9), False)):
        follower = Follower(3, jump_gain=gain)
        first = stands(follower, (0, 0), (3, 0), (20, 0))
        assert first == {0: (0, 0), 1: (3, 0), 2: (20, 0)}
        after = stands(follower, *near, other)
        assert (other in after.values()) == jumps, (gain, after)


def test_the_distance_of_neighbours_is_the_median_one_to_the_nearest_of_a_module():
    grid = [(5 * x, 5 * y) for x in range(4) for y in range(4)]
    assert neighbour_distance([grid]) == neighbour_distance([grid, [(x + 1, y + 1) for x, y in grid]]) == 5
    assert neighbour_distance([[(0, 0), (9, 0), (0, 2), (9, 2)]]) == 2
    assert neighbour_distance([[(1, 1), (1, 1), (4, 5)]]) == 5
    assert neighbour_distance([[(1, 1)], [(1, 2)]]) == 1


def test_an_outlier_moves_neither_baseline_nor_noise():
    samples = [[100, 200, 300], [102, 200, 300]] * 6
    clean, spiked = Rest(samples), Rest(samples[:6] + [[9000, 200, 300]] + samples[6:])
    assert clean.baseline.tolist() == spiked.baseline.tolist() == [101.0, 200.0, 300.0]
    assert clean.noise == pytest.approx(2**0.5) and spiked.noise == clean.noise
    assert clean.peak == spiked.peak == 1.0
    assert not clean.touched and not clean.constant


def test_a_step_is_the_least_change_of_two_axes_that_go_up_and_down_at_times_of_their_own():
    of = lambda *taxels: steps_of(np.array(taxels)[:, :, None].transpose(1, 0, 2))[:, 0].tolist()
    taxels = [
        [165, 181, 165, 181, 165, 181, 181],
        [325, 309, 325, 325, 309, 325, 309],
        [640, 672, 640, 640, 672, 640, 640],
        [7] * 7,
        [160, 176, 177, 177, 177, 177, 177],
    ]
    assert of(*taxels) == [16, 16, 16, 1, 1]
    # At the same times; twice and back; in one direction; hardly any taxels; rounded.
    assert of(taxels[0], taxels[0], taxels[3]) == [1, 1, 1]
    assert of(taxels[0], taxels[2], taxels[3]) == [1, 1, 1]
    assert of(taxels[0], [160, 176, 192, 208, 224, 208, 192], taxels[3]) == [1, 1, 1]
    assert of(taxels[0], taxels[3]) == [16, 1] and of(taxels[2]) == [1]
    assert of([38, 50, 38, 50, 50, 38, 50], [125, 112, 125, 125, 112, 125, 112], taxels[3]) == [13, 13, 1]


def test_a_hand_that_moves_rests_as_in_its_quieter_half():
    still = [[[100 + i % 2, 200, 300 + n] for n in range(4)] for i in range(24)]
    moved = [[[100 + i % 2, 200, 300 + n + 6 * max(0, i - 11)] for n in range(4)] for i in range(24)]
    for frames, moves in ((still, False), (moved, True)):
        rest = [Rest(samples) for samples in np.array(frames).transpose(1, 0, 2)]
        assert judge_movement(rest) == moves
        assert [r.touched for r in rest] == [moves] * 4
        assert [r.baseline.tolist() for r in rest] == [[100.5, 200, 300 + n] for n in range(4)]
        assert [r.peak for r in rest] == [0.5] * 4


def test_of_a_few_taxels_those_that_move_rest_as_in_their_quieter_half():
    frames = [[[100 + i % 2, 200, 300 + n + (8 * max(0, i - 9) if n == 1 else 0)] for n in range(4)] for i in range(24)]
    rest = [Rest(samples) for samples in np.array(frames).transpose(1, 0, 2)]
    assert [r.wanders for r in rest] == [False, True, False, False]
    assert not judge_movement(rest)
    assert [r.baseline.tolist() for r in rest] == [[100.5, 200, 300 + n] for n in range(4)]
    assert rest[1].peak > 30, "what counts for the threshold is that of the whole window"


def test_noise_of_a_part_of_the_window_is_no_outlier():
    random = np.random.default_rng(3)
    noise = random.normal(0, 20, (96, 3)) * (np.arange(96) >= 72)[:, None]
    rest = Rest(np.rint(1000 + noise + random.normal(0, 1, (96, 3))))
    assert rest.peak < 20 and 40 < rest.noise_peak < 90
    assert Rest(np.rint(1000 + random.normal(0, 20, (96, 3)))).noise_peak == 0.0


def test_one_step_is_noise_of_counts_in_steps_and_an_outlier_of_others():
    samples = [[100, 200, 16 * (i % 8 == 1)] for i in range(16)]
    assert Rest(samples, [1, 1, 16]).baseline.tolist() == [100, 200, 2]
    assert Rest(samples).baseline.tolist() == [100, 200, 0]


def test_a_level_that_moves_is_a_touch():
    assert Rest([[100 + i % 2, 200, 300 + (70 if i > 9 else 0)] for i in range(16)]).touched
    assert not Rest([[100 + i % 2, 200, 300 + (50 if i > 9 else 0)] for i in range(16)]).touched


def test_the_spread_of_a_hand_is_that_of_its_upper_median():
    assert upper_spread(np.array([1.0, 2.0, 4.0, 100.0])) == (4.0, 1.4826 * 3.0)


def at_rest(i):
    # Noise of one count on an axis; taxel 2 reads dead.
    return np.array([[100 + i % 2, 200, 300], [400, 500 + i % 2, 600], [65535] * 3])


def test_a_contact_begins_above_the_threshold_and_ends_at_its_release():
    conditioner = RobustConditioner(3)
    times = lambda i: (np.full(3, i * 33 * MS), i * 33 * MS)
    felt = [conditioner.feed(at_rest(i), *times(i)) for i in range(13)]
    # Eleven frames until 300 ms are over, then 33 of 50 ms for judging (two of three taxels, at least four): all.
    assert [f is None for f in felt] == [True] * 12 + [False]
    assert conditioner.threshold == 10.0  # 1.5 times half a count is less
    assert conditioner.faulty.tolist() == [False, False, True]
    contacts = []
    for i, z in enumerate((300, 309, 311, 309, 307, 309), start=13):
        counts = at_rest(0)
        counts[0, 2] = z
        force, contact, faulty = conditioner.feed(counts, *times(i))
        contacts.append(bool(contact[0]))
        assert faulty.tolist() == [False, False, True] and not contact[2] and force[2] == 0.0
    assert contacts == [False, False, True, True, False, False]


def test_a_taxel_that_does_not_change_is_stuck_until_it_does_and_has_the_baseline_it_rested_at():
    conditioner = RobustConditioner(2)
    rest = np.array([[100, 200, 300], [400, 500, 600]])
    for i in range(13):
        felt = conditioner.feed(rest, np.full(2, i * 33 * MS), i * 33 * MS)
    assert conditioner.threshold == 10.0 and felt[2].tolist() == [True, True]
    for i, z in enumerate((300, 311, 340, 311, 308, 300), start=13):
        rest[0, 2] = z
        force, contact, faulty = conditioner.feed(rest, np.full(2, i * 33 * MS), i * 33 * MS)
        assert force.tolist() == [z - 300, 0.0] and faulty.tolist() == [i == 13, True]
        assert contact.tolist() == [14 <= i <= 16, False]


def test_a_taxel_that_is_pressed_while_the_others_do_not_change_is_not_the_hand():
    conditioner = RobustConditioner(4)
    for i in range(13):
        counts = np.array([[100, 200, 300 + 20 * i]] + [[400, 500, 600]] * 3)
        conditioner.feed(counts, np.full(4, i * 33 * MS), i * 33 * MS)
    assert conditioner.calibrated and conditioner.stuck.tolist() == [False, True, True, True]
    assert conditioner.threshold == 10.0
