"""`biotac stream` and `record` on a terminal: a table that stands still; in a pipe plain lines."""

from __future__ import annotations

import io
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console

import biotac
from biotac.cli.live.table import LiveTable

UP = re.compile(r"\x1b\[1A")


def test_a_redrawn_table_has_the_same_lines_in_the_same_places() -> None:
    out = io.StringIO()
    console = Console(file=out, force_terminal=True, width=160, height=40, color_system=None)
    with biotac.open("sim:press.toml?fingers=5&seconds=4") as hand, LiveTable(hand, "a title", console) as table:
        heights, widths = set(), set()
        for batch in hand.batches():
            if not len(batch.wire):
                continue
            out.truncate(0)
            table.show("10 s", now=True)
            text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", out.getvalue()).strip("\x00\r")
            rows = [line for line in text.splitlines() if line.strip().startswith(("index", "middle", "thumb"))]
            assert len(rows) == 3
            heights.add(text.count("\n"))
            widths |= {len(row) for row in rows}
        assert len(heights) == len(widths) == 1


def on_a_terminal(*words: str) -> str:
    """What a command writes to a terminal of 40 lines."""
    ours, its = pty.openpty()
    program = subprocess.Popen(
        [sys.executable, "-m", "biotac", *words], stdout=its, stdin=its, env=os.environ | {"COLUMNS": "160"}
    )
    os.close(its)
    seen = b""
    while True:
        try:
            more = os.read(ours, 65536)
        except OSError:
            break
        if not more:
            break
        seen += more
    os.close(ours)
    assert program.wait() == 0
    return seen.decode()


@pytest.mark.parametrize("words", [("stream", "sim:press.toml?pace=5"), ("record", "sim:press.toml?pace=5", "a.mcap")])
def test_on_a_terminal_it_does_not_scroll(words, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    seen = on_a_terminal(*words, "--seconds", "4")
    assert UP.search(seen) and "index" in seen and "force" in seen and "frames" in seen
    # Every line that was drawn was gone up again, but for those of the last table.
    assert seen.count("\n") - len(UP.findall(seen)) < 15


def test_in_a_pipe_there_are_lines() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "biotac", "stream", "sim:press.toml?pace=fast", "--seconds", "1"],
        capture_output=True,
        text=True,
    )
    assert "\x1b" not in done.stdout and len(done.stdout.splitlines()) == 10
