"""The cross-check itself: right results pass at every gain, wrong ones are named by axis."""

import numpy as np
import pytest
from core_in_units import on_board

import biotac
from biotac import FrameFlags, Setting
from biotac.kernels.compiled import default_settings
from biotac.recording.crosscheck import CrossCheck
from biotac.wire import messages_gen as wire
from biotac.wire.dtypes_gen import DTYPES

TORQUE = (Setting.TORQUE_GAIN_Y_NN, Setting.TORQUE_GAIN_Z_NN)
FORCE = (Setting.FORCE_GAIN_X_NN, Setting.FORCE_GAIN_Y_NN, Setting.FORCE_GAIN_Z_NN)


def frames(n: int, settings: dict[Setting, int], seed: int = 1) -> np.ndarray:
    """FRAME messages that a board with these settings would send for random counts."""
    rng = np.random.default_rng(seed)
    out = np.zeros(n, DTYPES[wire.FrameMessage.ID])
    out["seq"] = np.arange(n)
    out["counts"] = rng.integers(1, 4096, (n, 19))  # 0 is a bound or out
    tare = rng.uniform(0, 4095, (n, 19))
    out["tare_q4"] = np.floor(tare * 16 + 0.5)
    board = on_board(out["counts"], tare, settings)
    for field, values, scale, invalid in (
        ("poc_um", board.poc_mm, 1e3, wire.INVALID_I16),
        ("force_100un", board.force_n, 1e4, wire.INVALID_I32),
        ("torque_mnmm", board.torque_nmm, 1e3, wire.INVALID_I32),
    ):
        out[field] = np.where(np.isnan(values), invalid, np.rint(np.nan_to_num(values) * scale))
    out["pdc"] = out["pdc_filtered_q4"] = wire.INVALID_COUNT
    out["pressure_force_100un"] = out["torsion_mnmm"] = wire.INVALID_I32
    out["flags"] = np.where(np.isnan(board.poc_mm[:, 0]), int(FrameFlags.POC_INVALID), 0)
    return out


@pytest.mark.parametrize("gain_nn", [0, 1, 111, -2_262_234, 100_000_000])
@pytest.mark.parametrize("weights", [0, 1, 2])
def test_what_a_board_sends_is_never_called_wrong(gain_nn: int, weights: int) -> None:
    settings = default_settings() | dict.fromkeys((*TORQUE, *FORCE), gain_nn) | {Setting.POC_WEIGHTS: weights}
    outcome = CrossCheck()
    outcome.add(frames(20_000, settings), settings)
    assert (outcome.frames, outcome.violations, outcome.findings) == (20_000, 0, [])


@pytest.mark.parametrize("setting", Setting)
def test_a_press_is_never_called_wrong_whatever_setting_is_at_an_end(setting: Setting) -> None:
    outcome, ends = CrossCheck(), wire.SETTINGS[setting]
    with biotac.open("sim:press.toml?seconds=3") as hand:
        hand.board.set_setting(setting, ends.high if ends.default != ends.high else ends.low)
        outcome.add(hand.read_batch(3.0).wire, hand.board.settings())
    assert (outcome.frames, outcome.violations, outcome.findings) == (300, 0, [])


@pytest.mark.parametrize(
    ("field", "axis", "words"), [("torque_mnmm", 1, "torque y off"), ("force_100un", 2, "force z off")]
)
def test_a_wrong_digit_is_named_with_its_axis_and_its_own_bound(field: str, axis: int, words: str) -> None:
    settings = default_settings() | {Setting.FORCE_MODEL: wire.ForceModel.LIN}  # frames() gives no flag of another
    sent = frames(50, settings)
    sent[field][17, axis] += 40
    outcome = CrossCheck()
    outcome.add(sent, settings)
    assert outcome.violations == 1
    (finding,) = outcome.findings
    assert finding.startswith("finger 0 frame 17 ")
    assert words in finding
    off, bound = (float(part.split()[0]) for part in finding.split(" off by ")[1].split(", bound "))
    assert off > bound
