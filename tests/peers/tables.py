"""The tables of docs/benchmarks.md from results.json: tables.py RESULTS FILE puts each between its marks in FILE.

A table's place is `<!-- table: NAME -->` to `<!-- end of table -->`, each on a line of its own; NAME is one of TABLES.
"""

import json
import re
import sys
from pathlib import Path

# Recordings whose comparison with peers is in the document; report.md has all of them.
SHOWN = {"peers-recording": "Waseda debug_0B2Z_raw, tiled", "peers-worst": "scene worst-case"}


def table(head, rows):
    return "\n".join([f"| {' | '.join(head)} |", "|" + "---|" * len(head), *(f"| {' | '.join(row)} |" for row in rows)])


def percent(value):
    return "" if value is None else f"{100 * value:.1f} %"


def number(value):
    return "" if value is None else f"{value:.3f}"


def method(report, name):
    return next(m for m in report["methods"] if m["name"] == name)


def place(m, key):
    """A position ratio; none where no frame has more contacts than actuators."""
    return "none" if m[key] is None else f"{m[key]:.3f}"


def programs(recording):
    """Both stages: time and error beside `optimal`."""
    head = ["program", "both stages, us p50", "p99", "times optimal's", "less call overhead", "force SSE p50", "mean", "p95", "frames optimal"]
    head += ["position SSE mean", "p95", "jumps", "displayed NRMSE"]
    own = method(recording["eval"], "optimal")["compress_us"]["p50"]
    rows = []
    for m in recording["eval"]["methods"]:
        us = m["compress_us"]
        rows.append(
            [f"taxeld `{m['name']}`", f"{us['p50']:.1f}", f"{us['p99']:.1f}", f"{us['p50'] / own:.1f}", ""]
            + [f"{m['force_sse_ratio_p50']:.3f}", f"{m['force_sse_ratio_mean']:.3g}", f"{m['force_sse_ratio_p95']:.3g}"]
            + [percent(m["force_optimal_fraction"]), place(m, "position_sse_ratio_mean"), place(m, "position_sse_ratio_p95"), percent(m["jump_fraction"])]
            + [number(m["displayed_nrmse"])]
        )
    for p in both_stages(recording):
        net = net_us(p)
        rows.append(
            [p["name"], f"{p['both_us_p50']:.0f}", f"{p['both_us_p99']:.0f}", f"{p['both_us_p50'] / own:.0f}", f"{net:.0f} ({net / own:.1f} times)"]
            + [f"{p['force_sse_ratio_p50']:.3f}", f"{p['force_sse_ratio_mean']:.3g}", f"{p['force_sse_ratio_p95']:.3g}"]
            + [percent(p["force_optimal_fraction"]), f"{p['position_sse_ratio_mean']:.3f}", f"{p['position_sse_ratio_p95']:.3f}", percent(p["jump_fraction"])]
            + [number(p["displayed_nrmse"])]
        )
    return table(head, rows)


def both_stages(recording):
    return [p for p in recording["peers"] if "both_us_p50" in p]


def net_us(peer):
    """Time of both calls less what they cost on two values."""
    return peer["both_us_p50"] - sum(peer["overhead_us"].values())


def kernel_rows(recording):
    head = ["one-dimensional kernel", "us p50", "p99", "times Kmeans1d's", "error over the least, max"]
    kernels = recording["kernels"]
    own = kernels["Kmeans1d, after the last frame"]["p50_us"]
    rows = []
    for name, times in kernels.items():
        if isinstance(times, dict):
            worst = f"{kernels['ckmeans_error_ratio_max']:.9f}" if name.startswith("ckmeans") else ""
            rows.append([name, f"{times['p50_us']:.2f}", f"{times['p99_us']:.2f}", f"{times['p50_us'] / own:.1f}", worst])
    for p in recording["peers"]:
        if "both_us_p50" not in p:
            net = p["levels_us_p50"] - p["overhead_us"]["levels"]
            rows.append(
                [p["name"], f"{p['levels_us_p50']:.1f} (less overhead {net:.1f})", f"{p['levels_us_p99']:.1f}"]
                + [f"{p['levels_us_p50'] / own:.1f} ({net / own:.1f})", f"{p['force_sse_ratio_p95']:.9f} (p95)"]
            )
    return table(head, rows)


