"""A finger's wrench map on every rig: uploaded, read back, refused, interrupted; and after a power cut."""

import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from kept_board import serial_of
from maps import BIG, make_map
from test_calibration import reboot

import biotac
from biotac import CalibrationState
from biotac.cli.main import main
from biotac.errors import CommandRefusedError, InputError
from biotac.map.board_map import PART_BYTES, for_any_sensor, part
from biotac.recording.crosscheck import CrossCheck
from biotac.recording.reader import Recording
from biotac.wire import messages_gen as wire
from biotac.wire.identity import board_name
from rig import NO_MAPS, Rig

SECTOR = 4096


@pytest.fixture
def board(board: Callable[[str], biotac.Hand]) -> Callable[[str], biotac.Hand]:
    """One that keeps maps."""

    def opened(source: str) -> biotac.Hand:
        hand = board(source)
        if hand.info.map_bytes == 0:
            with pytest.raises(InputError, match="keeps no wrench maps"):
                hand.board.set_map(0, make_map(1))
            pytest.skip(NO_MAPS.format(board_name(hand.info)))
        return hand

    return opened


PAGE = 256
PATIENCE_S = 5  # of the board's time, for steps that take some ms of it


def begin(hand: biotac.Hand, finger: int, blob: bytes) -> None:
    hand.board.command(wire.BeginMap(0, finger, len(blob), zlib.crc32(blob)))


def write(hand: biotac.Hand, finger: int, blob: bytes, offset: int) -> None:
    hand.board.command(wire.WriteMap(0, finger, offset, part(blob, offset)))


@pytest.mark.daily
def test_maps_of_all_sizes_come_back_as_they_were_sent(rig: Rig, board: Callable[[str], biotac.Hand]) -> None:
    hand = board("press.toml?fingers=2")
    assert [hand.board.get_map(f) for f in range(5)] == [None] * 5
    for blocks in (1, 4, BIG):
        blob = make_map(blocks, serial=serial_of(hand, 1), blocks=blocks)
        hand.board.set_map(1, blob)
        assert (hand.board.get_map(1), hand.board.map_state(1)) == (blob, CalibrationState.IN_FORCE)
    assert len(blob) > 4 * SECTOR  # the map has filled every sector of the slot
    assert hand.board.maps() == {1: blob}
    assert hand.board.map_state(0) == CalibrationState.NONE
    hand.board.clear_map(1)
    assert (hand.board.get_map(1), hand.board.map_state(1)) == (None, CalibrationState.NONE)
    if rig.can("presence"):
        assert hand.sensor_info(1).present  # the sensors were not lost over it


def test_another_sensors_is_refused_and_forced_it_is_for_any(board: Callable[[str], biotac.Hand]) -> None:
    hand = board("press.toml?fingers=2")
    blob = make_map(1, serial=serial_of(hand, 1))
    with pytest.raises(CommandRefusedError, match=r"EndMap: OTHER_SENSOR .*no serial number to force it"):
        hand.board.set_map(0, blob)
    with pytest.raises(CommandRefusedError, match="OTHER_SENSOR"):
        hand.board.set_map(4, blob)  # no sensor there
    assert hand.board.maps() == {}
    hand.board.set_map(0, blob, force=True)
    assert hand.board.maps() == {0: for_any_sensor(blob)}


def test_what_is_no_map_is_refused_and_the_old_one_stays(board: Callable[[str], biotac.Hand]) -> None:
    hand = board("press.toml")
    old, new = make_map(1), make_map(2)
    hand.board.set_map(0, old)
    with pytest.raises(CommandRefusedError, match="OUT_OF_RANGE"):
        hand.board.set_map(0, b"\xff" + new[1:])
    with pytest.raises(CommandRefusedError, match="OUT_OF_RANGE"):
        hand.board.set_map(0, new[:-1])
    assert hand.board.maps() == {0: old}


def test_an_upload_that_is_broken_off_leaves_the_old_map_and_nothing_in_the_way(
    board: Callable[[str], biotac.Hand],
) -> None:
    hand = board("press.toml")
    old, new = make_map(1), make_map(2, blocks=7)
    hand.board.set_map(0, old)
    begin(hand, 0, new)
    write(hand, 0, new, 2 * PART_BYTES)
    write(hand, 0, new, 0)
    write(hand, 0, new, 0)  # as after a lost reply
    with pytest.raises(CommandRefusedError, match="NOT_WHOLE"):
        hand.board.ask(wire.EndMap(0, 0, zlib.crc32(new)), wire.MapInfo)
    assert hand.board.get_map(0) == old
    hand.stop()  # as the next program does when it opens the port
    with pytest.raises(CommandRefusedError, match="NOT_BEGUN"):
        write(hand, 0, new, PART_BYTES)
    hand.board.set_map(0, new)
    assert hand.board.get_map(0) == new


def test_a_stream_runs_on_after_an_upload(board: Callable[[str], biotac.Hand]) -> None:
    hand = board("press.toml?fingers=2")
    hand.stop()
    hand.board.set_map(0, make_map(1, blocks=BIG))
    frames = hand.read(0.5)
    assert set(frames["finger"]) == {0, 1}
    assert hand.stats.frames_lost == 0


def test_a_recording_holds_the_maps_in_force(board: Callable[[str], biotac.Hand], tmp_path: Path) -> None:
    hand = board("press.toml?fingers=2&seconds=2")
    blob = make_map(1, serial=serial_of(hand, 1), blocks=BIG)
    hand.board.set_map(1, blob)
    hand.record(tmp_path / "one.mcap")
    hand.read(0.5)
    hand.close()
    assert Recording(tmp_path / "one.mcap").maps == {1: blob}


