"""biotac.Finger: the board's own code over recorded counts, compared with the frames of a simulated board."""

import itertools

import numpy as np
import pytest

import biotac
from biotac import FRAME_DTYPE, FrameFlags, QuantityFlags, Setting, TareReason, TareState
from biotac.core.finger import FINGER_DTYPE, ROUND_US, Finger, to_frames
from biotac.sim import load_source
from biotac.wire import messages_gen as wire
from biotac.wire import slots
from biotac.wire.dtypes_gen import DTYPES

WIRE_FIELDS = DTYPES[wire.FrameMessage.ID].names
EVERYTHING = QuantityFlags.POC | QuantityFlags.FORCE | QuantityFlags.TORQUE
ALL_ROUNDS = EVERYTHING | QuantityFlags.REST_FRAMES


def words_of(name: str, finger: int) -> dict[str, np.ndarray]:
    """Samples of the emulated sensor as Finger.feed takes them: a tape's codes are no counts."""
    samples = load_source(name).samples[:, finger].copy()
    samples[samples > 4095] = wire.INVALID_COUNT
    return {
        "counts": samples[:, slots.ELECTRODE_SLOT],
        "pdc": samples[:, slots.PDC_SLOT],
        "tac": samples[:, slots.TAC_SLOT],
        "tdc": samples[:, slots.TDC_SLOT],
        "pac": samples[:, slots.PAC_SLOT],
    }


@pytest.mark.parametrize("name", ["press.toml", "shear.toml", "faults.toml"])
def test_every_bit_is_the_one_that_the_simulated_board_sends(name: str) -> None:
    with biotac.open(f"sim:{name}") as hand:
        settings = hand.board.settings()
        hand.stream("poc", "force", "torque", "pac")
        sent = hand.read_batch(60.0)
    tares = [m for m in sent.messages if isinstance(m, wire.Tare)]
    for index in np.unique(sent.wire["finger"]):
        board = sent.wire[sent.wire["finger"] == index]
        words = words_of(name, int(index))
        assert len(board) > 500
        # Both count 10 ms rounds; only the reading of the board's clock at the first one differs.
        good = np.any(
            [(channel != wire.INVALID_COUNT).reshape(len(channel), -1).any(axis=1) for channel in words.values()],
            axis=0,
        )
        start_us = int(board["t_us"][0]) - ROUND_US * int(np.argmax(good))
        sent_rounds = (board["t_us"] - np.uint32(start_us)) // ROUND_US
        # A sensor that comes back is asked for its serial number, and not sampled in that round.
        asked = np.setdiff1d(np.flatnonzero(good[: sent_rounds[-1] + 1]), sent_rounds)
        assert len(asked) == (3 if (name, index) == ("faults.toml", 1) else 0)
        for channel in words.values():
            channel[asked] = wire.INVALID_COUNT
        rows = Finger(settings, index=int(index), quantities=ALL_ROUNDS).feed(**words)
        rows = rows[rows["present"] != 0][: len(board)]
        rows["t_us"] += np.uint32(start_us)
        board["flags"] &= ~np.uint32(FrameFlags.SENSOR_UNSURE)  # until it has answered; counts do not tell
        for field in WIRE_FIELDS:
            np.testing.assert_array_equal(rows[field], board[field], err_msg=f"{name} finger {index} {field}")
        # The reasons travel in TARE messages.
        changed = rows[(rows["flags"] & FrameFlags.TARE_CHANGED) != 0]
        tares_sent = {(m.seq, m.reason, m.noise_count2) for m in tares if m.finger == index}
        assert tares_sent >= {(int(r["seq"]), int(r["tare_reason"]), int(r["noise_count2"])) for r in changed}
        assert len(changed) >= 2


def test_rounds_in_pieces_are_the_rounds_in_one(tmp_path) -> None:
    words = words_of("press.toml", 0)
    whole = Finger().feed(**words)
    finger = Finger()
    cuts = [0, 1, 17, 400, 401, len(whole)]
    pieces = [finger.feed(**{k: v[a:b] for k, v in words.items()}) for a, b in itertools.pairwise(cuts)]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)
    finger.reset()
    np.testing.assert_array_equal(finger.feed(**words), whole)


def test_a_touch_is_told_in_its_slot_and_the_energy_is_that_of_the_signals() -> None:
    rest = np.full((40, 19), 3000)
    pressed = np.full((5, 19), 3000)
    pressed[:, 3] -= 60  # 3600 count^2; the first of them could be a glitch and is held back
    finger = Finger()
    finger.feed(rest)
    rows = finger.feed(pressed)
    assert rows["energy_count2"].tolist() == [0, 3600, 3600, 3600, 0]  # a touched finger is not asked
    assert rows["touch_slot"].tolist() == [255, 7 + 2 * 3, 255, 255, 255]
    assert rows["tare_state"].tolist() == [TareState.REST] * 3 + [TareState.CONTACT] * 2
    assert rows["tare_reason"][-1] == TareReason.ROLL_BACK
    assert rows["threshold_count2"].tolist() == [1000] * 5
    assert (rows["flags"] & FrameFlags.PDC_MISSING).all()


def test_pressure_at_a_rail_is_no_good_pressure() -> None:
    rows = Finger().feed(np.full((4, 19), 3000), pdc=np.array([2000, 0, 4095, 2000]))
    assert ((rows["flags"] & FrameFlags.PDC_MISSING) != 0).tolist() == [False, True, True, False]


