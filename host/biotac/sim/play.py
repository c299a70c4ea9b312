"""Playing a scenario: counts from its states, with faults laid over them, and the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ..core.geometry import Floats
from ..wire import sensor_gen as _sensor
from ..wire import slots
from . import sampling
from .faults import BUS_FAULTS, FAULTS, Faulty, broken_electrode, fault_named, on_the_bus
from .gains import fit_gains
from .physics import Finger, States
from .scenario import Fault, FingerSpec, Scenario, default_serial
from .source import Rows, Source, Truth

_IS_CHANNEL = {name: np.array(_sensor.SLOTS) == name for name in _sensor.SLOTS}
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
    emulated = tuple(Finger(spec.seed, spec.profile, spec.scale) for spec in specs)
    for index, track in enumerate(scenario.tracks[:count]):
        states = track.states(_seconds(np.arange(played + 1)))
        for k in range(index, count, own):
            samples[:, k] = sampling.sample(emulated[k], states, boundary)
    for fault in scenario.faults:  # of the sensors first, which feel each other's
        for k in range(fault.finger, count, own) if fault.kind in FAULTS else ():
            _lay(fault, samples, emulated, k, period)
    for index in range(min(own, count)):
        codes = _codes(
            [fault for fault in scenario.faults if fault.finger == index and fault.kind in BUS_FAULTS], period
        )
        for k in range(index, count, own) if codes is not None else ():
            laid = codes[frame]  # type: ignore[index]
            np.copyto(samples[:, k], laid, where=laid > 0)

    def middles(frames: int) -> list[States]:
        states = [track.states(_seconds(np.arange(frames) + 0.5)) for track in scenario.tracks[:count]]
        return [states[k % own] for k in range(count)]

    return Source(
        name=scenario.name,
        samples=samples,
        truth=_truth(middles(played), frame),
        settings=_fit(emulated, middles(period)) if scenario.fit_gains else {},
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
    """Codes that bus faults put in place of counts, (period, 44): in every slot that begins during a fault; otherwise 0."""
    if not faults:
        return None
    codes = np.zeros((period, slots.SLOTS_PER_FRAME), np.uint16)
    for fault in faults:
        # in slot numbers: comparing seconds would let rounding decide at the edges
        begin, end = (round(t * _sensor.SLOT_HZ) for t in (fault.at_s, fault.at_s + fault.seconds))
        hit = codes.reshape(-1)[begin:end]  # no more than it lasts: there may be many
        if fault.channel is None:
            hit[:] = BUS_FAULTS[fault.kind]
        else:
            hit[_IS_CHANNEL[fault.channel][np.arange(begin, begin + len(hit)) % slots.SLOTS_PER_FRAME]] = BUS_FAULTS[
                fault.kind
            ]
    return codes


def _lay(fault: Fault, samples: sampling.Words, emulated: tuple[Finger, ...], k: int, period: int) -> None:
    """Lay a fault of the sensor over finger ``k`` of samples (frames, fingers, 44), anew in each repetition."""
    beside = (k + 1) % len(emulated)
    rest, other_rest = (emulated[finger].rest_counts(np.zeros(1))[0] for finger in (k, beside))
    begin, end = (round(t * slots.FRAME_HZ) for t in (fault.at_s, fault.at_s + fault.seconds))
    lay = fault_named(fault.kind)
    for first in range(0, len(samples) - begin, period):
        rows = slice(first + begin, first + end)
        faulty = Faulty(broken_electrode(fault.channel), rest, other_rest, np.random.default_rng([emulated[k].seed, 7]))
        samples[rows, k] = on_the_bus(lay(faulty, samples[rows, k], samples[rows, beside]))


def _fit(emulated: tuple[Finger, ...], middles: list[States]) -> dict[str, int]:
    """Gains fitted over one whole timeline, even if only part of it is played, and over all fingers together."""
    signals = [
        finger.counts(states) - finger.rest_counts(states.warm_c)
        for finger, states in zip(emulated, middles, strict=True)
    ]
    forces, torques = zip(*(states.wrench() for states in middles), strict=True)
    return fit_gains(np.concatenate(signals), np.concatenate(forces), np.concatenate(torques))
