"""A board's clock and a USB link with truth, by which biotac.clock is judged.

Nothing of biotac is used here. Host time is the truth's own axis; the board's crystal runs at a rate that
may wander; a message waits for the next USB frame (1 ms), then for a heavy-tailed while, and sometimes the
computer stalls for 50 ms: nothing comes out in them, and everything does after them.
"""

from dataclasses import dataclass, field

import numpy as np

WAY_S = 0.000_15  # no message is quicker
USB_S = 0.001
TAIL_S = 0.000_08
STALL_S = 0.05
STALLS_EVERY_S = 4.0
ROUND_US = 10_000
LAST_SAMPLE_US = 9_772
PING_EVERY_S = 0.491_9


@dataclass
class Model:
    """One board on one link, for ``seconds``."""

    seed: int
    seconds: float
    ppm: float = 50.0
    wander_ppm_per_s: float = 0.0
    first_us: float = 3_000_000.0
    host_start_s: float = 123_456.0
    way_back_s: float = WAY_S  # board to host
    rng: np.random.Generator = field(init=False)

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self.usb_phase_s = self.rng.uniform(0, USB_S)
        starts = np.cumsum(self.rng.exponential(STALLS_EVERY_S, int(self.seconds / STALLS_EVERY_S * 3) + 10))
        self.stalls = self.host_start_s + starts
        # Drift second by second: it turns round at random, always at the full wander.
        n = int(self.seconds) + 60
        turns = np.where(self.rng.random(n) < 0.03, -1.0, 1.0).cumprod()
        drift = self.ppm + np.concatenate([[0.0], np.cumsum(turns * self.wander_ppm_per_s)])
        rate = 1.0 + drift * 1e-6
        self._device_s = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2)])
        self._rate = rate

    def device_us(self, host_s: float | np.ndarray) -> np.ndarray:
        """The board's clock, exactly: the rate is straight within each second."""
        x = np.asarray(host_s, float) - self.host_start_s
        k = np.clip(np.floor(x).astype(int), 0, len(self._rate) - 2)
        u = x - k
        rate, change = self._rate[k], self._rate[k + 1] - self._rate[k]
        return self.first_us + (self._device_s[k] + u * rate + u**2 / 2 * change) * 1e6

    def host_s(self, device_us: float | np.ndarray) -> np.ndarray:
        """The inverse of ``device_us``."""
        at = np.asarray(device_us, float)
        host = self.host_start_s + (at - self.first_us) / 1e6 / (1 + self.ppm * 1e-6)
        for _ in range(6):
            host = host - (self.device_us(host) - at) / 1e6
        return host

    def delivered(self, sent_s: np.ndarray, way_s: float = WAY_S) -> np.ndarray:
        """When messages that were sent at these times arrive, in order."""
        sent_s = np.asarray(sent_s, float)
        slot = np.ceil((sent_s - self.usb_phase_s) / USB_S) * USB_S + self.usb_phase_s
        tail = TAIL_S * self.rng.pareto(2.0, sent_s.shape)
        arrival_s = slot + way_s + np.minimum(tail, 0.5)
        at = np.searchsorted(self.stalls, arrival_s, side="right") - 1
        end = np.where(at >= 0, self.stalls[np.maximum(at, 0)] + STALL_S, -np.inf)
        return np.maximum.accumulate(np.maximum(arrival_s, end))

    def frames(self) -> tuple[np.ndarray, np.ndarray]:
        """Rounds' t_us, whole us, and when their messages arrive."""
        t_us = np.arange(self.first_us, self.first_us + self.seconds * 1e6, ROUND_US)
        made = self.host_s(t_us + ROUND_US + 100)
        return t_us.astype(np.int64), self.delivered(made, self.way_back_s)

    def pings(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Sent, the board's time of answering in whole us, received: five at once, then one in a while."""
        start = self.host_start_s + 0.05
        sent = np.concatenate(
            [start + 0.003 * np.arange(5), np.arange(start + 1, start + self.seconds - 2, PING_EVERY_S)]
        )
        arrival_s = np.array([float(self.delivered(np.array([s]))[0]) for s in sent])
        answered = arrival_s + self.rng.uniform(20e-6, 300e-6, len(sent))
        back = np.array([float(self.delivered(np.array([s]), self.way_back_s)[0]) for s in answered])
        return sent, np.floor(self.device_us(answered)).astype(np.int64), back

    def events(self) -> list[tuple[float, float, int]]:
        """(received, sent or NaN, device time) in the order of arrival at a host."""
        t_us, arrived = self.frames()
        sent, answered_us, back = self.pings()
        # A message that left at once but arrived before is in a chunk: the host sees only each chunk's newest.
        out = [(float(a), float("nan"), int(t) + LAST_SAMPLE_US) for t, a in zip(t_us, arrived, strict=True)]
        out += [(float(b), float(s), int(t)) for s, t, b in zip(sent, answered_us, back, strict=True)]
        return sorted(out)
