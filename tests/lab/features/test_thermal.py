"""Temperature against the recorded table and the simulator's truth; an unknown temperature stays unknown."""

import numpy as np
import pytest

from biotac.errors import InputError
from biotac.sim.sampling import tdc_counts
from biotac.wire.messages_gen import INVALID_COUNT
from biotac_lab.features.thermal import thermal


def rows(tdc: list[float]) -> np.ndarray:
    found = np.zeros(len(tdc), [("tdc", "<u2"), ("tac", "<u2")])
    found["tdc"], found["tac"] = tdc, 2053
    return found


def test_counts_of_the_reference_are_its_temperatures() -> None:
    found = thermal(rows([700, 830, 1000, 1240]))  # host/docs/reference/sensor_model.md
    np.testing.assert_allclose(found["celsius"], [21.4, 25.3, 29.8, 35.2], atol=0.06)
    there_and_back = thermal(rows(np.rint(tdc_counts(np.array([5.0, 30.0, 60.0]))).tolist()))
    np.testing.assert_allclose(there_and_back["celsius"], [5.0, 30.0, 60.0], atol=0.05)


def test_what_is_missing_or_not_credible_is_flagged() -> None:
    found = thermal(rows([INVALID_COUNT, 0, 4095, 1000]))
    assert found["valid"].tolist() == [False, False, False, True]
    assert np.isnan(found["celsius"][:3]).all()


def test_heat_flux_stays_in_counts() -> None:
    some = rows([1000, 1000, 1000])
    some["tac"] = [2053, 2060, INVALID_COUNT]
    found = thermal(some)
    assert found["flux_counts"][:2].tolist() == [0.0, 7.0] and np.isnan(found["flux_counts"][2])
    assert not found["flux_is_si"].any()
    with pytest.raises(InputError, match="rows have no tac: expected frames"):
        thermal(some[["tdc"]])
