import signal

import pytest

LONGEST_TEST_S = 100


@pytest.fixture(autouse=True)
def hang_is_a_failure():
    """Ends a test that waits for what never comes, so that the others still run."""

    def give_up(_signal, _frame):
        pytest.fail(f"hung: not done after {LONGEST_TEST_S} s")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(LONGEST_TEST_S)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)
