"""SAVE_SETTINGS on every rig, and a board that has no loader. What survives a reboot: test_pico_flash.py."""

from __future__ import annotations

import pytest

from biotac import Setting
from biotac.errors import CommandRefusedError


def test_saving_is_refused_while_streaming_and_done_when_not(board) -> None:
    hand = board("press.toml")
    hand.stream()
    with pytest.raises(CommandRefusedError, match="send STOP first"):
        hand.board.save_settings()
    hand.stop()
    hand.board.set_setting(Setting.IDLE_PERIOD_MS, 250)
    hand.board.save_settings()
    assert hand.board.setting(Setting.IDLE_PERIOD_MS) == 250


def test_a_process_has_no_loader(rig, board) -> None:
    if rig.name != "posix":
        pytest.skip(f"{rig.name} has a loader, and would leave for it")
    with pytest.raises(CommandRefusedError, match="this kind of board cannot do that"):
        board("press.toml").board.reboot_bootloader()
