"""Presses on a kitchen scale, guided on a board or from a recording: what the map says to each, and held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.geometry import Floats
from ...errors import InputError
from ...hand.hand import Hand
from ...recording import Recording
from ...wire import messages_gen as wire
from ...wire.frames import Q4_PER_COUNT, StructArray
from ..pressure.force_source import Truth, Unknown
from ..pressure.from_recording import recorded_rows
from ..pressure.guided import Face, ask_forces
from ..pressure.presses import Press, Procedure, Step
from ..pressure.rows import rows_of
from ..wrench.run import Run
from .fewshot import LEAST_PRESSES, Scale, scale_of
from .training import Population

FAR_SIGMAS = 3.0
ASKED_N = (2.0, 5.0, 3.0, 6.0, 4.0)  # light and firm in turn; of more presses, again from the first


@dataclass(frozen=True)
class Held:
    """Of k presses: frames' ``counts`` (n, 19) and ``tare`` (19,), which ``press`` (n,) they are of, 0 to k - 1.

    ``shown_n`` (k,) is what the scale showed.
    """

    counts: Floats
    tare: Floats
    press: Any
    shown_n: Floats

    def said(self, its: Population) -> Floats:
        """The map's force (k, 3) in N, a mean over each press."""
        force = its.force(self.counts, self.tare)
        return np.array([force[self.press == k].mean(axis=0) for k in range(len(self.shown_n))])

    def run(self, name: str) -> Run:
        """The frames as a run without a force, to compare fixed point with float on."""
        rows = len(self.counts)
        nothing = np.zeros((rows, 3))
        return Run(name, self.counts, self.tare, nothing, None, np.ones(19), np.zeros(rows, np.bool_), ())


@dataclass(frozen=True)
class Found:
    """``scale`` of all presses. RMS over presses of the error along x and z (2,) in N, where x should be 0.

    ``held_out_n`` is of each press by the scale of the others; ``before_n`` of the map as it was.
    """

    scale: Scale
    before_n: Floats
    held_out_n: Floats

    def worth_it(self, sigma_n: Floats) -> bool:
        """Better than the map as it was, and a finger as the map knows them, whose one sigma (3,) is ``sigma_n``."""
        better = (self.held_out_n**2).sum() < (self.before_n**2).sum()
        return bool(better and (self.held_out_n < FAR_SIGMAS * sigma_n[[0, 2]]).all())


def found(its: Population, held: Held) -> Found:
    """Gain and balance, and what they are worth. Raises InputError for presses that say nothing."""
    said, shown = held.said(its), held.shown_n
    scale = scale_of(said, shown)
    truth = np.column_stack([np.zeros_like(shown), shown])
    every = np.arange(len(shown))
    out = np.array([scale_of(said[every != k], shown[every != k], least=2).applied(said[k : k + 1])[0] for k in every])
    before, after = (np.sqrt(((force[:, [0, 2]] - truth) ** 2).mean(axis=0)) for force in (said, out))
    return Found(scale, before, after)


def asked_n(presses: int) -> tuple[float, ...]:
    """Newtons to ask for. Raises InputError for too few."""
    if presses < LEAST_PRESSES:
        raise InputError(f"{presses} presses are planned, expected {LEAST_PRESSES} or more; five are worth having")
    return tuple(ASKED_N[k % len(ASKED_N)] for k in range(presses))


def guided(hand: Hand, finger: int, presses: int, face: Face) -> Held:
    """On a board: ``face`` says what to do and is asked what the scale shows; a scenario knows its force itself.

    Raises InputError when a press is waited for in vain.
    """
    truth = None if hand.link.source is None else Truth(hand.link.source)
    procedure = Procedure([finger], asked_n(presses), needs_force=truth is not None)
    typed: dict[tuple[int, int], float] = {}
    kept: list[tuple[StructArray, Any]] = []
    shown: Step | None = procedure.step
    face.show(shown)
    for batch in hand.batches():
        mine = batch.wire["finger"] == finger
        kept.append((batch.wire[mine], batch.t_us[mine]))
        reference = truth or Unknown()
        procedure.feed(rows_of(batch.wire, batch.t_us, reference.at(batch.wire["finger"], batch.t_us)))
        if procedure.step != shown:
            shown = procedure.step
            if truth is None:
                ask_forces(procedure, typed, face)
            face.show(shown)
        if procedure.done:
            break
    else:
        procedure.finish()
    hand.stop()
    frames, t_us = np.concatenate([one for one, _ in kept]), np.concatenate([at for _, at in kept])
    held = procedure.presses[finger]
    return _held(frames, t_us, held, [typed.get((finger, press.number), np.nan) for press in held])


def recorded(recording: Recording, finger: int, shown_n: Sequence[float]) -> Held:
    """From a recording, a press for each reading. Raises InputError when there are not so many."""
    if len(shown_n) < LEAST_PRESSES:
        raise InputError(f"{len(shown_n)} readings: expected {LEAST_PRESSES} or more, one a press; name them in order")
    rows = recorded_rows(recording, None)
    procedure = Procedure([finger], shown_n, needs_force=False)
    procedure.feed(rows[rows["finger"] == finger])
    procedure.finish()
    mine = recording.wire["finger"] == finger
    return _held(recording.wire[mine], recording.frames["t_us"][mine], procedure.presses[finger], shown_n)


def _held(frames: StructArray, t_us: Any, presses: Sequence[Press], typed: Sequence[float]) -> Held:
    counts, numbers, shown = [], [], []
    tares = []
    for k, (press, force_n) in enumerate(zip(presses, typed, strict=True)):
        its = frames[np.isin(t_us, press.rows["t_us"])]
        whole = (its["counts"] != wire.INVALID_COUNT).all(axis=1) & (its["tare_q4"] != wire.INVALID_COUNT).all(axis=1)
        if not whole.any():
            raise InputError(
                f"press {k + 1} has no frame with all electrodes and a tare: expected one; see to the sensor"
            )
        counts.append(its["counts"][whole].astype(np.float64))
        tares.append(its["tare_q4"][whole] / Q4_PER_COUNT)
        numbers.append(np.full(int(whole.sum()), k))
        shown.append(float(np.nanmean(press.rows["force_n"])) if np.isnan(force_n) else force_n)
    tare = tares[0].mean(axis=0)
    # each press above its own tare: a board takes a new one in between
    level = [one - at + tare for one, at in zip(counts, tares, strict=True)]
    return Held(np.concatenate(level), tare, np.concatenate(numbers), np.array(shown))
