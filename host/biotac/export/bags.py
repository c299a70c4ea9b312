"""Reading ROS bags, of ROS 1 and ROS 2."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag2 import Reader as Reader2

from ..errors import BiotacError, InputError, error_text


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """rosbags' reader of a bag, of ROS 1 by suffix. Raises InputError for one that cannot be read."""
    if not path.exists():
        raise InputError(f"{path} does not exist; expected a ROS 1 .bag, or the folder of a ROS 2 bag")
    try:
        with Reader1(path) if is_ros1(path) else Reader2(path) as bag:
            yield bag
    except BiotacError:
        raise
    except Exception as error:  # rosbags raises many types
        cure = "`rosbag reindex`" if is_ros1(path) else "`mcap recover`, then `ros2 bag reindex`"
        cure = f"a recorder that was killed leaves it so: {cure} mends it, else copy it again"
        raise InputError(f"{path} cannot be read as a ROS bag ({error_text(error)}); {cure}") from error


def is_ros1(path: Path) -> bool:
    """By suffix, also while it was being written: .bag.active."""
    return path.name.lower().removesuffix(".active").endswith(".bag")
