"""A frame's time is the least of its rounds', and every program has it so."""

import json
import stat
import sys

from rounds import Eval, Kernels, Scaling


def program(folder, lines):
    """An executable that runs these lines of Python with its arguments in `args`, and what it counts in `calls`."""
    path = folder / "program"
    head = [f"#!{sys.executable}", "import json, sys", "import numpy as np", "from pathlib import Path", "args = sys.argv[1:]"]
    head += [f"log = Path({str(folder / 'calls')!r})", "calls = int(log.read_text()) if log.exists() else 0", "log.write_text(str(calls + 1))"]
    path.write_text("\n".join([*head, *lines]))
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


def test_a_frame_of_taxeld_has_the_least_of_its_rounds_medians(tmp_path):
    # Two methods, two frames, three passes; the first round is slow on frame 0, the second on frame 1.
    lines = [
        "condition = np.ones((2, 2, 3), dtype=np.float32)",
        "compress = np.full((2, 2, 3), 2, dtype=np.float32)",
        "compress[:, calls] = 50",
        "compress[:, 1 - calls, 0] = 90",
        "np.savez(args[args.index('--times') + 1], condition_us=condition, compress_us=compress)",
        "methods = [{'name': n, 'tick_us_p50': 1e9, 'weber_share': 0.5} for n in ('paper', 'optimal')]",
        "print(json.dumps({'methods': methods, 'restarts': args[-1]}))",
    ]
    timed = Eval(program(tmp_path, lines), ["input"], export=tmp_path / "frames.npz", times=tmp_path / "times.npz")
    timed.measure()
    timed.measure()
    report = timed.result()
    assert report["restarts"] == str(tmp_path / "frames.npz"), "errors are the first round's"
    for method in report["methods"]:
        assert method["weber_share"] == 0.5
        assert (method["tick_us_p50"], method["tick_us_p99"], method["tick_us_p999"]) == (3, 3, 3)
        assert method["compress_us"] == {"p50": 2, "p99": 2, "p999": 2, "max": 2}
        assert method["condition_us"]["max"] == 1
        assert method["every_tick_us"]["max"] == 91, "every measurement of every round counts here"
        assert method["tick_us_p50_of_each_round"] == [3, 3]


def test_a_frame_of_a_kernel_has_the_least_of_its_rounds(tmp_path):
    rounds = [{"frames": 2, "ratio": 1.5, "a": [1.0, 8.0]}, {"frames": 2, "ratio": 1.5, "a": [9.0, 2.0]}]
    recorded = Kernels(program(tmp_path, [f"print(json.dumps({json.dumps(rounds)}[calls]))"]))
    recorded.measure()
    recorded.measure()
    assert recorded.result() == {"frames": 2, "ratio": 1.5, "a": {"p50_us": 1, "p99_us": 2}}

    made_up = Kernels("")
    made_up.rounds = [[{"values": 16, "kernels": r}] for r in rounds]
    assert made_up.result() == [{"values": 16, "kernels": recorded.result()}]


def test_scaling_has_the_least_of_each_quantile(tmp_path):
    rounds = [[{"taxels": 16, "methods": [["paper", {"p50": p50, "max": most}]]}] for p50, most in [(1.0, 9.0), (2.0, 3.0)]]
    scaling = Scaling("")
    scaling.rounds = rounds
    assert scaling.result() == [{"taxels": 16, "methods": [["paper", {"p50": 1.0, "max": 3.0}]]}]


def test_a_kernel_without_frames_has_no_time(tmp_path):
    kernels = Kernels("")
    kernels.rounds = [{"frames": 0, "a": []}]
    assert kernels.result() == {"frames": 0, "a": {"p50_us": 0, "p99_us": 0}}
