"""The tare machine's evidence and decisions, sweep by sweep: for a tare that went wrong."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..keep.calibration import own_settings
from ..wire.fields import INVALID_U32, Field
from ..wire.frames import StructArray
from ..wire.messages_gen import INVALID_COUNT
from ..wire.slots import FRAME_S
from .reader import Recording
from .recompute import machine_rounds
from .rounds import run

SWEEP_ROUNDS = 8

#: A finger's columns beside ``t_us``; counts of rounds and sweeps saturate as on the board.
TRACE = (
    Field("tare_state", "u1", "1", "TareState after the round"),
    Field("tare_reason", "u1", "1", "TareReason of the last change of the tare"),
    Field("hits", "u1", "rounds", "in a row, in which the trigger fired"),
    Field("trigger_count2", "<u4", "count^2", "energy of this round that the trigger saw; 0 where it does not look"),
    Field("threshold_count2", "<u4", "count^2", "above which the trigger fires"),
    Field("energy_count2", "<f8", "count^2", "of the electrodes' means minus their tare; NaN without a tare"),
    Field("energy_peak_count2", "<u4", "count^2", "the most of it since the tare was taken"),
    Field("pdc_above_count", "<f8", "count", "static pressure above its tare; NaN where unknown"),
    Field("pdc_peak_count", "<i4", "count", "the most of it since the tare was taken"),
    Field("tdc_warmed_count", "<f8", "count", "how far TDC has risen since the tare was taken"),
    Field("still_sweeps", "u1", "sweeps", "in which no mean moved by more than 12 counts"),
    Field("level_sweeps", "u1", "sweeps", "in which pressure stayed level"),
    Field("quiet_sweeps", "u1", "sweeps", "in contact, with pressure back at rest"),
    Field("even_sweeps", "u1", "sweeps", "in contact, with only what all electrodes share"),
    Field("drift_count_per_s", "<f8", "count/s", "by which the tare is taken to drift"),
)
_DTYPE = np.dtype([("t_us", "<i8"), *((column.name, column.dtype) for column in TRACE)])
_SWEEP_S = SWEEP_ROUNDS * FRAME_S


def trace(recording: Recording, show: Callable[[float], None] = lambda share: None) -> dict[int, StructArray]:
    """By finger, a row for each sweep of the tare machine and each round in which the state or reason changed.

    The board's code runs again over the recorded counts. A row has the values that a verdict compared, from before it
    changed anything. Raises InputError where the recording lacks rounds.
    """
    own = own_settings(recording.settings, recording.calibrations)
    out: dict[int, StructArray] = {}
    done = 0
    for at, rounds in machine_rounds(recording, recording.maps, []):
        finger = rounds.fresh(own.get(rounds.finger, recording.settings))
        rows: list[tuple[Any, ...]] = []
        before, since = finger.tare_machine(), 0
        for k, part in enumerate(run(rounds, finger, range(len(rounds.counts)))):
            now, since = finger.tare_machine(), since + 1
            changed = (now.state, now.reason) != (before.state, before.reason)
            if changed or now.sweep.round < before.sweep.round or since == SWEEP_ROUNDS:
                rows.append((int(rounds.t_us[k]), *_row(now, before, int(part["energy_count2"][0]))))
                since = 0
            before = now
        out[rounds.finger] = np.array(rows, _DTYPE)
        done += len(at)
        show(done / len(recording.wire))
    return out


def _row(now: Any, was: Any, trigger_count2: int) -> tuple[Any, ...]:
    tare_q4 = np.array(list(was.electrode_q4), np.int64)
    away_q4 = np.where(tare_q4 == INVALID_COUNT, 0, 2 * np.array(list(was.sweep.mean_q3.lane)[:-1]) - tare_q4)
    pressure = now.trigger.pressure_now and was.base.pdc_q16 != INVALID_U32
    return (
        now.state,
        now.reason,
        now.hits,
        trigger_count2,
        was.threshold_count2,
        float(np.sum(away_q4**2)) / 256 if was.tared else np.nan,
        was.release.energy_peak,
        now.trigger.smooth.lane[len(away_q4)] - was.base.pdc_q16 / 65536 if pressure else np.nan,
        was.release.pdc_peak,
        (was.thermal.tdc_q8 - was.thermal.tdc_then_q8) / 256,
        was.sweep.still_sweeps,
        was.watch.level_sweeps,
        was.release.quiet_sweeps,
        was.release.even_sweeps,
        was.drift.now.q20 / 2**20 / _SWEEP_S,
    )
