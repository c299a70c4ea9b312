"""Seed 000's figure 7 on an emulated finger: which of four probes, by frames and trajectories, with two splits."""

from __future__ import annotations

import numpy as np

from ...features import roc
from ...sim.physics import Finger
from ...sim.probes import PROBES
from ...sim.stimulations import LEAST_SHARE, stimulate
from .outcome import Facts, number

FRAMES = 5  # a press; its way up is at 10, 65 and 100 % of the peak
LEAST_N = 1.0
BY_CONTACT, BY_ROW = "held out by contact", "rows at random, as the paper"


def frames(finger: Finger, places: tuple[int, ...], by_contact: bool, seed: int, steps: int, most: int) -> Facts:
    """The paper's own classifier: a frame's 19 electrodes into 38 units. It uses at most ``most`` rows."""
    its = stimulate(finger, places, seed=seed, frames=FRAMES)
    rng = np.random.default_rng([seed, 35])
    firm = np.flatnonzero(its.normal_n > max(LEAST_N, LEAST_SHARE))
    rows = np.sort(rng.permutation(firm)[:most])
    columns, kind = (its.counts - its.tare)[rows], its.probe[rows]
    training, stopping, test = roc.split(its.contact[rows] if by_contact else rows, seed)
    net = roc.train(columns, kind, training, stopping, seed=seed, steps=steps)
    return _facts("frame", BY_CONTACT if by_contact else BY_ROW, net(columns[test]), kind[test], net, places)


def trajectories(finger: Finger, places: tuple[int, ...], seed: int, steps: int) -> list[Facts]:
    """Classify how a press grows, one press or all five of a contact, by the paper's net and by support vectors."""
    its = stimulate(finger, places, seed=seed, frames=FRAMES)
    columns, press = roc.trajectories(its.counts - its.tare, its.tare, its.stimulation)
    first = np.searchsorted(its.stimulation, press)
    kind, contact = its.probe[first], its.contact[first]
    training, stopping, test = roc.split(contact, seed)
    net = roc.train(columns, kind, training, stopping, seed=seed, steps=steps)
    machine = roc.machine().fit(columns[training | stopping], kind[training | stopping])
    _, one = np.unique(contact[test], return_index=True)
    found = []
    for outputs, its_net, by in (
        (net.outputs(columns[test]), net, ""),
        (machine.decision_function(columns[test]), None, ", support vectors"),
    ):
        alone, together = roc.decide(outputs), roc.decide(outputs, contact[test])
        found += [
            _facts("press" + by, BY_CONTACT, alone, kind[test], its_net, places),
            _facts("contact of five presses" + by, BY_CONTACT, together[one], kind[test][one], its_net, places),
        ]
    return found


def _facts(
    what: str, split: str, said: roc.Integers, truth: roc.Integers, net: roc.Classifier | None, places: tuple[int, ...]
) -> Facts:
    """The figures of one classifier; without a ``net`` the entries about its weights are None."""
    its = net.net if net else None
    return {
        "what": what, "split": split, "places": list(places), "correct": number(float((said == truth).mean())),
        "confusion": roc.confusion(said, truth, len(PROBES)).tolist(),
        "gamma": number(its.gamma) if its else None, "weights": its.weights if its else None,
        "steps": its.steps if its else None,
    }  # fmt: skip
