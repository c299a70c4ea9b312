"""The tare machine on recordings of real fingers, judged by pressure and electrodes of the recordings.

A row is a round to the machine, whatever the logger's time stamps say: it left most rounds out, and the board's
half second is fifty of those that are there.
"""

from pathlib import Path

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view

from biotac import Finger, FrameFlags, TareReason, TareState

ROUNDS_PER_HALF_SECOND = 50
AT_REST_PDC = 30  # as much as a real skin keeps after a press
PRESSED_PDC = 60
STILL_COUNTS = 12  # means of eight rounds within this band have not moved
RELEASES = (TareReason.RELEASE, TareReason.RESIDUE)


@pytest.fixture
def trial(shared_data: Path) -> dict[str, np.ndarray]:
    with np.load(shared_data / "robotic_finger/trial_15330.npz") as archive:
        return {name: archive[name] for name in ("t", "E", "PDC")}


def rest_pressure(t_s: np.ndarray, pdc: np.ndarray) -> np.ndarray:
    """The unpressed pressure around each row: it drifts, and every twenty seconds have some rest."""
    return np.array([np.percentile(pdc[(t_s >= at - 10) & (t_s <= at + 10)], 5) for at in t_s])


def runs_of(mask: np.ndarray) -> list[tuple[int, int]]:
    """First row of each stretch with ``mask``, and the row after the last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return list(zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True))


def still_runs(counts: np.ndarray, first: int, end: int) -> list[tuple[int, int]]:
    """Cut rows first..end where a mean of eight leaves the band since the last cut."""
    means = sliding_window_view(counts[first:end].astype(float), 8, axis=0).mean(axis=-1) if end - first >= 8 else []
    out, begin = [], 0
    for k in range(len(means)):
        band = means[begin : k + 1]
        if (band.max(axis=0) - band.min(axis=0)).max() > STILL_COUNTS:
            out.append((first + begin, first + k + 7))
            begin = k
    return [*out, (first + begin, end)] if len(means) else []


def test_every_release_of_a_real_finger_is_tared_and_no_press_is(trial: dict[str, np.ndarray]) -> None:
    above = trial["PDC"].astype(float) - rest_pressure(trial["t"], trial["PDC"])
    rows = Finger().feed(trial["E"], trial["PDC"])
    changed = (rows["flags"] & FrameFlags.TARE_CHANGED) != 0
    tared = changed & np.isin(rows["tare_reason"], [*RELEASES, TareReason.START])

    assert (above > PRESSED_PDC).sum() > 1000
    assert not tared[above > PRESSED_PDC].any()

    released = [run for low in runs_of(above < AT_REST_PDC) for run in still_runs(trial["E"], *low)]
    released = [(a, b) for a, b in released if b - a >= ROUNDS_PER_HALF_SECOND]
    assert len(released) >= 10
    missed = [(a, b, trial["t"][a]) for a, b in released if not tared[a:b].any()]
    assert not missed
    # And the tare is the finger's reading then: the mean of the eight rounds before, which ended when each
    # electrode's turn came, within a sweep.
    for k in np.flatnonzero(tared):
        seen = trial["E"][max(k - 16, 0) : k + 1].astype(float)
        tare = rows["tare_q4"][k] / 16.0
        assert (tare >= seen.min(axis=0) - 1 / 16).all() and (tare <= seen.max(axis=0) + 1 / 16).all()


def test_no_press_of_a_real_finger_goes_unseen(trial: dict[str, np.ndarray]) -> None:
    above = trial["PDC"].astype(float) - rest_pressure(trial["t"], trial["PDC"])
    rows = Finger().feed(trial["E"], trial["PDC"])
    presses = [(a, b) for a, b in runs_of(above > PRESSED_PDC) if b - a >= 8]
    assert len(presses) >= 10
    for a, b in presses:
        assert (rows["tare_state"][a + 3 : b] == TareState.CONTACT).all()


def test_a_recorded_contact_is_seen_and_let_go_when_it_was(shared_data: Path) -> None:
    with np.load(shared_data / "btd_biotacsp/btd.npz") as archive:
        t, pdc = archive["t"], archive["PDC"].astype(float)
        rows = Finger().feed(archive["E"], archive["PDC"], archive["TAC"], archive["TDC"], archive["PAC"])
    changes = np.flatnonzero((rows["flags"] & FrameFlags.TARE_CHANGED) != 0)
    reasons = [TareReason(r) for r in rows["tare_reason"][changes]]
    assert reasons == [TareReason.START, TareReason.ROLL_BACK, TareReason.RESIDUE]
    # Rows come in batches with gaps of up to 0.64 s, and the board of this test does not run in them. By the stamps
    # contact was at 22.99 s, within a batch of ten rows, and the tare at 69.84 s, within a gap.
    gap = float(np.diff(t).max())
    assert gap < 0.7
    assert abs(t[changes[1]] - 22.99) <= 0.1
    assert abs(t[changes[2]] - 69.84) <= gap
    # By the pressure: at rest before and after, and pressed in between.
    rest = np.median(pdc[:600])
    assert abs(pdc[changes[2]] - rest) < AT_REST_PDC
    assert (pdc[changes[1] : changes[2]] > rest + PRESSED_PDC).sum() > 1000
    assert (rows["tare_state"][changes[1] : changes[2]] == TareState.CONTACT).all()
