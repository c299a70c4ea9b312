#!/usr/bin/env python3
"""Write the golden vectors in protocol/vectors/ that the C and the Python tests read.

    tools/make/vectors.py           write the files
    tools/make/vectors.py --check   exit 1, naming the files, when any of them has drifted

Nothing here uses the project's own code: COBS comes from the `cobs` package, CRC-32 from zlib, the layout from
link.toml by struct. The result of each hostile case is stated by hand beside it. A second opinion (`judge`), from the
same libraries, must agree before anything is written.
"""

from __future__ import annotations

import random
import struct
import sys
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cobs import cobs

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib

from committed import ROOT, write_or_check

LINK: dict[str, Any] = tomllib.loads((ROOT / "protocol/link.toml").read_text(encoding="utf-8"))

HEADER = "# Written by tools/make/vectors.py; do not edit. Format: README.md beside this file.\n"
CODE = {"u8": "B", "u16": "H", "u32": "I", "i16": "h", "i32": "i"}
LIMITS = {"u8": (0, 2**8 - 1), "u16": (0, 2**16 - 1), "u32": (0, 2**32 - 1)} | {
    "i16": (-(2**15), 2**15 - 1),
    "i32": (-(2**31), 2**31 - 1),
}
MAX_ENCODED = LINK["wire"]["max_frame_bytes"] + 1  # one COBS code byte
COUNTS = ("too_long", "bad_cobs", "bad_crc", "bad_length")
BYTES_PER_LINE = 48

Frames = list[tuple[int, bytes]]


# ---- messages --------------------------------------------------------------------------------


def layout(name: str) -> list[tuple[str, str, int]]:
    """(field, type, count) of one message."""
    return [(f["name"], f["type"], f.get("count", 1)) for f in LINK["message"][name]["fields"]]


def pack(name: str, values: dict[str, list[int]]) -> bytes:
    return b"".join(struct.pack(f"<{count}{CODE[kind]}", *values[f]) for f, kind, count in layout(name))


def payload_bytes() -> dict[int, int]:
    return {m["id"]: len(pack(name, filled(name, 0))) for name, m in LINK["message"].items()}


def filled(name: str, end: int) -> dict[str, list[int]]:
    """Every value at the lower (0) or the upper (1) end of the type's range."""
    return {f: [LIMITS[kind][end]] * count for f, kind, count in layout(name)}


def counting(name: str) -> dict[str, list[int]]:
    """Payload bytes 1, 2, 3...: no two fields or elements are equal, so that swapping any two shows."""
    values, at = {}, 1
    for f, kind, count in layout(name):
        size = struct.calcsize(CODE[kind]) * count
        values[f] = list(struct.unpack(f"<{count}{CODE[kind]}", bytes(k & 0xFF for k in range(at, at + size))))
        at += size
    return values


def special_values() -> list[tuple[str, str, dict[str, list[int]]]]:
    """(message, case, values) with a meaning."""
    untared = filled("FRAME", 0) | {
        "counts": [2048, 0xFFFF, 0, 4095] + [0xFFFF] * 15,
        "pdc": [0xFFFF],
        "tac": [0xFFFF],
        "tdc": [0xFFFF],
        "pdc_tare_q4": [0xFFFF],
    }
    extreme = counting("FRAME") | {
        "poc_um": [-13600, 5080, -5080],
        "force_100un": [2**31 - 1, -(2**31) + 1, -1],
        "torque_mnmm": [-(2**31), 2**31 - 1, -(2**31) + 1],
        "tare_q4": [65520] * 19,
    }
    pac = counting("PAC") | {"pac": [0, 4095, 0xFFFF] + [2000 + k for k in range(19)]}
    return [
        ("FRAME", "results_invalid_and_words_missing", untared),
        ("FRAME", "results_at_their_limits", extreme),
        ("PAC", "a_word_is_missing", pac),
        ("TARE", "pressure_never_read", counting("TARE") | {"pdc_tare_q16": [0xFFFFFFFF]}),
        ("TARE_SET", "pressure_unknown", counting("TARE_SET") | {"pdc_tare_q4": [0xFFFF]}),
        ("SET_SETTING", "minus_one", {"req_id": [1], "setting": [2], "value": [-1]}),
    ]


