"""The publication's own measurements, as files for `taxel categorize --sweep`.

Scimeca, Maiolino and Iida published them at https://github.com/lucascimeca/palpation_analysis, folder `data`. They state no
licence, so they are not here. With numpy and scipy:

    python examples/palpation/published.py palpation_analysis/data published
    taxel categorize --sweep published/sweep.csv --window 6.5 --figures published/figures

writes `published/touches.npz` and the manifest. Each area of a phantom was touched three times in each way; as in the authors' own
program (`src/skin_data.py`), the mean of the three is a touch, and counts are taken as they are: PCA does without a baseline.
"""

import argparse
import csv
from pathlib import Path

import numpy as np

# Each phantom's file, and what lies under its areas: row by row, as in the authors' `src/run_experiments.py`.
PHANTOMS = {
    "Ph-1": ("presence_exp.mat", "NA BS NA NA  SD NA NA NA  NA NA SS NA  NA NA NA BD"),
    "Ph-2": ("properties_exp.mat", "BD SS BD SS  BS NA SS SD  NA BD NA SD  BS NA BS SD"),
}
# Depths that the authors judge motions straight down at, mm. Frames are 0.5 mm apart, and the one at the surface counts as the
# first step: a motion to 6.5 mm is the file's first 13 frames.
DEPTHS_MM = np.arange(6.5, 20, 1)


def write(folder: Path, phantoms: dict) -> None:
    """Writes the manifest and its touches: of each phantom, arrays of frames x (depth or angle, 7 taxels) x 3 repetitions,
    called `Vertical_ROW_COLUMN` and `Rotate_ROW_COLUMN_dDEPTH_rRADIUS` with tenths of mm."""
    folder.mkdir(parents=True, exist_ok=True)
    touches, rows = {}, []
    for phantom, measured in phantoms.items():
        classes = PHANTOMS[phantom][1].split()
        for name in sorted(measured):
            kind, *place = name.split("_")
            if kind not in ("Vertical", "Rotate"):
                continue
            row, column, *how = place
            area, label = f"{row}-{column}", classes[4 * int(row) + int(column) - 5]
            touches[f"{phantom}-{name}"] = measured[name][:, 1:, :].mean(axis=2)
            file = f"touches.npz:{phantom}-{name}"
            if kind == "Vertical":
                rows += [(phantom, "vertical", depth, 0, area, label, file) for depth in DEPTHS_MM]
            else:
                depth, radius = (int(text[1:]) / 10 for text in how)
                rows.append((phantom, "rotary", depth, radius, area, label, file))
    np.savez(folder / "touches.npz", **touches)
    with open(folder / "sweep.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("phantom", "motion", "depth", "radius", "area", "label", "file"))
        # Touches of one motion follow each other, in the order of their areas.
        writer.writerows(sorted(rows, key=lambda row: (row[0], row[1] == "rotary", *row[2:5])))


def main() -> None:
    import scipy.io

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="the folder `data` of palpation_analysis")
    parser.add_argument("out", type=Path, help="where the manifest and its touches go")
    args = parser.parse_args()
    write(args.out, {phantom: scipy.io.loadmat(args.data / file) for phantom, (file, _) in PHANTOMS.items()})
    print(f"{args.out}/sweep.csv: `taxel categorize --sweep {args.out}/sweep.csv --window 6.5` judges its motions")


if __name__ == "__main__":
    main()
