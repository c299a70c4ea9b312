"""Temperature in degrees C, and heat flux in counts."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from biotac.wire import messages as wire
from biotac.wire import sensor as _sensor

from .signals import check_fields

KELVIN_AT_0_C = 273.15
RANGE_C = (0.0, 75.0)  # from SynTouch's manual; a BioTac SP reads 47 to 63 by it, which looks valid

#: ``celsius`` is NaN where missing, railed or beyond RANGE_C. ``flux_counts`` is TAC above that of the first row that
#: has one. ``flux_is_si`` is False as long as TAC's gain is unknown.
THERMAL_DTYPE = np.dtype([("celsius", "<f8"), ("valid", "?"), ("flux_counts", "<f8"), ("flux_is_si", "?")])


def thermal(rows: npt.NDArray[Any]) -> npt.NDArray[np.void]:
    """Temperature and heat flux, THERMAL_DTYPE (n,), of rows with ``tdc`` and ``tac``.

    TDC is a thermistor in a divider: T = beta / ln(A / x - B) - 273.15 with x = TDC / 4095 (sensor.toml, the product
    manual). TAC is high-pass filtered and amplified by stages of a gain in W that no public document gives, so heat
    flux stays in counts above the first row that has a TAC, and ``flux_is_si`` is False. Raises InputError for rows
    without ``tdc`` or ``tac``.
    """
    rows = np.atleast_1d(rows)
    check_fields(rows, "tdc", "tac")
    result = np.zeros(len(rows), THERMAL_DTYPE)
    share = np.clip(rows["tdc"].astype(np.float64), 1.0, _sensor.FULL_SCALE_COUNT) / _sensor.FULL_SCALE_COUNT
    inside = _sensor.TDC_A / share - _sensor.TDC_B
    # a railed reading is no measurement
    known = (rows["tdc"] != wire.INVALID_COUNT) & (rows["tdc"] < _sensor.FULL_SCALE_COUNT) & (inside > 1.0)
    celsius = _sensor.TDC_BETA_K / np.log(np.where(known, inside, np.e)) - KELVIN_AT_0_C
    result["valid"] = known & (celsius >= RANGE_C[0]) & (celsius <= RANGE_C[1])
    result["celsius"] = np.where(result["valid"], celsius, np.nan)
    known = rows["tac"] != wire.INVALID_COUNT
    first = float(rows["tac"][known][0]) if known.any() else np.nan
    result["flux_counts"] = np.where(known, rows["tac"] - first, np.nan)
    return result
