"""The sensors' image read as other drivers read a BioTac: 0x0100 to listen, the select high between words, 1 MHz."""

import json
import subprocess
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from deframer import Deframer

from biotac.wire import messages_gen as wire
from biotac.wire import sensor_gen as sensor
from biotac.wire.framing import encode
from biotac_rig import emu_gen as emu

ROOT = Path(__file__).resolve().parents[2]
SLOTS = 55
ROUND = len(sensor.SLOTS)
SETTLE_US, GAP_US = 50, 10
LISTEN_0100 = 0x0100
DELAY_WORD, EMPTY_WORD = 0xA52D, 0xA55F


@pytest.fixture(scope="session")
def image(two_picos: None) -> Path:
    return ROOT / "build/sensor-board/biotac-sensor.bin"


def word_of(count: int) -> int:
    """The word of two bytes with odd parity, as in the product manual."""
    odd = lambda byte: byte | (byte.bit_count() + 1) % 2  # noqa: E731
    return odd(count >> 5 << 1) << 8 | odd((count & 31) << 3)


def run(
    image: Path, folder: Path, samples: list[int], course: list[dict[str, Any]], *, then: bytes = b""
) -> dict[str, Any]:
    """``then``: bytes from the host behind the tape."""
    sent = encode(emu.EmuPlug.ID, emu.EmuPlug(1, 0, 1, (0,) * 16).pack())
    sent += encode(emu.EmuTape.ID, emu.EmuTape(2, 1, len(samples), 0, padded(samples)).pack())
    (folder / "said").write_bytes(sent + then)
    (folder / "course").write_text(json.dumps(course))
    words = ["node", Path(__file__).with_name("other_driver.mjs"), image, folder / "said", folder / "course"]
    answer: dict[str, Any] = json.loads(subprocess.run(words, check=True, capture_output=True).stdout)
    return answer


def reading(slot: int, *, theirs: bool = False) -> list[dict[str, Any]]:
    """A sample command and the word that fetches the answer, as a public driver does it or as ours does."""
    hz = 1e6 if theirs else 4.4e6
    listen = LISTEN_0100 if theirs else sensor.LISTEN_WORD
    command = sensor.CHANNEL_COMMAND[sensor.SLOTS[slot % ROUND]]
    return [{"mosi": command << 8, "hz": hz, "wait_us": SETTLE_US}, {"mosi": listen, "hz": hz, "wait_us": GAP_US}]


