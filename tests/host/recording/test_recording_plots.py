"""What other tools see of a recording: JSON messages with schemas, next to a wire that is still whole."""

from __future__ import annotations

import json
from collections import defaultdict
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from record_all import record_all

import biotac
from biotac.hand.subscription import AT_FIRST
from biotac.recording import writer
from biotac.recording.facts import Facts
from biotac.wire import messages_gen as wire
from biotac.wire.framing import encode

UNITS = (("force_n", "force_n", 1), ("poc_m", "poc_mm", 1e3), ("torque_nm", "torque_nmm", 1e3))
SOURCE = "sim:press.toml?fingers=2&seconds=4"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    return record_all(SOURCE, tmp_path_factory.mktemp("plots") / "a.mcap")


def messages(path: Path) -> tuple[dict[str, list[tuple[int, dict[str, Any]]]], dict[str, dict[str, Any]]]:
    """(log time, body) by topic, and the schema of each topic, by the mcap library's own reader."""
    found: dict[str, list[tuple[int, dict[str, Any]]]] = defaultdict(list)
    schemas: dict[str, dict[str, Any]] = {}
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
            if channel.message_encoding != "json":
                continue
            assert schema is not None and schema.encoding == "jsonschema"
            schemas[channel.topic] = json.loads(schema.data)
            found[channel.topic].append((message.log_time, json.loads(message.data)))
    return found, schemas


def test_every_message_is_its_frame_in_si_units(recorded: Path) -> None:
    found, _ = messages(recorded)
    frames = biotac.load(recorded)
    valid = invalid = 0
    for finger in (0, 1):
        of_finger = {int(row["seq"]): row for row in frames[frames["finger"] == finger]}
        for _, body in found[f"/biotac/finger{finger}/results"]:
            row = of_finger[body["seq"]]
            assert body["frame_id"] == f"biotac_finger{finger}"
            assert body["flags"] == row["flags"]
            for name, values, per_m in (
                ("force_n", "force_n", 1),
                ("poc_m", "poc_mm", 1e3),
                ("torque_nm", "torque_nmm", 1e3),
            ):
                if np.isnan(row[values]).all():
                    invalid += 1
                    assert name not in body
                    continue
                valid += 1
                assert [body[name][axis] for axis in "xyz"] == pytest.approx(row[values] / per_m, abs=1e-12)
    assert valid > 300 and invalid > 3


def test_results_come_25_and_counts_5_times_a_second(recorded: Path) -> None:
    found, _ = messages(recorded)
    for finger in (0, 1):
        # 4 s; the periods are those of device time, and the first was under way already
        assert len(found[f"/biotac/finger{finger}/results"]) in (100, 101)
        assert len(found[f"/biotac/finger{finger}/counts"]) in (20, 21)
    stamps = np.array([stamp for stamp, _ in found["/biotac/finger0/results"]])
    assert np.unique(np.diff(stamps)[1:]).tolist() == [40_000_000]


def test_counts_and_pac_are_those_of_the_wire(recorded: Path) -> None:
    found, _ = messages(recorded)
    recording = biotac.Recording(recorded)
    for _, body in found["/biotac/finger1/counts"]:
        row = recording.frames[(recording.frames["finger"] == 1) & (recording.frames["seq"] == body["seq"])][0]
        pac = recording.pac[(recording.pac["finger"] == 1) & (recording.pac["seq"] == body["seq"])][0]
        assert body["electrodes"] == row["counts"].tolist()
        assert (body["pdc"], body["tac"], body["tdc"]) == (row["pdc"], row["tac"], row["tdc"])
        assert body["pac"] == pac["pac"].tolist()


def test_tare_changes_are_told_in_words(recorded: Path) -> None:
    found, _ = messages(recorded)
    sent = [m for m in biotac.Recording(recorded).messages if isinstance(m, wire.Tare) and m.finger == 0]
    told = [body for _, body in found["/biotac/finger0/tare"]]
    assert [body["seq"] for body in told] == [m.seq for m in sent]
    assert told[0]["reason"] == wire.TareReason(sent[0].reason).name == "START"
    assert told[0]["tare"] == pytest.approx([q16 / 65536 for q16 in sent[0].tare_q16], abs=1e-4)


def test_events_are_recorded_told_and_read_again(tmp_path: Path) -> None:
    with biotac.open("sim:press.toml?seconds=3") as hand:
        hand.subscribe(AT_FIRST | biotac.QuantityFlags.EVENTS)
        hand.record(tmp_path / "e.mcap")
        live = [m for m in hand.read_batch(10.0).messages if isinstance(m, biotac.Event)]
    assert [m for m in biotac.Recording(tmp_path / "e.mcap").messages if isinstance(m, biotac.Event)] == live
    found, schemas = messages(tmp_path / "e.mcap")
    bodies = [body for _, body in found["/biotac/finger0/events"]]
    assert [body["kind"] for body in bodies] == [biotac.EventKind(m.kind).name for m in live]
    touch = next(body for body in bodies if body["kind"] == "TOUCH")
    assert touch["energy"] >= 0 and touch["age_s"] == 0 and "peak" not in touch
    assert {*touch} <= {*schemas["/biotac/finger0/events"]["properties"]}
    with biotac.open(f"replay:{tmp_path / 'e.mcap'}") as hand:
        assert [m.kind for m in hand.read_batch(10.0).messages if isinstance(m, biotac.Event)] == [m.kind for m in live]


