"""Changes that a streaming board refuses on every rig, and a board that has no loader. Changes that survive a reboot:
test_pico_flash.py.
"""

import pytest
from maps import make_map

from biotac import Calibration, Setting
from biotac.errors import CommandRefusedError
from biotac.wire import messages_gen as wire
from biotac.wire.identity import board_name


def test_nothing_is_saved_or_changed_while_streaming(board) -> None:
    hand = board("press.toml")
    own, old, new = Calibration(thermal_gain_milli=700), make_map(1), make_map(2)
    hand.board.set_calibration(0, own)
    if hand.info.map_bytes:
        hand.board.set_map(0, old)
    changes = [
        hand.board.save_settings,
        lambda: hand.board.set_calibration(0, Calibration()),
        lambda: hand.board.clear_calibration(0),
    ]
    if hand.info.map_bytes:
        changes += [lambda: hand.board.set_map(0, new), lambda: hand.board.clear_map(0)]
    hand.stream()
    for change in changes:
        with pytest.raises(CommandRefusedError, match="send STOP first"):
            change()
    # Asking is allowed.
    assert hand.board.calibration(0) == own and hand.board.get_map(0) == (old if hand.info.map_bytes else None)
    hand.stop()
    for change in changes:
        change()
    hand.board.set_setting(Setting.IDLE_PERIOD_MS, 250)
    hand.board.save_settings()
    assert hand.board.setting(Setting.IDLE_PERIOD_MS) == 250
    assert (hand.board.calibration(0), hand.board.get_map(0)) == (None, None)


def test_a_process_has_no_loader(board) -> None:
    hand = board("press.toml")
    if hand.info.board != wire.BoardKind.POSIX_SIM:
        pytest.skip(f"a {board_name(hand.info)} has a loader, and would leave for it")
    with pytest.raises(CommandRefusedError, match="this kind of board cannot do that"):
        hand.board.reboot_bootloader()
