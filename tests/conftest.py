import itertools
import shutil
import signal
import tempfile
from pathlib import Path

import pytest
from harness.daemon import HANGS_AFTER_S, Daemon
from harness.hand import Hand
from harness.lockstep import TABLES, Lockstep

LONGEST_TEST_S = 3 * HANGS_AFTER_S


@pytest.fixture(autouse=True)
def hang_is_a_failure():
    """Ends a test that waits for what never comes, so that the others still run. Nothing else ends what it runs."""

    def give_up(_signal, _frame):
        pytest.fail(f"hung: not done after {LONGEST_TEST_S} s")

    before = signal.signal(signal.SIGALRM, give_up)
    # Again and again: what is cleaned up may wait for the same.
    signal.setitimer(signal.ITIMER_REAL, LONGEST_TEST_S, 30)
    yield
    signal.setitimer(signal.ITIMER_REAL, 0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture(scope="session")
def hand():
    return Hand()


@pytest.fixture
def folder():
    """A folder with a path short enough for Unix sockets (107 bytes)."""
    path = Path(tempfile.mkdtemp(prefix="taxel-"))
    yield path
    shutil.rmtree(path, ignore_errors=True)


@pytest.fixture
def start(folder, request):
    """Starts daemons, on the `buses` of the test's folder if no sources are given; all of them are gone after the test."""
    started = []
    numbers = itertools.count()

    def start(sources=None, **tables):
        sources = sources or request.getfixturevalue("buses").sources
        daemon = Daemon(folder / f"d{next(numbers)}", sources, **{**TABLES, **tables})
        started.append(daemon)
        return daemon.__enter__()

    yield start
    for daemon in started:
        daemon.kill()


@pytest.fixture
def lockstep(buses, hand):
    """Drives a daemon sweep by sweep."""
    opened = []

    def lockstep(daemon):
        opened.append(Lockstep(daemon, buses, hand))
        return opened[-1]

    yield lockstep
    for one in opened:
        one.reader.close()


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    """A failed test shows the logs of its daemons."""
    report = (yield).get_result()
    folder = item.funcargs.get("folder") if hasattr(item, "funcargs") else None
    if report.failed and folder:
        for log in sorted(Path(folder).glob("*/taxeld.log")):
            report.sections.append((f"log of {log.parent.name}", log.read_text(errors="replace")[-8000:]))
