"""The prover is one of the tools; what the proofs find is printed at the end of the run."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

from prover import Report


@pytest.fixture
def proved(request: pytest.FixtureRequest) -> Report:
    """Keeps a figure for the summary, under the name of the test that proved it."""
    name = request.node.name.removeprefix("test_").replace("_", " ")

    def keep(figure: str) -> None:
        # With the test's report, which comes here from whatever process ran the test.
        request.node.user_properties.append(("proved", f"{name}: {figure}"))

    return keep


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    reports = [report for outcome in ("passed", "failed") for report in terminalreporter.stats.get(outcome, [])]
    figures = [figure for report in reports for kind, figure in report.user_properties if kind == "proved"]
    if figures:
        terminalreporter.section("proved")
        for figure in figures:
            terminalreporter.write_line(figure)
