import pytest
from harness.bus import MulticastBuses
from harness.daemon import binary


def pytest_configure():
    if not binary("taxeld").exists():
        pytest.exit(f"{binary('taxeld')} is not built: cargo build --workspace --bins", returncode=3)


@pytest.fixture
def buses(hand):
    with MulticastBuses(len(hand.buses)) as buses:
        yield buses
