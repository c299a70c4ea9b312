"""Bands of dynamic pressure (BANDS), computed by the board's own code (firmware/core/signal/bands.h)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..wire import messages_gen as wire
from ..wire import sensor_gen as sensor
from ..wire.dtypes_gen import DTYPES
from ..wire.frames import StructArray, bands_from_wire
from ..wire.native import ffi, lib
from .compiled import c_pointers, checked_words

#: The frequencies between which each band has at least half its power, Hz.
BANDS_HZ = ((11, 26), (22, 53), (45, 106), (91, 214), (190, 454), (527, 1100))
SAMPLES = sensor.SLOTS.count("PAC")  # of a round of 10 ms
_WIRE = DTYPES[wire.Bands.ID]


def bands_of(pac: StructArray) -> StructArray:
    """BANDS_DTYPE (n,) from one finger's PAC_DTYPE rows (n,), as the board would send them.

    The filters restart where rounds are missing. Raises ValueError for rows of several fingers.
    """
    if len(np.unique(pac["finger"])) > 1:
        raise ValueError(f"rows are of fingers {np.unique(pac['finger']).tolist()}, expected one; select its rows")
    begins = np.flatnonzero(np.diff(pac["seq"].astype(np.int64)) != 1) + 1
    sent = np.zeros(len(pac), _WIRE)
    sent["finger"] = pac["finger"]
    for part in np.split(np.arange(len(pac)), begins):
        sent["good"][part], sent["energy_q4"][part] = _energies(pac["pac"][part])
    return bands_from_wire(sent, pac["seq"], pac["t_us"])


def pac_bands(pac: Any) -> NDArray[np.float64]:
    """Energy of each round and band (n, 6), in count^2, the lowest band first; NaN where a round has no valid word.

    The bands are BANDS_HZ. ``pac`` (n, 22) are integers 0..4095, or 0xFFFF where no valid word came; each row is a
    round of 10 ms, and no rounds are missing. An energy is the sum of squares over the round's 22 samples. Raises
    ValueError for another shape, type or range.
    """
    words = checked_words("pac", pac, None, SAMPLES)
    sent = np.zeros(len(words), _WIRE)
    sent["good"], sent["energy_q4"] = _energies(words)
    rounds = np.arange(len(words))
    return bands_from_wire(sent, rounds, rounds)["energy_count2"]


def _energies(words: NDArray[np.uint16]) -> tuple[NDArray[np.uint8], NDArray[np.uint32]]:
    words = np.ascontiguousarray(words)
    good = np.zeros(len(words), np.uint8)
    energy_q4 = np.zeros((len(words), len(BANDS_HZ)), np.uint32)
    lib.bt_replay_bands(ffi.new("bt_bands *"), len(words), *c_pointers(words, good, energy_q4))
    return good, energy_q4
