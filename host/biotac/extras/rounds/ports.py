"""The ports with rounds from messages, by their text. They have a time of their own, which no ``pace`` changes.

All raise PortError, or InputError for a file.
"""

from __future__ import annotations

from pathlib import Path

from ...errors import imported
from ...link.port_text import file_and_options
from .link import MessagesLink


def open_bag(port: str, pace: float) -> MessagesLink:
    """``bag:FILE?topic=T``, of ROS 1 or ROS 2."""
    path, options = file_and_options(port, ("topic",), "bag:FILE?topic=/rh/tactile")
    bag = imported("biotac.extras.rounds.bag", port, "robot")
    return MessagesLink(port, bag.Bag(Path(path), options.get("topic", "")))


def open_csv(port: str, pace: float) -> MessagesLink:
    """``csv:FILE?columns=FILE.toml``."""
    from .table import CsvRows

    path, options = file_and_options(port, ("columns",), "csv:FILE?columns=FILE.toml")
    return MessagesLink(port, CsvRows(Path(path), options.get("columns")))


def open_foxglove(port: str, pace: float) -> MessagesLink:
    """``foxglove://HOST:PORT/topic``."""
    host, _, topic = port.partition("://")[2].partition("/")
    foxglove = imported("biotac.extras.rounds.foxglove", port, "robot")
    return MessagesLink(port, foxglove.Foxglove(port, host, topic and f"/{topic}"))


def open_btd(port: str, pace: float) -> MessagesLink:
    """``btd:FILE``, SynTouch's own."""
    from .btd import Btd

    path, _ = file_and_options(port, (), "btd:FILE.btd")
    return MessagesLink(f"btd:{Path(path).name}", Btd(Path(path)))
