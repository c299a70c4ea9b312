"""The conversation with a board: handshake, refusals, stale streams, boards that go away."""

import os
import tempfile
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from deframer import Deframer
from live_board import Firmware, Live, frame, packed, until

import biotac
from biotac.errors import InputError
from biotac.hand.hand import Hand
from biotac.link.serial_port import SerialLink
from biotac.wire import messages_gen as wire
from biotac.wire.framing import encode


def test_nothing_answers_is_no_gateway(scripted_board) -> None:
    link = SerialLink(scripted_board(lambda message_id, payload: b"").path)
    link.patience = 0.02
    with pytest.raises(biotac.NotAGatewayError, match=r"nothing answers.*expected a HELLO.*check that this is"):
        Hand(link)


def test_another_wire_major_is_refused_with_both_versions(scripted_board, hello) -> None:
    board = scripted_board(lambda i, p: hello(p, wire_major=9, wire_minor=3) if i == wire.HelloRequest.ID else b"")
    with pytest.raises(biotac.WireVersionError, match=rf"wire 9\.3, this library {wire.WIRE_MAJOR}\."):
        biotac.open(board.path)


def test_options_that_are_refused_leave_the_port_free(scripted_board) -> None:
    port, errors = scripted_board(lambda i, p: b"").path, []  # an error's traceback keeps the link alive
    for _ in range(2):
        with pytest.raises(InputError, match="max_age_s") as refused:
            biotac.open(port, max_age_s=0.0)
        errors.append(refused.value)


def test_a_stale_stream_and_an_old_hello_do_not_disturb_the_handshake(scripted_board, hello) -> None:
    old = hello(wire.HelloRequest(1, 12345).pack(), boot_id=666)
    stale = b"half a frame\x01\x02" + old + encode(wire.Pac.ID, bytes(wire.Pac.STRUCT.size)) * 20
    board = scripted_board(lambda i, p: hello(p, boot_id=7) if i == wire.HelloRequest.ID else b"", greeting=stale)
    with biotac.open(board.path) as hand:
        assert hand.info.boot_id == 7
        assert hand.stats.frames_lost == 0


def test_a_refused_command_names_command_and_reason() -> None:
    with biotac.open("sim:press.toml") as hand:
        with pytest.raises(biotac.CommandRefusedError, match="refused SetSetting: OUT_OF_RANGE"):
            hand.board.set_setting(biotac.Setting.POC_WEIGHTS, 3)
        with pytest.raises(biotac.CommandRefusedError, match="refused GetSensorStatus: NO_SUCH_FINGER"):
            hand.sensor_status(5)
        hand.stream()
        with pytest.raises(biotac.CommandRefusedError, match=r"BUSY.*send STOP first"):
            hand.board.set_setting(biotac.Setting.POC_WEIGHTS, 0)


def test_frames_are_typed_and_in_order() -> None:
    with biotac.open("sim:press.toml?seconds=0.5") as hand:
        frames = list(hand.frames())
        assert hand.ended
    assert [f.seq for f in frames] == list(range(50))
    assert np.diff([f.t_us for f in frames]).tolist() == [10_000] * 49
    assert biotac.FrameFlags.UNTARED in frames[0].flags
    assert np.isnan(frames[0].force_n).all()
    assert biotac.FrameFlags.UNTARED not in frames[-1].flags
    assert not np.isnan(frames[-1].force_n).any()


def test_a_tare_command_changes_the_tare_of_the_next_frame() -> None:
    with biotac.open("sim:drift.toml?seconds=1") as hand:
        hand.set_tare(0, np.full(19, 3000.0), 1500 + 0.5 / 16)  # a half of 1/16 count, rounded up like the electrodes'
        batch = hand.read_batch(0.1)
    events = [m for m in batch.messages if isinstance(m, wire.Tare)]
    assert batch.wire["tare_q4"][0].tolist() == [48000] * 19 and batch.wire["pdc_tare_q4"][0] == 24001
    assert (events[0].seq, events[0].reason) == (0, wire.TareReason.HOST_SET)


@pytest.mark.parametrize(
    ("port", "message"),
    [
        (os.devnull, "cannot be opened as a serial port"),
        ("modbus:1", "unknown kind of port 'modbus'"),
        ("sim:", "no source"),
        ("sim:press.toml?pace=nan", "pace is 'nan', expected real, fast or"),
    ],
)
def test_a_port_that_cannot_be_opened_says_why(port: str, message: str) -> None:
    with pytest.raises(biotac.PortError, match=message):
        biotac.open(port)


def test_a_newer_hello_is_read_as_far_as_it_is_known(scripted_board, hello) -> None:
    def longer(payload: bytes, **changes: int) -> bytes:
        (message_id, known), *_ = Deframer().feed(hello(payload, **changes))
        return encode(message_id, known + b"new field")

    board = scripted_board(lambda i, p: longer(p, wire_minor=9) if i == wire.HelloRequest.ID else b"")
    with biotac.open(board.path) as hand:
        assert hand.info.wire_minor == 9
    board = scripted_board(lambda i, p: longer(p, wire_major=2) if i == wire.HelloRequest.ID else b"")
    with pytest.raises(biotac.WireVersionError):
        biotac.open(board.path)


