"""Extras by name: kinds of port and bridges, of this distribution or anyone's, loaded only when they are named.

A distribution adds one by an entry point in pyproject.toml:

    [project.entry-points."biotac.ports"]
    mine = "my_package.port:open_port"    # biotac.open("mine:WHAT") calls open_port("mine:WHAT", pace) -> Link
    [project.entry-points."biotac.bridges"]
    mine = "my_package.bridge"            # biotac share PORT --by mine calls run(args) there -> exit code

This file is the only way in: nothing else here imports an extra.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Any, TypeVar

from .errors import BiotacError, InputError

PORTS, BRIDGES = "biotac.ports", "biotac.bridges"
#: The distributions of this project with extras that the gateway itself lacks.
ELSEWHERE = {"emu": "biotac-rig"}

Result = TypeVar("Result")


def names(group: str) -> list[str]:
    """Names of the extras that are installed."""
    return sorted({point.name for point in entry_points(group=group)})


def call(group: str, name: str, use: Callable[[Any], Result]) -> Result:
    """The result of ``use`` on the extra. Raises KeyError where no distribution has it.

    An error that is neither ours nor the system's becomes an InputError that names the extra.
    """
    point = next(iter(entry_points(group=group, name=name)), None)
    if point is None:
        raise KeyError(name)
    try:
        return use(point.load())
    except (BiotacError, OSError):
        raise
    except Exception as error:
        whose = f"{point.dist.name} {point.dist.version}" if point.dist is not None else point.value
        cure = f"update {whose.partition(' ')[0]}, or uninstall it"
        raise InputError(f"{point.name}, an extra of {whose}, failed ({error!r}); {cure}") from error


def rig(purpose: str, use: Callable[[Any], Result]) -> Result:
    """The result of ``use`` on biotac-rig's ``hooks``. Raises InputError with ``purpose`` where it is not installed."""
    try:
        return call("biotac.rig", "hooks", use)
    except KeyError:
        raise InputError(f"{purpose} needs {missing('emu')}") from None


def missing(name: str) -> str:
    """The distribution that has this extra, and how to install it; empty for an unknown one."""
    where = ELSEWHERE.get(name)
    return (
        f"{where}, which is not installed; pip install {where}, in a clone pip install ./host/{where}" if where else ""
    )
