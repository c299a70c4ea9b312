"""Wettels and Loeb 2011, figure 7, emulated: which of four probes, by his rows and net, and by frames and presses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from biotac.sim import SimFinger

from ...learn import inputs, levenberg, nets, roc
from ...learn.probes import PROBES
from ...learn.smooth import low_pass
from ...learn.stimulations import LEAST_SHARE, Stimulations, stimulate
from ...report import Facts, plain
from ..trial import Floats

FRAMES = 5  # a press; the way up is at 10, 65 and 100 % of the peak
LEAST_N = 1.0
BY_CONTACT, BY_ROW = "held out by contact", "rows at random, as the paper"
HIS, QUICK = "frame, Levenberg-Marquardt", "frame"
PRESS_S = 2.0  # the paper's are "sufficiently slow"; his rows are read at an even pace through them


def filtered(pressed: Stimulations, frames: int) -> Stimulations:
    """Counts and forces through the paper's low-pass, each press by itself."""
    rate_hz = frames / PRESS_S
    counts, force_n = pressed.counts.copy(), pressed.force_n.copy()
    for first in range(0, len(pressed), frames):
        rows = slice(first, first + frames)
        counts[rows] = low_pass(counts[rows] - pressed.tare[rows], rate_hz) + pressed.tare[rows]
        force_n[rows] = low_pass(force_n[rows], rate_hz)
    return replace(pressed, counts=counts, force_n=force_n)


def his_rows(
    finger: SimFinger, places: tuple[int, ...], seed: int, steps: tuple[int, int], frames: int, most: int, low: bool
) -> list[Facts]:
    """The paper's way: ``frames`` rows a press, split at random, 19 electrodes into 38 units, four linear outputs.

    ``steps`` are those of his trainer and of the quicker one; ``low`` filters, and ``most`` rows are used.
    """
    pressed = stimulate(finger, places, seed=seed, frames=frames)
    pressed = filtered(pressed, frames) if low else pressed
    columns, kind, rows = _firm(pressed, seed, most)
    training, stopping, test = roc.split(rows, seed)
    x = inputs.every(columns[training])(columns)
    targets = np.eye(len(PROBES))[kind]
    a_press = len(rows) / len(np.unique(pressed.stimulation[rows]))
    given = x[training], targets[training], (x[stopping], targets[stopping])
    found = []
    for name, net in (
        (HIS, levenberg.train(*given, seed=seed, steps=steps[0])),
        (QUICK, nets.train(*given, seed=seed, steps=steps[1])),
    ):
        right = float((roc.decide(net(x[stopping])) == kind[stopping]).mean())
        named = f"{name}, {a_press:.0f} rows a press"
        found.append(_facts(named, BY_ROW, right, roc.decide(net(x[test])), kind[test], places))
    return found


def _firm(pressed: Stimulations, seed: int, most: int) -> tuple[Floats, roc.Integers, roc.Integers]:
    """Signals, probe and number of at most ``most`` rows above LEAST_N."""
    rng = np.random.default_rng([seed, 35])
    firm = np.flatnonzero(pressed.normal_n > max(LEAST_N, LEAST_SHARE))
    rows = np.sort(rng.permutation(firm)[:most])
    return (pressed.counts - pressed.tare)[rows], pressed.probe[rows], rows


def frames(finger: SimFinger, places: tuple[int, ...], seed: int, steps: int, most: int) -> Facts:
    """The same from a frame of a new contact, by the quicker trainer. It uses at most ``most`` rows."""
    pressed = stimulate(finger, places, seed=seed, frames=FRAMES)
    columns, kind, rows = _firm(pressed, seed, most)
    training, stopping, test = roc.split(pressed.contact[rows], seed)
    net = roc.train(columns, kind, training, stopping, seed=seed, steps=steps)
    right = float((roc.decide(net(columns[stopping])) == kind[stopping]).mean())
    return _facts(QUICK, BY_CONTACT, right, roc.decide(net(columns[test])), kind[test], places)


def trajectories(finger: SimFinger, places: tuple[int, ...], seed: int, steps: int) -> list[Facts]:
    """Classify how a press grows, one press or all five of a contact, by the paper's net and by support vectors."""
    pressed = stimulate(finger, places, seed=seed, frames=FRAMES)
    columns, press = roc.trajectories(pressed.counts - pressed.tare, pressed.tare, pressed.stimulation)
    first = np.searchsorted(pressed.stimulation, press)
    kind, contact = pressed.probe[first], pressed.contact[first]
    training, stopping, test = roc.split(contact, seed)
    net = roc.train(columns, kind, training, stopping, seed=seed, steps=steps)
    # tested on the rows set aside before it learns from them, too: the method is chosen by ``validated`` alone
    before = roc.machine().fit(columns[training], kind[training])
    machine = roc.machine().fit(columns[~test], kind[~test])
    _, at = np.unique(contact[test], return_index=True)
    found = []
    for aside, outputs, by in (
        (net(columns[stopping]), net(columns[test]), ""),
        (before.decision_function(columns[stopping]), machine.decision_function(columns[test]), ", support vectors"),
    ):
        rights = [roc.decide(aside) == kind[stopping], roc.decide(aside, contact[stopping]) == kind[stopping]]
        alone, together = roc.decide(outputs), roc.decide(outputs, contact[test])
        found += [
            _facts("press" + by, BY_CONTACT, float(rights[0].mean()), alone, kind[test], places),
            _facts("contact of five presses" + by, BY_CONTACT, float(rights[1].mean()), together[at], kind[test][at],
                   places),
        ]  # fmt: skip
    return found


def chosen(found: list[Facts]) -> Facts:
    """The way that does best on the contacts kept aside, among those held out by contact: test data have no say."""
    return max((fact for fact in found if fact["split"] == BY_CONTACT), key=lambda fact: fact["validated"])


def _facts(
    name: str, split: str, validated: float, decided: roc.Integers, truth: roc.Integers, places: tuple[int, ...]
) -> Facts:
    """The figures of one classifier; rows of ``confusion`` are its answers, ``validated`` is from rows set aside.

    ``by_probe`` is the share of each probe's presses that it recognised.
    """
    from sklearn.metrics import confusion_matrix  # half a second to import

    confusion = confusion_matrix(decided, truth, labels=range(len(PROBES)))
    return {
        "what": name, "split": split, "places": list(places), "validated": plain(validated),
        "correct": plain(float((decided == truth).mean())),
        "by_probe": [plain(share) for share in np.diag(confusion) / np.maximum(confusion.sum(axis=0), 1)],
        "confusion": confusion.tolist(),
    }  # fmt: skip
