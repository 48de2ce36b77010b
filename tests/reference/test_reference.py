"""The reference against cases computed by hand."""

import numpy as np
import pytest
from conditioning import Conditioner, faulty_sensors
from sequential_clustering import Profile, cluster_means, compress, contact_list, maximin, quantise_force, spread

ROW = np.array([[x, 0] for x in range(8)])


def press(forces, profile=Profile(), xy=None, shape=(1, 8), contact=None, faulty=None, missing=None):
    n = len(forces)
    xy = ROW[:n] if xy is None else np.array(xy)
    none = np.zeros(n, dtype=bool)
    return compress(
        np.array(forces, dtype=float),
        np.ones(n, dtype=bool) if contact is None else np.array(contact),
        none if faulty is None else np.array(faulty),
        none if missing is None else np.array(missing),
        xy,
        shape,
        profile,
    )


def test_two_groups_of_forces_become_two_levels():
    # Start: 1 + 0.25 * 10, 1 + 0.75 * 10 = 3.5, 8.5; then the means of {1, 2} and {10, 11}.
    image = press([1, 10, 2, 11], Profile(levels=2))
    assert image.levels == [1.5, 10.5]
    assert image.pixels.tolist() == [[128, 255, 128, 255, 0, 0, 0, 0]]
    assert image.actuators == [(0, 0, 0, 1, 1.5), (1, 1, 0, 2, 10.5), (2, 2, 0, 1, 1.5), (3, 3, 0, 2, 10.5)]


def test_one_iteration_is_the_uniform_quantiser():
    # Range 0.5..8.5 in two halves, border 4.5: {0.5, 4} and {5, 8.5}.
    mu, level = quantise_force(np.array([0.5, 4, 5, 8.5]), Profile(levels=2, force_iterations=1))
    assert mu.tolist() == [2.25, 6.75]
    assert level.tolist() == [1, 1, 2, 2]


def test_an_empty_cluster_keeps_its_centroid():
    # Starts 5/3, 5, 25/3: nothing lies nearest to the middle one.
    mu, level = quantise_force(np.array([0.0, 1.0, 9.0, 10.0]), Profile(levels=3, force_iterations=5))
    assert mu.tolist() == [0.5, 5.0, 9.5]
    assert level.tolist() == [1, 1, 3, 3]


def test_equal_forces_are_the_highest_level():
    image = press([7, 7, 7])
    assert image.levels == [7.0] * 8
    assert [a[3] for a in image.actuators] == [8, 8, 8]
    assert image.pixels[0, :3].tolist() == [255, 255, 255]


def test_few_forces_are_spread_over_all_levels():
    # Bins of 6/8 from 3 to 9; the two that have a member move to it.
    image = press([3, 9])
    assert image.levels == [3.0, 4.125, 4.875, 5.625, 6.375, 7.125, 7.875, 9.0]
    assert image.pixels[0, :2].tolist() == [32, 255]


def test_levels_found_are_spread_over_those_of_the_display():
    levels, numbers = spread([3.0, 9.0], np.array([1, 2, 1]), 5)
    assert levels == [3.0, 3.0, 3.0, 9.0, 9.0] and numbers.tolist() == [3, 5, 3]
    assert spread([3.0], np.array([1]), 8)[1].tolist() == [8]


def test_a_force_between_two_levels_goes_to_the_lower():
    _, level = quantise_force(np.array([1.0, 2.0, 3.0]), Profile(codebook=(1.0, 3.0)))
    assert level.tolist() == [1, 1, 2]


def test_a_constant_codebook_is_not_moved_and_is_told_without_contact():
    profile = Profile(levels=4, codebook=(10.0, 20.0))
    image = press([11, 50], profile)
    assert image.levels == [10.0, 20.0]
    assert [a[3] for a in image.actuators] == [1, 2]
    assert image.pixels[0, :2].tolist() == [64, 128]  # 255 / 4 = 63.75; K_D is the display's
    assert press([11, 50], profile, contact=[False, False]).levels == [10.0, 20.0]


def test_grey_by_centroid_keeps_ratios_and_is_never_zero():
    image = press([1, 1000, 500], Profile(levels=3, grey="centroid"))
    assert image.levels == [1.0, 500.0, 1000.0]
    assert image.pixels[0, :3].tolist() == [1, 255, 128]  # 127.5 up


def test_actuators_start_as_far_apart_as_possible():
    c = np.array([[0, 0], [1, 0], [5, 0], [9, 0], [4, 0]], dtype=float)
    # Farthest from 0 is 9; then 5 and 4 have squared distance 16 each: the first in the list, 5.
    assert maximin(c, 3)[:, 0].tolist() == [0, 9, 5]


def test_more_contacts_than_actuators_are_clustered_and_snap_to_a_member():
    # Columns 0 1 2 | 6 7, two actuators: centroids 1 and 6.5; 6.5 is as near to 6 as to 7, the first is taken.
    xy = [[0, 0], [1, 0], [2, 0], [6, 0], [7, 0]]
    image = press([5, 1, 1, 1, 9], Profile(levels=3, actuators=2), xy=xy)
    assert image.levels == [1.0, 5.0, 9.0]
    assert image.actuators == [(0, 1, 0, 2, 5.0), (1, 6, 0, 3, 9.0)]
    assert np.flatnonzero(image.pixels[0]).tolist() == [1, 6]


