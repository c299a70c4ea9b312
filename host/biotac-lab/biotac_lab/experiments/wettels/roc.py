"""Wettels and Loeb 2011, figure 7, emulated: which of four probes, by frames and trajectories, with two splits."""

from __future__ import annotations

import numpy as np
from sklearn.metrics import confusion_matrix

from biotac.sim import Finger

from ...learn import roc
from ...learn.probes import PROBES
from ...learn.stimulations import LEAST_SHARE, stimulate
from ...report import Facts, plain

FRAMES = 5  # a press; its way up is at 10, 65 and 100 % of the peak
LEAST_N = 1.0
BY_CONTACT, BY_ROW = "held out by contact", "rows at random, as the paper"


def frames(finger: Finger, places: tuple[int, ...], by_contact: bool, seed: int, steps: int, most: int) -> Facts:
    """The paper's own classifier: a frame's 19 electrodes into 38 unpressed. It uses at most ``most`` rows."""
    pressed = stimulate(finger, places, seed=seed, frames=FRAMES)
    rng = np.random.default_rng([seed, 35])
    firm = np.flatnonzero(pressed.normal_n > max(LEAST_N, LEAST_SHARE))
    rows = np.sort(rng.permutation(firm)[:most])
    columns, kind = (pressed.counts - pressed.tare)[rows], pressed.probe[rows]
    training, stopping, test = roc.split(pressed.contact[rows] if by_contact else rows, seed)
    net = roc.train(columns, kind, training, stopping, seed=seed, steps=steps)
    return _facts("frame", BY_CONTACT if by_contact else BY_ROW, net(columns[test]), kind[test], places)


def trajectories(finger: Finger, places: tuple[int, ...], seed: int, steps: int) -> list[Facts]:
    """Classify how a press grows, one press or all five of a contact, by the paper's net and by support vectors."""
    pressed = stimulate(finger, places, seed=seed, frames=FRAMES)
    columns, press = roc.trajectories(pressed.counts - pressed.tare, pressed.tare, pressed.stimulation)
    first = np.searchsorted(pressed.stimulation, press)
    kind, contact = pressed.probe[first], pressed.contact[first]
    training, stopping, test = roc.split(contact, seed)
    net = roc.train(columns, kind, training, stopping, seed=seed, steps=steps)
    machine = roc.machine().fit(columns[training | stopping], kind[training | stopping])
    _, one = np.unique(contact[test], return_index=True)
    found = []
    for outputs, by in (
        (net.outputs(columns[test]), ""),
        (machine.decision_function(columns[test]), ", support vectors"),
    ):
        alone, together = roc.decide(outputs), roc.decide(outputs, contact[test])
        found += [
            _facts("press" + by, BY_CONTACT, alone, kind[test], places),
            _facts("contact of five presses" + by, BY_CONTACT, together[one], kind[test][one], places),
        ]
    return found


def _facts(what: str, split: str, decided: roc.Integers, truth: roc.Integers, places: tuple[int, ...]) -> Facts:
    """The figures of one classifier; rows of ``confusion`` are what it decided."""
    return {
        "what": what, "split": split, "places": list(places), "correct": plain(float((decided == truth).mean())),
        "confusion": confusion_matrix(decided, truth, labels=range(len(PROBES))).tolist(),
    }  # fmt: skip
