"""Power lost, and the watchdog's reset, in any state of the board: it says so, and only a grip goes on."""

import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from held_press import of_finger
from maps import make_map
from restarts import Restarts

from biotac import FaultFlags, FrameFlags, Setting, TareReason
from biotac.map.board_map import PART_BYTES, part
from biotac.wire import messages_gen as wire
from biotac.wire.identity import board_name
from rig import NO_MAPS, Rig

FINGERS = 3
PRESSED, AT_REST = 0, 1
# Pressed from 1.5 s on for as long as any test takes; the other fingers feel nothing.
WORLD = f"""
name = "reset"
seed = 5
fingers = {FINGERS}
step = [
    {{do = "rest", seconds = 1.0}},
    {{do = "press", fingers = [{PRESSED}], seconds = 0.5, at = "E17", force_n = 3.0}},
    {{do = "hold", seconds = 280}},
]
"""
KEPT, NEW = make_map(1), make_map(2)


def idle(run: Restarts) -> None:
    run.hand.ping()


def taring(run: Restarts) -> None:
    frames = run.hand.read(0.05)
    assert (frames["flags"] & FrameFlags.UNTARED != 0).all()


def streaming(run: Restarts) -> None:
    frames = run.hand.read(0.5)
    assert not (frames["flags"][-FINGERS:] & FrameFlags.UNTARED).any()


def with_a_keep_alive(run: Restarts) -> None:
    run.hand.board.command(wire.Start(9, int(wire.StreamFlags.FRAMES), 31, 60_000))
    run.link.release()


def touched(run: Restarts) -> None:
    frames = of_finger(run.hand.read(2.0), PRESSED)
    assert frames["flags"][-1] & FrameFlags.CONTACT and frames["force_n"][-1].max() > 0.3


def held(run: Restarts) -> None:
    touched(run)
    run.hand.hold(PRESSED)
    assert of_finger(run.hand.read(0.1, fresh=True), PRESSED)["flags"][-1] & FrameFlags.HELD


def uploading_a_map(run: Restarts) -> None:
    run.hand.board.command(wire.BeginMap(0, AT_REST, len(NEW), zlib.crc32(NEW)))
    for offset in range(0, len(NEW) - PART_BYTES, PART_BYTES):
        run.hand.board.command(wire.WriteMap(0, AT_REST, offset, part(NEW, offset)))


def storing(run: Restarts) -> None:
    run.hand.board.set_setting(Setting.IDLE_PERIOD_MS, 260)
    run.hand.board.send(wire.SaveSettings(0))


STATES = [idle, taring, streaming, with_a_keep_alive, touched, held, uploading_a_map, storing]


def restarted(rig: Rig, folder: Path, state: Callable[[Restarts], None], how: str, expected: FaultFlags) -> None:
    """Restart a board in a state: the faults that it must then report; the state itself is gone."""
    run = Restarts(rig, folder, WORLD)
    run.hand.board.set_setting(Setting.IDLE_PERIOD_MS, 250)
    maps = {AT_REST: KEPT} if run.hand.info.map_bytes else {}
    if not maps and state is uploading_a_map:
        pytest.skip(NO_MAPS.format(board_name(run.hand.info)))
    for finger, blob in maps.items():
        run.hand.board.set_map(finger, blob)
    run.hand.board.save_settings()
    at_first_ms = run.hand.board.setting(Setting.HOLD_TIMEOUT_MS)
    run.hand.board.set_setting(Setting.HOLD_TIMEOUT_MS, 60_000)  # not saved, but by storing()
    before = run.hand.info
    state(run)
    pressed_n = of_finger(run.hand.read(0.1), PRESSED)["force_n"].mean(axis=0) if state in (touched, held) else None
    getattr(run, how)()
    hand, after = run.hand, run.hand.info
    assert after.boot_id != before.boot_id
    assert after.board_serial == before.board_serial
    status, faults = hand.status(), hand.board.faults()
    # A tare outlives the watchdog's reset, if there was one.
    kept = bool(faults.board & FaultFlags.TARE_RESTORED)
    assert faults.board == expected | (FaultFlags.TARE_RESTORED if kept else 0) and not faults.fingers
    assert not kept or how == "hang"
    assert kept or how != "hang" or state not in (touched, held, streaming)
    assert status.streams == 0 and status.rx_errors == 0
    found = hand.board.setting(Setting.IDLE_PERIOD_MS), hand.board.setting(Setting.HOLD_TIMEOUT_MS)
    assert found == (250, at_first_ms) or (state is storing and found == (260, 60_000))
    assert not maps or hand.board.maps() == maps
    frames = hand.read(0.5)
    flags = frames["flags"]
    tared = flags & FrameFlags.UNTARED == 0
    assert np.isnan(frames["force_n"][~tared]).all()
    assert not (flags & (FrameFlags.SENSOR_UNSURE | FrameFlags.SENSOR_OTHER)).any()
    goes_on = kept and state in (touched, held)
    assert (flags[frames["finger"] == PRESSED] & FrameFlags.HELD != 0).all() == (goes_on and state is held)
    if goes_on:
        again = of_finger(frames, PRESSED)[10:]
        assert (again["flags"] & FrameFlags.CONTACT).all()
        assert np.abs(again["force_n"].mean(axis=0) - pressed_n).max() < 0.01 * np.abs(pressed_n).max() + 0.05
    for finger in set(range(FINGERS)) - {PRESSED}:  # which has no tare while the force grows
        assert tared[frames["finger"] == finger][-1]
        assert hand.sensor_status(finger).tare_reason == (TareReason.RESTORED if kept else TareReason.START)
    others = frames[tared & (frames["finger"] != PRESSED) & (frames["finger"] != AT_REST)]
    assert not (others["flags"] & FrameFlags.CONTACT).any() and np.abs(others["force_n"]).max() < 0.1


@pytest.mark.parametrize("state", STATES)
def test_after_power_was_lost_it_begins_anew_and_says_so(rig: Rig, tmp_path: Path, state: Callable) -> None:
    restarted(rig, tmp_path, state, "lose_power", FaultFlags.STARTED)


@pytest.mark.parametrize("state", STATES)
def test_after_it_hung_it_begins_anew_and_says_so(rig: Rig, tmp_path: Path, state: Callable) -> None:
    rig.need("flash")
    restarted(rig, tmp_path, state, "hang", FaultFlags.HUNG)


def test_saved_settings_that_lose_a_bit_are_told_and_the_ones_before_hold(rig: Rig, tmp_path: Path) -> None:
    run = Restarts(rig, tmp_path, WORLD)
    run.hand.board.set_setting(Setting.IDLE_PERIOD_MS, 250)
    run.hand.board.save_settings()
    run.hand.board.set_setting(Setting.IDLE_PERIOD_MS, 260)
    run.flip_saved_bit(run.hand.board.save_settings)
    run.lose_power()
    assert run.hand.board.setting(Setting.IDLE_PERIOD_MS) == 250
    assert run.hand.board.faults().board == FaultFlags.STARTED | FaultFlags.STORAGE
