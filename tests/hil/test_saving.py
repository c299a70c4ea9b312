"""SAVE_SETTINGS on every rig, and a board that has no loader. What survives a reboot: test_pico_flash.py."""

from __future__ import annotations

import pytest

from biotac import Setting
from biotac.errors import CommandRefusedError
from biotac.wire import messages_gen as wire
from biotac.wire.identity import board_name


def test_saving_is_refused_while_streaming_and_done_when_not(board) -> None:
    hand = board("press.toml")
    hand.stream()
    with pytest.raises(CommandRefusedError, match="send STOP first"):
        hand.board.save_settings()
    hand.stop()
    hand.board.set_setting(Setting.IDLE_PERIOD_MS, 250)
    hand.board.save_settings()
    assert hand.board.setting(Setting.IDLE_PERIOD_MS) == 250


def test_a_process_has_no_loader(board) -> None:
    hand = board("press.toml")
    if hand.info.board != wire.Board.POSIX_SIM:
        pytest.skip(f"a {board_name(hand.info)} has a loader, and would leave for it")
    with pytest.raises(CommandRefusedError, match="this kind of board cannot do that"):
        hand.board.reboot_bootloader()