def test_messages_hold_what_their_schemas_say_and_no_nan(recorded: Path) -> None:
    kinds = {"number": (int, float), "integer": int, "string": str, "boolean": bool, "array": list, "object": dict}

    def fits(value: Any, schema: dict[str, Any]) -> None:
        assert isinstance(value, kinds[schema["type"]])
        for name, inner in value.items() if schema["type"] == "object" else ():
            fits(inner, schema["properties"][name])
        for inner in value if schema["type"] == "array" else ():
            fits(inner, schema["items"])

    found, schemas = messages(recorded)
    assert set(schemas) == {f"/biotac/finger{f}/{kind}" for f in (0, 1) for kind in ("results", "counts", "tare")}
    for topic, rows in found.items():
        assert schemas[topic]["type"] == "object"
        for _, body in rows:
            fits(body, schemas[topic])


def test_a_second_on_the_recorders_clock_closes_a_block(tmp_path: Path) -> None:
    now_s = [100.0]
    with biotac.open("sim:press.toml?seconds=1") as hand:
        facts = Facts(hand.info, [hand.sensor_info(0)], hand.settings())
    path = tmp_path / "clock.mcap"
    recorder = writer.Recorder(path, facts, "test", clock_s=lambda: now_s[0], unix_ns=lambda: 7)
    ping = encode(wire.Reply.ID, wire.Reply(1, wire.Ping.ID, 0).pack())
    sizes = []
    for step in (0.0, 0.5, 0.3, 0.2, 0.4, 0.3):
        now_s[0] += step
        recorder.write(ping)
        sizes.append(path.stat().st_size)
    # 1.0 s after the first byte, and not 0.7 s after it: by then another block has begun, which is 0.3 s old.
    grown = [after > before for before, after in pairwise(sizes)]
    assert grown == [False, False, True, False, False]
    now_s[0] += 1.0
    recorder.write(b"")
    assert path.stat().st_size > sizes[-1]
    recorder.close()
    assert biotac.Recording(path).arrived_ns == [7, 7]


def test_a_recording_of_the_first_releases_still_loads(recorded: Path, tmp_path: Path) -> None:
    """As this project wrote them before there was anything but the wire: a chunk a message, fewer metadata."""
    new = biotac.Recording(recorded)
    path = tmp_path / "old.mcap"
    with path.open("wb") as out:
        old = Writer(out, chunk_size=1, compression=CompressionType.ZSTD)
        old.start(profile="", library="biotac-gateway 0.1.0")
        schema = old.register_schema("biotac.link", "biotac-schema", b"{}")
        channel = old.register_channel("/biotac/wire", "biotac-wire", schema)
        keys = ("format", "software", "port", "wire", "hello", "settings", "sensors")
        old.add_metadata("biotac", {key: new.metadata[key] for key in keys})
        for number, block in enumerate(new.blocks):
            old.add_message(channel, number, block, number, number)
        old.finish()
    assert biotac.load(path).tobytes() == new.frames.tobytes()
    with biotac.open(f"replay:{path}") as hand:
        assert hand.read(100).tobytes() == new.frames.tobytes()


def test_metadata_say_who_and_with_what(recorded: Path) -> None:
    recording = biotac.Recording(recorded)
    assert recording.metadata["firmware"] == biotac.__version__
    assert [info.finger for info in recording.sensors] == [0, 1]
    assert recording.settings[biotac.Setting.POC_WEIGHTS] == json.loads(recording.metadata["settings"])["poc_weights"]


def test_whatever_a_board_says_the_wire_is_kept(recorded: Path, tmp_path: Path) -> None:
    """Random payloads under right CRCs: nothing that is derived from the wire may stop its recording."""
    known = biotac.Recording(recorded)
    rng = np.random.default_rng(7)
    path = tmp_path / "wild.mcap"
    recorder = writer.Recorder(path, Facts(known.info, known.sensors, known.settings), "test", clock_s=lambda: 0.0)
    wild = b""
    for message_id in (wire.Frame.ID, wire.Pac.ID, wire.Tare.ID, wire.Idle.ID, wire.Status.ID) * 60:
        wild += encode(message_id, rng.bytes(wire.MESSAGES[message_id].STRUCT.size))
    recorder.write(wild)
    recorder.close()
    recording = biotac.Recording(path)
    assert b"".join(recording.blocks) == wild
    assert len(recording.frames) == 60 and recording.problems != []
