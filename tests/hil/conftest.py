"""Every test here runs against every rig of rigs/*.toml. --rig NAME picks one, --port and --sensor-port
name real boards."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import biotac

sys.path.insert(0, str(Path(__file__).resolve().parent))

from rig import Rig, all_rigs, in_ci, prepare

RIGS = all_rigs()
READY: dict[str, str | None] = {}


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "rig_name" in metafunc.fixturenames:
        chosen = metafunc.config.getoption("--rig") or list(RIGS)
        unknown = set(chosen) - set(RIGS)
        if unknown:
            raise pytest.UsageError(f"no rig {sorted(unknown)[0]}: expected one of {', '.join(RIGS)}")
        metafunc.parametrize("rig_name", chosen, scope="session")


@pytest.hookimpl(tryfirst=True)  # before -m is applied
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What is marked ``long`` is for the night on a rig that is slower than a board, and all on one much slower."""
    for item in items:
        params = item.callspec.params if hasattr(item, "callspec") else {}
        facts = RIGS.get(params.get("rig_name"), {})
        slow = facts.get("slow", False) and item.get_closest_marker("long") is not None
        if slow or facts.get("nightly", False):
            item.add_marker("nightly")


@pytest.fixture
def rig(rig_name: str, request: pytest.FixtureRequest) -> Iterator[Rig]:
    """The board under test; whatever was opened on it is closed after the test."""
    ports = {name: request.config.getoption(f"--{name.replace('_', '-')}") for name in ("port", "sensor_port")}
    facts = RIGS[rig_name]
    for name, port in ports.items():
        if f"{{{name}}}" in facts["port"] and port is None:
            pytest.skip(f"{rig_name}: no --{name.replace('_', '-')} was given, so there is no board to test")
    if rig_name not in READY:
        READY[rig_name] = prepare(facts)
    why = READY[rig_name]
    if why is not None:
        if in_ci():
            pytest.fail(f"{rig_name}: {why}")
        pytest.skip(f"{rig_name}: {why}")
    rig = Rig(rig_name, facts, **ports)
    yield rig
    rig.close()


@pytest.fixture
def board(rig: Rig) -> Callable[[str], biotac.Hand]:
    """Opens the rig's board with a source to play."""
    return rig.play
