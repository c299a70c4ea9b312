"""Playing a scenario: counts from the states, with faults laid over them, and the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..kernels.geometry import Floats
from ..wire import sensor_gen as _sensor
from ..wire import slots
from . import sampling
from .faults import BUS_FAULTS, FAULTS, IS_CHANNEL, begin
from .physics import SimFinger, States
from .scenario import Fault, FingerSpec, Scenario, default_serial
from .source import Rows, Source, Truth

_REPEAT_SEED_STEP = 100  # large enough that repeated fingers do not get the scenario's own seeds


def play(scenario: Scenario, *, fingers: int | None = None, seconds: float | None = None) -> Source:
    """Play ``scenario`` on ``fingers`` fingers for ``seconds``; None: as the scenario says.

    A longer time repeats the timeline, so a scenario should end as it began, or each repetition starts with a jump;
    drift and noise go on. Finger k plays the script of finger k modulo the scenario's number of fingers.
    """
    own = len(scenario.fingers)
    count = own if fingers is None else fingers
    period = max(1, round(scenario.seconds * slots.FRAME_HZ))
    frames = period if seconds is None else max(1, round(seconds * slots.FRAME_HZ))
    specs = [_repeated(scenario.fingers[k % own], k // own) for k in range(count)]

    played = min(frames, period)  # of the timeline
    frame = np.arange(frames) % period
    # frame numbers, not seconds, so that no rounding shifts a repetition; the very last boundary
    # belongs to the frame before it
    boundary = np.append(frame, frame[-1] + 1)

    samples = np.empty((frames, count, slots.SLOTS_PER_FRAME), dtype=np.uint16)
    emulated = tuple(SimFinger(spec.seed, spec.profile) for spec in specs)
    for index, track in enumerate(scenario.tracks[:count]):
        states = track.states(_seconds(np.arange(played + 1)))
        for k in range(index, count, own):
            samples[:, k] = sampling.sample(emulated[k], states, boundary)
    for fault in scenario.faults:  # of the sensors first, which feel each other's
        for k in range(fault.finger, count, own) if fault.kind in FAULTS else ():
            _lay(fault, samples, emulated, k, period)
    for index in range(min(own, count)):
        codes = _codes([fault for fault in scenario.faults if fault.finger == index], period)
        if codes is not None:
            laid = codes[frame]
            for k in range(index, count, own):
                np.copyto(samples[:, k], laid, where=laid > 0)

    def middles(frames: int) -> list[States]:
        states = [track.states(_seconds(np.arange(frames) + 0.5)) for track in scenario.tracks[:count]]
        return [states[k % own] for k in range(count)]

    return Source(
        name=scenario.name,
        samples=samples,
        truth=_truth(middles(played), frame),
        serials=tuple(spec.serial for spec in specs),
        emulated=emulated,
    )


def _truth(middles: list[States], frame: Rows) -> Truth:
    """The truth for each finger, from its states at the middle of each frame of the timeline."""
    contact = np.stack([states.force_n > 0.0 for states in middles], axis=1)
    poc_mm = np.stack([states.contact_mm for states in middles], axis=1)
    wrenches = [states.wrench() for states in middles]
    force_n, torque_nmm = (np.stack([wrench[part] for wrench in wrenches], axis=1) for part in (0, 1))
    return Truth(contact, np.where(contact[:, :, None], poc_mm, np.nan), force_n, torque_nmm, frame)


def _seconds(frame: npt.ArrayLike) -> Floats:
    return np.asarray(frame, dtype=np.float64) * slots.FRAME_S


def _repeated(spec: FingerSpec, repetition: int) -> FingerSpec:
    if repetition == 0:
        return spec
    seed = spec.seed + _REPEAT_SEED_STEP * repetition
    return replace(spec, seed=seed, serial=default_serial(seed))


def _codes(faults: list[Fault], period: int) -> sampling.Words | None:
    """Codes that faults of the bus put in place of counts, (period, 44), in each slot that begins in one; else 0."""
    on_bus = [fault for fault in faults if fault.kind in BUS_FAULTS]
    if not on_bus:
        return None
    codes = np.zeros((period, slots.SLOTS_PER_FRAME), np.uint16)
    for fault in on_bus:
        # in slot numbers: comparing seconds would let rounding decide at the edges
        begin, end = (round(t * _sensor.SLOT_HZ) for t in (fault.at_s, fault.at_s + fault.seconds))
        hit = codes.reshape(-1)[begin:end]  # no more than it lasts: there may be many
        slot = np.arange(begin, begin + len(hit)) % slots.SLOTS_PER_FRAME
        hit[slice(None) if fault.channel is None else IS_CHANNEL[fault.channel][slot]] = BUS_FAULTS[fault.kind]
    return codes


def with_fault(source: Source, finger: int, kind: str, channel: str | None = None) -> Source:
    """``source`` with a fault on one finger from the first round to the last.

    A recording's finger is taken to rest in its first round. Raises InputError for a finger, fault or channel that
    there is not.
    """
    fingers = source.samples.shape[1]
    if not 0 <= finger < fingers:
        raise InputError(f"finger {finger}: {source.name} has {fingers}, expected 0 to {fingers - 1}")
    samples, beside = source.samples.copy(), (finger + 1) % fingers
    rest, other_rest = (samples[0, k, slots.ELECTRODE_SLOT].astype(np.float64) for k in (finger, beside))
    samples[:, finger] = begin(kind, channel, rest, other_rest, 7)(samples[:, finger], source.samples[:, beside])
    return replace(source, samples=samples)


def _lay(fault: Fault, samples: sampling.Words, emulated: tuple[SimFinger, ...], k: int, period: int) -> None:
    """Lay a fault of the sensor over finger ``k`` of samples (frames, fingers, 44), anew in each repetition."""
    beside = (k + 1) % len(emulated)
    rest, other_rest = (emulated[finger].rest_counts(np.zeros(1))[0] for finger in (k, beside))
    from_row, to_row = (round(t * slots.FRAME_HZ) for t in (fault.at_s, fault.at_s + fault.seconds))
    for first in range(0, len(samples) - from_row, period):
        rows = slice(first + from_row, first + to_row)
        lay = begin(fault.kind, fault.channel, rest, other_rest, [emulated[k].seed, 7])
        samples[rows, k] = lay(samples[rows, k], samples[rows, beside])