def peers(recording):
    """What was compared on a recording, in words and tables."""
    e = recording["eval"]
    text = (
        f"{e['frames']} frames of {e['taxels']} taxels, {e['contact_frames']} with contact, median {e['contacts_median']:.0f} contacts;"
        f" K_D = {e['levels']}, K_A = {e['actuators']}.\n\n{programs(recording)}"
    )
    return f"{text}\n\n{kernel_rows(recording)}" if recording["kernels"].get("frames") else text


def named(results, name):
    return next((r for r in results["recordings"] if r["name"] == name), None)


def shown(name):
    def of(results):
        recording = named(results, SHOWN[name])
        return peers(recording) if recording else None

    return of


def summary(results):
    """The method optimal on every recording."""
    head = ["recording", "contacts", "tick us p50", "p99", "p99.9", "every tick p99.9", "frames optimal", "position SSE mean", "p95", "jumps", "levels in 7 %"]
    head += ["centre of pressure", "kbit/s", "allocations"]
    rows = []
    for recording in results["recordings"]:
        e = recording["eval"]
        m = method(e, "optimal")
        rows.append(
            [recording["name"], f"{e['contacts_median']:.0f}", f"{m['tick_us_p50']:.1f}", f"{m['tick_us_p99']:.1f}", f"{m['tick_us_p999']:.1f}"]
            + [f"{m['every_tick_us']['p999']:.0f}", percent(m["force_optimal_fraction"])]
            + [place(m, "position_sse_ratio_mean"), place(m, "position_sse_ratio_p95"), percent(m["jump_fraction"]), percent(m["weber_share"])]
            + [f"{m['cop_error_mean']:.1f} {m['cop_unit']}", f"{m['bits_per_s'] / 1e3:.1f}", f"{m['allocations_per_tick']:g}"]
        )
    return table(head, rows)


def display(results):
    """Errors from the forces felt to those that the display shows, beside the peers'."""
    head = ["recording", "`paper` NRMSE", "shown in 7 %", "sum", "`optimal` NRMSE", "shown in 7 %", "sum", "of `paper`'s"]
    head += ["OpenCV", "scikit-learn", "`optimal` with `force_distance` 0", "with `max`", "with `force_weighted`"]
    rows = []
    for r in results["display"]:
        of = {m["name"]: m for m in r["eval"]["methods"]}
        paper, own = of["paper"], of["optimal"]
        peer = {p["name"]: p["displayed_nrmse"] for p in named(results, r["name"])["peers"] if "displayed_nrmse" in p}
        row = [r["name"]]
        for m in (paper, own):
            row += [number(m["displayed_nrmse"]), percent(m["displayed_weber_share"]), percent(m["displayed_total_error_mean"])]
        row += [f"{own['displayed_nrmse'] / paper['displayed_nrmse']:.2f}"]
        row += [number(peer.get(name)) for name in ("OpenCV kmeans, 1 attempt", "scikit-learn KMeans, 1 start")]
        rows.append(row + [number(of[f"optimal {key}"]["displayed_nrmse"]) for key in ("force_distance=0", "actuator_force=max", "force_weighted=true")])
    return table(head, rows)


def kernels(results):
    """The one-dimensional kernel beside its peers on every recording."""
    head = ["recording", "contacts", "Kmeans1d us p50", "p99", "cold", "ckmeans us", "times", "kmeans1d (C++, less overhead) us", "times"]
    rows = []
    for r in results["recordings"]:
        k = r["kernels"]
        if not k.get("frames"):
            continue
        own, cold, other = k["Kmeans1d, after the last frame"], k["Kmeans1d, cold"], k["ckmeans"]["p50_us"]
        row = [r["name"], f"{r['eval']['contacts_median']:.0f}", f"{own['p50_us']:.2f}", f"{own['p99_us']:.2f}", f"{cold['p50_us']:.2f}"]
        row += [f"{other:.2f}", f"{other / own['p50_us']:.1f}"]
        net = kmeans1d_us(r)
        rows.append(row + ([f"{net:.1f}", f"{net / own['p50_us']:.1f}"] if net else ["", ""]))
    return table(head, rows)


def kmeans1d_us(recording):
    for p in recording["peers"]:
        if "both_us_p50" not in p and "C++" in p["name"]:
            return p["levels_us_p50"] - p["overhead_us"]["levels"]
    return None