def test_a_silent_sensor_leaves_rows_without_numbers() -> None:
    finger = Finger()
    rest = np.full((40, 19), 3000)
    finger.feed(rest)
    gap = finger.feed(np.full((24, 19), 0xFFFF))
    assert not gap["present"].any() and (gap["seq"] == 39).all()
    assert (gap["force_100un"] == wire.INVALID_I32).all() and (gap["counts"] == 0xFFFF).all()
    # However long: the same sensor has its tare again. A board asks which sensor it is; words do not tell.
    finger.feed(np.full((2000, 19), 0xFFFF))
    back = finger.feed(rest[:1])
    assert back["seq"][0] == 40 and back["tare_state"][0] == TareState.REST
    assert len(to_frames(gap)) == 0


def test_frames_come_out_in_units() -> None:
    rows = Finger().feed(**words_of("press.toml", 0))
    frames = to_frames(rows)
    assert frames.dtype == FRAME_DTYPE and len(frames) == len(rows)
    k = int(np.argmax(np.abs(rows["force_100un"][:, 2].astype(np.int64) * (rows["tare_state"] == TareState.CONTACT))))
    np.testing.assert_allclose(frames["force_n"][k], rows["force_100un"][k] / 1e4)
    np.testing.assert_allclose(frames["poc_mm"][k], rows["poc_um"][k] / 1e3)
    assert np.isnan(frames["force_n"][0]).all()


def test_host_tares_are_the_boards() -> None:
    finger = Finger()
    with pytest.raises(biotac.CommandRefusedError, match=r"TARE_NOW was refused: NOT_STILL"):
        finger.tare_now()
    assert np.isnan(finger.tare_counts).all()
    stored = 3000 + np.arange(19) / 16
    finger.set_tare(stored, 1326.25)
    rows = finger.feed(np.full((1, 19), 3000), [1326])
    assert rows["tare_q4"][0].tolist() == [48000 + k for k in range(19)]
    assert rows["pdc_tare_q4"][0] == 21220 and rows["tare_reason"][0] == TareReason.HOST_SET
    np.testing.assert_array_equal(finger.tare_counts, stored)
    finger.feed(np.full((30, 19), 2990), np.full(30, 1326))
    finger.tare_now()
    assert finger.tare_counts.tolist() == [2990.0] * 19


def test_a_hold_ends_by_release_or_lapse() -> None:
    for end in (Finger.release, Finger.lapse):
        finger, still = Finger(quantities=ALL_ROUNDS), np.full((30, 19), 3000)
        held = [bool(finger.feed(still)["flags"][-1] & FrameFlags.HELD)]
        for act in (Finger.hold, end):
            act(finger)
            held.append(bool(finger.feed(still)["flags"][-1] & FrameFlags.HELD))
        assert held == [False, True, False]


def test_settings_and_times() -> None:
    counts = np.full((40, 19), 3000)
    counts[30:, 16] -= 10
    loud = Finger({Setting.FORCE_GAIN_Z_NN: 10_000_000}).feed(counts, t_us=2**32 - 5 + ROUND_US * np.arange(40))
    quiet = Finger({Setting.FORCE_GAIN_Z_NN: 1_000_000}).feed(counts)
    # Ten times the force: the rounding to half a unit then shows ten times.
    assert abs(int(loud["force_100un"][-1, 2]) - 10 * int(quiet["force_100un"][-1, 2])) <= 5
    assert quiet["force_100un"][-1, 2] > 50
    assert loud["t_us"][:2].tolist() == [2**32 - 5, ROUND_US - 5]
    assert quiet["t_us"].tolist() == list(range(0, 400_000, ROUND_US))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Finger().feed(np.zeros((3, 18), int)), r"counts have shape \(3, 18\), expected \(n, 19\)"),
        (lambda: Finger().feed(np.zeros((3, 19))), "counts are float64, expected integers"),
        (lambda: Finger().feed(np.full((3, 19), 4096)), "counts row 0 holds 4096"),
        (lambda: Finger().feed(np.zeros((3, 19), int), [1, 2]), r"pdc have shape \(2,\), expected \(3,\)"),
        (lambda: Finger().feed(np.zeros((1, 19), int), pac=np.zeros((1, 21), int)), "pac have shape"),
        (lambda: Finger().feed(np.zeros((1, 19), int), t_us=[0.5]), "t_us is float64"),
        (lambda: Finger(index=5), "index is 5"),
        (lambda: Finger({Setting.POC_WEIGHTS: 3}), "POC_WEIGHTS is 3"),
        (lambda: Finger().set_tare(np.full(19, 4096)), r"the tare holds 4096, expected 0\.\.4095 counts"),
        (lambda: Finger().set_tare(np.full(18, 100)), r"the tare has shape \(18,\), expected \(19,\)"),
    ],
)
def test_bad_input_is_refused_at_the_door(call, words) -> None:
    with pytest.raises(ValueError, match=words):
        call()


def test_a_refused_piece_changes_nothing() -> None:
    finger, twin = Finger(), Finger()
    good = np.full((30, 19), 3000)
    finger.feed(good)
    twin.feed(good)
    with pytest.raises(ValueError):
        finger.feed(good, np.full(30, 5000))
    np.testing.assert_array_equal(finger.feed(good), twin.feed(good))
    assert finger.feed(good[:0]).shape == (0,) and finger.feed(good[:0]).dtype == FINGER_DTYPE
