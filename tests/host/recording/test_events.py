"""A recording's events as a table."""

import math

import biotac
from biotac.recording.events import events_of
from biotac.wire import messages_gen as wire

NONE16, NONE32 = 0xFFFF, 0xFFFFFFFF


def test_times_go_on_over_the_wrap_and_missing_numbers_are_nan() -> None:
    wrap = 2**32
    slip = wire.Event(1, 40, 2, 0, wire.EventKind.SLIP, 0, wrap - 60, NONE32, 120, 255)
    later = wire.Event(2, 90, 2, 0, 200, 0, 90, NONE32, NONE16, 255)  # of a board that knows more kinds
    rows = events_of([slip, object(), later], begin_us=wrap - 1_000_060)
    assert rows["kind"].tolist() == ["SLIP", "200"]
    assert rows["onset_us"].tolist() == [wrap - 60, wrap + 90]
    assert rows["t_us"].tolist() == [wrap + 40, wrap + 90]
    assert rows["at_s"].tolist() == [1.0, 1.00015]
    assert rows["peak_count"][0] == 120 and math.isnan(rows["peak_count"][1])
    assert len(events_of([], 0)) == 0


def test_a_press_is_touched_and_lifted_when_it_was_applied(tmp_path) -> None:
    with biotac.open("sim:press.toml") as hand, hand.record(tmp_path / "a.mcap"):
        hand.stream("results", "events")
        hand.read(20)
    recording = biotac.Recording(tmp_path / "a.mcap")
    events, frames = recording.events(), recording.frames
    touch_s, lift_s = (events["at_s"][events["kind"] == kind] for kind in ("TOUCH", "LIFT"))
    pressed = frames["t_us"][(recording.applied_n != 0).any(axis=1)]
    first_s, last_s = (pressed[[0, -1]] - recording.begin_us) / 1e6
    assert abs(touch_s[0] - first_s) < 0.2 and len(touch_s) >= len(lift_s) > 0 and lift_s[0] > touch_s[0]
    assert lift_s[-1] <= last_s + 1.0


def test_flags_are_read_as_names() -> None:
    flags = biotac.FrameFlags.CONTACT | biotac.FrameFlags.RAIL
    assert (str(flags), f"{flags}", f"{flags:08x}") == ("CONTACT|RAIL", "CONTACT|RAIL", "00000021")
    assert str(biotac.FrameFlags(0)) == "0" and str(biotac.QuantityFlags(1 << 30 | 1)).endswith("|0x40000000")
