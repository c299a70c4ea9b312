"""A recording is decoded by the wire schema that it carries. The other schema's packets are made here, byte by byte."""

import copy
import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from record_all import blocks_of

import biotac
from biotac.recording import layout
from biotac.recording.schema import own_schema
from biotac.wire import messages_gen as wire
from biotac.wire.decoder import packed, pairs
from biotac.wire.dtypes_gen import DTYPES

OTHER_PAC, GONE, APPENDED = 0x60, 0x61, 6
EVENT_KIND_AT, FRAME_FLAGS_AT = 8, 8


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> biotac.Recording:
    path = tmp_path_factory.mktemp("own") / "a.mcap"
    with biotac.open("sim:press.toml?fingers=2&seconds=8") as hand:
        hand.record(path)
        hand.stream("results", "pac", "events")
        hand.read_batch(100)
    return biotac.Recording(path)


def other_schema() -> dict[str, Any]:
    """FRAME without the last field; EVENT with two more; PAC with another id, as the old id went to a dropped message.

    All event kinds are ten more, one has another name, and the flags CONTACT and UNTARED have changed places.
    """
    schema = copy.deepcopy(json.loads(own_schema()))
    link = schema["link"]
    link["message"]["FRAME"]["fields"].pop()
    link["message"]["EVENT"]["fields"] += [
        {"name": "later", "type": "i32", "unit": "1"},
        {"name": "on", "type": "u16", "unit": "1"},
    ]
    link["message"]["PAC"]["id"] = OTHER_PAC
    link["message"]["BANDS"] = {"id": GONE, "fields": [{"name": "seq", "type": "u16", "unit": "1"}]}
    kinds = link["enum"]["event_kind"]
    for kind in kinds.values():
        kind["value"] += 10
    kinds["NUDGE"] = kinds.pop("LIFT")
    flags = link["flags"]["frame"]
    flags["CONTACT"]["bit"], flags["UNTARED"]["bit"] = flags["UNTARED"]["bit"], flags["CONTACT"]["bit"]
    return schema


def swapped(flags: int) -> int:
    both = wire.FrameFlags.CONTACT | wire.FrameFlags.UNTARED
    return flags ^ int(both) if (flags & both) in (wire.FrameFlags.CONTACT, wire.FrameFlags.UNTARED) else flags


def as_other(message_id: int, payload: bytes) -> tuple[int, bytes]:
    data = bytearray(payload)
    if message_id in (wire.FrameMessage.ID, wire.Idle.ID):
        at = DTYPES[message_id].fields["flags"][1]  # type: ignore[index]
        data[at : at + 4] = swapped(int.from_bytes(data[at : at + 4], "little")).to_bytes(4, "little")
    if message_id == wire.FrameMessage.ID:
        last = DTYPES[wire.FrameMessage.ID].names[-1]  # type: ignore[index]
        del data[DTYPES[wire.FrameMessage.ID].fields[last][1] :]  # type: ignore[index]
    if message_id == wire.Event.ID:
        data[EVENT_KIND_AT] += 10
        data += bytes(APPENDED)
    return OTHER_PAC if message_id == wire.Pac.ID else message_id, bytes(data)


def with_schema(source: Path, out: Path, schema: bytes, change: Callable[[bytes], bytes]) -> Path:
    """The recording ``source`` as a board and a library with that wire schema would have written it."""
    with source.open("rb") as read, out.open("wb") as stream:
        reader, writer = make_reader(read), Writer(stream, chunk_size=1)
        writer.start()
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, record.metadata)
        schema_id = writer.register_schema(layout.WIRE_SCHEMA, layout.WIRE_SCHEMA_ENCODING, schema)
        channels: dict[str, int] = {}
        for _, channel, m in reader.iter_messages(log_time_order=False):
            if channel.topic not in channels:
                to = writer.register_channel(channel.topic, channel.message_encoding, schema_id)
                channels[channel.topic] = to
            data = change(m.data) if channel.topic == layout.PACKETS else m.data
            writer.add_message(channels[channel.topic], m.log_time, data, m.publish_time, m.sequence)
        writer.finish()
    return out


def test_messages_fields_values_and_flags_are_found_by_their_names(own, tmp_path: Path) -> None:
    added = [(GONE, b"xx"), (0x7F, b"new")]
    path = with_schema(
        own.path,
        tmp_path / "other.mcap",
        json.dumps(other_schema()).encode(),
        lambda block: packed([*(as_other(*m) for m in pairs(block)), *added]),
    )
    read = biotac.Recording(path)
    last = own.wire.dtype.names[-1]
    for name in own.wire.dtype.names:
        if name == last:
            assert len(np.unique(read.wire[name])) == 1  # the invalid mark
        else:
            np.testing.assert_array_equal(read.wire[name], own.wire[name], err_msg=name)
    assert read.pac.tobytes() == own.pac.tobytes() and read.frames_lost == 0
    events, before = ([m for m in one.messages if isinstance(m, wire.Event)] for one in (read, own))
    lifts = [m.kind == wire.EventKind.LIFT for m in before]
    assert any(lifts) and not all(lifts)
    for event, was, is_lift in zip(events, before, lifts, strict=True):
        assert event.kind == was.kind or (is_lift and event.kind not in list(wire.EventKind))
        assert (event.t_us, event.finger, event.trust) == (was.t_us, was.finger, was.trust)
    assert {i for block in blocks_of(read) for i, _ in pairs(block)} >= {wire.Pac.ID, 0x7F}
    np.testing.assert_array_equal(biotac.load(path, fields=["force_n"])["force_n"], own.frames["force_n"])


def test_a_schema_that_cannot_be_read_is_said(own, tmp_path: Path) -> None:
    path = with_schema(own.path, tmp_path / "bad.mcap", b"{}", lambda block: block)
    with pytest.raises(biotac.RecordingError, match="wire schema cannot be read"):
        biotac.Recording(path).frames  # noqa: B018


GOLDEN = Path(__file__).parent / "golden" / "format3.mcap"
GOLDEN_SHA = "cc3ec760aa4f697f"


def test_the_first_recording_of_this_format_is_read_for_good() -> None:
    recording = biotac.Recording(GOLDEN)
    assert recording.problems == [] and recording.fingers == [0, 1] and len(recording.wire) == len(recording.pac) == 400
    named = ("seq", "t_us", "finger", "counts", "pdc", "force_100un", "trust")
    sent = b"".join(np.ascontiguousarray(recording.wire[name]).tobytes() for name in named)
    assert hashlib.sha256(sent + recording.pac["pac"].tobytes()).hexdigest()[:16] == GOLDEN_SHA
    texts = [(label.text, label.t_us, label.end_us, label.finger, label.facts) for label in recording.labels]
    assert texts == [("golden", None, None, None, {}), ("span", 683672, 1183672, 1, {"trial": 3})]
    assert recording.applied_n is not None and recording.applied_n.max() == 4.95