def sweep(results):
    head = ["K_D = K_A", "method", "force SSE p50", "p95", "frames optimal", "position SSE mean", "p95", "jumps", "levels in 7 %", "tick us p50", "p99"]
    rows = [
        [str(e["levels"]), f"`{m['name']}`", f"{m['force_sse_ratio_p50']:.3f}", f"{m['force_sse_ratio_p95']:.3g}", percent(m["force_optimal_fraction"])]
        + [place(m, "position_sse_ratio_mean"), place(m, "position_sse_ratio_p95"), percent(m["jump_fraction"]), percent(m["weber_share"])]
        + [f"{m['tick_us_p50']:.1f}", f"{m['tick_us_p99']:.1f}"]
        for e in results["sweep"]
        for m in e["methods"]
    ]
    return table(head, rows)


def switches(results):
    head = ["method and switch", "force SSE p50", "frames optimal", "position SSE mean", "p95", "jumps", "levels in 7 %"]
    head += ["force NRMSE", "levels changing", "both stages us p50", "p99"]
    rows = [
        [f"`{m['name']}`", f"{m['force_sse_ratio_p50']:.3f}", percent(m["force_optimal_fraction"])]
        + [place(m, "position_sse_ratio_mean"), place(m, "position_sse_ratio_p95"), percent(m["jump_fraction"]), percent(m["weber_share"])]
        + [f"{m['force_nrmse']:.3f}", percent(m["level_change_fraction"])]
        + [f"{m['compress_us']['p50']:.1f}", f"{m['compress_us']['p99']:.1f}"]
        for m in results["switches"]["methods"]
    ]
    return table(head, rows)


def scaling(results):
    head = ["taxels", "`paper` us p50", "slowest frame", "`optimal` us p50", "slowest frame", "... for each n log2 n, ns"]
    rows = []
    for size in results["scaling"]:
        us = dict(size["methods"])
        n = size["taxels"]
        per = 1e3 * us["optimal"]["p50"] / (n * (n.bit_length() - 1 if n & (n - 1) == 0 else n.bit_length()))
        rows.append([f"{n:,}"] + [f"{us[m][q]:,.1f}" for m in ("paper", "optimal") for q in ("p50", "max")] + [f"{per:.1f}"])
    return table(head, rows)


def kernel_scaling(results):
    head = ["values", "Kmeans1d us p50", "cold", "ckmeans"]
    names = ["Kmeans1d, after the last frame", "Kmeans1d, cold", "ckmeans"]
    rows = [[f"{k['values']:,}"] + [f"{k['kernels'][n]['p50_us']:,.1f}" for n in names] for k in results["kernel_scaling"]]
    return table(head, rows)


def best(results):
    """Positions against the best of thousands of runs."""
    head = ["recording", "`optimal` position SSE mean", "p95", "jumps", "`paper` position SSE mean", "p95", "jumps"]
    rows = []
    for r in results["best"]:
        row = [r["name"]]
        for m in (method(r["eval"], name) for name in ("optimal", "paper")):
            row += [place(m, "position_sse_ratio_mean"), place(m, "position_sse_ratio_p95"), percent(m["jump_fraction"])]
        rows.append(row)
    return table(head, rows)


def movement(results):
    gains = [m["name"].split("=")[1] for m in results["history"][0]["eval"]["methods"] if "jump_gain" in m["name"]] if results["history"] else []
    head = ["recording"] + [f"`jump_gain` {g}: position SSE mean, jumps" if n == 0 else g for n, g in enumerate(gains)] + ["`paper`"]

    def cell(m):
        return f"{m['position_sse_ratio_mean']:.3f}, {percent(m['jump_fraction'])}"

    rows = [
        [h["name"], *(cell(method(h["eval"], f"optimal jump_gain={g}")) for g in gains), cell(method(h["eval"], "paper"))] for h in results["history"]
    ]
    return table(head, rows)


