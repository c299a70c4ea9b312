"""The force nets of balakumar-s/biotac_force_net (BSD; ICRA 2019) in NumPy: a second opinion, from other rigs.

A net spreads counts above the tare over 16 x 16 x 8 voxels, beside a mark in the contact's voxel, and gives minus the
force on the finger, up to 2 N. The trained nets are not part of this project: clone theirs.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from biotac import InputError
from biotac.core import geometry as surface

ROWS_AT_ONCE = 500
_GRID = (16, 16, 8)
_M = np.asarray(surface.ELECTRODE_MM) / 1e3
_EDGES = [np.linspace(low, high, n) for low, high, n in zip(_M.min(axis=0), _M.max(axis=0), _GRID, strict=True)]


class PeerNet:
    """A net from its ``path``, model.ckpt.data-00000-of-00001. Raises InputError if it is none of these nets."""

    def __init__(self, path: Path) -> None:
        try:
            self._w = _arrays(path.read_bytes())
        except ValueError as error:
            raise InputError(
                f"{path} has {error}: expected a net of biotac_force_net, its .data-00000-of-00001"
            ) from error

    def force_n(self, e: Any) -> Any:
        """Force (n, 3) on the finger in N, from counts above the tare (n, 19)."""
        return np.concatenate([-self._run(e[at : at + ROWS_AT_ONCE]) for at in range(0, len(e), ROWS_AT_ONCE)])

    def _run(self, e: Any) -> Any:
        rows, signals, mark = np.arange(len(e)), np.zeros((len(e), *_GRID, 1)), np.zeros((len(e), *_GRID, 1))
        at, touched = _voxels(_M), _voxels(_contact(e))
        signals[rows[:, None], at[0], at[1], at[2], 0] = e
        mark[rows, touched[0], touched[1], touched[2], 0] = 1.0
        x = np.concatenate([self._conv(signals, "", 0), self._conv(mark, "_1", 1)], axis=-1)
        for k in (2, 3, 4):
            x = self._conv(x[:, :, :, 0] if k == 4 else x, f"_{k}", k)
        x = self._norm(self._dense(x.reshape(len(e), -1), "fully_connected"), 5)
        if "fully_connected_1/weights" in self._w:
            return self._dense(self._norm(self._dense(x, "fully_connected_1"), 6), "fully_connected_2")
        shared = self._dense(x, "fcn32")  # ten heads that differ in their norms
        return np.mean([self._dense(self._norm(shared, k), "fcn3") for k in range(6, 16)], axis=0)

    def _conv(self, x: Any, name: str, norm: int) -> Any:
        """Cells of two voxels along each axis, without overlap."""
        weights, biases = (self._w[f"Conv{name}/{kind}"] for kind in ("weights", "biases"))
        n, *size, _ = x.shape
        cells = x.reshape([n, *(part for along in size for part in (along // 2, 2)), -1])
        cells = np.moveaxis(cells, range(2, 2 * len(size) + 1, 2), range(1 + len(size), 1 + 2 * len(size)))
        flat = cells.reshape([n, *(along // 2 for along in size), -1])
        return self._norm(flat @ weights.reshape(-1, weights.shape[-1]) + biases, norm)

    def _dense(self, x: Any, name: str) -> Any:
        return x @ self._w[f"{name}/weights"] + self._w[f"{name}/biases"]

    def _norm(self, x: Any, k: int) -> Any:
        gamma, beta = (self._w[f"LayerNorm{f'_{k}' if k else ''}/{kind}"] for kind in ("gamma", "beta"))
        every = tuple(range(1, x.ndim))
        spread = np.sqrt(x.var(axis=every, keepdims=True) + 1e-12)
        return np.maximum((x - x.mean(axis=every, keepdims=True)) / spread * gamma + beta, 0.0)


def _voxels(m: Any) -> tuple[Any, ...]:
    return tuple(np.digitize(m[:, d], _EDGES[d]) - 1 for d in range(3))  # -1 wraps there too


def _contact(e: Any) -> Any:
    """Centroid (n, 3) by squares of the signals, moved to the core, in m."""
    centre = e**2 @ _M / ((e**2).sum(axis=1, keepdims=True) + 1e-8)
    tip = centre[:, :1] > 0
    radius = np.linalg.norm(np.where(tip, centre, centre * [0.0, 1.0, 1.0]), axis=1, keepdims=True)
    moved = centre * (5.5e-3 / np.maximum(radius, 1e-12))
    return np.concatenate([np.where(tip, moved, centre)[:, :1], moved[:, 1:]], axis=1)


def _arrays(data: bytes) -> dict[str, Any]:
    """A checkpoint's arrays by name. Raises ValueError for other data.

    They follow each other in the order of their names, each before the momentum. Nets with one head and with ten
    differ in size; peer_net.json has the shapes of both.
    """
    for shapes in json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8")):
        ends = np.cumsum([int(np.prod(shape)) for shape in shapes.values()])
        if 4 * ends[-1] == len(data):
            parts = np.split(np.frombuffer(data, "<f4"), ends[:-1])
            return {name: part.reshape(shape) for (name, shape), part in zip(shapes.items(), parts, strict=True)}
    raise ValueError(f"{len(data)} bytes")
