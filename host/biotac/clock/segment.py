"""One run of the device's clock against the host's, from observations that are never early.

A message with device time t arrives after t, and a question was sent before the device time in the answer. Nothing
else is assumed about delays: no distribution, no typical value. About the clocks it is assumed that the drift stays
within MAX_DRIFT and changes no faster than WANDER_PER_S. Then the tangent to the true course at any device time t0
lies below every arrival and above every sending, each loosened by WANDER_PER_S / 2 * (t - t0)^2. The estimate is in
the middle of all such lines (band.py), and the stated uncertainty reaches to the farthest of them: it is a bound, not
a standard deviation. Old observations are loosened until they say nothing; this is how they are forgotten.

It cannot be observed how the quickest round trip divides into the way there and the way back. The estimate assumes
about half each, so it is off by a constant of at most half the quickest round trip. The stated uncertainty includes
this.

Sources: for lines below arrivals, Moon, Skelly, Towsley, "Estimation and removal of clock skew from network delay
measurements" (1999); for round trips, Klipper's clocksync.py and liblsl's time_receiver.cpp.
"""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .band import between

Array = NDArray[np.float64]

#: Crystals are within 100 ppm; the margin is for a host with a clock that is being steered.
MAX_DRIFT = 500e-6
#: A crystal that warms by 10 K in five minutes changes by some ppm: 0.02 ppm a second is above that.
WANDER_PER_S = 0.02e-6
#: Device time is in whole us, so it is never more exact than that.
TICK_S = 1e-6
#: This far from a time, an observation has been loosened by 0.2 ms and adds nothing about it.
REACH_S = 150.0
#: Of the arrivals in each such span of host time, only the quickest counts.
BUCKET_S = 1.0
#: Between knots the course is taken as straight: WANDER_PER_S bends it by at most a quarter of a us.
KNOT_S = 10.0
#: Older observations are dropped, and times near them become uncertain.
KEEP_S = 3600.0
#: Without round trips: in every span of this length one message was as quick as promised.
PROMISE_S = 5.0
#: A clock that goes back by more than this was restarted; messages overtake each other by less.
STEP_BACK_US = 1_000_000


@dataclass(frozen=True)
class Fit:
    """The state of the clocks around one device time."""

    t_us: float
    host_s: float = math.nan
    uncertainty_s: float = math.inf  #: bound: the true host time is within plus or minus this
    drift_ppm: float = math.nan  #: of the device's clock against the host's; positive: the device's is fast
    drift_uncertainty_ppm: float = math.inf  #: bound, likewise

    @property
    def known(self) -> bool:
        """Whether there were enough observations for a bound."""
        return math.isfinite(self.uncertainty_s)

    def extended(self, t_us: Array) -> tuple[Array, Array]:
        """Host times and bounds in s at other device times, along the straight line through this one."""
        away_s = (t_us - self.t_us) / 1e6
        bend_s = WANDER_PER_S / 2 * away_s**2
        host_s = self.host_s + away_s * (1.0 - self.drift_ppm / 1e6)
        return host_s, self.uncertainty_s + np.abs(away_s) * self.drift_uncertainty_ppm / 1e6 + bend_s


class Points:
    """Observations in order of x. x: device time in s since the segment's start; y: host time since then minus x."""

    def __init__(self) -> None:
        self._x: list[float] = []
        self._y: list[float] = []

    def add(self, x: float, y: float) -> None:
        """Insert a point, almost always at the end."""
        at = bisect.bisect_right(self._x, x)
        self._x.insert(at, x)
        self._y.insert(at, y)

    def around(self, x0: float) -> tuple[Array, Array]:
        """The points within REACH_S of x0, with x counted from x0."""
        cut = slice(bisect.bisect_left(self._x, x0 - REACH_S), bisect.bisect_right(self._x, x0 + REACH_S))
        return np.array(self._x[cut]) - x0, np.array(self._y[cut])

    def forget_before(self, x: float) -> None:
        n = bisect.bisect_left(self._x, x)
        del self._x[:n], self._y[:n]


