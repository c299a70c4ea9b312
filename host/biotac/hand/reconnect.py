"""Reconnecting after a lost link: find the board, restore what it was told before, and mark the gap."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ..errors import DeviceLostError, NotAGatewayError, PortError
from ..wire import messages_gen as wire
from .board import Board
from .gap import Gap, Reason

RETRY_S = 0.25


class Reconnection:
    """Takes over ``board.lost``.

    ``last_t_us`` returns the device time of the latest row, None before any. ``resume`` is called with whether the
    board had restarted, once it has been told its settings, calibrations, subscriptions and maps again.
    """

    def __init__(self, board: Board, last_t_us: Callable[[], int | None], resume: Callable[[bool], object]) -> None:
        self._board = board
        self._last_t_us = last_t_us
        self._resume = resume
        board.lost = self._lost

    def _lost(self, error: DeviceLostError, reason: Reason) -> None:
        board = self._board
        if not board.connected or board.closed:
            raise error
        lost_at_ns = board.host_clock.unix_ns()
        board.connected = False
        board.notify()
        try:
            board.incoming.end_packet()
            before = board.info
            while not self._restored(before, reason, lost_at_ns):
                if board.closing.is_set():
                    raise error
                board.host_clock.sleep(RETRY_S)
        finally:
            board.connected = True
            board.notify()

    def _restored(self, before: wire.Hello, reason: Reason, lost_at_ns: int) -> bool:
        """Try once to find the board, tell it again what it was told before, and let it stream."""
        board = self._board
        try:
            if not self._found(before):
                return False
            if board.info.boot_id != before.boot_id:
                reason = "rebooted"
                board.incoming.restarted(board.info)
            # Before START, because rows may come with its reply. Two losses without a row in between are one gap.
            gap = board.incoming.gap or Gap(reason, self._last_t_us(), None, lost_at_ns, 0, 0)
            if gap.reason == "rebooted":
                reason = "rebooted"
            back_at_ns = board.host_clock.unix_ns()
            board.incoming.gap = replace(gap, reason=reason, back_at_ns=back_at_ns, boot_id=board.info.boot_id)
            board.tell_again()
            self._resume(reason == "rebooted")
        except DeviceLostError:
            return False  # gone again
        return True

    def _found(self, before: wire.Hello) -> bool:
        board = self._board
        for place in board.link.places():
            try:
                board.link.reopen(place)
                hello = board.handshake()
            except (PortError, DeviceLostError, NotAGatewayError):
                continue
            if hello.board_serial == before.board_serial:
                board.info = hello
                return True
        return False
