"""Loading a source of any kind."""

from __future__ import annotations

import math
from importlib import resources
from pathlib import Path

from ..documents import TOML_BYTES
from ..errors import InputError
from ..wire import sensor_gen as _sensor
from .play import play
from .recorded_counts import load_btd, load_npz
from .scenario import parse_scenario
from .source import MAX_SECONDS, Source


def bundled_scenarios() -> list[str]:
    """File names of the scenarios that come with the package."""
    folder = resources.files(__package__) / "scenarios"
    return sorted(entry.name for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load_source(path: str | Path, *, fingers: int | None = None, seconds: float | None = None) -> Source:
    """Load a scenario (.toml) or a recording (.npz, .btd, .btd.gz), by its suffix.

    A bare name such as ``press.toml`` that is not a file is looked up among the bundled scenarios. ``fingers`` (1..5)
    is the number of fingers to play, by default all: a scenario's are cut or repeated, each repeated one with a sensor
    seed of its own; a recording's are cut or copied. ``seconds`` (0.01..7200) crops the source; a shorter scenario is
    repeated.

    Raises InputError (ScenarioError for a scenario's text), naming what was seen and expected.
    """
    if fingers is not None and not (type(fingers) is int and 1 <= fingers <= _sensor.MAX_SENSORS):
        raise InputError(f"fingers is {fingers!r}: expected 1 to {_sensor.MAX_SENSORS}")
    if seconds is not None and not (math.isfinite(seconds) and 0.01 <= seconds <= MAX_SECONDS):
        raise InputError(f"seconds is {seconds!r}: expected 0.01 to {MAX_SECONDS:.0f} s")
    file = Path(path)
    if file.exists() and not file.is_file():  # opening a pipe would wait for ever
        raise InputError(f"{file}: not a file: expected a scenario or a recording; check the path")
    lower = file.name.lower()
    if lower.endswith(".toml"):
        return play(parse_scenario(_scenario_bytes(file), file=file.name), fingers=fingers, seconds=seconds)
    if lower.endswith(".npz"):
        return load_npz(file, fingers=fingers, seconds=seconds)
    if lower.endswith((".btd", ".btd.gz")):
        return load_btd(file, fingers=fingers, seconds=seconds)
    raise InputError(
        f"{path}: unknown kind of source: expected .toml (scenario), .npz, .btd or .btd.gz (recording); "
        f"bundled scenarios: {', '.join(bundled_scenarios())}"
    )


def bundled_scenario(name: str) -> bytes:
    """A scenario that comes with the package, by file name."""
    return (resources.files(__package__) / "scenarios" / name).read_bytes()


def _scenario_bytes(file: Path) -> bytes:
    try:
        if not file.exists() and file.parent == Path() and file.name in bundled_scenarios():
            return bundled_scenario(file.name)
        with file.open("rb") as stream:
            return stream.read(4 * TOML_BYTES + 1)  # a character has four at most: more is refused
    except OSError as error:
        raise InputError(
            f"{file}: cannot be read ({error.strerror}): expected a scenario's path or one of "
            f"{', '.join(bundled_scenarios())}"
        ) from error