class Segment:
    """The time from a boot of the device, or a jump of either clock, to the next."""

    def __init__(self, t_us: int, host_s: float, *, promised_delay_s: float | None = None, because: str = "") -> None:
        self.because = because  #: why it began; empty for the first
        self.first_t_us = t_us
        self.last_t_us = t_us
        self._first_host_s = host_s
        self._promised_delay_s = promised_delay_s
        self._arrived = Points()
        self._sent = Points()
        self._bucket: tuple[float, float] | None = None  # the quickest arrival since _bucket_from_s
        self._bucket_from_s = host_s
        self._latest = Fit(t_us)
        self.contradicted = False  #: enough was observed, but no course of the clocks agrees with it
        self._knots: dict[float, Fit] = {}  # fits that no later observation will change
        self._fresh: dict[float, Fit] = {}  # other fits, valid until the next observation

    # ---- observations ----------------------------------------------------------------------------

    def refuses(self, t_us: int, sent_s: float, arrived_s: float) -> str:
        """Why an observation cannot belong to this run; empty when it can."""
        if t_us < self.last_t_us - STEP_BACK_US:
            return "device time stepped back"
        if self._latest.known:
            host_s, bound_s = (float(v) for v in self._latest.extended(np.float64(t_us)))
            if arrived_s < host_s - bound_s - TICK_S:
                return "a message arrived before it could have been sent"
            if sent_s > host_s + bound_s + TICK_S:
                return "an answer is older than its question"
        return ""

    def arrive(self, t_us: int, host_s: float) -> None:
        """Note that a message made at device time t_us or later had arrived at host_s."""
        x, y = self._xy(t_us, host_s)
        slope = -self._latest.drift_ppm / 1e6 if self._latest.known else 0.0
        self.last_t_us = max(self.last_t_us, t_us)
        self._fresh.clear()
        if self._bucket is None or host_s - self._bucket_from_s >= BUCKET_S:
            self._close_bucket()
            self._bucket_from_s, self._bucket = host_s, (x, y)
        elif y - slope * x < self._bucket[1] - slope * self._bucket[0]:
            self._bucket = (x, y)

    def send(self, t_us: int, host_s: float) -> None:
        """Note that a question answered at device time t_us was sent at host_s."""
        self._sent.add(*self._xy(t_us, host_s))
        self._fresh.clear()

    def _close_bucket(self) -> None:
        if self._bucket is not None:
            self._arrived.add(*self._bucket)
            self._bucket = None
            oldest = (self.last_t_us - self.first_t_us) / 1e6 - KEEP_S
            self._arrived.forget_before(oldest)
            self._sent.forget_before(oldest)
            self._latest = self.fit(self.last_t_us)
            self.contradicted = not self._latest.known and self._observed(self._x(self.last_t_us)) is not None

    # ---- results ---------------------------------------------------------------------------------

    def fit(self, t_us: float) -> Fit:
        """The clocks at device time t_us; unknown without an arrival and a sending within reach."""
        if t_us not in self._fresh:
            self._fresh[t_us] = self._fit(t_us)
        return self._fresh[t_us]

    def estimate_s(self, t_us: float) -> float:
        """Host time of device time t_us, along a line that is at most a second old; NaN while nothing is known."""
        fit = self._latest if self._latest.known else self.fit(self.last_t_us)
        return fit.host_s + (t_us - fit.t_us) / 1e6 * (1.0 - fit.drift_ppm / 1e6) if fit.known else math.nan

    def times(self, t_us: Array) -> tuple[Array, Array]:
        """Host times and their bounds in s at ``t_us`` (n,); NaN and infinity while nothing is known.

        Linear between knots, so that times never run backwards and do not jump.
        """
        if not t_us.size:
            return t_us.copy(), t_us.copy()
        step, last = KNOT_S * 1e6, float(self.last_t_us)
        begin, end = (
            max(math.floor((min(t, last) - self.first_t_us) / step), 0) for t in (float(t_us.min()), float(t_us.max()))
        )
        knots = [self.first_t_us + k * step for k in range(begin, end + 2)]
        fits = [*(self._knot(at) for at in knots if at < last), self.fit(last)]
        fits = [fit for fit in fits if fit.known]
        if not fits:
            return np.full(t_us.shape, np.nan), np.full(t_us.shape, np.inf)
        at = [fit.t_us for fit in fits]
        host_s: Array = np.interp(t_us, at, [fit.host_s for fit in fits])
        bound_s: Array = np.interp(t_us, at, [fit.uncertainty_s for fit in fits])
        gaps_s = np.diff(at, prepend=at[0], append=at[-1]) / 1e6
        bound_s += WANDER_PER_S / 8 * gaps_s[np.searchsorted(at, t_us)] ** 2
        for outside, fit in ((t_us < at[0], fits[0]), (t_us > at[-1], fits[-1])):
            host_s[outside], bound_s[outside] = fit.extended(t_us[outside])
        return host_s, bound_s

    def guess_t_us(self, host_s: float) -> float:
        """Roughly the device time at host_s, without any drift."""
        return self.first_t_us + (host_s - self._first_host_s) * 1e6

    def _knot(self, t_us: float) -> Fit:
        fit = self._knots.get(t_us) or self.fit(t_us)
        if self.last_t_us - t_us > (REACH_S + KNOT_S) * 1e6:
            self._knots[t_us] = fit
        return fit

    def _observed(self, x0: float) -> tuple[tuple[Array, Array], tuple[Array, Array]] | None:
        """Loosened arrivals and sendings around x0; None without at least one of each."""
        x, y = self._arrived.around(x0)
        if self._bucket is not None and abs(self._bucket[0] - x0) <= REACH_S:
            x, y = np.append(x, self._bucket[0] - x0), np.append(y, self._bucket[1])
        from_x, from_y = self._sent.around(x0)
        if not len(from_x) and len(x) and self._promised_delay_s is not None:
            from_x, from_y = quickest(x, y)
            from_y = from_y - self._promised_delay_s
        if not len(x) or not len(from_x):
            return None
        return (x, y + WANDER_PER_S / 2 * x**2 + TICK_S), (from_x, from_y - WANDER_PER_S / 2 * from_x**2 - TICK_S)

    def _fit(self, t_us: float) -> Fit:
        x0 = self._x(t_us)
        observed = self._observed(x0)
        band = observed and between(*observed, (-MAX_DRIFT, MAX_DRIFT))
        if not band:
            return Fit(t_us)
        low, high = band.at_zero()
        y, slope = band.centre()
        return Fit(
            t_us,
            self._first_host_s + x0 + y,
            max(high - y, y - low),
            -slope * 1e6,
            max(float(band.slopes[-1]) - slope, slope - float(band.slopes[0])) * 1e6,
        )

    def _x(self, t_us: float) -> float:
        return (t_us - self.first_t_us) / 1e6

    def _xy(self, t_us: float, host_s: float) -> tuple[float, float]:
        x = self._x(t_us)
        return x, host_s - self._first_host_s - x


def quickest(x: Array, y: Array) -> tuple[Array, Array]:
    """The points with the smallest y in every PROMISE_S of x."""
    groups = np.floor(x / PROMISE_S)
    best = [np.flatnonzero(groups == g)[np.argmin(y[groups == g])] for g in np.unique(groups)]
    return x[best], y[best]
