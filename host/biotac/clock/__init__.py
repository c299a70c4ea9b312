"""When things happened: converts device time to host time, with a bound on the error.

>>> import numpy as np
>>> from biotac.clock import DeviceClock
>>> clock = DeviceClock()
>>> for k in range(100):  # a question each second: sent, answered 0.4 ms later, heard 0.6 ms after that
...     clock.round_trip(sent_s=50.0 + k, t_us=1_000_000 * k, received_s=50.001 + k)
>>> round(float(clock.host_time_s([30_000_000])[0]), 6)
80.0005
>>> bool(clock.uncertainty_s([30_000_000])[0] < 0.0006)
True
"""

from __future__ import annotations

from .device_clock import Arrivals, DeviceClock
from .sample_times import LAST_SAMPLE_US, channel_t_us, electrode_t_us, pac_t_us
from .segment import Fit, Segment

__all__ = ["LAST_SAMPLE_US", "Arrivals", "DeviceClock", "Fit", "Segment", "channel_t_us", "electrode_t_us", "pac_t_us"]