def messages_text() -> str:
    cases = []
    for name in LINK["message"]:
        cases += [(name, "counting", counting(name)), (name, "smallest", filled(name, 0))]
        cases.append((name, "largest", filled(name, 1)))
    out = [HEADER]
    for name, case, values in cases + special_values():
        out.append(f"message {name} {LINK['message'][name]['id']:02x} {case}\n")
        out += [f"{f} {' '.join(map(str, values[f]))}\n" for f, _, _ in layout(name)]
        out.append(f"payload {pack(name, values).hex()}\n\n")
    return "".join(out)


# ---- framing ---------------------------------------------------------------------------------


@dataclass
class Case:
    name: str
    wire: bytes
    frames: Frames
    counts: dict[str, int] = field(default_factory=dict)


def sealed(message_id: int, payload: bytes) -> bytes:
    plain = bytes([message_id]) + payload
    return plain + struct.pack("<I", zlib.crc32(plain))


def delimited(plain: bytes) -> bytes:
    return bytes(cobs.encode(plain)) + b"\0"


def frame(message_id: int, payload: bytes) -> bytes:
    return delimited(sealed(message_id, payload))


def flipped(data: bytes, at: int, mask: int) -> bytes:
    return data[:at] + bytes([data[at] ^ mask]) + data[at + 1 :]


def judge(wire: bytes) -> tuple[Frames, dict[str, int]]:
    """A second opinion on a case, from the libraries alone."""
    accepted: Frames = []
    counts = dict.fromkeys(COUNTS, 0)
    known = payload_bytes()
    for piece in wire.split(b"\0")[:-1]:
        if len(piece) > MAX_ENCODED:
            counts["too_long"] += 1
            continue
        if not piece:
            continue
        try:
            plain = cobs.decode(piece)
        except cobs.DecodeError:
            counts["bad_cobs"] += 1
            continue
        body, crc = plain[:-4], plain[-4:]
        if not body or struct.pack("<I", zlib.crc32(body)) != crc:
            counts["bad_crc"] += 1
        elif len(body) - 1 != known.get(body[0], len(body) - 1):
            counts["bad_length"] += 1
        else:
            accepted.append((body[0], bytes(body[1:])))
    return accepted, counts


def longest_without_zero() -> bytes:
    """A payload such that id 0x7F, payload and CRC fill 254 bytes, none of them zero."""
    rng = random.Random(7)
    while True:
        payload = bytes(rng.randrange(1, 256) for _ in range(249))
        if 0 not in sealed(0x7F, payload):
            return payload


def good_cases() -> list[Case]:
    every = [(m["id"], pack(name, counting(name))) for name, m in LINK["message"].items()]
    ping, stop = (0x83, b"\x05"), (0x82, b"\x06")
    zeros = [(i, bytes(n)) for i, n in payload_bytes().items()]
    ones = [(i, b"\xff" * n) for i, n in payload_bytes().items()]
    unknown = [(0x7E, b"\x01\x00\x02"), (0xF0, b"\x09")]
    longest = [(0x7F, longest_without_zero()), (0x7F, bytes(249))]

    def plain(name: str, frames: Frames) -> Case:
        return Case(name, b"".join(frame(*f) for f in frames), frames)

    return [
        plain("every_message_once", every),
        plain("two_frames_in_one_chunk", [ping, stop]),
        plain("payloads_full_of_zeros", zeros),
        plain("payloads_without_zeros", ones),
        plain("unknown_ids_with_right_crc_are_passed_on", unknown),
        plain("an_unknown_id_without_payload", [(0x7E, b"")]),
        plain("longest_frames", longest),
        plain("one_frame_sent_twice_arrives_twice", [ping, ping]),
        Case("nothing_at_all", b"", []),
        Case("delimiters_alone", b"\0" * 9, []),
        Case("empty_frames_between", b"\0\0" + frame(*ping) + b"\0\0\0" + frame(*stop) + b"\0", [ping, stop]),
        Case("the_last_frame_is_not_finished", frame(*ping) + frame(*stop)[:-1], [ping]),
    ]