def test_what_a_newer_board_says_ends_nothing_and_what_is_known_of_it_is_kept(scripted_board, hello) -> None:
    """A level of trust, flags, an event, a message and a field that this library does not know."""
    firmware = Firmware(hello, wire_minor=wire.WIRE_MINOR + 1, schema_hash=1)
    live = Live(scripted_board(firmware), firmware)
    events: list[wire.Event] = []
    live.hand.on_event(events.append)
    (frame_id, payload), *_ = Deframer().feed(frame(1, trust=4, flags=0xFFFFFFFF))
    facts = dict.fromkeys((f.name for f in fields(wire.Event)), 0) | {"kind": 200}
    live.send(encode(frame_id, payload + b"new"), packed(wire.Event(**facts)), encode(0x7E, b"new"))
    until(lambda: events and live.hand[0].t_us == 10_000)
    assert live.hand[0].trust is live.hand[0].frame.trust is biotac.Trust.HOLD and "HOLD" in repr(live.hand[0])
    assert (events[0].kind, live.hand.stats.unknown_messages) == (200, 1)
    assert [w.code for w in live.hand.warnings if "pip install -U" in w.text][-1:] == ["unknown_messages"]
    live.hand.close()


def test_stop_ends_the_iteration() -> None:
    with biotac.open("sim:drift.toml") as hand:
        seen = 0
        for _ in hand.frames():
            seen += 1
            if seen == 50:
                hand.stop()
        assert 50 <= seen < 12_000


def test_a_board_without_sensors_reads_nothing_and_says_so() -> None:
    fault = '[[fault]]\nat_s = 0\nseconds = 20\nfinger = 0\nkind = "stuck_low"\n'
    text = f'name = "none"\n[[step]]\ndo = "rest"\nseconds = 20\n{fault}'
    path = Path(tempfile.mkdtemp()) / "none.toml"
    path.write_text(text)
    with biotac.open(f"sim:{path}") as hand:
        assert len(hand.read(0.5)) == 0
        assert not hand.ended  # it gave up on the sensors, not on the board


def test_a_notebook_shows_fingers_and_completes_their_names() -> None:
    with biotac.open("sim:press.toml?fingers=2&seconds=2") as hand:
        hand.read(seconds=2)
        assert hand._ipython_key_completions_() == ["index", "middle"]
        assert {"force_n", "poc_mm", "touched", "age_s"} <= set(dir(hand["index"]))
        shown = hand._repr_html_()
    assert shown.startswith("&lt;biotac.Hand on sim:press.toml?fingers=2&amp;seconds=2, fingers [0, 1]&gt;<table>")
    assert shown.count("<tr><td>middle</td><td>force (") == 1 and shown.count("<tr>") == 2


def test_values_that_no_message_can_hold_are_refused() -> None:
    with biotac.open("sim:drift.toml?seconds=1") as hand:
        with pytest.raises(ValueError, match=r"tare_counts has shape \(18,\), expected \(19,\)"):
            hand.set_tare(0, np.full(18, 3000.0))
        for bad in (-1.0, 5000.0, np.nan):
            with pytest.raises(ValueError, match=rf"the tare holds {bad:g}, expected 0\.\.4095 counts"):
                hand.set_tare(0, np.full(19, bad))
            with pytest.raises(ValueError, match=rf"the tare holds {bad:g}, expected 0\.\.4095 counts"):
                hand.set_tare(0, np.full(19, 3000.0), bad)
        with pytest.raises(biotac.InputError, match="SetSetting cannot hold"):
            hand.board.set_setting(biotac.Setting.POC_WEIGHTS, 10**12)
        for seconds in (0, -1, float("nan"), float("inf")):
            with pytest.raises(ValueError, match="number above 0"):
                hand.read(seconds)


def test_one_recording_at_a_time_and_the_stream_goes_on_after_it(tmp_path) -> None:
    with biotac.open("sim:drift.toml?seconds=1800") as hand:
        recorder = hand.record(tmp_path / "a.mcap")
        with pytest.raises(biotac.InputError, match=r"being recorded to .*a\.mcap; close that recorder first"):
            hand.record(tmp_path / "b.mcap")
        hand.read(1.0)
        recorder.close()
        hand.read(1.0)
        hand.record(tmp_path / "b.mcap")
        hand.read(10.0, fresh=True)  # rows after that
    assert biotac.Recording(tmp_path / "a.mcap").problems == []
    assert len(biotac.load(tmp_path / "b.mcap")) > 0


def test_the_bus_is_tried_at_another_rate_only_while_nothing_streams() -> None:
    with biotac.open("sim:press.toml?seconds=2") as hand:
        hand.stream()
        with pytest.raises(biotac.CommandRefusedError, match="BUSY"):
            hand.board.try_bus_rate(1000)
        hand.stop()
        assert hand.board.try_bus_rate(1000).bus_khz > 0
