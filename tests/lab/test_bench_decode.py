"""biotac-lab bench decode: all contestants decode the same fields or there are no figures. Times are not looked at."""

import sys
from functools import partial

import pytest

from biotac.wire import encode, messages
from biotac_lab.bench import decode
from biotac_lab.cli import main


def test_every_contestant_is_timed_at_every_chunk_size(capsys) -> None:
    tables = decode.measure(1000, rounds=1)
    assert len(tables) == 2 * len(decode.CHUNK_BYTES)
    for times, ratios in zip(tables[::2], tables[1::2], strict=True):
        names = [decode.OURS, decode.LIVE, decode.UNITS, decode.MAVLINK, decode.STRUCT, decode.NUMPY]
        assert [row[0] for row in times.rows] == names
        assert all(row[1] > 0 for row in times.rows)
        assert [(row[0], row[1], row[3]) for row in ratios.rows] == list(decode.ASKED)


@pytest.mark.parametrize("field", ["t_us", "tare_q4", "pac"])
def test_a_contestant_that_decodes_another_value_is_named(field: str) -> None:
    sent = decode.recording(500)
    data = b"".join(encode(i, messages.MESSAGES[i].unpack(row.tobytes()).pack()) for i in sent for row in sent[i])
    message_id = decode.PAC if field == "pac" else decode.FRAME
    sent[message_id] = sent[message_id].copy()
    sent[message_id][field].reshape(len(sent[message_id]), -1)[77, -1] ^= 1
    start = partial(decode._ours, decode.Decoder, {decode.FRAME: "frames", decode.PAC: "pacs"})
    with pytest.raises(RuntimeError, match=f"it decoded a wrong {field} of {decode.NAMES[message_id]}"):
        decode.check("it", [data], start, sent)


def test_without_the_extra_one_line_says_what_to_install(monkeypatch, capsys) -> None:
    package = "pymavlink"
    for name in [name for name in sys.modules if name.split(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    assert main(["bench", "decode"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "pip install 'biotac-lab[bench]'" in line and package in line
