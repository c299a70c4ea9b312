"""The population map: a force for fingers without a calibration, the map's file, and the package's own.

It is linear in 114 columns: signals by sign, with gains that follow the contact. They are 0 where counts are at their
tare, so that rest is 0 N on any finger. Coefficients have seven digits in the file: short, the same on every computer,
and off by a thousandth of the map's error. A file holds coefficients and their provenance, never recordings. biotac-lab
trains such maps; ``biotac.calibrate.press.few_shot`` improves one with five presses on a scale, or known weights.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..documents import parse_document, read_document, sealed
from ..kernels.geometry import ELECTRODE_MM, Floats, normals_at
from ..map import columns as map_columns
from ..map.columns import ELECTRODES, GATED, SIGNAL_COUNTS, Signals, split
from ..map.fitted import WrenchMap
from ..map.margin import UNKNOWN, Margin
from ..map.population import SHIPPED, Likeness, board_map, light_gain, likeness, shipped
from ..version import __version__
from ..wire.frames import FORCE_LSB_PER_N

__all__ = [
    "AXES", "COLUMNS", "ROWS_AT_ONCE", "SIGNAL_COUNTS", "Population", "Sums", "Trained", "columns", "dumps",
    "light_gain", "load", "normals", "provenance_of",
]  # fmt: skip

FORMAT = "biotac-population-map/1"
_CURE = f"expected a {FORMAT}, as `biotac-lab population --out` writes it"
DIGITS = 7
NOTHING = 1e-9
MODEL = "population"
AXES = map_columns.AXES[:3]
ROWS_AT_ONCE = 4096

COLUMNS = map_columns.width(GATED)
_BLOCK_NAMES = [[kind.name, gate.name] for kind, gate in GATED]


@dataclass(frozen=True)
class Sums:
    """Means over rows and drift: ``gram`` (114, 114), ``cross`` (114, 3) with force in N, ``mean`` (114,)."""

    gram: Floats
    cross: Floats
    mean: Floats


@dataclass(frozen=True)
class Population:
    """A population map: ``coefficients`` (114, 3) of columns(), in N.

    ``variance`` (114,) is that of the columns in training, with a floor; ``margin`` that of held-out fingers.
    """

    coefficients: Floats
    variance: Floats
    margin: Margin = UNKNOWN

    def published(self, counts: Floats, tare: Floats) -> Floats:
        """Force (n, 3) in N as a board publishes it: along the normals where the map contradicts them."""
        return self.judged(counts, tare).mixed(self.force(counts, tare))

    def judged(self, counts: Floats, tare: Floats) -> Likeness:
        """How like the training the signals are, as a board says."""
        force_100un = np.rint(FORCE_LSB_PER_N * self.force(counts, tare)).astype(np.int64)
        return likeness(counts - tare, force_100un)

    def force(self, counts: Floats, tare: Floats) -> Floats:
        """Force (n, 3) in N on the finger, from counts (n, 19) and their ``tare`` (19,)."""
        e, starts = counts - tare, range(0, len(counts), ROWS_AT_ONCE)  # chunks that fit the cache
        return np.concatenate([columns(e[at : at + ROWS_AT_ONCE], tare) @ self.coefficients for at in starts])

    def wrench_map(self, tare: Floats) -> WrenchMap:
        """The same map in the form of a calibrated finger's, for ``tare`` (19,), with an offset of 0."""
        every = np.zeros((map_columns.width(map_columns.blocks(with_pdc=False)) + 1, len(AXES)))
        every[map_columns.index(GATED, len(every) - 1)] = self.coefficients
        return WrenchMap(MODEL, AXES, np.asarray(tare, dtype=np.float64), 1, (0, 0, 0), every, self.margin)


def columns(e: Floats, tare: Floats) -> Floats:
    """The columns (n, 114) that the map is linear in, from counts above the tare ``e`` (n, 19) and ``tare`` (19,)."""
    return map_columns.columns(Signals(e, tare), GATED)


def normals() -> Floats:
    """Coefficients (114, 3) of 1 mN per count along the outward normal of each compressed electrode."""
    result = np.zeros((COLUMNS, len(AXES)))
    result[:ELECTRODES] = 1e-3 * SIGNAL_COUNTS * normals_at(ELECTRODE_MM)  # COMPRESSION comes first
    return result


