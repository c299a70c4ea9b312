"""A device's clock as the host sees it, across restarts."""

from __future__ import annotations

import math
import threading

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..wire.counters import nearest
from .segment import Fit, Segment

SEGMENTS_KEPT = 16
# During this time a drift of 500 ppm, more than any crystal has, moves the clocks against each other by 10 us.
EVERY_S = 0.02


class DeviceClock:
    """Converts device time to host time, with a bound on the error.

    Feed it with ``arrived`` for streamed messages and with ``round_trip`` for questions: five at the start, then about
    two a second, not in step with the board. Device times are unwrapped, in us (``frames["t_us"]``); ``extend`` unwraps
    that of a single message. Host times are seconds of one steady clock, ``time.monotonic()``; reading it late only
    widens the bound. ``unix_offset_s`` is ``time.time() - time.monotonic()``, for unix_time_s.

    An uncertainty is a bound on the error, not a standard deviation; segment.py has the assumptions. It includes half
    the quickest round trip, for a constant error that cannot be seen from here. Without any round trip nothing is
    known, unless ``promised_delay_s`` is given: the caller's promise that in every 5 s at least one message took no
    longer than that.

    A restart of the device, or a step of either clock, begins a new segment. Times are those of the latest segment
    unless another of ``segments`` is given. This class does no I/O and reads no clock.
    """

    def __init__(self, *, promised_delay_s: float | None = None, unix_offset_s: float | None = None) -> None:
        if promised_delay_s is not None and not 0 <= promised_delay_s < math.inf:
            raise ValueError(f"promised_delay_s is {promised_delay_s}, expected a finite number of seconds, 0 or more")
        self.unix_offset_s = unix_offset_s
        self.segments: list[Segment] = []  #: the latest last; at most SEGMENTS_KEPT
        self.resets = 0  #: how many segments began after the first
        self.quickest_round_trip_s = math.inf
        self._promised_delay_s = promised_delay_s
        self._because = ""
        self._lock = threading.RLock()  # one thread feeds the clock, others ask it

    # ---- observations ----------------------------------------------------------------------------

    def __repr__(self) -> str:
        fit = self.now()
        known = f"{fit.drift_ppm:+.1f} ppm, within {fit.uncertainty_s * 1e3:.2f} ms" if fit.known else "nothing known"
        return f"<biotac.clock.DeviceClock: {known}, {self.resets} resets>"

    def arrived(self, t_us: int, host_s: float) -> None:
        """Note that a message made at device time ``t_us`` or later had arrived at ``host_s``.

        For a chunk, the newest message is enough. For a round's messages, give t_us + LAST_SAMPLE_US.
        """
        with self._lock:
            self._segment(t_us, -math.inf, host_s).arrive(t_us, host_s)
            if self.segments[-1].contradicted:
                self._begin(t_us, host_s, "no drift that the clocks can have fits the observations")
                self.segments[-1].arrive(t_us, host_s)

    def round_trip(self, sent_s: float, t_us: int, received_s: float) -> None:
        """Note a question sent at ``sent_s``, answered at device time ``t_us``, the answer received at ``received_s``.

        Raises ValueError when ``received_s`` is before ``sent_s``.
        """
        if not sent_s <= received_s:
            raise ValueError(f"received_s is {received_s}, before sent_s {sent_s}; take both from one monotonic clock")
        with self._lock:
            self._segment(t_us, sent_s, received_s).send(t_us, sent_s)
            self.quickest_round_trip_s = min(self.quickest_round_trip_s, received_s - sent_s)
            self.arrived(t_us, received_s)

    def restart(self, because: str = "the board restarted") -> None:
        """Begin a new segment with the next observation: the device restarted, as another boot_id shows."""
        self._because = because

    def extend(self, t_us: int, host_s: float) -> int:
        """A message's 32-bit ``t_us`` as unwrapped device time, given when it arrived.

        Correct while the guess from the host's time is off by less than 35 minutes: with a crystal's drift, for months
        after the segment began.
        """
        return nearest(t_us, round(self.segments[-1].guess_t_us(host_s))) if self.segments else t_us

    def _segment(self, t_us: int, sent_s: float, arrived_s: float) -> Segment:
        because = self._because
        if self.segments and not because:
            because = self.segments[-1].refuses(t_us, sent_s, arrived_s)
        if because or not self.segments:
            self._begin(t_us, arrived_s, because)
        return self.segments[-1]

    def _begin(self, t_us: int, host_s: float, because: str) -> None:
        self.resets += len(self.segments) > 0
        self._because = ""
        self.segments.append(Segment(t_us, host_s, promised_delay_s=self._promised_delay_s, because=because))
        del self.segments[:-SEGMENTS_KEPT]

    # ---- answers ---------------------------------------------------------------------------------

    def host_time_s(self, t_us: ArrayLike, *, segment: int = -1) -> NDArray[np.float64]:
        """Host times in s of device times, in the shape of ``t_us``; NaN while nothing is known.

        The result for the same time can change as more is observed, by no more than the two uncertainties together.
        """
        return self._times(t_us, segment)[0]

    def uncertainty_s(self, t_us: ArrayLike, *, segment: int = -1) -> NDArray[np.float64]:
        """Bounds on the error of host_time_s in s, in the shape of ``t_us``; infinite while nothing is known."""
        return self._times(t_us, segment)[1]

    def unix_time_s(self, t_us: ArrayLike, *, segment: int = -1) -> NDArray[np.float64]:
        """Like host_time_s, in seconds since 1970. Raises ValueError without a ``unix_offset_s``."""
        if self.unix_offset_s is None:
            raise ValueError("unix_offset_s is not set; set it to time.time() - time.monotonic()")
        return self.host_time_s(t_us, segment=segment) + self.unix_offset_s

    def estimate_s(self, t_us: float) -> float:
        """A cheap estimate of the host time of one device time, in s; NaN while nothing is known."""
        with self._lock:
            return self.segments[-1].estimate_s(t_us) if self.segments else math.nan

    def now(self) -> Fit:
        """Host time and drift at the newest device time; ``known`` is false while nothing is known."""
        with self._lock:
            if not self.segments:
                return Fit(math.nan)
            return self.segments[-1].fit(self.segments[-1].last_t_us)

    def _times(self, t_us: ArrayLike, segment: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        at = np.asarray(t_us, np.float64)
        if not self.segments:
            return np.full(at.shape, np.nan), np.full(at.shape, np.inf)
        with self._lock:
            host_s, bound_s = self.segments[segment].times(at.ravel())
        return host_s.reshape(at.shape), bound_s.reshape(at.shape)


class Arrivals:
    """Passes the quickest message of every EVERY_S to a clock.

    The clock's bound depends only on the quickest message of each second. Passing on each of thousands of chunks a
    second would cost the reading thread as much as decoding them.
    """

    def __init__(self, clock: DeviceClock) -> None:
        self._clock = clock
        self._due_s = -math.inf
        self.forget()

    def forget(self) -> None:
        """Forget earlier messages: the device restarted, and device time began anew."""
        self._lag_s = math.inf
        self._t_us = 0
        self._host_s = 0.0

    def note(self, t_us: int, host_s: float) -> None:
        """See DeviceClock.arrived."""
        lag_s = host_s - t_us * 1e-6
        if lag_s < self._lag_s:
            self._lag_s, self._t_us, self._host_s = lag_s, t_us, host_s
        if host_s >= self._due_s:
            self._due_s = host_s + EVERY_S
            self._lag_s = math.inf
            self._clock.arrived(self._t_us, self._host_s)