def flicker(results):
    head = ["recording", "threshold", "contacts", "at least must jump", "jumps of `optimal`", "position SSE mean", "p95"]
    head += ["jumps at `jump_gain` 0.1", "position SSE mean", "0.3", "position SSE mean", "`paper`"]
    rows = []
    for r in results["flicker"]:
        for run in r["runs"]:
            e = run["eval"]
            m, gentle, gentler = method(e, "optimal"), method(e, "optimal jump_gain=0.1"), method(e, "optimal jump_gain=0.3")
            rows.append(
                [r["name"], run["threshold"], f"{e['contacts_median']:.0f}", percent(e["jump_bound_fraction"]), percent(m["jump_fraction"])]
                + [place(m, "position_sse_ratio_mean"), place(m, "position_sse_ratio_p95")]
                + [percent(gentle["jump_fraction"]), place(gentle, "position_sse_ratio_mean")]
                + [percent(gentler["jump_fraction"]), place(gentler, "position_sse_ratio_mean"), percent(method(e, "paper")["jump_fraction"])]
            )
    return table(head, rows)


def verdict(values, reached):
    """`yes`, `no`, or on how many of several."""
    good = sum(1 for v in values if reached(v))
    return "yes" if good == len(values) else f"**on {good} of {len(values)}**" if good else "**no**"


def figures(results):
    """What was to be reached, and what was."""
    every = results["recordings"]
    tiled = [r for r in every if r["real"] and r["eval"]["taxels"] in range(240, 257)]
    scenes = [r for r in every if not r["real"]]
    others = [r for r in every if r["real"] and r not in tiled]
    worst = named(results, SHOWN["peers-worst"])
    if not tiled or not worst:
        return None

    def of(recordings, value):
        return [value(method(r["eval"], "optimal")) for r in recordings]

    def listed(values, form):
        return ", ".join(form.format(v) for v in values)

    rows = []

    def row(figure, values, reached, measured):
        rows.append([figure, verdict(values, reached), measured])

    optimal = of(every, lambda m: m["force_optimal_fraction"])
    most = max(of(every, lambda m: m["force_sse_ratio_max"]))
    row("force error exactly optimal in every frame", optimal, lambda v: v == 1, f"{percent(min(optimal))} of frames on {len(every)} inputs; largest ratio {most:.10f}")
    for name, key, limit in [
        ("position error within 3 % of the best of 64 on average", "position_sse_ratio_mean", 1.03),
        ("... and within 8 % at p95", "position_sse_ratio_p95", 1.08),
    ]:
        values, more = of(tiled, lambda m: m[key]), of(scenes, lambda m: m[key])
        row(name, values, lambda v: v <= limit, f"{listed(values, '{:.3f}')}; scenes {listed(more, '{:.3f}')}")
    jumps = [100 * v for v in of(tiled, lambda m: m["jump_fraction"])]
    measured = f"{min(jumps):.1f} to {max(jumps):.1f} %; scenes {listed([100 * v for v in of(scenes, lambda m: m['jump_fraction'])], '{:.1f}')} %"
    if others:
        measured += f"; Schunk at the noise {listed([100 * v for v in of(others, lambda m: m['jump_fraction'])], '{:.1f}')} %, see below"
    row("at most 3 % of actuators jumping per frame", jumps, lambda v: v <= 3, measured)
    p50 = of(tiled, lambda m: m["tick_us_p50"])
    condition = of(tiled, lambda m: m["condition_us"]["p50"])
    row("tick p50 under 10 us on recordings", p50, lambda v: v < 10, f"{listed(p50, '{:.1f}')} us, of which conditioning {min(condition):.1f} to {max(condition):.1f}")
    full = of([worst], lambda m: m["tick_us_p50"])
    row("... under 25 us with all 240 taxels in contact", full, lambda v: v < 25, f"{full[0]:.1f} us with forces that all differ (worst-case scene)")
    spread = of(tiled, lambda m: m["tick_us_p99"] / m["tick_us_p50"])
    more = of(scenes, lambda m: m["tick_us_p99"] / m["tick_us_p50"])
    row("p99 within 3 times p50", spread, lambda v: v <= 3, f"factors {listed(spread, '{:.1f}')}; scenes {listed(more, '{:.1f}')}")
    both = [*tiled, worst]

    def times_of(recordings, peer):
        """How many times as long a peer takes, with the recordings of which that is known."""
        pairs = [(r, p) for r in recordings for p in both_stages(r) if p["name"] == peer]
        return pairs, [net_us(p) / method(r["eval"], "optimal")["compress_us"]["p50"] for r, p in pairs]

    for name, peer, times in [
        ("10 times faster than OpenCV's two calls, at lower error", "OpenCV kmeans, 1 attempt", 10),
        ("50 times faster than scikit-learn's, at lower error", "scikit-learn KMeans, 1 start", 50),
    ]:
        pairs, ratios = times_of(both, peer)
        lower = all(
            method(r["eval"], "optimal")["position_sse_ratio_mean"] <= p["position_sse_ratio_mean"]
            and method(r["eval"], "optimal")["force_sse_ratio_mean"] <= p["force_sse_ratio_mean"] * (1 + 1e-9)
            for r, p in pairs
        )
        measured = f"{listed(ratios, '{:.1f}')} times on these and the worst-case scene, less call overhead, against both stages; {'both errors lower on all' if lower else '**not at lower error on all**'}"
        row(name, ratios, lambda v: v >= times, measured)
        _, few = times_of([r for r in every if r not in both], peer)
        row("... with few contacts", few, lambda v: v >= times, f"{listed(few, '{:.1f}')} times on the others, of which a peer has no figure where there are no more contacts than actuators")
    for name, times, value in [
        ("kernel 3 times faster than `ckmeans`, at equal error", 3, lambda r: r["kernels"]["ckmeans"]["p50_us"]),
        ("kernel 10 times faster than `kmeans1d`, at equal error", 10, kmeans1d_us),
    ]:

        def ratios_of(recordings):
            own = [(r, r["kernels"]["Kmeans1d, after the last frame"]["p50_us"]) for r in recordings if r["kernels"].get("frames")]
            return [value(r) / us for r, us in own if value(r)]

        values = ratios_of(both)
        few = ratios_of([r for r in every if r not in both])
        row(name, values, lambda v: v >= times, f"{listed(values, '{:.1f}')} times on these and the worst-case scene; with few contacts {listed(few, '{:.1f}')}")
    cost = {s["taxels"]: dict(s["methods"])["optimal"] for s in results["scaling"]}
    row("4,096 taxels at 1 kHz on one core", [cost[4096]["max"]], lambda v: v < 1000, f"{cost[4096]['p50'] / 1e3:.2f} ms; slowest frame {cost[4096]['max'] / 1e3:.2f} ms")
    growth = []
    for n in (256, 4096):
        law = 65280 * 16 / (n * (n.bit_length() - 1))
        growth.append((cost[65280]["p50"] / cost[n]["p50"], law, n))
    row("cost growing no faster than n log n to 65,536", growth, lambda g: g[0] <= g[1], "; ".join(f"{g:.1f}-fold from {n:,} to 65,280 taxels, n log n is {law:.1f}-fold" for g, law, n in growth))
    none = of(every, lambda m: m["allocations_per_tick"])
    row("no allocation after start", none, lambda v: v == 0, f"{max(none):g} on {len(every)} inputs")
    return table(["figure", "reached", "measured"], rows)


