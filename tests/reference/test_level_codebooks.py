"""The reference of levels in steps and of learned levels against cases computed by hand."""

import pytest
from exact_levels import optimal_levels
from level_codebooks import (
    Learned,
    equal_steps,
    just_distinguishable,
    lifted,
    nearest,
    nearest_in_ratio,
    root,
    weber_steps,
)


def test_equal_steps_are_the_middles_of_equal_parts():
    assert equal_steps(5, 0.5, 10.5) == [1.5, 3.5, 5.5, 7.5, 9.5]
    assert [nearest(rho, [10.0, 20.0, 40.0]) for rho in (1, 15, 15.5, 30, 1000)] == [1, 1, 2, 2, 3]


def test_weber_steps_have_equal_ratios():
    # r is the root number 4 of 256; 1 * 4, then times 16.
    assert root(256.0, 4) == 4.0
    assert weber_steps(2, 1.0, 256.0) == [4.0, 64.0]
    # The border is 16, the middle in ratio.
    assert [nearest_in_ratio(rho, [4.0, 64.0]) for rho in (0.1, 16.0, 16.1, 1e9)] == [1, 1, 2, 2]


def test_a_root_is_the_greatest_double_whose_power_is_not_above():
    assert root(1.0, 6) == 1.0
    assert root(2.0, 2) == 1.414213562373095  # its square is below 2, that of the next double above


def test_a_step_of_weber_is_counted_by_multiplication():
    assert just_distinguishable(1.0, 1.0, 8.0) == 3
    assert just_distinguishable(0.07, 1.0, 50.0) == 58
    assert just_distinguishable(0.001, 1.0, 1e38) == 255


def test_the_strongest_contact_and_those_of_its_level_have_the_highest():
    assert lifted([5.0, 5.0], [1, 1], 8) == [8, 8]
    assert lifted([1.0, 9.0, 8.0], [1, 7, 7], 8) == [1, 8, 8]


def test_a_weight_counts_a_force_so_often():
    assert optimal_levels([0.0, 1.0, 5.0], 2, [1, 3, 1])[0][0] == [0.75, 5.0]
    for forces, weights in (([1.0, 2.0, 4.0, 8.0], [3, 1, 2, 1]), ([8.0, 2.0, 1.0], [2, 2, 1])):
        many = [f for f, w in zip(forces, weights) for _ in range(w)]
        (levels, _), = optimal_levels(forces, 2, weights)
        assert levels == pytest.approx(optimal_levels(many, 2)[0][0])


def test_learned_levels_are_those_of_the_means_of_bins_by_weight():
    learned = Learned(2, 0.5)
    learned.learn([])
    learned.learn([10.0, 100.0])
    learned.learn([100.0, 102.0])
    # The octave from 64 has steps of 4: 100 and 102 are one bin, 2.5 in weight with 0.5 of the first frame.
    values, weights = learned.weighted()
    assert values == [10.0, 252.0 / 2.5] and weights == [512, 2560]
    assert learned.levels() == [[10.0, 252.0 / 2.5]]


def test_a_bin_that_has_faded_is_left_out_and_a_new_contact_counts_in_it_alone():
    learned = Learned(8, 0.9)
    learned.learn([7.0, 1.0])
    for _ in range(3):
        learned.learn([1.0])
    assert learned.weighted()[1][1] == 1  # a thousandth of 1,024
    learned.learn([1.0])
    assert learned.levels() == [[1.0]]
    learned.learn([7.25])
    assert learned.levels()[0][1] == pytest.approx(7.25, rel=1e-4)


def test_the_weights_of_many_contacts_are_made_to_fit():
    learned = Learned(8, 0.0)
    learned.bins = {(1, 16): (2.0**40, 2.0**40), (2, 16): (512.0, 1024.0), (3, 16): (2048.0, 8192.0)}
    values, weights = learned.weighted()
    assert values == [1.0, 4.0] and weights == [2**30 - 3, 1]
