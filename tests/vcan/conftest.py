import os

import pytest
from harness.bus import VcanBuses


def pytest_collection_modifyitems(items):
    if os.environ.get("TAXEL_VCAN") != "1":
        for item in items:
            item.add_marker(pytest.mark.skip(reason="real SocketCAN: run them with tests/run vcan"))


@pytest.fixture
def buses(hand):
    # Virtual interfaces queue frames per CPU: a sender that changes its CPU can overtake itself.
    os.sched_setaffinity(0, {0})
    with VcanBuses(len(hand.buses)) as buses:
        yield buses
