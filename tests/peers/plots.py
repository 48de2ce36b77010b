"""Draws the plots of docs/benchmarks.md from results.json: plots.py RESULTS DIR writes SVG, and PNG beside RESULTS."""

import json
import math
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

OWN, PAPER, PEER, GUIDE = "#0b5cad", "#b3541e", "#555555", "#aaaaaa"
plt.rcParams.update(
    {
        "font.size": 10,
        "svg.fonttype": "none",
        "svg.hashsalt": "taxeld",
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "grid.color": "#e4e4e4",
        "grid.linewidth": 0.6,
        "figure.constrained_layout.use": True,
    }
)


def plain(axis):
    axis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:,.0f}" if v >= 1 else f"{v:g}"))
    axis.set_minor_formatter(NullFormatter())


def save(figure, name, folder, previews):
    figure.savefig(folder / f"{name}.svg", metadata={"Date": None, "Creator": None})
    figure.savefig(previews / f"{name}.png", dpi=110)
    plt.close(figure)


MARKS = {
    "taxeld optimal": (OWN, "o"),
    "taxeld paper": (PAPER, "s"),
    "OpenCV, 1 attempt": ("#3f7d3a", "^"),
    "OpenCV, 10 attempts": ("#3f7d3a", "v"),
    "scikit-learn, 1 start": (PEER, "D"),
    "scikit-learn, 10 starts": (PEER, "X"),
}


def points_of(recording):
    """Name, time of both stages, force ratio, position ratio."""
    for m in recording["eval"]["methods"]:
        yield f"taxeld {m['name']}", m["compress_us"]["p50"], m["force_sse_ratio_p95"], m["position_sse_ratio_mean"]
    for p in recording["peers"]:
        if "both_us_p50" in p:
            name = p["name"].replace(" KMeans", "").replace(" kmeans", "")
            yield name, p["both_us_p50"], p["force_sse_ratio_p95"], p["position_sse_ratio_mean"]


def speed_against_error(results, folder, previews):
    chosen = [r for r in results["recordings"] if r["eval"]["contacts_median"] > 30][:1]
    chosen += [r for r in results["recordings"] if r["name"] == "scene ball-grasp"]
    figure, axes = plt.subplots(len(chosen), 2, figsize=(10, 3.2 * len(chosen) + 0.6), squeeze=False, sharex=True)
    for row, recording in zip(axes, chosen):
        points = list(points_of(recording))
        for axis, which, label in [(row[0], 2, "force error / least there is, p95"), (row[1], 3, "position error / best of 64, mean")]:
            # Excess over the reference, on a scale that keeps zero.
            for point in points:
                colour, marker = MARKS[point[0]]
                excess = max(point[which] - 1, 0)
                axis.plot(point[1], excess, marker, color=colour, markersize=9, clip_on=False, zorder=3, label=point[0])
            axis.set_xscale("log")
            axis.set_xlim(3, 300_000)
            top = max(max(p[which] - 1 for p in points), 0.01)
            if top > 3:
                axis.set_yscale("symlog", linthresh=0.1)
                axis.set_yticks([t for t in (0, 0.1, 1, 10, 100, 1000) if t <= top * 3])
                axis.yaxis.set_minor_locator(NullLocator())
            axis.set_ylim(0, top * 2 if top > 3 else top * 1.2)
            axis.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{1 + v:g}"))
            axis.set_ylabel(label)
            plain(axis.xaxis)
        row[0].set_title(recording["name"], loc="left", fontsize=10, fontweight="bold")
    for axis in axes[-1]:
        axis.set_xlabel("both stages of a frame, microseconds (median)")
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    save(figure, "speed-against-error", folder, previews)


