"""Clusters on the skin's graph, by hand."""

import numpy as np
import pytest

from biotac.core import geometry as surface
from biotac_lab.features import several
from biotac_lab.features.signals import ELECTRODE_DR_MM


def signals(**electrodes: float) -> np.ndarray:
    row = np.zeros(19)
    for name, counts in electrodes.items():
        row[int(name[1:]) - 1] = -counts
    return row


def test_the_graph_is_the_skin_s() -> None:
    graph = several.NEIGHBOURS
    assert (graph == graph.T).all() and not graph.diagonal().any() and graph.any(axis=1).all()
    mirrored = [int(np.argmin(np.linalg.norm(ELECTRODE_DR_MM - one, axis=1))) for one in ELECTRODE_DR_MM * [1, -1]]
    assert (graph == graph[np.ix_(mirrored, mirrored)]).all()
    reached = np.linalg.matrix_power(graph.astype(int) + np.eye(19, dtype=int), 18)
    assert (reached > 0).all(), "one piece: any two electrodes are connected"


def test_one_pressed_electrode_is_one_contact_over_it_and_nothing_is_none() -> None:
    assert several.contacts(np.zeros(19)) == []
    (one,) = several.contacts(signals(E19=900))
    assert one == several.Contact(one.poc_mm, share=1.0, electrodes=(18,))
    np.testing.assert_allclose(one.poc_mm, surface.project(surface.ELECTRODE_MM[[18]])[0])
    missing = signals(E19=900)
    missing[4] = np.nan
    assert several.contacts(missing) == []


def test_two_far_ones_are_two_and_a_bridge_makes_them_one() -> None:
    first, second = several.contacts(signals(E10=900, E18=700))
    assert first.electrodes == (9,) and second.electrodes == (17,)
    assert first.share + second.share == pytest.approx(1.0) and first.share > second.share
    assert len(several.contacts(signals(E18=900, E17=850))) == 2, "7 mm apart: not neighbours"
    assert len(several.contacts(signals(E18=900, E19=850))) == 1
