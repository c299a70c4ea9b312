"""A scenario played: states to counts, faults laid over them, and the truth beside them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ..core.geometry import Floats
from ..wire import sensor_gen as _sensor
from ..wire import slots
from . import sampling
from .gains import fit_gains
from .physics import Finger
from .scenario import Fault, FingerSpec, Scenario, default_serial
from .source import Source, Truth

_REPEAT_SEED_STEP = 100  # apart enough that repeated fingers do not meet the scenario's own seeds


def play(scenario: Scenario, *, fingers: int | None = None, seconds: float | None = None) -> Source:
    """Play ``scenario`` on ``fingers`` fingers for ``seconds``; None: as the scenario says.

    A longer time repeats the timeline, so end a scenario as it began or the start of a repetition
    jumps; drift and noise go on. Finger k plays the script of finger k modulo the scenario's count.
    """
    own = len(scenario.fingers)
    count = own if fingers is None else fingers
    period = max(1, round(scenario.seconds * slots.FRAME_HZ))
    frames = period if seconds is None else max(1, round(seconds * slots.FRAME_HZ))
    specs = [_repeated(scenario.fingers[k % own], k // own) for k in range(count)]

    boundary = np.arange(frames + 1)
    # frame numbers, not seconds, so that no rounding shifts a repetition; the very last boundary
    # belongs to the frame before it
    boundary_s = _seconds(np.append(boundary[:-1] % period, (frames - 1) % period + 1))
    middle_s = _seconds(boundary[:-1] % period + 0.5)

    samples = np.empty((frames, count, slots.SLOTS_PER_FRAME), dtype=np.uint16)
    truth = Truth(
        contact=np.zeros((frames, count), dtype=np.bool_),
        poc_mm=np.full((frames, count, 3), np.nan),
        force_n=np.zeros((frames, count, 3)),
        torque_nmm=np.zeros((frames, count, 3)),
    )
    emulated = tuple(Finger(spec.seed, spec.profile) for spec in specs)
    for k, finger in enumerate(emulated):
        track = scenario.tracks[k % own]
        samples[:, k] = sampling.sample(finger, track.states(boundary_s))
        for fault in scenario.faults:
            if fault.finger == k % own:
                _lay(fault, samples[:, k], period)
        middle = track.states(middle_s)
        touched = middle.force_n > 0.0
        truth.contact[:, k] = touched
        truth.poc_mm[touched, k] = middle.contact_mm[touched]
        truth.force_n[:, k], truth.torque_nmm[:, k] = middle.wrench()

    return Source(
        name=scenario.name,
        samples=samples,
        truth=truth,
        settings=_fit(scenario, emulated, period) if scenario.fit_gains else {},
        serials=tuple(spec.serial for spec in specs),
        emulated=emulated,
    )


def _seconds(frame: npt.ArrayLike) -> Floats:
    return np.asarray(frame, dtype=np.float64) * slots.FRAME_S


def _repeated(spec: FingerSpec, repetition: int) -> FingerSpec:
    if repetition == 0:
        return spec
    seed = spec.seed + _REPEAT_SEED_STEP * repetition
    return replace(spec, seed=seed, serial=default_serial(seed))


def _lay(fault: Fault, words: sampling.Words, period: int) -> None:
    """Put the fault's code into ``words`` (frames, 44) at every slot that begins while it lasts."""
    frames, slots = words.shape
    # in slot numbers: comparing seconds would let rounding decide at the edges
    begin, end = (round(t * _sensor.SLOT_HZ) for t in (fault.at_s, fault.at_s + fault.seconds))
    mine = np.ones(slots, np.bool_) if fault.channel is None else np.array(_sensor.SLOTS) == fault.channel
    for first in range(begin // slots, frames, period):
        rows = words[first : first + -(-end // slots) - begin // slots]
        slot = np.arange(rows.size).reshape(rows.shape) + begin // slots * slots
        rows[(slot >= begin) & (slot < end) & mine] = fault.code


def _fit(scenario: Scenario, emulated: tuple[Finger, ...], period: int) -> dict[str, int]:
    """Gains over one whole timeline, whatever part of it is played, and all fingers together."""
    middle_s = _seconds(np.arange(period) + 0.5)
    signals, forces, torques = [], [], []
    for k, finger in enumerate(emulated):
        states = scenario.tracks[k % len(scenario.tracks)].states(middle_s)
        signals.append(finger.counts(states) - finger.rest_counts(states.warm_c))
        force, torque = states.wrench()
        forces.append(force)
        torques.append(torque)
    return fit_gains(np.concatenate(signals), np.concatenate(forces), np.concatenate(torques))
