"""Imports of a start: counted in modules, as time depends on the machine."""

import subprocess
import sys

import pytest

import biotac

HEAVY = {"numpy", "serial", "mcap", "matplotlib", "cffi", "biotac._core", "asyncio", "http.server"}


def imported(code: str) -> set[str]:
    """All modules there are when a fresh interpreter has run ``code``."""
    arguments = [sys.executable, "-c", f"import sys\n{code}\nprint(chr(10), *sys.modules)"]
    output = subprocess.run(arguments, capture_output=True, text=True, check=True).stdout
    return set(output.splitlines()[-1].split())


@pytest.mark.parametrize("verb", ["--help", "--version"])
def test_help_and_version_import_nothing_heavy(verb: str) -> None:
    code = f"from biotac.cli.main import main\ntry: main({verb.split()})\nexcept SystemExit: pass"
    assert imported(code) & HEAVY == set()


def test_a_verb_imports_only_itself() -> None:
    code = "from biotac.cli.main import main\ntry: main(['list', '--help'])\nexcept SystemExit: pass"
    verbs = {name for name in imported(code) if name.startswith("biotac.cli.") and name.count(".") == 3}
    assert verbs == {"biotac.cli.boards.list_ports"}


def test_biotac_imports_what_is_asked_for() -> None:
    assert {name for name in imported("import biotac") if name.startswith("biotac")} == {"biotac"}
    assert "biotac.recording" not in imported("import biotac; biotac.FRAME_DTYPE")
    # Imports of a live reader beside NumPy: no recordings, no asyncio, no physics.
    live = imported("import biotac; biotac.open")
    assert {"numpy", "biotac._core"} <= live and not live & {"mcap", "asyncio", "matplotlib", "biotac.sim"}


def test_every_name_of_biotac_is_there() -> None:
    assert set(biotac.__all__) <= set(dir(biotac))
    for name in biotac.__all__:
        assert getattr(biotac, name) is getattr(biotac, name)
    with pytest.raises(AttributeError, match="nothing"):
        _ = biotac.nothing
