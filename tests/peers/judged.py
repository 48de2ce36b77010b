"""What goals.py and made_up.py share: their command line, `taxel eval` on an input, a table's lines in Markdown."""

import argparse
import json
import subprocess


def command_line(of: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=of, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--restarts", default="4000")
    parser.add_argument("--taxel", default="target/release/taxel")
    return parser


def judged(args: argparse.Namespace, methods: list[str], *what: str) -> dict | None:
    """The report of `taxel eval`; None where it refuses the input, as one without a contact."""
    command = [args.taxel, "eval", *what, "--restarts", args.restarts, "--passes", "1", "--json"]
    command += [word for method in methods for word in ("--method", method)]
    ended = subprocess.run(command, stdout=subprocess.PIPE)
    return json.loads(ended.stdout) if ended.returncode == 0 else None


def places(method: dict) -> list[str]:
    """Of position error over the best: mean and p95."""
    ratios = (method[f"position_sse_ratio_{of}"] for of in ("mean", "p95"))
    return ["none" if ratio is None else f"{ratio:.3f}" for ratio in ratios]


def percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def line(*cells: str) -> None:
    print(f"| {' | '.join(cells)} |", flush=True)


def head(*cells: str) -> None:
    line(*cells)
    print("|" + len(cells) * "---|")
