import pytest
from harness.bus import MulticastBuses
from harness.daemon import must_be_built


def pytest_configure():
    must_be_built("taxeld", "taxel", "examples/servo_bus")


@pytest.fixture
def buses(hand):
    with MulticastBuses(len(hand.buses)) as buses:
        yield buses
