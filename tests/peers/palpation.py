"""Maps, categories and silhouettes of the same touches, by taxel-palpation and by scikit-learn, in one run.

    cargo build --release -p taxel-palpation --example map_times -p taxel-cli
    python tests/peers/palpation.py [--large | --recordings]

`--large` adds 2,000 touches of 20,000 features, by scikit-learn's `auto` and `full`, which takes minutes and 2 GB.
scikit-learn is in tests/peers/requirements.txt. Nothing else should run on the machine meanwhile; where it does,
seconds of a processor are said too.

Recordings of others, where they are ($TAXEL_DATA, else shared/data beside the repository), are categorised by `taxel
categorize` and by scikit-learn: grasps, whose objects are known, and trials of a uSkin module, whose objects are not.
`--recordings` does that alone.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import sklearn
from scipy.optimize import linear_sum_assignment
from sklearn.cluster import KMeans
from sklearn.decomposition import PCA
from sklearn.metrics import adjusted_rand_score, silhouette_score
from sklearn.metrics.cluster import contingency_matrix

REPOSITORY = Path(__file__).resolve().parents[2]
TIMES = REPOSITORY / "target/release/examples/map_times"
TAXEL = REPOSITORY / "target/release/taxel"
DATA = Path(os.environ.get("TAXEL_DATA", REPOSITORY.parent / "shared/data"))


def touches(features: int, count: int) -> np.ndarray:
    """As in crates/palpation/examples/map_times.rs, N x D."""
    d, n = np.arange(features)[None, :], np.arange(count)[:, None]
    signal = (n % 5) * ((d * 31 + (n % 5) * 17) % 101)
    noise = (d * d * 7919 + n * 104729 + d * n * 613) % 1009
    return signal + noise / 16.0


def theirs(x: np.ndarray, clusters: int, solver: str, repeats: int) -> dict:
    best = [float("inf")] * 3
    for _ in range(repeats):
        began = time.perf_counter()
        pca = PCA(2, svd_solver=solver, random_state=0).fit(x)
        w = pca.transform(x)
        mapped = time.perf_counter()
        means = KMeans(clusters, n_init=10, random_state=0).fit(w)
        categorised = time.perf_counter()
        silhouette = silhouette_score(w, means.labels_)
        ended = time.perf_counter()
        best = [min(b, t) for b, t in zip(best, [mapped - began, categorised - mapped, ended - categorised])]
    return dict(zip(["map_s", "categories_s", "silhouette_s"], best)) | {
        "explained_variance": pca.explained_variance_ratio_.tolist(), "cost": means.inertia_, "silhouette": silhouette,
    }


def compare(features: int, count: int, clusters: int, solver: str, repeats: tuple[int, int]) -> None:
    sizes = [str(size) for size in (features, count, clusters, repeats[0])]
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    ours = json.loads(subprocess.run([TIMES, *sizes], check=True, capture_output=True, text=True).stdout)
    used = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    began = time.process_time()
    peer = theirs(touches(features, count), clusters, solver, repeats[1])
    ended = time.process_time()
    print(f"\nN = {count}, D = {features}, K = {clusters}; scikit-learn {sklearn.__version__}, svd_solver={solver}, n_init=10")
    print(f"{'':14}{'taxel':>14}{'scikit-learn':>14}{'times faster':>14}")
    for part in ["map_s", "categories_s", "silhouette_s"]:
        print(f"{part[:-2]:14}{ours[part] * 1e3:>11.3f} ms{peer[part] * 1e3:>11.3f} ms{peer[part] / ours[part]:>14.1f}")
    total, other = (sum(r[p] for p in ["map_s", "categories_s", "silhouette_s"]) for r in (ours, peer))
    print(f"{'all':14}{total * 1e3:>11.3f} ms{other * 1e3:>11.3f} ms{other / total:>14.1f}")
    if repeats == (1, 1):
        print(f"{'processor, s':14}{used:>14.1f}{ended - began:>14.1f}   touches made included")
    kept = [sum(r["explained_variance"]) for r in (ours, peer)]
    print(f"{'variance kept':14}{kept[0]:>14.9f}{kept[1]:>14.9f}")
    print(f"{'cost':14}{ours['cost']:>14.8g}{peer['cost']:>14.8g}   proved: {ours['proved']}")
    print(f"{'silhouette':14}{ours['silhouette']:>14.9f}{peer['silhouette']:>14.9f}")


def accuracy(labels: np.ndarray, classes: list[str]) -> float:
    """The share of touches that agree, categories matched with classes so that most do."""
    agree = contingency_matrix(classes, labels)
    return float(agree[linear_sum_assignment(agree, maximize=True)].sum() / len(classes))


def recordings(name: str, clusters: int, components: int, class_of=None) -> None:
    """Every array of a file is a touch, aligned by time; `class_of` says from its name what was touched."""
    path = DATA / name
    if not path.exists():
        print(f"\nSKIPPED: there is no {path}")
        return
    arrays = {n: a for n, a in np.load(path).items() if not n.endswith("_joints")}
    if name.startswith("uskin"):  # columns 16 x, 16 y, 16 z of a module
        arrays = {n: a.reshape(-1, 3, 16).transpose(0, 2, 1) for n, a in arrays.items()}
    classes = [class_of(n) for n in arrays] if class_of else None
    with tempfile.TemporaryDirectory() as folder:
        np.savez(f"{folder}/touches.npz", **arrays)
        rows = [f"touches.npz:{n},{class_of(n) if class_of else ''}\n" for n in arrays]
        Path(folder, "touches.csv").write_text("file,label\n" + "".join(rows))
        sizes = ["--classes", str(clusters), "--components", str(components)]
        command = [TAXEL, "categorize", f"{folder}/touches.csv", *sizes, "--json"]
        ours = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    # What `taxel categorize` makes of touches, anew: the steps that all have, and counts of three axes above the first frame.
    steps = min(map(len, arrays.values()))
    touches = [a[:steps].astype(float) for a in arrays.values()]
    x = np.stack([(t - t[0] if t.ndim == 3 else t).ravel() for t in touches])
    w = PCA(components, svd_solver="full").fit_transform(x)
    means = KMeans(clusters, n_init=50, random_state=0).fit(w)
    mine = np.array(ours["labels"])
    kept = np.array(ours["map"])
    cost = sum(((kept[mine == k] - kept[mine == k].mean(0)) ** 2).sum() for k in range(clusters))
    print(f"\n{name}: N = {len(x)}, D = {x.shape[1]}, K = {clusters}, {components} components; n_init=50")
    print(f"{'':14}{'taxel':>14}{'scikit-learn':>14}")
    print(f"{'cost':14}{cost:>14.8g}{means.inertia_:>14.8g}   proved: {ours['proved']}")
    print(f"{'silhouette':14}{ours['silhouette']['standard']:>14.6f}{silhouette_score(w, means.labels_):>14.6f}")
    print(f"{'alike (ARI)':14}{adjusted_rand_score(mine, means.labels_):>14.6f}")
    if classes:
        theirs_right = accuracy(means.labels_, classes)
        print(f"{'accuracy':14}{ours['accuracy']:>14.6f}{theirs_right:>14.6f}")
        print(f"{'ARI':14}{ours['ari']:>14.6f}{adjusted_rand_score(classes, means.labels_):>14.6f}")


if "--recordings" not in sys.argv[1:]:
    compare(427, 16, 5, "full", (2000, 200))
recordings("schunk_sdh_grasps.npz", 5, 2, lambda name: name.split("_")[0])
recordings("schunk_sdh_grasps.npz", 5, 10, lambda name: name.split("_")[0])
recordings("uskin_pick_and_move.npz", 3, 2)
if "--large" in sys.argv[1:]:
    compare(20_000, 2_000, 5, "auto", (1, 1))
    compare(20_000, 2_000, 5, "full", (1, 1))
