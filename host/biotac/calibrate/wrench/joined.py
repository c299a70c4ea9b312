"""Joins a board's recording and a force/torque sensor's, each by its own clock, into a run.

Counts, tare and contact are the board's own, frame by frame. The force is the mean of the reference over each frame's
10 ms. The reference's zero is measured where the board felt nothing, before its axes are turned into Lin's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ...clock.alignment import ELECTRODES_S, PDC_S, Alignment, align_best, means
from ...errors import InputError, RecordingError
from ...kernels.geometry import Floats
from ...map.board_map import pdc_above_rest_q4
from ...wire import messages_gen as wire
from ...wire.frames import Q4_PER_COUNT, electrode_signals, to_units
from ..reference.samples import Reference
from . import contact
from .plate_recording import (
    MIN_REST_ROWS,
    REST_N,
    Run,
    check_clipping,
    check_electrodes,
    check_loads,
    check_rows,
    check_units,
    drift_of,
)

Mask = npt.NDArray[np.bool_]

MAX_INCOMPLETE_SHARE = 0.05
SETTLE_ROWS = 30  # after a touch the skin creeps back, and a hand may still be near
MAX_REST_FORCE_N = 0.5
FIRM_N = 1.0
MIN_ON_SKIN_SHARE = 0.7
LEVER_MM = (0.1, 40.0)  # |M| / |F| about Lin's origin: contacts are within 17 mm of it, torsion adds some
IDLE_MEAN_ROWS = 50  # drift is slow: means show it without the noise


@dataclass(frozen=True)
class Joined:
    """A run and how it was made. ``zero`` is the reference's, in the sensor's axes: N, and N mm where it has torque.

    ``on_skin_share`` is the share of firm rows with a line of action that meets the finger's ventral surface; NaN
    without torque.
    """

    run: Run
    finger: int
    reference: Reference
    alignment: Alignment
    zero: Floats
    on_skin_share: float


@dataclass(frozen=True)
class BoardRows:
    """A board's data for one finger: n frames in order.

    ``t_s`` (n,) is device time. ``counts`` and ``e``, the counts above the tare, are (n, 19); they are NaN where a word
    is missing, ``e`` also without a tare. ``pdc`` (n,) is above the tare, NaN where unknown. ``quiet`` (n,) is true
    after more than SETTLE_ROWS frames that were tared and not in contact.
    """

    finger: int
    serial: str
    t_s: Floats
    counts: Floats
    e: Floats
    pdc: Floats
    quiet: Mask

    def only(self, rows: Mask) -> BoardRows:
        """The frames where ``rows`` is true."""
        arrays = {name: getattr(self, name)[rows] for name in ("t_s", "counts", "e", "pdc", "quiet")}
        return replace(self, **arrays)


def board_of(frames: npt.NDArray[np.void], t_us: npt.NDArray[np.int64], finger: int, serial: str) -> BoardRows:
    """A BoardRows from FRAME messages (DTYPES) of one finger and their unwrapped times."""
    counts = to_units(frames["counts"], 1)
    pdc = to_units(pdc_above_rest_q4(frames), Q4_PER_COUNT)
    untouched = (frames["flags"] & (wire.FrameFlags.CONTACT | wire.FrameFlags.UNTARED)) == 0
    since = np.arange(len(frames)) - np.maximum.accumulate(np.where(untouched, -1, np.arange(len(frames))))
    quiet = untouched & (since > SETTLE_ROWS)
    return BoardRows(finger, serial, t_us / 1e6, counts, electrode_signals(frames), pdc, quiet)


def join(where: str, board: BoardRows, reference: Reference) -> Joined:
    """Align, zero and turn the reference. Raises RecordingError that begins with ``where`` for unusable data."""
    known: Mask = np.isfinite(board.e.sum(axis=1))
    if len(known) and (~known).mean() > MAX_INCOMPLETE_SHARE:
        raise RecordingError(
            f"{where}: {(~known).sum()} of {len(known)} frames have no tare or lack an electrode: expected at most "
            f"{MAX_INCOMPLETE_SHARE:.0%}; tare before you record, and check the wiring"
        )
    check_rows(where, int(known.sum()))
    board = board.only(known)
    wrench = reference.samples.wrench
    zero = _common_value(wrench)
    for _ in range(2):  # twice, now with a better zero: |F| grows with the load only if the zero is right
        alignment = _align(where, board, reference.samples.t_s, wrench, zero)
        rows = means(reference.samples.t_s, wrench, alignment.to_reference_s(board.t_s + ELECTRODES_S))
        zero = _zero(where, board, rows)
    referenced: Mask = np.isfinite(rows.sum(axis=1))
    check_rows(f"{where}, where counts and force are both known", int(referenced.sum()))
    truth = reference.mounting.to_finger(rows[referenced] - zero)
    check_clipping(where, "force", reference.mounting.sign * (rows[referenced] - zero)[:, :3])
    covered = board.only(referenced)
    counts, e = covered.counts, covered.e
    check_electrodes(where, counts)
    tare = np.median(counts - e, axis=0)
    moved = float(np.abs(counts - e - tare).max())
    check_units(where, e, truth[:, :3])
    about_loads = check_loads(where, truth[:, :3])
    on_skin = float("nan")
    about_torque: list[str] = []
    if truth.shape[1] == 6:
        on_skin = _on_skin(where, truth)
        about_torque = [f"{on_skin:.1%} of the rows above {FIRM_N:g} N have their line of action on the skin"]
        about_normal, about_torsion = contact.torsion_truth(where, None, truth[:, :3], truth[:, 3:])
        about_torque += about_torsion
        truth = np.column_stack([truth, about_normal])
    resting = counts[covered.quiet]
    whole = len(resting) // IDLE_MEAN_ROWS * IDLE_MEAN_ROWS
    drift, drift_note = drift_of("rest", resting[:whole].reshape(-1, IDLE_MEAN_ROWS, counts.shape[1]).mean(axis=1))
    zero_text = ", ".join(f"{v:+.3f}" for v in zero[:3]) + " N"
    if len(zero) > 3:
        zero_text += "; " + ", ".join(f"{v:+.2f}" for v in zero[3:]) + " N mm"
    notes = (
        f"tare: the board's own, which moved by up to {moved:.0f} counts",
        f"reference: {reference.name}" + (f", {reference.sensor}" if reference.sensor else ""),
        f"reference's zero: {zero_text}, from {int(board.quiet.sum())} rows in which the board saw no contact",
        str(alignment),
        f"{int((~referenced).sum())} of {len(referenced)} frames left out, as the reference does not cover them",
        *about_torque[:1],
        drift_note,
        *about_torque[1:],
        *about_loads,
    )
    run = Run(
        name=where,
        # one tare for the whole run, but each frame keeps its own e
        counts=e + tare,
        tare=tare,
        truth=truth,
        pdc=covered.pdc if np.isfinite(covered.pdc).all() else None,
        drift=drift,
        rest=np.linalg.norm(truth[:, :3], axis=1) < REST_N,
        notes=notes,
        serial=board.serial,
        by_clocks=True,
    )
    return Joined(run, board.finger, reference, alignment, zero, on_skin)


def _align(where: str, board: BoardRows, t_s: Floats, wrench: Floats, zero: Floats) -> Alignment:
    load = np.linalg.norm(wrench[:, :3] - zero[:3], axis=1)
    tries = [(ELECTRODES_S, np.sqrt((board.e**2).mean(axis=1)))]
    if np.isfinite(board.pdc).all() and np.ptp(board.pdc) > 0.0:
        # where the channel works, the fluid's pressure follows the normal force more closely than the counts do
        tries.append((PDC_S, board.pdc))
    return align_best(where, [(board.t_s + after_s, board_load) for after_s, board_load in tries], t_s, load)


def _common_value(wrench: Floats) -> Floats:
    """The most frequent reading of each axis: the zero, if the run lets go now and then."""
    result = np.zeros(wrench.shape[1])
    for axis, column in enumerate(wrench.T):
        values = np.sort(column[np.isfinite(column)])
        width = max(1, len(values) // 50)
        narrowest = int(np.argmin(values[width:] - values[:-width])) if len(values) > width else 0
        result[axis] = values[narrowest : narrowest + width].mean()
    return result


def _zero(where: str, board: BoardRows, rows: Floats) -> Floats:
    quiet = board.quiet & np.isfinite(rows).all(axis=1)
    if quiet.sum() < MIN_REST_ROWS:
        raise RecordingError(
            f"{where}: never at rest: the board saw no contact in {int(quiet.sum())} frames: expected {MIN_REST_ROWS}; "
            "let go in between, where the reference is zeroed"
        )
    zero: Floats = np.median(rows[quiet], axis=0)
    left = float(np.percentile(np.linalg.norm(rows[quiet, :3] - zero[:3], axis=1), 90))
    if left > MAX_REST_FORCE_N:
        raise RecordingError(
            f"{where}: where the board saw no contact the reference is up to {left:.2f} N (90th percentile): expected "
            f"at most {MAX_REST_FORCE_N:g} N; are both from the same run, and is the reference warm?"
        )
    return zero


def _on_skin(where: str, truth: Floats) -> float:
    """Share of firm rows with a contact on the finger: wrong torque units or a wrong mounting put it elsewhere."""
    firm = truth[np.linalg.norm(truth[:, :3], axis=1) > FIRM_N]
    if not len(firm):
        raise RecordingError(f"{where}: no force above {FIRM_N:g} N: expected firm presses; press harder")
    lever = float(np.median(np.linalg.norm(firm[:, 3:], axis=1) / np.linalg.norm(firm[:, :3], axis=1)))
    if not LEVER_MM[0] <= lever <= LEVER_MM[1]:
        guess = "is it in N m?" if lever < LEVER_MM[0] else "is it in N um, or is the mounting's offset wrong?"
        raise RecordingError(
            f"{where}: torque over force is {lever:.3g} mm about the fingertip's centre: expected {LEVER_MM[0]:g} to "
            f"{LEVER_MM[1]:g} mm; {guess}"
        )
    found = contact.locate(firm[:, :3], firm[:, 3:])
    share = float(np.mean(found.on_skin & ~found.missed))
    if share < MIN_ON_SKIN_SHARE:
        raise RecordingError(
            f"{where}: in {share:.0%} of the rows above {FIRM_N:g} N the line of force meets the finger's skin: "
            f"expected at least {MIN_ON_SKIN_SHARE:.0%}; check the mounting's rotation, offset and sign, and "
            "the torque's unit"
        )
    return share


def choose_finger(where: str, fingers: list[int], finger: int | None) -> int:
    """The finger asked for, or the only one. Raises InputError if it is not there, or if there is a choice."""
    seen = ", ".join(str(f) for f in fingers) or "none"
    if finger is None:
        if len(fingers) != 1:
            raise InputError(f"{where}: holds fingers {seen}: expected one; choose it with --finger")
        return fingers[0]
    if finger not in fingers:
        raise InputError(f"{where}: holds fingers {seen}, not {finger}; choose another with --finger")
    return finger