def cost_against_taxels(results, folder, previews):
    figure, (both, kernel) = plt.subplots(1, 2, figsize=(10, 4.2), sharex=True)
    sizes = [s["taxels"] for s in results["scaling"]]
    for n, (name, colour) in enumerate([("paper", PAPER), ("optimal", OWN)]):
        us = [dict(map(tuple, s["methods"]))[name] for s in results["scaling"]]
        both.plot(sizes, [u["p50"] for u in us], "o-", color=colour, markersize=5, label=f"{name}, p50")
        both.plot(sizes, [u["max"] for u in us], ":", color=colour, label=f"{name}, slowest frame")
    last = dict(map(tuple, results["scaling"][2]["methods"]))["optimal"]["p50"]
    guide = [last * n * math.log2(n) / (sizes[2] * math.log2(sizes[2])) for n in sizes]
    both.plot(sizes, guide, "--", color=GUIDE, label="n log n", zorder=0)
    both.axhline(1000, color=GUIDE, linewidth=0.8)
    both.annotate("1 ms: a tick at 1 kHz", (16, 1000), (0, 3), textcoords="offset points", color=PEER, fontsize=9)
    both.set_title("both stages, every taxel in contact", loc="left", fontsize=10, fontweight="bold")
    values = [s["values"] for s in results["kernel_scaling"]]
    for name, colour, style in [
        ("Kmeans1d, after the last frame", OWN, "o-"),
        ("Kmeans1d, cold", OWN, "o:"),
        ("ckmeans", PEER, "s-"),
    ]:
        kernel.plot(values, [s["kernels"][name]["p50_us"] for s in results["kernel_scaling"]], style, color=colour, markersize=5, label=name)
    kernel.set_title("force levels alone (K = 8, sorting included)", loc="left", fontsize=10, fontweight="bold")
    for axis, label in [(both, "taxels"), (kernel, "values")]:
        axis.set(xscale="log", yscale="log", xlabel=label, ylabel="microseconds per frame")
        axis.set_xticks([16, 64, 256, 1024, 4096, 16384, 65536])
        axis.xaxis.set_minor_locator(NullLocator())
        axis.yaxis.set_major_locator(LogLocator(10))
        plain(axis.xaxis)
        plain(axis.yaxis)
        axis.legend(frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(0, 0.98))
    both.legend(frameon=False, fontsize=9, loc="lower right")
    kernel.legend(frameon=False, fontsize=9, loc="lower right")
    save(figure, "cost-against-taxels", folder, previews)


def error_against_movement(results, folder, previews):
    chosen = results["history"]
    columns = 2
    rows = math.ceil(len(chosen) / columns)
    figure, axes = plt.subplots(rows, columns, figsize=(10, 3.3 * rows), squeeze=False)
    for axis, entry in zip(axes.flat, chosen):
        methods = {m["name"]: m for m in entry["eval"]["methods"]}
        curve = [(float(n.split("=")[1]), m) for n, m in methods.items() if "history" in n]
        gains = [(float(n.split("=")[1]), m) for n, m in methods.items() if "jump_gain" in n]
        gains = sorted([*gains, (0.03, methods["optimal history=0"])], key=lambda g: g[0])
        at = lambda series: [[m[key] for _, m in series] for key in ("moved_px_mean", "position_sse_ratio_mean")]
        axis.plot(*at(gains), "D--", color="#8a5fa8", markersize=6, linewidth=1, zorder=2)
        for (gain, m), offset in [(gains[0], (8, -11)), (gains[-1], (8, -4))]:
            place = (m["moved_px_mean"], m["position_sse_ratio_mean"])
            axis.annotate(f"jump_gain {gain:g}", place, offset, textcoords="offset points", color="#8a5fa8")
        axis.plot(*at(curve), "-", color=GUIDE, linewidth=1, zorder=3)
        x, y = at(curve)
        shades = axis.scatter(x, y, c=[h for h, _ in curve], cmap="viridis_r", vmin=0, vmax=2, s=45, edgecolor="#333333", linewidth=0.5, zorder=4)
        x, y = x + at(gains)[0], y + at(gains)[1]
        paper = methods["paper"]
        axis.text(
            0.98,
            0.96,
            f"paper: {paper['moved_px_mean']:.2f} px, {paper['position_sse_ratio_mean']:.3f}, jumps {100 * paper['jump_fraction']:.1f} %",
            transform=axis.transAxes,
            ha="right",
            va="top",
            color=PAPER,
            backgroundcolor="white",
        )
        axis.set_title(entry["name"], loc="left", fontsize=10, fontweight="bold")
        axis.set_xlabel("movement of an actuator, pixels per frame (mean)")
        axis.set_ylabel("position error / best of 64, mean")
        axis.set_xlim(0, max(x) * 1.35 + 1e-6)
        low, high = min(min(y), 1.0), max(y)
        axis.set_ylim(low - 0.1 * (high - low) - 0.001, high + 0.35 * (high - low) + 0.001)
        axis.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:.3f}"))
    for axis in list(axes.flat)[len(chosen) :]:
        axis.remove()
    figure.colorbar(shades, ax=axes, label="history (circles)", shrink=0.6)
    save(figure, "error-against-movement", folder, previews)


def main():
    source, folder = Path(sys.argv[1]), Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    results = json.loads(source.read_text())
    speed_against_error(results, folder, source.parent)
    cost_against_taxels(results, folder, source.parent)
    error_against_movement(results, folder, source.parent)


if __name__ == "__main__":
    main()
