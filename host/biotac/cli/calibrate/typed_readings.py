"""Readings of a scale, typed in by whoever presses."""

from __future__ import annotations

import sys

from ...errors import InputError

MAX_N = 100.0  # no finger bears more


def reading_n(which: str, unit: str = "N", newtons: float = 1.0) -> float:
    """Ask on stderr until a force between 0 and MAX_N is typed in, in ``unit`` of ``newtons`` each; return it in N.

    Raises InputError at the end of the input.
    """
    while True:
        print(f"{which}: the scale shows [{unit}] ", end="", file=sys.stderr, flush=True)
        try:
            value_n = float(input()) * newtons
        except ValueError:
            continue
        except EOFError as error:
            raise InputError(f"no reading was typed in; expected a number in {unit}") from error
        if 0 < value_n < MAX_N:
            return value_n
