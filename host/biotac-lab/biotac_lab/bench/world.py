"""How long a round of the simulated world takes, without a plant: sampling, board, link and library in lock-step."""

from __future__ import annotations

import statistics
import time

from biotac.sim import SimFinger, SimTouch, world

from ..report import Show, Table

ROUNDS = 500
ASKED_MS = {1: None, 2: 4.0, 5: 10.0}


def measure(show: Show) -> list[Table]:
    """Wall time of ROUNDS rounds in which every finger is pressed, moved and slides."""
    rows = []
    for fingers, asked in ASKED_MS.items():
        show(f"{fingers} fingers")
        names = [f"f{number}" for number in range(fingers)]
        with world({name: SimFinger(number + 1) for number, name in enumerate(names)}) as w:
            w.run(2.0)
            took_ms = []
            for k in range(ROUNDS):
                begin_s = time.perf_counter()
                w.step(**{name: SimTouch(2.0 + 0.01 * (k % 100), (0.1, 0.2), slip_mm_s=5.0) for name in names})
                took_ms.append(1e3 * (time.perf_counter() - begin_s))
        rows.append((fingers, statistics.median(took_ms), statistics.quantiles(took_ms, n=20)[-1], asked))
    return [Table("Lock-step, the firmware as a process", ("fingers", "median ms a round", "95 %", "asked"), rows)]
