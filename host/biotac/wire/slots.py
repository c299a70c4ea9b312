"""The 44 slots of a round: how long it is, and which slots each channel has."""

from __future__ import annotations

import numpy as np

from . import sensor_gen as _sensor

SLOTS_PER_FRAME = len(_sensor.SLOTS)
FRAME_S = SLOTS_PER_FRAME / _sensor.SLOT_HZ
FRAME_HZ = _sensor.SLOT_HZ / SLOTS_PER_FRAME

ELECTRODE_SLOT = np.array([_sensor.SLOTS.index(name) for name in _sensor.ELECTRODE_NAMES])
PAC_SLOT = np.flatnonzero(np.array(_sensor.SLOTS) == "PAC")
PDC_SLOT, TAC_SLOT, TDC_SLOT = (_sensor.SLOTS.index(name) for name in ("PDC", "TAC", "TDC"))
#: The channels that have one slot each, by the names of their columns.
SLOW_SLOTS = {"pdc": PDC_SLOT, "tac": TAC_SLOT, "tdc": TDC_SLOT}