def hostile_cases() -> list[Case]:
    ping = (0x83, b"\x05")
    start = (0x81, struct.pack("<BBBH", 7, 3, 31, 1000))
    pac = (0x11, pack("PAC", counting("PAC")))
    tare = (0x12, pack("TARE", counting("TARE")))
    end, ping_wire, pac_wire, tare_wire = frame(*ping), frame(*ping), frame(*pac), frame(*tare)
    crc = {"bad_crc": 1}
    bad = {"bad_cobs": 1}
    start_big_endian = bytes([start[0]]) + start[1]
    start_big_endian += struct.pack(">I", zlib.crc32(start_big_endian))
    # 255 bytes without delimiter are the longest possible frame; 256 can be none.
    full = bytes([0xFF]) + b"U" * 254
    return [
        Case("cut_at_the_start_by_one_byte", pac_wire[1:] + end, [ping], bad),
        Case("cut_at_the_start_by_half", pac_wire[20:] + end, [ping], bad),
        Case("cut_in_the_middle", pac_wire[:20] + pac_wire[24:] + end, [ping], bad),
        Case("cut_at_the_end_swallows_the_next", pac_wire[:30] + end + end, [ping], bad),
        Case("only_the_delimiter_is_lost", ping_wire[:-1] + end + end, [ping], crc),
        Case("two_frames_spliced", pac_wire[:25] + tare_wire[40:] + end, [ping], bad),
        Case("spliced_at_a_code_byte", ping_wire[:-1] + b"\x03ab\0" + end, [ping], crc),
        Case("doubled_without_delimiter", pac_wire[:-1] * 2 + b"\0" + end, [ping], crc),
        Case("id_changed", delimited(flipped(sealed(*start), 0, 0x02)) + end, [ping], crc),
        Case("payload_bit_flipped", delimited(flipped(sealed(*pac), 30, 0x10)) + end, [ping], crc),
        Case("crc_bit_flipped", delimited(flipped(sealed(*pac), -1, 0x80)) + end, [ping], crc),
        Case("crc_in_the_wrong_byte_order", delimited(start_big_endian) + end, [ping], crc),
        Case("a_byte_turned_into_a_delimiter", pac_wire[:15] + b"\0" + pac_wire[16:] + end, [ping], {"bad_cobs": 2}),
        Case("known_id_one_byte_short", frame(start[0], start[1][:-1]) + end, [ping], {"bad_length": 1}),
        Case("known_id_one_byte_long", frame(start[0], start[1] + b"\1") + end, [ping], {"bad_length": 1}),
        Case("known_id_without_payload", frame(start[0], b"") + end, [ping], {"bad_length": 1}),
        Case("at_commands_swallow_one_frame", b"AT\r\nAT+CGMI\r\n" + ping_wire + end, [ping], bad),
        Case("at_commands_between_delimiters", end + b"\0AT\r\n\0" + end, [ping, ping], bad),
        Case("terminal_text", b"login: \0~~~~\0" + end, [ping], {"bad_cobs": 2}),
        Case("overlong_run", b"U" * 300 + b"\0" + end, [ping], {"too_long": 1}),
        Case("overlong_run_of_1000_swallows_one", b"U" * 1000 + ping_wire + end, [ping], {"too_long": 1}),
        Case("a_run_of_the_longest_length", full + b"\0" + end, [ping], crc),
        Case("a_run_one_byte_over_the_longest", full + b"U\0" + end, [ping], {"too_long": 1}),
        Case("too_long_by_one_with_right_crc", frame(0x7F, bytes(250)) + end, [ping], {"too_long": 1}),
        Case("overlong_and_not_finished", b"U" * 400, []),
        Case("code_points_past_the_end", b"\x09\x83\x05\0" + end, [ping], bad),
        Case("code_points_past_the_end_by_one", b"\x04ab\0" + end, [ping], bad),
        Case("largest_code_alone", b"\xff\0" + end, [ping], bad),
        Case("zero_length", b"\x01\0" + end, [ping], crc),
        Case("one_byte", b"\x02\x83\0" + end, [ping], crc),
        Case("crc_of_nothing_and_no_id", delimited(struct.pack("<I", zlib.crc32(b""))) + end, [ping], crc),
        Case("id_and_three_bytes_of_crc", delimited(sealed(0x7E, b"")[:-1]) + end, [ping], crc),
        Case("all_refusals_in_a_row", b"U" * 256 + b"\0\xff\0\x01\0" + frame(0x83, b"") + end, [ping],
             {"too_long": 1, "bad_cobs": 1, "bad_crc": 1, "bad_length": 1}),
    ]  # fmt: skip


