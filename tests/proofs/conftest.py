"""The prover is one of the tools; what the proofs find is printed at the end of the run."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

from prover.report import Report

FIGURES: list[str] = []


@pytest.fixture
def proved(request: pytest.FixtureRequest) -> Report:
    """Keeps a figure for the summary, under the name of the test that proved it."""
    name = request.node.name.removeprefix("test_").replace("_", " ")

    def keep(figure: str) -> None:
        FIGURES.append(f"{name}: {figure}")

    return keep


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if FIGURES:
        terminalreporter.section("proved")
        for figure in FIGURES:
            terminalreporter.write_line(figure)
