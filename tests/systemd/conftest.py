import os
from pathlib import Path

import pytest
from harness.bus import VcanBuses
from harness.service import Service, install, systemctl


def pytest_collection_modifyitems(items):
    if not Path("/run/systemd/system").is_dir() or "TAXEL_PACKAGE" not in os.environ:
        for item in items:
            item.add_marker(pytest.mark.skip(reason="systemd as the first process: run them with tests/run vcan"))


@pytest.fixture(scope="session")
def package():
    """The package, installed as a user would."""
    install(os.environ["TAXEL_PACKAGE"])


@pytest.fixture
def buses():
    with VcanBuses(2) as buses:
        yield buses


@pytest.fixture
def service(package, buses):
    """The installed unit with a hand of two modules that is on the test's buses, not started yet."""
    service = Service("taxeld")
    service.configure(sources=buses.sources)
    yield service
    systemctl("stop", "taxeld.service", "taxeld@*.service", "taxel-record.service", "taxel-metrics.service")
    systemctl("reset-failed")
    service.clean()