def hex_lines(word: str, data: bytes) -> list[str]:
    return [f"{word} {data[k : k + BYTES_PER_LINE].hex()}\n" for k in range(0, len(data), BYTES_PER_LINE)]


def framing_text() -> str:
    out = [HEADER]
    for case in good_cases() + hostile_cases():
        counts = dict.fromkeys(COUNTS, 0) | case.counts
        opinion = judge(case.wire)
        if opinion != (case.frames, counts):
            raise ValueError(f"{case.name}: stated {case.frames}, {counts}; the libraries say {opinion}")
        out.append(f"case {case.name}\n")
        out += hex_lines("wire", case.wire)
        out += [f"frame {i:02x} {payload.hex() or '-'}\n" for i, payload in case.frames]
        out.append(f"counts {' '.join(str(counts[c]) for c in COUNTS)}\n\n")
    return "".join(out)


# ---- known answers ---------------------------------------------------------------------------


def crc32_text() -> str:
    published = {b"123456789": 0xCBF43926, b"": 0, b"\0": 0xD202EF8D, b"\xff" * 4: 0xFFFFFFFF}
    published[b"The quick brown fox jumps over the lazy dog"] = 0x414FA339
    for data, crc in published.items():
        if zlib.crc32(data) != crc:
            raise ValueError(f"zlib disagrees with the published CRC of {data!r}")
    more = [b"\0" * 32, bytes(range(256)), bytes(range(255, -1, -1)), b"\xff" * 254, b"\x80"]
    return HEADER + "".join(f"{zlib.crc32(d):08x} {d.hex() or '-'}\n" for d in [*published, *more])


def cobs_text() -> str:
    published = {  # Cheshire and Baker 1999, figure 3, and the boundary cases of their section 3
        "4500002c4c79000040064f37": "0245 01 042c4c79 01 0540064f37",
        "00": "01 01",
        "0000": "01 01 01",
        "001100": "01 0211 01",
        "11220033": "031122 0233",
        "11223344": "0511223344",
        "11000000": "0211 01 01 01",
        bytes(range(1, 255)).hex(): "ff" + bytes(range(1, 255)).hex(),
        bytes(range(0, 255)).hex(): "01 ff" + bytes(range(1, 255)).hex(),
        bytes(range(1, 256)).hex(): "ff" + bytes(range(1, 255)).hex() + "02ff",
        (bytes(range(2, 256)) + b"\0").hex(): "ff" + bytes(range(2, 256)).hex() + "01 01",
        (bytes(range(3, 256)) + b"\0\1").hex(): "fe" + bytes(range(3, 256)).hex() + "0201",
    }
    out = [HEADER]
    for plain, encoded in published.items():
        if cobs.encode(bytes.fromhex(plain)) != bytes.fromhex(encoded):
            raise ValueError(f"the cobs package disagrees with the published code of {plain}")
    more = [b"", b"\1" * 253, b"\1" * 508, b"\1" * 509, b"\0" * 254, b"\1" * 254 + b"\0\0", bytes(range(256)) * 3]
    for data in [*map(bytes.fromhex, published), *more]:
        out.append(f"good {data.hex() or '-'} {cobs.encode(data).hex()}\n")
    for wrong in ("00", "02", "0511 22", "ff01", "0211 00 11", "01 01 03 11"):
        try:
            cobs.decode(bytes.fromhex(wrong))
        except cobs.DecodeError:
            out.append(f"bad {bytes.fromhex(wrong).hex()}\n")
        else:
            raise ValueError(f"the cobs package accepts {wrong}")
    return "".join(out)


def outputs() -> dict[Path, str]:
    folder = ROOT / "protocol/vectors"
    return {
        folder / "framing.txt": framing_text(),
        folder / "messages.txt": messages_text(),
        folder / "crc32.txt": crc32_text(),
        folder / "cobs.txt": cobs_text(),
    }


if __name__ == "__main__":
    sys.exit(write_or_check(outputs(), "tools/make/vectors.py"))
