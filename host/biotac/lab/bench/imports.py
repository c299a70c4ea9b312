"""What startup costs: CPU time of processes that only import, interleaved, medians, in one run."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys

BASE = "import numpy"
STARTS = {
    "pass": ("-c", "pass"),
    BASE: ("-c", "import numpy"),
    "import biotac": ("-c", "import biotac"),
    "import biotac, all its names": ("-c", "from biotac import *"),
    "biotac.open named": ("-c", "import biotac; biotac.open"),
    "biotac --help": ("-m", "biotac", "--help"),
    "biotac version": ("-m", "biotac", "version"),
}


def measure(rounds: int) -> dict[str, float]:
    """Median CPU seconds (user and system) of each startup."""
    taken: dict[str, list[float]] = {name: [] for name in STARTS}
    for _ in range(rounds):
        for name, words in STARTS.items():
            before = os.times()
            subprocess.run([sys.executable, *words], stdout=subprocess.DEVNULL, check=True)
            after = os.times()
            taken[name].append(
                after.children_user + after.children_system - before.children_user - before.children_system
            )
    return {name: statistics.median(times) for name, times in taken.items()}