TABLES = {
    "summary": summary,
    "best": best,
    **{name: shown(name) for name in SHOWN},
    "figures": figures,
    "display": display,
    "kernels": kernels,
    "flicker": flicker,
    "switches": switches,
    "sweep": sweep,
    "scaling": scaling,
    "kernel-scaling": kernel_scaling,
    "movement": movement,
}


def report(results):
    parts = [f"{results['machine']}; least of {results['rounds']} rounds", summary(results), *(f"### {r['name']}\n\n{peers(r)}" for r in results["recordings"])]
    return "\n\n".join(parts) + "\n"


def write(results, path):
    """Puts the tables between their marks; a table that these results do not have stays as it was."""
    place = re.compile(r"(<!-- table: ([a-z-]+) -->\n).*?(<!-- end of table -->)", re.S)
    seen = set()

    def replaced(match):
        name = match[2]
        if name not in TABLES:
            raise SystemExit(f"{path}: there is no table {name}; there are {', '.join(TABLES)}")
        seen.add(name)
        made = TABLES[name](results)
        if made is None:
            print(f"{path}: {name} is left as it was: its recordings were not measured", file=sys.stderr)
            return match[0]
        return f"{match[1]}{made}\n{match[3]}"

    text = place.sub(replaced, path.read_text())
    missing = [name for name in TABLES if name not in seen]
    if missing:
        print(f"{path} has no place for {', '.join(missing)}", file=sys.stderr)
    path.write_text(text)
    print(f"{path}: {len(seen)} tables written", file=sys.stderr)


if __name__ == "__main__":
    write(json.loads(Path(sys.argv[1]).read_text()), Path(sys.argv[2]))
