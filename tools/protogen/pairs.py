"""The finger's left/right symmetry, pair by pair: which electrodes mirror each other, and sums over them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .c_sensor import electrodes
from .schema import Contract


def mirror_image(table: list[Any], i: int) -> int | None:
    """Which electrode is i on the other side; None on the midline. ValueError when there is no such one."""
    name, r, n = table[i]
    if r[1] == 0:
        return None
    image = ((r[0], -r[1], r[2]), (n[0], -n[1], n[2]))
    twins = [j for j, (_, q, m) in enumerate(table) if (q, m) == image]
    if len(twins) != 1:
        raise ValueError(f"sensor.toml: {name} has no mirror image; the sums go over pairs")
    return twins[0]


class Mirror:
    """Pairs and singles of Table 1, and sums over them grouped by equal coefficient."""

    def __init__(self, contract: Contract) -> None:
        self.table = electrodes(contract)
        self.pairs: list[tuple[int, int]] = []  # (negative y, positive y)
        for i, (_, r, _) in enumerate(self.table):
            image = mirror_image(self.table, i)
            if image is not None and r[1] < 0:
                self.pairs.append((i, image))
        paired = {k for pair in self.pairs for k in pair}
        self.singles = [i for i in range(len(self.table)) if i not in paired]

    def groups(self, value: Callable[[int], int], *, odd: bool) -> dict[int, list[str]]:
        """Coefficient -> the terms it multiplies, as C. ``odd``: the coefficient flips with y."""
        out: dict[int, list[str]] = {}
        for a, b in self.pairs:
            self._put(out, value(b), f"(v[{b}] - v[{a}])" if odd else f"(v[{a}] + v[{b}])")
        for i in self.singles:
            self._put(out, value(i), f"v[{i}]")
        return out

    @staticmethod
    def _put(out: dict[int, list[str]], coefficient: int, term: str) -> None:
        # Coefficients that differ in sign only share a product.
        if -coefficient in out:
            out[-coefficient].append(f"-{term}")
        elif coefficient:
            out.setdefault(coefficient, []).append(term)


def join(terms: list[str]) -> str:
    text = " + ".join(terms).replace("+ -", "- ")
    return text
