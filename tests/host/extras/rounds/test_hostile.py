"""Damaged or hostile messages are refused in words, without any other error."""

import os
import random
from pathlib import Path

import numpy as np
import pytest
from robot_messages import ALL, HAND, START_NS, Robot

import biotac
from biotac.errors import BiotacError, PortError
from biotac.extras.rounds.message import RefusedError
from biotac.extras.rounds.ros import decoder
from biotac.extras.rounds.words import RoundMaker
from biotac.sim.loading import load_source
from biotac.wire import messages_gen as wire

TRIES = int(os.environ.get("BIOTAC_FUZZ_TRIES", "1000"))  # of each kind; 100 000 by hand
ROWS = load_source("press.toml", fingers=1, seconds=3.0).samples.astype(int)
NS = START_NS + 500_000_000  # of row 50


@pytest.mark.parametrize(("kind", "ros1"), [(ALL, True), (ALL, False), (HAND, True), (HAND, False)])
def test_damaged_bytes_are_messages_or_refused(kind: str, ros1: bool) -> None:
    robot = Robot(kind, pac=True, ros1=ros1)
    good = [robot.bytes_of(robot.message(START_NS + k * 10_000_000, list(ROWS[k]))) for k in range(20)]
    decode = decoder(kind, robot.definition, ros1=ros1)
    rounds = RoundMaker("fuzz", [decode(raw, 0) for raw in good])
    draw, outcomes = random.Random(kind + str(ros1)), [0, 0]
    for _ in range(TRIES):
        raw = bytearray(draw.choice(good))
        for _ in range(draw.randint(1, 8)):
            raw[draw.randrange(len(raw))] = draw.choice((0, 1, 0x7F, 0x80, 0xFF, draw.randrange(256)))
        if draw.random() < 0.3:
            raw = raw[: draw.randrange(len(raw))] + bytes(draw.randrange(64))
        try:
            made = rounds.add(decode(bytes(raw), 1))
            outcomes[0] += 1
            assert made is None or ((made.words <= 4095) | (made.words == wire.INVALID_COUNT)).all()
        except RefusedError as error:
            outcomes[1] += 1
            assert str(error)
    assert min(outcomes) > 20
    print(f"{kind} ros{2 - ros1}: {outcomes[0]} taken, {outcomes[1]} refused")


def test_a_definition_that_is_none_is_refused() -> None:
    draw, text = random.Random(1), Robot().definition
    for _ in range(100):
        cut = draw.randrange(len(text))
        put = draw.choice(("\0", "[99999999]", "int16[] x\n", "{", "float64 electrodes\n"))
        with pytest.raises(RefusedError):
            decoder(ALL, text[:cut] + put + text[cut + 3 :], ros1=True)(bytes(400), 0)


def message(robot: Robot, ns: int = NS, words: int = 44, fingers: int = 1) -> bytes:
    return robot.bytes_of(robot.message(ns, [np.resize(ROWS[50, 0], words)] * fingers))


HOSTILE = [
    (message(Robot(), words=10025), "10000 electrodes, expected 19"),
    (message(Robot(), ns=NS - 10**10), "its stamp is not after the one before"),
    (message(Robot())[:8] + b"\xff" * 4 + message(Robot())[12:], "4294967295 ns, expected 0 to 10"),
    (message(Robot(), fingers=6), "tactiles has 6 entries, expected at most 5"),
    (b"\1", "of 1 bytes is no such message"),
]


@pytest.mark.parametrize(("raw", "words"), HOSTILE)
def test_one_hostile_message_among_good_ones_is_left_out(tmp_path: Path, raw: bytes, words: str) -> None:
    robot = Robot()
    whole = [robot.bytes_of(robot.message(START_NS + k * 10_000_000, list(row))) for k, row in enumerate(ROWS)]
    whole[50] = raw
    sent = iter(whole)
    robot.bytes_of = lambda message: next(sent)  # type: ignore[method-assign]
    with biotac.open(robot.write(tmp_path / "a.bag", ROWS)) as hand:
        frames = hand.read(100.0)
        assert any(words in text for text in hand.link.notes), hand.link.notes
    assert len(frames) == len(ROWS) - 1 and not np.isnan(frames["force_n"][100:]).any()


def test_a_bag_of_nothing_else_or_cut_off_ends_in_words(tmp_path: Path) -> None:
    robot, path, draw = Robot(), tmp_path / "a.bag", random.Random(2)
    robot.write(path, ROWS)
    whole = path.read_bytes()
    for _ in range(10):
        path.write_bytes(whole[: draw.randrange(len(whole))])
        with pytest.raises(BiotacError):
            biotac.open(f"bag:{path}").read(100.0)
    robot.bytes_of = lambda message: b"\2" * 17  # type: ignore[method-assign]
    with pytest.raises(PortError, match=r"no messages of a BioTac: .* of 17 bytes is no such message"):
        biotac.open(robot.write(tmp_path / "b.bag", ROWS))
