"""A population map as JSON, with its provenance; and the one that comes with the package.

Coefficients have seven digits: short, the same on every computer, and off by a thousandth of the map's error.
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

from ...core import population
from ...core.board_map import BoardMap
from ...core.geometry import Floats
from ...core.map_columns import ELECTRODES
from ...core.population import SHIPPED, shipped
from ...documents import JSON_BYTES, parse_json, read_text
from ...errors import InputError
from ...version import __version__
from ...wire.map_gen import Gate, Kind
from ..wrench import features
from .training import AXES, COLUMNS, FAMILIES, Population

FORMAT = "biotac-population-map/1"
DIGITS = 7
NOTHING = 1e-9


@dataclass(frozen=True)
class Kept:
    """A map and its provenance, with one sigma (3,) in N of a new finger's force, as it is and after five presses."""

    its: Population
    sigma_n: Floats
    sigma_scale5_n: Floats
    provenance: dict[str, Any]


def provenance_of(files: Sequence[Path], source: str, *, symmetric: bool) -> dict[str, Any]:
    """Names and SHA-256 of the recordings, and ``source``: where they come from and under which licence."""
    hashes = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
    return {"source": source, "files": hashes, "symmetric": symmetric, "software": f"biotac-gateway {__version__}"}


def made_of(kept: Kept, files: Sequence[Path]) -> bool:
    """Whether the map was trained on one of ``files``: its error on these is no estimate for a new finger."""
    seen = provenance_of(files, "", symmetric=False)["files"]
    return bool(set(seen.values()) & set(kept.provenance.get("files", {}).values()))


def others_than(kept: Kept, files: Sequence[Path]) -> tuple[Floats | None, str]:
    """Coefficients (533, 3) of a wrench map to pull the finger of ``files`` to, None if trained on them; and a note."""
    fingers = ", ".join(kept.provenance.get("files", {})) or "unnamed fingers"
    if made_of(kept, files):
        return None, f"not regularized towards the population map of {fingers}, which was made from this recording"
    # any tare will do: the columns mean the same with every tare
    return kept.its.wrench_map(
        np.zeros(ELECTRODES)
    ).coefficients, f"regularized towards the population map of {fingers}"


def dumps(kept: Kept) -> str:
    """The map as JSON, one line for each column."""
    head = {
        "format": FORMAT,
        "provenance": kept.provenance,
        "axes": list(AXES),
        "sigma_n": _short(kept.sigma_n),
        "sigma_scale5_n": _short(kept.sigma_scale5_n),
        "blocks": _block_names(),
        "board_map": base64.b64encode(_board_map(kept.its).blob).decode("ascii"),
    }
    lines = [f" {json.dumps(key)}: {json.dumps(value)}," for key, value in head.items()]
    rows = np.column_stack([kept.its.coefficients, kept.its.variance])
    columns = ",\n".join(f"  {json.dumps(_short(row))}" for row in rows)
    return "\n".join(["{", *lines, ' "coefficients_n_and_variance": [', columns, " ]", "}", ""])


def loads(text: str, where: str) -> Kept:
    """Inverse of dumps, up to rounding. Raises InputError that begins with ``where`` and says what is wrong."""
    try:
        facts = parse_json(text)
        if facts["format"] != FORMAT:
            raise ValueError(f"format {facts['format']!r}")
        if facts["blocks"] != _block_names():
            raise ValueError(f"blocks {facts['blocks']}")
        rows = np.array(facts["coefficients_n_and_variance"], dtype=np.float64)
        sigmas = [np.array(facts[key], dtype=np.float64) for key in ("sigma_n", "sigma_scale5_n")]
        if rows.shape != (COLUMNS, len(AXES) + 1) or any(one.shape != (len(AXES),) for one in sigmas):
            raise ValueError(f"coefficients {rows.shape}")
        if not all(np.isfinite(one).all() for one in (rows, *sigmas)) or (rows[:, -1] <= 0.0).any():
            raise ValueError("a coefficient is not finite, or a variance is not above 0")
        return Kept(Population(rows[:, :-1], rows[:, -1]), sigmas[0], sigmas[1], dict(facts["provenance"]))
    except (ValueError, KeyError, TypeError, OverflowError) as error:
        seen = str(error) or type(error).__name__
        cure = "expected a " + FORMAT + " written by `biotac calibrate population --out`"
        raise InputError(f"{where}: {seen}: {cure}") from None


def load(path: Path | None) -> Kept:
    """The map in a file, or the package's own if ``path`` is None. Raises InputError if it cannot be read or used."""
    if path is None:
        return loads(shipped(), SHIPPED)
    try:
        text = read_text(path, JSON_BYTES)
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read ({error}); check the path") from None
    return loads(text, str(path))


def _short(values: Floats) -> list[float]:
    # what cancels between mirror images is not exactly 0, and differs between computers
    return [float(f"{value:.{DIGITS}g}") if abs(value) > NOTHING else 0.0 for value in values]


def _board_map(its: Population) -> BoardMap:
    """The board's map, made from the rounded coefficients, so that a reader of the file gets the same one."""
    named = [(Kind[kind], Gate[gate]) for kind, gate in _block_names()]
    return population.board_map(population.split(named, np.array([_short(row) for row in its.coefficients])))


def _block_names() -> list[list[str]]:
    own = features.blocks(with_pdc=False)
    return [[block.kind.name, block.gate.name] for family in FAMILIES for block in own if block in family.blocks]
