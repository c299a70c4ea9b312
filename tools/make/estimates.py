#!/usr/bin/env python3
"""Fit estimates of each electrode from the others to fingers pressed on a plate: firmware/core/map/estimates.json.

tools/make/estimates.py F1.npz F2.npz      ../shared/data/syntouchcontact: E (n, 19), and E_base (n, 19) without load
tools/make/estimates.py --test F2.npz F1.npz   fit to the others, print how far off the estimates of this one are

The signals are bounded as firmware/core/map/estimate.c does it. Each frame's pattern counts as a unit vector, and
so does the mirror image; a ridge of a hundredth of the variance keeps the weights small.
"""

from __future__ import annotations

import argparse
import hashlib
import json
from pathlib import Path

import numpy as np
import numpy.typing as npt

from biotac import compute
from biotac.wire.sensor_gen import ELECTRODE_UM

OUT = Path(__file__).resolve().parents[2] / "firmware/core/map/estimates.json"
BITS = 6  # of a weight: |weight| < 2
RIDGE = 1 / 100
REST = 3000.0
SOURCE = (
    "github.com/MiaoLi/syntouchcontact, commit d58862d13f1325d8e0e70921b449a1df9649d483, no licence stated: "
    "data/MISC/F1calibration, F2calibration, SynTouchBase, gathered as F1.npz (finger 1) and F2.npz (finger 2)"
)
Floats = npt.NDArray[np.float64]


def signals(path: Path) -> Floats:
    """Signals (n, 19) in counts."""
    with np.load(path) as data:
        return np.asarray(data["E"] - data["E_base"].mean(axis=0), dtype=np.float64)


def bounded(e: Floats) -> Floats:
    """Less 8 counts of noise, and a quarter of the excess over 256."""
    size = np.maximum(np.abs(e) - 8, 0)
    return np.asarray(np.sign(e) * np.where(size > 256, 256 + (size - 256) / 4, size))


def unbounded(x: Floats) -> Floats:
    """The inverse."""
    size = np.abs(x)
    return np.asarray(np.sign(x) * (np.where(size > 256, 256 + (size - 256) * 4, size) + 8 * (size > 0)))


def fit(paths: list[Path]) -> Floats:
    """Weights (19, 19): row i has those of the others' bounded signals in electrode i's, and 0 for itself."""
    position = np.array(ELECTRODE_UM)
    image = [int(np.abs(position - row * [1, -1, 1]).sum(axis=1).argmin()) for row in position]
    square = np.zeros((19, 19))
    for path in paths:
        x = bounded(signals(path))
        x = x[np.abs(x).sum(axis=1) > 64]
        x /= np.linalg.norm(x, axis=1, keepdims=True)
        square += (x.T @ x + x[:, image].T @ x[:, image]) / len(x)
    precision = np.linalg.inv(square + RIDGE * np.trace(square) / 19 * np.eye(19))
    weights = -precision / np.diag(precision)[:, None]
    np.fill_diagonal(weights, 0.0)
    return np.asarray(weights)


def useful(e: Floats, instead: Floats) -> float:
    """How often the population map's force is within 30 % or 0.5 N of that of all electrodes, for each left out."""

    def force_n(signal: Floats) -> Floats:
        return np.asarray(
            compute(np.clip(np.rint(signal + REST), 1, 4089).astype(np.uint16), np.full(19, REST))["force_n"]
        )

    truth = force_n(e)
    limit = np.maximum(0.5, 0.3 * np.linalg.norm(truth, axis=1))
    good = []
    for i in range(19):
        without = e.copy()
        without[:, i] = instead[:, i]
        good.append(np.linalg.norm(force_n(without) - truth, axis=1) <= limit)
    return float(np.mean(good))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--test", type=Path)
    args = parser.parse_args()
    weights = fit(args.files)
    if args.test is not None:
        e = signals(args.test)
        estimates = unbounded(bounded(e) @ weights.T)
        print(f"off by {np.sqrt(((estimates - e) ** 2).mean() / (e**2).mean()):.2f} of the signals")
        shares = f"{useful(e, estimates):.3f} of frames and electrodes, {useful(e, 0 * e):.3f} if one counts as 0"
        print(f"force within 30 % or 0.5 N: {shares}")
        return
    files = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in args.files}
    facts = {
        "provenance": {"source": SOURCE, "files": files},
        "bits": BITS,
        "weights": np.rint(weights * 2**BITS).astype(int).tolist(),
    }
    OUT.write_text(json.dumps(facts, indent=None) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
