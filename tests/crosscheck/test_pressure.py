"""The check of pressure: a board's own frames pass at every setting, errors are found, and gaps are counted."""

from typing import Any

import numpy as np
import pytest

from biotac import Finger, FrameFlags, Setting
from biotac.kernels.compiled import default_settings
from biotac.recording.crosscheck import CrossCheck
from biotac.wire import messages_gen as wire
from biotac.wire.dtypes_gen import DTYPES

GAIN, FILTER = Setting.PRESSURE_GAIN_NN, Setting.PRESSURE_FILTER_MILLI
ROUNDS = 600


def frames(settings: dict[Setting, int], seed: int = 1) -> Any:
    """A board's frames of a finger that rests, is pressed in steps, loses words and reads the ends of the range."""
    rng = np.random.default_rng(seed)
    pdc = np.rint(1326 + rng.normal(0, 2, ROUNDS)).astype(np.uint16)
    pdc[250:400] += (500 * rng.random(150)).astype(np.uint16)
    pdc[300:310], pdc[320], pdc[330] = wire.INVALID_COUNT, 0, 4095
    counts = np.rint(2900 + rng.normal(0, 1.5, (ROUNDS, 19))).astype(np.uint16)
    rows = Finger(settings).feed(counts, pdc=pdc)
    out = np.zeros(len(rows), DTYPES[wire.FrameMessage.ID])
    for name in out.dtype.names or ():
        out[name] = rows[name]
    return out


@pytest.mark.parametrize("gain_nn", [0, 1, 10_000_000, 99_999_999])
@pytest.mark.parametrize("milli", [10, 333, 1000])
def test_what_a_board_sends_is_never_called_wrong(gain_nn: int, milli: int) -> None:
    settings = default_settings() | {GAIN: gain_nn, FILTER: milli}
    outcome = CrossCheck()
    sent = frames(settings)
    for k in range(0, ROUNDS, 37):
        outcome.add(sent[k : k + 37], settings)
    assert (outcome.violations, outcome.findings) == (0, [])
    assert outcome.pressure.starts == 1  # the very first; after a missing word the filter begins anew, which is checked
    assert 0 <= outcome.pressure.filter_max <= outcome.pressure.filter_bound
    assert outcome.pressure.force_n_max <= 0.5e-4 + 1e-9
    assert (outcome.pressure.force_n_max > 0) == (gain_nn > 0)


SETTINGS = default_settings() | {GAIN: 12_345_678, FILTER: 500}


@pytest.mark.parametrize(
    ("field", "row", "off_by", "value", "words"),
    [
        ("pressure_force_100un", 280, 1, None, "force from pressure off by"),
        ("pressure_force_100un", 280, -1, None, "force from pressure off by"),
        ("pdc_filtered_q4", 280, 3, None, "filtered pressure off by"),
        ("pdc_filtered_q4", 280, -3, None, "filtered pressure off by"),
        # Zero or stale for invalid, and the reverse; a word is missing at 305, and railed at 320.
        ("pressure_force_100un", 280, 0, wire.INVALID_I32, "force from pressure is valid on one side only"),
        ("pressure_force_100un", 305, 0, 0, "force from pressure is valid on one side only"),
        ("pdc_filtered_q4", 280, 0, wire.INVALID_COUNT, "filtered pressure is valid on one side only"),
        ("pdc_filtered_q4", 305, 0, 16 * 1326, "filtered pressure is valid on one side only"),
        ("pdc_filtered_q4", 320, 0, 0, "filtered pressure is valid on one side only"),
    ],
)
def test_one_wrong_number_is_found(field: str, row: int, off_by: int, value: int | None, words: str) -> None:
    sent = frames(SETTINGS)
    sent[field][row] = int(sent[field][row]) + off_by if value is None else value
    outcome = CrossCheck()
    outcome.add(sent, SETTINGS)
    assert outcome.violations >= 1
    assert any(finding.startswith(f"finger 0 frame {row} ") and words in finding for finding in outcome.findings)


def test_frames_after_a_gap_are_taken_as_told_and_counted_and_the_next_are_checked() -> None:
    sent = np.delete(frames(SETTINGS), slice(260, 275))
    outcome = CrossCheck()
    outcome.add(sent, SETTINGS)
    assert (outcome.violations, outcome.pressure.starts) == (0, 2)
    wrong = sent.copy()
    wrong["pdc_filtered_q4"][260] += 160  # the first after the gap: nothing is before it
    outcome = CrossCheck()
    outcome.add(wrong, SETTINGS)
    assert any("frame 276" in f and "filtered pressure off by" in f for f in outcome.findings)


def test_a_stale_filter_is_found() -> None:
    """As of a board that forgets to run the filter while nobody asks."""
    sent = frames(SETTINGS)
    sent["pdc_filtered_q4"][270:290] = sent["pdc_filtered_q4"][269]
    outcome = CrossCheck()
    outcome.add(sent, SETTINGS)
    assert outcome.violations > 15


def test_what_nobody_asked_for_is_no_fault() -> None:
    sent = frames(SETTINGS)
    sent["pdc_filtered_q4"], sent["pressure_force_100un"] = wire.INVALID_COUNT, wire.INVALID_I32
    asked = CrossCheck()
    asked.add(sent, SETTINGS)
    assert asked.violations > 500
    sent["flags"] |= np.uint32(FrameFlags.NOT_ASKED)
    outcome = CrossCheck()
    outcome.add(sent, SETTINGS)
    assert outcome.violations == 0
