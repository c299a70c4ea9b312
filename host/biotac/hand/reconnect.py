"""Coming back after a lost link: the board is looked for, told what it was told before, and the gap is marked."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..errors import DeviceLostError, InputError, NotAGatewayError, PortError
from ..wire import messages_gen as wire
from ..wire.batches import Batch, StreamDecoder
from ..wire.sensor_gen import MAX_SENSORS
from .board import Conversation
from .gap import GAP, Gap, Reason

RETRY_S = 0.25


class ComingBack(Conversation):
    """What happens between a link that is gone and one that is there again."""

    def _lost(self, error: DeviceLostError, reason: Reason) -> None:
        """The link is gone: raise, or return once the board is back as it was."""
        if not (self._reconnect and self.connected) or self._closed:
            raise error
        lost_at_ns = self.timing.unix_ns()
        with self._changed:
            self.connected = False
            self._changed.notify_all()
        try:
            self._take(b"\0")  # ends the half frame that was on its way, here and in a recording
            before = self.info
            while not self._bring_back(before, reason, lost_at_ns):
                if self.closing.is_set():
                    raise error
                self.timing.pause(RETRY_S)
        finally:
            with self._changed:
                self.connected = True
                self._changed.notify_all()

    def _bring_back(self, before: wire.Hello, reason: Reason, lost_at_ns: int) -> bool:
        """One try: find the board, tell it what it was told before, and let it stream."""
        try:
            if not self._found(before):
                return False
            if self.info.boot_id != before.boot_id:
                reason = "rebooted"
                self._past.append(self._decoder.stats(0, 0))
                self._decoder = StreamDecoder()
                self.clock.restart()
                self._arrivals.forget()
                self._checked(self.info)
            # Before START: rows may come with its reply. Two losses without a row between them are one gap.
            gap = self._gap or Gap(reason, self._last_t_us(), None, lost_at_ns, 0, 0)
            if gap.reason == "rebooted":
                reason = "rebooted"
            self._gap = replace(gap, reason=reason, back_at_ns=self.timing.unix_ns(), boot_id=self.info.boot_id)
            for request in self._session.requests():
                self._again(request)
            for finger, blob in self._session.maps().items():
                self._tell_map(finger, blob)
            if reason == "rebooted":
                self._record_on()
            if self._started:
                self._again(self._started)
        except DeviceLostError:
            return False  # gone again
        return True

    def _record_on(self) -> None:
        """A restarted board's rows go into a file of their own."""
        if self._recorder is None or self._recorder.closed:
            return
        try:
            self._recorder.go_on(self.info, *self._to_be_recorded())
        except (OSError, InputError) as error:
            self._recorder = None
            self._trouble = error

    def _to_be_recorded(self) -> tuple[Any, Any, Any, Any]:
        """Settings, calibrations, sensors and maps: what a recording's results rest on."""
        present = self.info.fingers_present
        sensors = [self.sensor_info(finger) for finger in range(MAX_SENSORS) if present >> finger & 1]
        return self.settings(), self.calibrations(), sensors, self.maps()

    def _again(self, request: Any) -> None:
        self._ask(replace(request, req_id=self._next_req_id()), wire.ANSWERS[type(request)])

    def _found(self, before: wire.Hello) -> bool:
        for place in self.link.places():
            try:
                self.link.reopen(place)
                hello = self._handshake()
            except (PortError, DeviceLostError, NotAGatewayError):
                continue
            if hello.board_serial == before.board_serial:
                self.info = hello
                return True
        return False

    def _mark(self, gap: Gap, batch: Batch) -> None:
        self._gap = None
        self._gaps += 1
        batch.messages.insert(0, gap)
        if self._recorder is not None:
            self._recorder.mark(GAP, gap.as_text())
