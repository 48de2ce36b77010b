"""What `taxel metrics` says, read by both parsers of Prometheus' own client."""

import re
import subprocess
import urllib.request

from harness.daemon import binary, eventually
from prometheus_client import parser
from prometheus_client.openmetrics import parser as openmetrics


def metrics(daemon):
    """Once, on stdout."""
    command = [binary("taxel"), "metrics", "--socket", daemon.control_path]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def told(text, parse):
    """The families, each sample in one of them."""
    families = {family.name: family for family in parse(text)}
    assert families["taxeld_up"].samples[0].value == 1
    assert len(families) > 20
    assert {family.type for family in families.values()} >= {"counter", "gauge", "histogram"}
    assert all(family.documentation for family in families.values())
    # Buses and boards are told apart by labels, none of which comes twice: the parser refuses that.
    assert any(sample.labels for family in families.values() for sample in family.samples)
    return families


def text_format(text):
    """What node_exporter takes as format 0.0.4; the parser of Python takes more."""
    for line in text.splitlines():
        if line.startswith("# TYPE "):
            _, _, name, kind = line.split(" ")
            assert kind in ("counter", "gauge", "histogram", "summary", "untyped"), line
            assert (kind == "counter") == name.endswith("_total"), line
        elif line.startswith("# HELP "):
            assert re.fullmatch(r"([^\\]|\\\\|\\n)*", line), line
        else:
            assert not line.startswith("#"), line
    return told(text, parser.text_string_to_metric_families)


def test_metrics_of_a_running_daemon_are_the_text_format_to_the_letter(start):
    families = text_format(metrics(start()))
    assert families["taxeld_info"].samples[0].labels["layout"]


def test_the_parts_of_a_ticks_lateness_add_up_to_it(start):
    daemon = start()
    daemon.wait_status(lambda s: s["images"]["made"] > 20, "there are no images")
    families = text_format(metrics(daemon))

    def sum_us(name):
        samples = families[name].samples
        return round(1e6 * next(sample.value for sample in samples if sample.name.endswith("_sum")))

    whole = sum_us("taxeld_image_lateness_seconds")
    # Each is cut off at a microsecond.
    assert 0 <= whole - sum_us("taxeld_tick_jitter_seconds") - sum_us("taxeld_tick_duration_seconds") <= 1
    assert whole > 0


def test_a_file_for_node_exporter_is_the_text_format(start, folder):
    daemon, path = start(), folder / "taxeld.prom"
    command = [binary("taxel"), "metrics", "--socket", daemon.control_path, "--textfile", path]
    with subprocess.Popen(command) as process:
        try:
            eventually(path.exists, "it writes no file")
            text_format(path.read_text())
        finally:
            process.kill()


def test_openmetrics_is_answered_to_who_asks_for_it(start):
    daemon = start()
    command = [binary("taxel"), "metrics", "--socket", daemon.control_path, "--listen", "127.0.0.1:0"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            url = re.search(r"http://\S+/metrics", process.stderr.readline())[0]
            with urllib.request.urlopen(url) as answer:
                assert answer.headers["Content-Type"].startswith("text/plain; version=0.0.4")
                text_format(answer.read().decode())
            accept = {"Accept": "application/openmetrics-text;version=1.0.0,text/plain;q=0.5"}
            with urllib.request.urlopen(urllib.request.Request(url, headers=accept)) as answer:
                assert answer.headers["Content-Type"].startswith("application/openmetrics-text")
                families = told(answer.read().decode(), openmetrics.text_string_to_metric_families)
            assert families["taxeld_bus_load_ratio"].unit == "ratio"
            assert families["taxeld"].type == "info"
        finally:
            process.kill()


def test_metrics_without_a_daemon_say_that_it_is_down(folder):
    class Nobody:
        control_path = folder / "nobody.sock"

    assert "\ntaxeld_up 0\n" in metrics(Nobody)
