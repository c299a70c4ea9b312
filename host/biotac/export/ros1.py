"""ROS 1 bag, with standard messages only."""

from __future__ import annotations

from functools import partial

from . import ros2

KINDS_APART = False
BESIDE = True
write = partial(ros2.write, ros1=True)
