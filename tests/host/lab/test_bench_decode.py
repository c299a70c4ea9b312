"""biotac bench decode: all contestants decode the same fields or there are no figures. Times are not looked at."""

from __future__ import annotations

import json
import sys
import zlib
from functools import partial

import numpy as np
import pytest

from biotac.cli.main import main
from biotac.lab.bench import decode
from biotac.wire import messages_gen as wire
from biotac.wire.dtypes_gen import DTYPES


@pytest.fixture(scope="module")
def outcome() -> decode.Outcome:
    return decode.measure(500, rounds=1)


def test_every_contestant_is_timed_at_every_chunk_size(outcome) -> None:
    assert (outcome.seconds, outcome.messages) == (1.0, 1000)
    # id, CRC, COBS and delimiter around the mean of a FRAME and a PAC; MAVLink 2 cuts a payload's last zeros off
    sizes = [DTYPES[i].itemsize for i in (wire.Frame.ID, wire.Pac.ID)]
    assert outcome.bytes_per_message == np.mean(sizes) + 7
    assert np.mean(sizes) < outcome.mavlink_bytes_per_message <= np.mean(sizes) + 12
    assert [result.chunk_bytes for result in outcome.results] == list(decode.CHUNK_BYTES)
    for result in outcome.results:
        names = {row.name for row in result.rows}
        assert names == {decode.OURS, decode.LIVE, decode.UNITS, decode.MAVLINK, decode.STRUCT, decode.NUMPY}
        assert [(r.faster, r.slower, r.asked) for r in result.ratios] == list(decode.ASKED)
        assert all(0 < row.min_ns <= row.median_ns <= row.max_ns for row in result.rows)


def test_the_residue_that_replaces_a_comparison_is_that_of_a_right_crc() -> None:
    for plain in (b"\0", b"123456789", bytes(range(200))):
        crc = zlib.crc32(plain)
        assert zlib.crc32(plain + crc.to_bytes(4, "little")) == decode.CRC_RESIDUE
        assert zlib.crc32(plain + (crc ^ 1).to_bytes(4, "little")) != decode.CRC_RESIDUE


@pytest.mark.parametrize("field", ["t_us", "tare_q4", "pac"])
def test_a_contestant_that_decodes_another_value_is_named(field: str) -> None:
    sent = decode.recording(500)
    data = b"".join(decode.encode(m.ID, m.pack()) for m in decode._as_sent(sent))
    message_id = decode.PAC if field == "pac" else decode.FRAME
    sent[message_id] = sent[message_id].copy()
    sent[message_id][field].reshape(len(sent[message_id]), -1)[77, -1] ^= 1
    contestant = decode._Contestant(
        "it", [data], partial(decode._ours, decode.Decoder, {decode.FRAME: "frames", decode.PAC: "pacs"})
    )
    with pytest.raises(RuntimeError, match=f"it decoded a wrong {field} of {decode.NAMES[message_id]}"):
        decode._check(contestant, sent)


@pytest.mark.parametrize("package", ["pymavlink", "cobs"])
def test_without_the_extra_one_line_says_what_to_install(package: str, monkeypatch, capsys) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    assert main(["bench", "decode"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "pip install 'biotac-gateway[bench]'" in line and package in line


def test_the_verb_prints_tables_and_json(outcome, monkeypatch, capsys) -> None:
    monkeypatch.setattr(decode, "measure", lambda frames: outcome)
    assert main(["bench", "decode", "--frames", "500"]) == 0
    text = capsys.readouterr().out
    assert text.count("(target 150x: ") == text.count("(target 5x: ") == len(decode.CHUNK_BYTES)
    assert main(["bench", "decode", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["messages"] == 1000 and len(facts["results"]) == len(decode.CHUNK_BYTES)
