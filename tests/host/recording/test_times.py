"""Another sensor's times in any unit and state: one sentence that says how they look, or an alignment."""

import numpy as np
import pytest

import biotac
from biotac.calibrate.reference.samples import Samples, checked


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A selection of 150 s, and the force that made it, 100 a second on another clock."""
    path = tmp_path_factory.mktemp("times") / "c.mcap"
    with biotac.open("sim:calibrate.toml?fingers=1&seconds=150") as hand, hand.record(path):
        hand.read_batch(200)
    recording = biotac.Recording(path)
    own = recording.frames["finger"] == 0
    return recording.select(fingers=0, fields=["counts"]), recording.applied_n[own], recording.t_us[own] / 1e6 + 7.0


def twice(t: np.ndarray) -> np.ndarray:
    return np.insert(t, 500, t[500])


def jumped(t: np.ndarray) -> np.ndarray:
    return t + 400 * 86_400.0 * (np.arange(len(t)) > 3000)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t * 1e3, "t looks like ms: expected s"),
        (lambda t: t * 1e6, "t looks like us: expected s"),
        (lambda t: t * 1e9, "t looks like ns: expected s"),
        (lambda t: (t * 1e9).astype("datetime64[ns]"), r"t is datetime64\[ns\]: expected s"),
        (lambda t: t[::-1], "time runs backwards"),
        (lambda t: np.roll(t, 7), "sort the samples"),
        (jumped, "clock jumps by 3.456e"),
        (lambda t: t[:-1], "expected 15000 numbers, a time a sample"),
        (lambda t: np.round(t * 20) / 20, "were they rounded"),
    ],
)
def test_a_wrong_time_is_one_sentence(run, change, words: str) -> None:
    selection, force_n, t_s = run
    with pytest.raises(biotac.RecordingError, match=words) as caught:
        selection.align(force_n, change(t_s))
    assert "\n" not in str(caught.value)
    if len(changed := change(t_s)) == len(t_s) and changed.dtype.kind == "f":
        with pytest.raises(biotac.RecordingError, match=words):
            checked("a.csv", Samples(changed, force_n))


def test_of_an_equal_pair_one_is_kept_and_told(run) -> None:
    selection, force_n, t_s = run
    offset_s = selection.align(force_n, t_s)[1].offset_s
    doubled = np.insert(force_n, 500, force_n[500], axis=0)
    with pytest.warns(biotac.RecordingWarning, match=r"1 sample\(s\) have the time of the one before.*kept"):
        assert selection.align(doubled, twice(t_s))[1].offset_s == pytest.approx(offset_s, abs=1e-3)
    with pytest.warns(biotac.RecordingWarning, match="one before"):
        assert len(checked("a.csv", Samples(twice(t_s), doubled))) == len(t_s)