def test_a_mapped_fingers_frames_come_from_its_map_and_the_others_from_the_gains(
    board: Callable[[str], biotac.Hand], tmp_path: Path
) -> None:
    hand = board("shear.toml?fingers=2&seconds=3")
    hand.board.set_map(1, make_map(1, serial=serial_of(hand, 1), axes=7))
    settings, maps = hand.board.settings(), hand.board.maps()
    hand.record(tmp_path / "two.mcap")
    messages = hand.read_batch(2.5).wire
    hand.close()
    tared = (messages["flags"] & biotac.FrameFlags.UNTARED) == 0
    mapped = (messages["flags"] & biotac.FrameFlags.MAPPED) != 0
    assert tared.sum() > 400
    assert (mapped == (tared & (messages["finger"] == 1))).all()
    assert ((messages["torsion_mnmm"] != wire.INVALID_I32) == mapped).all()
    right = CrossCheck()
    right.add(messages, settings, maps=maps)
    assert (right.violations, right.frames) == (0, len(messages))
    other = CrossCheck()
    other.add(messages, settings, maps={1: make_map(2, axes=7)})
    assert other.violations > 100
    assert main(["check", str(tmp_path / "two.mcap")]) == 0


def test_a_cleared_map_publishes_no_more(board: Callable[[str], biotac.Hand]) -> None:
    hand = board("press.toml?seconds=60")
    hand.board.set_map(0, make_map(1))
    before = hand.read_batch(0.5).wire
    hand.stop()
    hand.board.clear_map(0)
    assert ((before["flags"] & biotac.FrameFlags.MAPPED) != 0).any()
    flags = before["flags"]
    for _ in range(40):  # a board that runs ahead had sent seconds before the stop
        flags = np.concatenate([flags, hand.read_batch(0.5).wire["flags"]])
        if not flags[-1] & biotac.FrameFlags.MAPPED:
            break
    mapped = (flags & (biotac.FrameFlags.MAPPED | biotac.FrameFlags.UNTARED)) == biotac.FrameFlags.MAPPED
    tared = (flags & biotac.FrameFlags.UNTARED) == 0
    assert mapped[tared].argmin() == mapped.sum() < tared.sum()  # mapped up to the stop, and never again


# ---- power -------------------------------------------------------------------------------------


def opened(rig: Rig) -> biotac.Hand:
    rig.need("power")
    hand = rig.open("press.toml?fingers=2&seconds=300&pace=fast")  # time goes on while this program computes
    hand.stop()
    hand.link.release()
    return hand


def test_a_saved_map_holds_after_power_was_off(rig: Rig) -> None:
    hand = opened(rig)
    bound, anyones = make_map(1, serial=serial_of(hand, 0), blocks=BIG), make_map(2)
    hand.board.set_map(0, bound)
    hand.board.set_map(1, anyones)
    hand.board.save_settings()
    hand.board.clear_map(0)  # not saved
    hand.board.set_map(1, make_map(3, blocks=7))  # nor that
    reboot(hand, 2)
    assert hand.board.maps() == {0: bound, 1: anyones}
    hand.board.clear_map(0)
    hand.board.save_settings()
    reboot(hand, 3)
    assert hand.board.maps() == {1: anyones}


def test_a_power_cut_in_the_middle_leaves_the_old_map_or_the_new(rig: Rig) -> None:
    hand = opened(rig)
    kept = make_map(1)
    hand.board.set_map(0, kept)
    hand.board.save_settings()
    size = len(kept)
    written = SECTOR + -(-size // PART_BYTES) * PAGE  # bytes of flash until the map is whole: each part costs a page
    boots = 1
    for cut in (0, SECTOR - 1, SECTOR, SECTOR + 100, written - 1, written, written + 20, written + PAGE - 1):
        new = make_map(100 + cut)
        assert len(new) == size
        hand.link.board.do(f"cut power after {cut} flash bytes")  # type: ignore[attr-defined]
        upload_in_vain(hand, new)
        boots += 1
        hand.link.board.until(PATIENCE_S, boots=boots, usb={"state": "configured"})  # type: ignore[attr-defined]
        hand.ping()
        assert hand.board.maps().get(0) in (kept, new), cut
        if cut < written:
            assert hand.board.maps() == {0: kept}, cut
        kept = hand.board.maps()[0]
    assert hand.link.board.counters()["flash"]["wrong"] == []  # type: ignore[attr-defined]


def test_the_slowest_flash_loses_neither_link_nor_sensors(rig: Rig) -> None:
    hand = opened(rig)
    board = hand.link.board  # type: ignore[attr-defined]
    board.do("wear the flash out")  # 0.4 s for an erase, and nothing else runs meanwhile
    blob = make_map(1, serial=serial_of(hand, 1), blocks=BIG)
    hand.board.set_map(1, blob)
    hand.board.save_settings()
    facts = board.counters()
    assert (facts["boots"], facts["watchdog_resets"], facts["flash"]["wrong"]) == (1, 0, [])
    assert facts["flash"]["erases"] == 5 + 1  # the slot's, and the settings' first
    assert hand.board.maps() == {1: blob}  # in force: the sensor counts as there
    assert set(hand.read(0.3)["finger"]) == {0, 1}


def upload_in_vain(hand: biotac.Hand, blob: bytes) -> None:
    """Send all of it and the save, without waiting for any answer: the board goes away in the middle."""
    messages = [wire.BeginMap(1, 0, len(blob), zlib.crc32(blob))]
    messages += [wire.WriteMap(1, 0, at, part(blob, at)) for at in range(0, len(blob), PART_BYTES)]
    for message in (*messages, wire.EndMap(1, 0, zlib.crc32(blob)), wire.SaveSettings(1)):
        hand.board.send(message)
