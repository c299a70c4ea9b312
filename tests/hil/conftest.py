"""Every test here runs against every rig of rigs/*.toml that has a board: --port and --sensor-port name real
boards. --rig NAME picks one."""

import os
from collections.abc import Callable, Iterator

import pytest

import biotac
from rig import Rig, all_rigs, in_ci, prepare

RIGS = all_rigs()
READY: dict[str, str | None] = {}


def missing_port(rig_name: str, config: pytest.Config) -> str | None:
    """The option or variable that would name a board of this rig, when neither was given."""
    fetched = RIGS[rig_name].get("fetched")
    if fetched is not None and fetched not in os.environ:
        return str(fetched)
    options = {"{port}": "--port", "{sensor_port}": "--sensor-port", "{image_command}": "--image-command"}
    named = f"{RIGS[rig_name]['port']} {RIGS[rig_name].get('command', '')}"
    return next((option for field, option in options.items() if field in named and not config.getoption(option)), None)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "rig_name" in metafunc.fixturenames:
        config = metafunc.config
        chosen = config.getoption("--rig") or [name for name in RIGS if not missing_port(name, config)]
        unknown = set(chosen) - set(RIGS)
        if unknown:
            raise pytest.UsageError(f"no rig {sorted(unknown)[0]}: expected one of {', '.join(RIGS)}")
        metafunc.parametrize("rig_name", chosen, scope="session")


@pytest.hookimpl(tryfirst=True)  # before -m is applied
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests not marked ``daily`` are for the night on a rig slower than a board; on one much slower all are."""
    for item in items:
        params = item.callspec.params if hasattr(item, "callspec") else {}
        facts = RIGS.get(params.get("rig_name"), {})
        slow = facts.get("slow", False) and item.get_closest_marker("daily") is None
        if slow or facts.get("nightly", False):
            item.add_marker("nightly")


@pytest.fixture
def rig(rig_name: str, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Rig]:
    """The board under test; hands opened on it are closed after the test."""
    facts = RIGS[rig_name]
    request.node.user_properties.append(("rig", rig_name))  # for the table at the end
    if facts.get("command"):
        command = facts["command"].format(image_command=request.config.getoption("--image-command"))
        monkeypatch.setenv("BIOTAC_SIM", command)
    option = missing_port(rig_name, request.config)
    if option is not None:
        pytest.skip(f"{rig_name}: no {option} was given, so there is no board to test")
    if rig_name not in READY:
        READY[rig_name] = prepare(facts)
    why = READY[rig_name]
    if why is not None:
        if in_ci():
            pytest.fail(f"{rig_name}: {why}")
        pytest.skip(f"{rig_name}: {why}")
    rig = Rig(rig_name, facts, *(request.config.getoption(option) for option in ("--port", "--sensor-port")))
    yield rig
    rig.close()


@pytest.fixture
def board(rig: Rig) -> Callable[[str], biotac.Hand]:
    """Opens the rig's board with a source to play."""
    return rig.play
