"""What `taxel metrics` says, read by the parser of Prometheus itself."""

import subprocess

from harness.daemon import binary
from prometheus_client.openmetrics.parser import text_string_to_metric_families


def metrics(daemon):
    command = [binary("taxel"), "metrics", "--socket", daemon.control_path]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30)
    assert done.returncode == 0, done.stderr
    return {family.name: family for family in text_string_to_metric_families(done.stdout)}


def test_metrics_of_a_running_daemon_are_openmetrics_to_the_letter(start):
    daemon = start()
    families = metrics(daemon)
    assert families["taxeld_up"].samples[0].value == 1
    assert len(families) > 20
    assert {family.type for family in families.values()} >= {"counter", "gauge", "histogram"}
    assert all(family.documentation for family in families.values())
    # Buses and boards are told apart by labels, none of which comes twice: the parser refuses that.
    assert any(sample.labels for family in families.values() for sample in family.samples)


def test_metrics_without_a_daemon_say_that_it_is_down(folder):
    class Nobody:
        control_path = folder / "nobody.sock"

    assert metrics(Nobody)["taxeld_up"].samples[0].value == 0
