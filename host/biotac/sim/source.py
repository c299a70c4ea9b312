"""Sources of counts for the emulated sensor, and the one function that loads any of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..wire import sensor_gen as _sensor

MAX_SECONDS = 3600.0  # 5 fingers for an hour are 160 MB of counts


@dataclass(frozen=True)
class Truth:
    """What a scenario applied, at the middle of each frame.

    ``contact`` bool (frames, fingers); ``poc_mm`` float64 (frames, fingers, 3), the point on the core
    surface, NaN without contact; ``force_n`` and ``torque_nmm`` float64 (frames, fingers, 3), on the
    finger, the torque about the origin: c x f + torsion n. Frame and origin are Lin's, figure 4.
    """

    contact: npt.NDArray[np.bool_]
    poc_mm: npt.NDArray[np.float64]
    force_n: npt.NDArray[np.float64]
    torque_nmm: npt.NDArray[np.float64]


@dataclass(frozen=True)
class Source:
    """Counts to play, and what is known about them.

    ``samples`` uint16 (frames, fingers, 44) in SLOTS order, 100 frames/s: counts 0..4095 or the codes
    of tape.py. ``truth`` is None for recorded counts. ``tare_q4`` uint16 (fingers, 19), count * 16: a
    stored tare the board should be given, or None. ``settings``: board settings to apply before
    streaming, by their name in link.toml. ``truth_force_n`` float64 (frames, fingers, 3): the force a
    recording itself carries, in Lin's frame, or None. ``serials``: one of 16 characters a finger.
    ``skipped_frames``: incomplete frames of a recording that were left out.
    """

    name: str
    samples: npt.NDArray[np.uint16]
    truth: Truth | None = None
    tare_q4: npt.NDArray[np.uint16] | None = None
    settings: dict[str, int] = field(default_factory=dict)
    truth_force_n: npt.NDArray[np.float64] | None = None
    serials: tuple[str, ...] = ()
    skipped_frames: int = 0

    @property
    def known_force_n(self) -> npt.NDArray[np.float64] | None:
        """The force that was applied (frames, fingers, 3), from the scenario or with the recording."""
        return self.truth_force_n if self.truth is None else self.truth.force_n


def bundled_scenarios() -> list[str]:
    """File names of the scenarios that come with the package."""
    folder = resources.files("biotac.sim") / "scenarios"
    return sorted(entry.name for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load_source(path: str | Path, *, fingers: int | None = None, seconds: float | None = None) -> Source:
    """Load a scenario (.toml) or a recording (.npz, .btd, .btd.gz), by its suffix.

    A bare name such as ``press.toml`` that is no file is looked up among the bundled scenarios.
    ``fingers`` (1..5) is how many fingers to play: a scenario's are cut or repeated, repeated ones
    with a sensor seed of their own; a recording's are cut or copied; default: as many as it has.
    ``seconds`` (0.01..3600) crops; a scenario that is shorter is repeated.

    Raises InputError (ScenarioError for the text of a scenario) naming what was seen and expected.
    """
    # here and not above: these modules build a Source, so they import this one
    from .play import play
    from .replay import load_btd, load_npz
    from .scenario import parse_scenario

    if fingers is not None and not (type(fingers) is int and 1 <= fingers <= _sensor.MAX_SENSORS):
        raise InputError(f"fingers is {fingers!r}: expected 1 to {_sensor.MAX_SENSORS}")
    if seconds is not None and not (math.isfinite(seconds) and 0.01 <= seconds <= MAX_SECONDS):
        raise InputError(f"seconds is {seconds!r}: expected 0.01 to {MAX_SECONDS:.0f}")
    place = Path(path)
    lower = place.name.lower()
    if lower.endswith(".toml"):
        return play(parse_scenario(_scenario_bytes(place), file=place.name), fingers=fingers, seconds=seconds)
    if lower.endswith(".npz"):
        return load_npz(_existing(place), fingers=fingers, seconds=seconds)
    if lower.endswith((".btd", ".btd.gz")):
        return load_btd(_existing(place), fingers=fingers, seconds=seconds)
    raise InputError(
        f"{path}: unknown kind of source: expected .toml (scenario), .npz, .btd or .btd.gz (recording); "
        f"bundled scenarios: {', '.join(bundled_scenarios())}"
    )


def _scenario_bytes(place: Path) -> bytes:
    try:
        if not place.exists() and place.parent == Path() and place.name in bundled_scenarios():
            return (resources.files("biotac.sim") / "scenarios" / place.name).read_bytes()
        return place.read_bytes()
    except FileNotFoundError:
        raise InputError(
            f"{place}: no such file, and no bundled scenario: expected a scenario's path or one of "
            f"{', '.join(bundled_scenarios())}"
        ) from None
    except OSError as error:
        raise InputError(f"{place}: cannot be read ({error.strerror}): expected a scenario file") from error


def _existing(place: Path) -> Path:
    if not place.is_file():
        seen = "is no file" if place.exists() else "no such file"
        raise InputError(f"{place}: {seen}: expected a recording; check the path")
    if place.stat().st_size == 0:
        raise InputError(f"{place}: the file is empty: expected a recording; copy it again")
    return place