# ---- the file ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Trained:
    """A map and its provenance, with one sigma (3,) in N of a new finger's force, as it is and after five presses."""

    population: Population
    sigma_n: Floats
    sigma_scale5_n: Floats
    provenance: dict[str, Any]

    @property
    def fingers(self) -> str:
        """Names of the recordings that it was made of."""
        return ", ".join(self.provenance.get("files", {})) or "unnamed fingers"

    def made_of(self, files: Sequence[Path]) -> bool:
        """Whether it was trained on one of ``files``: the error on these is no estimate for a new finger."""
        return bool(set(_sha256(files).values()) & set(self.provenance.get("files", {}).values()))

    def others_than(self, files: Sequence[Path]) -> tuple[Floats | None, str]:
        """Coefficients (533, 3) of a wrench map to pull the finger of ``files`` to, and a note.

        They are None if the map was trained on one of the files.
        """
        note = f"regularized towards the population map of {self.fingers}"
        if self.made_of(files):
            return None, f"not {note}, which was made from this recording"
        # any tare will do: the columns mean the same with every tare
        return self.population.wrench_map(np.zeros(ELECTRODES)).coefficients, note


def provenance_of(files: Sequence[Path], source: str, *, symmetric: bool) -> dict[str, Any]:
    """Names and SHA-256 of the recordings, and ``source``: where they come from and under which licence."""
    software = f"biotac-gateway {__version__}"
    return {"source": source, "files": _sha256(files), "symmetric": symmetric, "software": software}


def _sha256(files: Sequence[Path]) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def dumps(trained: Trained) -> str:
    """The map as JSON, one line for each column."""
    rounded = np.array([_short(row) for row in trained.population.coefficients])
    # the board's map is made from the rounded coefficients, so that a reader of the file gets the same one
    margin = trained.population.margin
    on_board = board_map(split(GATED, rounded), margin)
    rows = np.column_stack([rounded, trained.population.variance])
    document = sealed(
        {
            "format": FORMAT,
            "provenance": trained.provenance,
            "axes": list(AXES),
            "sigma_n": _short(trained.sigma_n),
            "sigma_scale5_n": _short(trained.sigma_scale5_n),
            "margin": [margin.base_mn, margin.share_q8],
            "blocks": _BLOCK_NAMES,
            "board_map": base64.b64encode(on_board.blob).decode("ascii"),
            "coefficients_n_and_variance": [_short(row) for row in rows],
        }
    )
    last = "coefficients_n_and_variance"
    texts = {key: json.dumps(value) for key, value in document.items()}
    texts[last] = "[\n" + ",\n".join(f"  {json.dumps(row)}" for row in document[last]) + "\n ]"
    return "{\n" + ",\n".join(f' "{key}": {text}' for key, text in texts.items()) + "\n}\n"


def load(path: Path | None) -> Trained:
    """The map in a file, or the package's own if ``path`` is None. Raises InputError if it cannot be read or used."""
    if path is None:
        return parse_document(shipped(), SHIPPED, FORMAT, _trained, _CURE)
    return read_document(path, FORMAT, _trained, _CURE)


def _trained(content: dict[str, Any]) -> Trained:
    if content["blocks"] != _BLOCK_NAMES:
        raise ValueError(f"its blocks are {content['blocks']}")
    rows = np.array(content["coefficients_n_and_variance"], dtype=np.float64)
    sigmas = [np.array(content[key], dtype=np.float64) for key in ("sigma_n", "sigma_scale5_n")]
    if rows.shape != (COLUMNS, len(AXES) + 1) or any(sigma.shape != (len(AXES),) for sigma in sigmas):
        raise ValueError(f"its coefficients have shape {rows.shape}")
    if not all(np.isfinite(values).all() for values in (rows, *sigmas)) or (rows[:, -1] <= 0.0).any():
        raise ValueError("a coefficient is not finite, or a variance is not above 0")
    (normal_mn, shear_mn), (normal_q8, shear_q8) = content["margin"]
    margin = Margin((int(normal_mn), int(shear_mn)), (int(normal_q8), int(shear_q8)))
    return Trained(Population(rows[:, :-1], rows[:, -1], margin), sigmas[0], sigmas[1], dict(content["provenance"]))


def _short(values: Floats) -> list[float]:
    # values that cancel between mirror images are not exactly 0, and differ between computers
    return [float(f"{value:.{DIGITS}g}") if abs(value) > NOTHING else 0.0 for value in values]