def test_mean_force_is_the_level_nearest_to_the_mean_of_the_cluster():
    # Levels 1, 5, 9; mean of 5 1 1 is 2.33 -> level 1; mean of 1 and 9 is 5 -> level 2.
    xy = [[0, 0], [1, 0], [2, 0], [6, 0], [7, 0]]
    image = press([5, 1, 1, 1, 9], Profile(levels=3, actuators=2, actuator_force="mean"), xy=xy)
    assert [a[3] for a in image.actuators] == [1, 2]


def test_the_closest_level_has_the_least_error_from_the_forces_of_the_cluster():
    # One level for 1, 2 and 9, 6; one actuator for the first three: their mean, 4, is nearer to the level 2 than to 8.
    xy = [[0, 0], [1, 0], [2, 0], [6, 0], [7, 0]]
    closest = Profile(levels=2, actuators=2, actuator_force="closest", codebook=(2.0, 8.0))
    assert [a[3] for a in press([1, 2, 9, 1, 9.5], closest, xy=xy).actuators] == [1, 2]


def test_force_weights_pull_the_actuator_to_the_stronger_contact():
    xy = [[0, 0], [1, 0], [2, 0]]
    plain = press([1, 1, 10], Profile(actuators=1), xy=xy)
    weighted = press([1, 1, 10], Profile(actuators=1, force_weighted=True), xy=xy)
    assert [a[1] for a in plain.actuators] == [1]
    assert [a[1] for a in weighted.actuators] == [2]


def test_contacts_are_taken_in_raster_order_whatever_their_number():
    xy = np.array([[1, 1], [0, 1], [3, 0]])
    order, _ = contact_list(np.ones(3), np.ones(3, dtype=bool), np.zeros(3, dtype=bool), xy)
    assert order.tolist() == [2, 1, 0]


@pytest.mark.parametrize(
    "force, contact, refused",
    [
        (np.nan, False, 1),
        (np.inf, True, 1),
        (0.0, True, 1),
        (-1.0, True, 1),
        (1.1e38, True, 1),
        (0.9e-38, True, 1),
        (0.0, False, 0),
        (1e38, True, 0),
    ],
)
def test_a_force_that_is_none_is_refused(force, contact, refused):
    image = press([force], contact=[contact])
    assert image.faulty == refused
    assert image.contacts == (1 if contact and not refused else 0)


def test_faulty_and_missing_taxels_are_counted_and_not_felt():
    image = press([1, 2, 3, 4], faulty=[True, True, False, False], missing=[False, True, True, False])
    assert (image.contacts, image.faulty, image.missing) == (1, 1, 2)
    assert np.flatnonzero(image.pixels).tolist() == [3]


def test_nothing_touched_is_an_empty_image():
    image = press([1, 2], contact=[False, False])
    assert (image.levels, image.actuators, image.contacts) == ([], [], 0)
    assert not image.pixels.any()


def test_sums_go_in_the_order_of_the_contacts():
    # 1e16 + 1 + 1 is 1e16 one by one, 1e16 + 2 in pairs.
    values = np.array([1e16, 1.0, 1.0])
    mean = cluster_means(values, np.ones(3), np.zeros(3, dtype=int), np.zeros(1))
    assert mean[0] == 1e16 / 3


def test_the_dead_sensor_is_what_the_fault_rule_finds():
    counts = np.tile([30000, 30000, 10000], (16, 1))
    counts[5] = 65535
    assert np.flatnonzero(faulty_sensors(counts)).tolist() == [5]


def test_one_axis_is_enough_for_a_fault_and_low_is_none():
    counts = np.tile([100, 100, 100], (10, 1))
    counts[2, 1] = 200
    counts[3, 2] = 0
    assert np.flatnonzero(faulty_sensors(counts)).tolist() == [2]


def test_two_frames_calibrate_and_the_third_is_felt():
    conditioner = Conditioner()
    rest = np.tile([100, 100, 100], (3, 1))
    breath = rest.copy()
    breath[0, 2] = 101  # squared magnitude + 201
    force, contact, _ = conditioner.feed(rest)
    assert not contact.any() and not force.any()
    force, contact, _ = conditioner.feed(breath)
    assert force.tolist() == [201, 0, 0] and not contact.any()
    assert conditioner.threshold == 201
    pressed = rest.copy()
    pressed[1, 0] = 101  # just the threshold: no contact
    pressed[2, 0] = 99  # - 199: below
    pressed[0, 0] = 102  # + 404
    force, contact, _ = conditioner.feed(pressed)
    assert force.tolist() == [404, 201, 199]
    assert contact.tolist() == [True, False, False]


def test_a_faulty_sensor_does_not_set_the_threshold():
    conditioner = Conditioner()
    rest = np.tile([100, 100, 100], (9, 1))
    rest[4] = 65535
    conditioner.feed(rest)
    wild = rest.copy()
    wild[4] = 0
    wild[1, 1] = 101
    conditioner.feed(wild)
    assert conditioner.threshold == 201


def test_the_first_frame_waits_for_every_taxel_but_no_longer_than_ten_frames():
    rest = np.tile([100, 100, 100], (3, 1))
    silent = np.array([False, False, True])
    waits, patient = Conditioner(), Conditioner()
    waits.feed(rest, silent)
    assert waits.baseline is None
    waits.feed(rest)
    assert waits.baseline.tolist() == [30000] * 3
    for _ in range(10):
        patient.feed(rest, silent)
    assert patient.baseline[:2].tolist() == [30000] * 2 and patient.threshold is None
    patient.feed(rest, silent)
    assert patient.threshold == 0.0
