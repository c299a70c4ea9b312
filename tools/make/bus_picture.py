#!/usr/bin/env python3
"""Draw firmware/boards/pico/bus.png: a logic analyser's view of a slot, from a VCD that the emulated Pico writes.

tools/make/bus_picture.py             record it, and draw
tools/make/bus_picture.py FILE.vcd    draw another recording, a bench's own too (lines named SCK MOSI MISO SS0.. TX)
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from biotac.hand.hand import Hand
from biotac.link.serial_port import SerialLink
from biotac.picture import picture
from biotac.sim.loading import load_source
from biotac.wire import messages_gen as wire
from biotac.wire.frames import StructArray
from biotac_rig.emulated import EmulatedBoard
from committed import ROOT

BITS_PER_S = 921_600
LINES = ("SS0", "SS1", "SS2", "SS3", "SS4", "SCK", "MOSI", "MISO", "TX")
Edges = tuple[np.ndarray, np.ndarray]


class PatientLink(SerialLink):
    """To an emulated board, which is slower than device time."""

    patience = 60.0


def record(path: Path, *, fingers: int = 5, seconds: float = 0.1) -> StructArray:
    """Have an emulated Pico write ``path`` while it streams over a UART; returns the FRAMEs from there."""
    board = EmulatedBoard(
        "pico", load_source("press.toml", fingers=fingers, seconds=60.0), pace=0.0, hold=False, uart=True
    )
    try:
        with Hand(PatientLink(board.path)) as hand:
            hand.board.set_setting(wire.Setting.UART_BITS_PER_S, BITS_PER_S)
            hand.board.save_settings()
        board.do("cut power")  # from then on it has a UART
        board.until(5.0, uart={"sent": 0})
        with Hand(PatientLink(board.uart_path, BITS_PER_S)) as hand:
            board.do(f"write vcd {path}")
            return hand.read_batch(seconds).wire
    finally:
        board.close()


def read_vcd(path: Path) -> dict[str, Edges]:
    """By a line's name: the times of the changes in ns, and the levels from then on. The timescale must be in ns."""
    text = path.read_text()
    scale = re.search(r"\$timescale\s+(\d+)\s*ns", text)
    if scale is None:
        raise SystemExit(f"{path}: no $timescale in ns; export it from the analyser with one")
    names = {mark: name for mark, name in re.findall(r"\$var \w+ 1 (\S+) (\S+)", text)}
    edges: dict[str, list[tuple[int, int]]] = {name: [] for name in names.values()}
    at_ns = 0
    for word in text[text.index("$enddefinitions") :].split():
        if word[0] == "#":
            at_ns = int(word[1:]) * int(scale[1])
        elif word[0] in "01" and word[1:] in names:
            edges[names[word[1:]]].append((at_ns, int(word[0])))
    return {name: tuple(np.array(some, np.int64).reshape(-1, 2).T) for name, some in edges.items()}


def slots_ns(lines: dict[str, Edges]) -> np.ndarray:
    """When slots begin: the falls of all selects at once."""
    falls = [at_ns[levels == 0] for at_ns, levels in (lines[name] for name in ("SS0", "SS1"))]
    return np.intersect1d(*falls)


def draw(lines: dict[str, Edges], path: Path) -> None:
    """One slot, and a word of it."""
    slots = slots_ns(lines)
    start_ns = slots[np.searchsorted(slots, lines["TX"][0][1]) - 1 if len(lines["TX"][0]) > 1 else 0]  # TX speaks, too
    first_us = float((lines["SS0"][0][lines["SS0"][0] > start_ns + 40_000][0] - start_ns) / 1000)
    with picture(path) as page:
        page.set_size_inches(10, 7)
        slot, word = page.subplots(2, 1)
        show(slot, lines, start_ns, (-8.0, 228.0))
        slot.set_title("A slot: the command to all fingers at once; 50 us later each is read by itself")
        show(word, lines, start_ns, (first_us - 1.0, first_us + 9.0))
        word.set_title(
            "The read of finger 0: SS0 falls at least 1.8 us before the first clock; bits are valid where SCK rises"
        )


def show(axes: Any, lines: dict[str, Edges], start_ns: float, span_us: tuple[float, float]) -> None:
    """The lines over one another, in us from ``start_ns``."""
    for row, name in enumerate(LINES):
        at_us, levels = (lines[name][0] - start_ns) / 1000, lines[name][1]
        before = np.searchsorted(at_us, span_us[0]) - 1
        level = levels[max(before, 0)] if len(levels) else 1
        inside = (at_us > span_us[0]) & (at_us < span_us[1])
        x = [span_us[0], *at_us[inside], span_us[1]]
        y = [level, *levels[inside]]
        axes.step(x, np.array([*y, y[-1]]) * 0.7 - row, where="post", linewidth=0.8)
    axes.set_yticks([0.35 - row for row in range(len(LINES))], LINES)
    axes.set_xlim(span_us)
    axes.set_xlabel("time in us")


def main() -> int:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(folder) / "bus.vcd"
        if len(sys.argv) <= 1:
            record(path)
        draw(read_vcd(path), ROOT / "firmware/boards/pico/bus.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
