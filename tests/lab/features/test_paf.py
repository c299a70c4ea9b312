"""PAF against the paper's equations by hand."""

import numpy as np
import pytest

import biotac
from biotac.core import geometry as surface
from biotac.errors import InputError
from biotac.wire.messages_gen import INVALID_COUNT
from biotac_lab.features.paf import electrode_force, paf
from biotac_lab.features.signals import ELECTRODE_DR_MM, signals, skin


def counts(**electrodes: float) -> np.ndarray:
    """One row of signals from volts: E3=-0.5."""
    row = np.zeros((1, 19))
    for name, volt in electrodes.items():
        row[0, int(name[1:]) - 1] = volt * 4095 / 3.3
    return row


def test_equation_4_as_printed_and_without_its_rest() -> None:
    printed = electrode_force(counts(E3=-0.5, E4=0.3), as_printed=True)[0]
    assert printed[2] == pytest.approx(6.083 / 1.476)
    assert printed[3] == pytest.approx(6.083 / 2.276)
    assert printed[0] == pytest.approx(3.0784, abs=1e-4)
    ours = electrode_force(counts(E3=-0.5, E4=0.3))[0]
    assert ours[2] == pytest.approx(6.083 / 1.476 - 6.083 / 1.976)
    assert ours[3] == ours[0] == 0.0
    beyond = electrode_force(counts(E3=-2.1), as_printed=True)[0, 2]
    assert beyond == pytest.approx(40.0), "beyond the pole it saturates"


def test_equation_5_is_the_weighted_mean_of_three() -> None:
    row = counts(E1=-0.9, E2=-0.5, E18=-0.2, E5=-0.1)
    force = electrode_force(row)[0]
    three = [0, 1, 17]
    expected = (force[three, None] * ELECTRODE_DR_MM[three]).sum(axis=0) / force[three].sum()
    found = paf(row, threshold_n=0.0)
    np.testing.assert_allclose(found["dr_mm"][0], expected)
    assert found["force_n"][0] == pytest.approx(force[three].sum()) and found["valid"][0]


def test_what_is_too_light_or_missing_is_flagged_and_the_printed_threshold_holds_nothing_back() -> None:
    rest = np.zeros((1, 19))
    found = paf(rest)
    assert not found["valid"][0] and np.isnan(found["dr_mm"]).all() and found["force_n"][0] == 0.0
    assert paf(rest, as_printed=True)["valid"][0]
    missing = counts(E3=-0.9)
    missing[0, 7] = np.nan
    found = paf(missing, threshold_n=0.0)
    assert not found["valid"][0] and np.isnan(found["force_n"][0])


def test_rows_of_a_board_and_their_missing_electrodes() -> None:
    with biotac.open("sim:press.toml") as hand:
        rows = hand.read(seconds=8.0)
    above = signals(rows)
    good = np.isfinite(rows["tare"]).all(axis=1)
    assert good.any() and np.isnan(above[~np.isfinite(rows["tare"])]).all()
    np.testing.assert_array_equal(above[good], (rows["counts"] - rows["tare"].astype(float))[good])
    pressed = paf(rows, threshold_n=0.2)  # a 7 mm flat spreads the 5 N: Eq 4 finds little under any one electrode
    assert pressed["valid"].any() and not pressed["valid"].all()
    rows["counts"][:, 4] = INVALID_COUNT
    assert np.isnan(signals(rows)[:, 4]).all()
    with pytest.raises(InputError, match="rows have no tare: expected frames"):
        signals(rows[["counts", "pdc"]])
    with pytest.raises(InputError, match=r"\(3, 18\): expected frames"):
        signals(np.zeros((3, 18)))


def test_the_skin_s_coordinates() -> None:
    r = surface.RADIUS_MM
    at = skin(np.array([[-16.0, 0.0, -r], [0.0, 0.0, -r], [-4.0, r, 0.0], [-4.0, -r, 0.0]]))
    quarter = np.pi / 2 * r
    np.testing.assert_allclose(at, [[0, 0], [16, 0], [12, quarter], [12, -quarter]], atol=1e-9)
