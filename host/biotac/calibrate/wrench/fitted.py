"""The map that a calibration results in, and its file."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.geometry import Floats
from ...core.map_columns import ELECTRODES, Signals
from ...documents import read_json
from ...errors import InputError
from . import features
from .crossvalidation import Validation
from .models import POOLED
from .moments import with_one
from .provenance import KEY, Provenance

FORMAT = "biotac-wrench-map/3"


@dataclass(frozen=True)
class WrenchMap:
    """A map from one frame's counts to force on the finger, and where calibrated torque about Lin's origin and torsion.

    ``coefficients`` (p + 1, axes) are for features.columns, block by block, the offset last; ``tare`` (19,) is in
    counts. The map was trained on mean counts of ``window_rows`` frames, which lag the force by ``lag_rows`` (axes,).
    """

    model: str
    axes: tuple[str, ...]
    tare: Floats
    window_rows: int
    lag_rows: tuple[int, ...]
    coefficients: Floats

    @property
    def with_pdc(self) -> bool:
        """Whether the map was trained with PDC, and so needs it."""
        return len(self.coefficients) - 1 == features.width(with_pdc=True)

    def predict(self, counts: Floats, pdc: Floats | None = None) -> Floats:
        """Wrench (n, axes) in N and N mm for each of ``counts`` (n, 19); NaN where a count is NaN.

        The caller averages the counts over ``window_rows``. ``pdc`` (n,) is in counts above rest. Raises InputError
        when the map was trained with PDC and there is none.
        """
        if self.with_pdc and pdc is None:
            raise InputError(
                "this map was trained with PDC: expected pdc (n,) too; pass it, or calibrate without field PDC"
            )
        signals = Signals(np.asarray(counts, dtype=np.float64) - self.tare, self.tare, pdc if self.with_pdc else None)
        return with_one(features.columns(signals)) @ self.coefficients


def of(validation: Validation) -> WrenchMap:
    """The map trained on the whole run."""
    final, run = validation.final, validation.run
    return WrenchMap(POOLED, run.axes, run.tare, final.window_rows, final.lag_rows, final.best)


def dumps(its: WrenchMap, origin: Provenance | None = None) -> str:
    """The map as JSON; load() gives exactly the same numbers, provenance.read() the ``origin``."""
    facts: dict[str, Any] = {
        "format": FORMAT,
        "model": its.model,
        "axes": list(its.axes),
        "tare_counts": its.tare.tolist(),
        "window_rows": its.window_rows,
        "lag_rows": list(its.lag_rows),
        "blocks": _block_names(with_pdc=its.with_pdc),
        "coefficients": its.coefficients.tolist(),
    }
    if origin is not None:
        facts[KEY] = asdict(origin)
    return json.dumps(facts) + "\n"


def load(path: Path) -> WrenchMap:
    """The map in a file. Raises InputError that says what is wrong with it."""
    try:
        facts = read_json(path)
        if facts["format"] != FORMAT:
            raise ValueError(f"format {facts['format']!r}")
        its = WrenchMap(
            str(facts["model"]),
            tuple(str(axis) for axis in facts["axes"]),
            np.array(facts["tare_counts"], dtype=np.float64),
            int(facts["window_rows"]),
            tuple(int(lag) for lag in facts["lag_rows"]),
            np.array(facts["coefficients"], dtype=np.float64),
        )
        shapes = [(features.width(with_pdc=pdc) + 1, len(its.axes)) for pdc in (False, True)]
        if its.coefficients.shape not in shapes or its.tare.shape != (ELECTRODES,):
            raise ValueError(f"coefficients {its.coefficients.shape}, tare {its.tare.shape}")
        if len(its.lag_rows) != len(its.axes):
            raise ValueError(f"{len(its.lag_rows)} lags for {len(its.axes)} axes")
        if facts["blocks"] != _block_names(with_pdc=its.with_pdc):
            raise ValueError(f"blocks {facts['blocks']}")
        if not np.isfinite(its.coefficients).all() or not np.isfinite(its.tare).all():
            raise ValueError("a coefficient or tare is not finite")
    except (OSError, ValueError, KeyError, TypeError, OverflowError) as error:
        seen = str(error) or type(error).__name__
        raise InputError(f"{path}: {seen}: expected a {FORMAT} written by `biotac calibrate wrench --out`") from None
    return its


def _block_names(*, with_pdc: bool) -> list[list[str]]:
    return [[block.kind.name, block.gate.name] for block in features.blocks(with_pdc=with_pdc)]
