"""What the proofs compare with: Table 1 from protocol/sensor.toml, and the constants that the C asserts."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cache

from .cnumbers import Unsupported
from .machine import Machine
from .source import ROOT, parse, run_c
from .storage import Value

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


@dataclass(frozen=True)
class Table:
    um: list[tuple[int, int, int]]
    milli: list[tuple[int, int, int]]
    radius_um: int
    e_max_q4: int

    @property
    def arm_nm(self) -> list[tuple[int, int, int]]:
        """r x n in nm: um times 1/1000."""
        pairs = zip(self.um, self.milli, strict=True)
        return [(y * c - z * b, z * a - x * c, x * b - y * a) for (x, y, z), (a, b, c) in pairs]

    def column(self, name: str, axis: int) -> list[int]:
        rows: list[tuple[int, int, int]] = getattr(self, name)
        return [row[axis] for row in rows]


@cache
def table() -> Table:
    sensor = tomllib.loads((ROOT / "protocol/sensor.toml").read_text(encoding="utf-8"))
    rows = sensor["geometry"]["electrodes"]
    return Table(
        um=[(row[1], row[2], row[3]) for row in rows],
        milli=[(row[4], row[5], row[6]) for row in rows],
        radius_um=sensor["geometry"]["core_radius_um"],
        e_max_q4=16 * sensor["bus"]["full_scale_count"],  # signals are in 1/16 count
    )


def constants(include: str, *names: str) -> list[int]:
    """The values of macros and constant expressions in the C."""
    text = "".join(f"const long long proof_{k} = (long long)({name});\n" for k, name in enumerate(names))
    machine = Machine(parse(f'#include "{include}"\n{text}'), None)  # type: ignore[arg-type]
    values = [machine.globals[f"proof_{k}"][0] for k in range(len(names))]
    if not all(isinstance(value, Value) and isinstance(value.x, int) for value in values):
        raise Unsupported(f"{names} are not all constant")
    return [value.x for value in values]


def doubles(include: str, *names: str) -> list[float]:
    """The values of a header's expressions as doubles, from a compiled program."""
    prints = "".join(f'    printf("%.17g\\n", (double)({name}));\n' for name in names)
    text = f'#include <stdio.h>\n#include "{include}"\nint main(void)\n{{\n{prints}    return 0;\n}}\n'
    return [float(line) for line in run_c(text, (ROOT / "firmware/reference",)).split()]
