"""Maps, categories and silhouettes of the same touches, by taxel-palpation and by scikit-learn, in one run.

    cargo build --release -p taxel-palpation --example times
    python tests/peers/palpation.py [--large]

`--large` adds 2,000 touches of 20,000 features, which takes a minute and 1.5 GB. scikit-learn is in
tests/peers/requirements.txt. Nothing else should run on the machine meanwhile.
"""

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import sklearn
from sklearn.cluster import KMeans
from sklearn.decomposition import PCA
from sklearn.metrics import silhouette_score

TIMES = Path(__file__).resolve().parents[2] / "target/release/examples/times"


def touches(features: int, count: int) -> np.ndarray:
    """As in crates/palpation/examples/times.rs, N x D."""
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
    ours = json.loads(subprocess.run([TIMES, *sizes], check=True, capture_output=True, text=True).stdout)
    peer = theirs(touches(features, count), clusters, solver, repeats[1])
    print(f"\nN = {count}, D = {features}, K = {clusters}; scikit-learn {sklearn.__version__}, svd_solver={solver}, n_init=10")
    print(f"{'':14}{'taxel':>14}{'scikit-learn':>14}{'times faster':>14}")
    for part in ["map_s", "categories_s", "silhouette_s"]:
        print(f"{part[:-2]:14}{ours[part] * 1e3:>11.3f} ms{peer[part] * 1e3:>11.3f} ms{peer[part] / ours[part]:>14.1f}")
    total, other = (sum(r[p] for p in ["map_s", "categories_s", "silhouette_s"]) for r in (ours, peer))
    print(f"{'all':14}{total * 1e3:>11.3f} ms{other * 1e3:>11.3f} ms{other / total:>14.1f}")
    kept = [sum(r["explained_variance"]) for r in (ours, peer)]
    print(f"{'variance kept':14}{kept[0]:>14.9f}{kept[1]:>14.9f}")
    print(f"{'cost':14}{ours['cost']:>14.8g}{peer['cost']:>14.8g}   proved: {ours['proved']}")
    print(f"{'silhouette':14}{ours['silhouette']:>14.9f}{peer['silhouette']:>14.9f}")


compare(427, 16, 5, "full", (200, 20))
if "--large" in sys.argv[1:]:
    compare(20_000, 2_000, 5, "auto", (1, 1))