@pytest.mark.nightly
def test_both_ways_of_reading_get_the_tape(image: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(19)
    samples = [int(count) for count in rng.integers(0, 4096, SLOTS)]
    course = [step for k in range(SLOTS) for step in reading(k, theirs=k < SLOTS // 2)]
    answer = run(image, tmp_path, samples, course)
    assert answer["words"][1::2] == [word_of(count) for count in samples]
    assert answer["counters"]["late_edges"] == 0
    print({name: answer["counters"][name] for name in ("answer_ns", "answer_left_ns")})
    assert answer["counters"]["answer_ns"] < 500  # this driver's time between select and clock


@pytest.mark.nightly
def test_the_fifty_microseconds_are_kept_and_a_sample_is_given_once(image: Path, tmp_path: Path) -> None:
    command = sensor.CHANNEL_COMMAND[sensor.SLOTS[0]] << 8
    steps = [(command, 30), (sensor.LISTEN_WORD, 51), (sensor.LISTEN_WORD, 20), (sensor.LISTEN_WORD, 20)]
    course = [{"mosi": mosi, "hz": 5e6, "wait_us": wait_us} for mosi, wait_us in steps]
    words = run(image, tmp_path, [1234, 77], course)["words"]
    assert words[1:] == [DELAY_WORD, word_of(1234), EMPTY_WORD]


KEPT = [int(count) for count in np.random.default_rng(20).integers(0, 4096, ROUND)]


def keep(slots: int, crc32: int) -> bytes:
    return encode(emu.EmuKeep.ID, emu.EmuKeep(3, slots, crc32).pack())


def digest(samples: list[int]) -> int:
    return zlib.crc32(np.array(samples, "<u2").tobytes())


def answers(answer: dict[str, Any]) -> list[Any]:
    known = {**wire.MESSAGES, **emu.MESSAGES}
    return [known[kind].unpack(payload) for kind, payload in Deframer().feed(bytes.fromhex(answer["said"]))]


def test_a_tape_that_is_kept_is_played_over_and_over_from_power_up_on(image: Path, tmp_path: Path) -> None:
    course = [{"power": True}] + [step for slot in range(3 * ROUND) for step in reading(slot)]
    answer = run(image, tmp_path, KEPT, course, then=keep(ROUND, digest(KEPT)))
    assert isinstance(answers(answer)[-1], emu.EmuStatus)
    assert answer["words"][1::2] == 3 * [word_of(count) for count in KEPT]


@pytest.mark.nightly
def test_what_is_not_whole_is_not_kept_and_what_was_is_forgotten_when_told_so(image: Path, tmp_path: Path) -> None:
    not_these = [
        (ROUND, digest(KEPT) ^ 1),
        (ROUND - 1, digest(KEPT[:-1])),
        (2 * ROUND, digest(2 * KEPT)),
        (2**32 - 1, 0),
    ]
    then = b"".join(keep(slots, crc32) for slots, crc32 in [*not_these, (ROUND, digest(KEPT)), (0, 0)])
    answer = run(image, tmp_path, KEPT, [{"power": True}, *reading(0)], then=then)
    refused = wire.Reply(3, emu.EmuKeep.ID, wire.Error.NOT_WHOLE)
    assert answers(answer)[-6:-2] == [refused] * 4
    assert all(isinstance(status, emu.EmuStatus) for status in answers(answer)[-2:])
    assert answer["words"][1] == 0x0000  # nothing is played


def test_a_hostile_tape_is_refused_or_left_and_what_there_was_is_played(image: Path, tmp_path: Path) -> None:
    nobody, six, empty, too_long = (0, 1, ROUND), (6, 1, ROUND), (1, 0, ROUND), (5, 23, ROUND)
    other_fingers, again, a_gap = (2, 1, ROUND), (1, 1, 3), (1, 1, 99)
    tapes = (nobody, six, empty, too_long, other_fingers, again, a_gap)
    then = b"".join(encode(emu.EmuTape.ID, emu.EmuTape(7, *facts, (0,) * 220).pack()) for facts in tapes)
    answer = run(image, tmp_path, KEPT, [step for slot in range(ROUND + 1) for step in reading(slot)], then=then)
    refused, left = answers(answer)[-7:-3], answers(answer)[-3:]
    assert refused == [wire.Reply(7, emu.EmuTape.ID, wire.Error.OUT_OF_RANGE)] * 4
    assert [status.slots_taken for status in left] == [ROUND] * 3
    # Behind the last slot, as after a host killed in the middle, a sensor is silent.
    assert answer["words"][1::2] == [*(word_of(count) for count in KEPT), 0x0000]


@pytest.mark.nightly
def test_by_time_a_bus_of_half_the_speed_gets_every_other_round(image: Path, tmp_path: Path) -> None:
    tape = [int(count) for count in np.random.default_rng(21).integers(0, 4096, 4 * ROUND)]
    more = [
        encode(emu.EmuTape.ID, emu.EmuTape(8, 1, ROUND, at, padded(tape[at : at + ROUND])).pack())
        for at in range(ROUND, len(tape), ROUND)
    ]
    by_time = encode(emu.EmuPlay.ID, emu.EmuPlay(9, 2**32 - 1, 1, 0).pack())
    course = [step for slot in range(2 * ROUND) for step in reading(slot)]
    for listen in course[1::2]:
        listen["wait_us"] = 2e6 / sensor.SLOT_HZ - SETTLE_US  # and the words themselves
    answer = run(image, tmp_path, tape[:ROUND], course, then=b"".join(more) + by_time)
    served = tape[:ROUND] + tape[2 * ROUND : 3 * ROUND]
    assert answer["words"][1::2] == [word_of(count) for count in served]


def padded(samples: list[int]) -> tuple[int, ...]:
    return tuple(np.array(samples, "<u2").tobytes().ljust(220, b"\0"))
