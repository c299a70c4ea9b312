"""Runs from files, an .npz that has everything or a board's recording and a reference, and where a map comes from.

The provenance is kept in the map's own file. Its hash is over the recordings' bytes, in the order given: the same files
give the same hash, and a single changed count gives another.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...recording import Recording
from ...version import __version__
from ...wire.identity import ascii_text
from ..reference.samples import Reference
from .joined import Joined, board_of, choose_finger, join
from .run import Run, load_run


@dataclass(frozen=True)
class Provenance:
    """Origin of a map. ``serial`` is the sensor's, "" if unknown; ``made_s`` is in seconds since 1970 UTC.

    ``alignment`` and ``mounting`` are None where force and counts came from one file.
    """

    serial: str
    made_s: int
    software: str
    files: tuple[str, ...]
    data_sha256: str
    reference: str
    mounting: dict[str, Any] | None = None
    alignment: dict[str, Any] | None = None

    @property
    def made(self) -> str:
        """Date and time as text, in UTC."""
        return time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime(self.made_s))


def of_files(
    serial: str,
    files: Sequence[Path],
    reference: str,
    *,
    made_s: int,
    mounting: dict[str, Any] | None = None,
    alignment: dict[str, Any] | None = None,
) -> Provenance:
    """The provenance of a map made from ``files``, which it reads; the caller gives ``made_s``."""
    digest = hashlib.sha256()
    for path in files:
        digest.update(path.read_bytes())
    names = tuple(path.name for path in files)
    software = f"biotac-gateway {__version__}"
    return Provenance(serial, made_s, software, names, digest.hexdigest(), reference, mounting, alignment)


def check_serial(where: str, made_for: str, serial: str, *, force: bool = False) -> None:
    """Refuse one sensor's data or calibration for another, unless forced. Raises InputError.

    If either serial number is unknown (""), nothing is refused.
    """
    if made_for and serial and made_for != serial and not force:
        raise InputError(
            f"{where} is of sensor {made_for}, but this is {serial}: expected the same; use this sensor's own, or add "
            "--force"
        )


@dataclass(frozen=True)
class Loaded:
    """A run, the files it came from, and how they were joined, None for an .npz."""

    run: Run
    files: tuple[Path, ...]
    joined: Joined | None = None

    def provenance(self, made_s: int) -> Provenance:
        """The provenance of a map made from this run."""
        joined = self.joined
        if joined is None:
            return of_files(self.run.serial, self.files, "in the same file", made_s=made_s)
        reference = f"{joined.reference.name} {joined.reference.sensor}".strip()
        mounting, alignment = joined.reference.mounting.facts(), asdict(joined.alignment)
        return of_files(self.run.serial, self.files, reference, made_s=made_s, mounting=mounting, alignment=alignment)

    def facts(self) -> dict[str, Any]:
        """Results of joining, as JSON types; empty for an .npz."""
        if self.joined is None:
            return {}
        joined = self.joined
        share = None if np.isnan(joined.on_skin_share) else joined.on_skin_share
        return {"alignment": asdict(joined.alignment), "reference_zero": joined.zero.tolist(), "on_skin_share": share}


def load(
    path: Path,
    reference: tuple[Path, Reference] | None = None,
    *,
    finger: int | None = None,
    serial: str = "",
    force: bool = False,
) -> Loaded:
    """A checked run from ``path``. ``serial`` is the sensor it is for; a run of another is refused unless forced.

    Raises InputError, RecordingError for the content of files.
    """
    if path.suffix.lower() != ".mcap":
        if reference is not None:
            raise InputError(f"{path} contains its force: expected no --reference; that is for .mcap recordings")
        run = load_run(path)
        check_serial(str(path), run.serial, serial, force=force)
        return Loaded(run, (path,))
    if reference is None:
        raise InputError(f"{path} is a board's recording, which has no force: add --reference FILE")
    recording = Recording(path)
    chosen = choose_finger(str(path), recording.fingers, finger)
    number = next((ascii_text(sensor.serial) for sensor in recording.sensors if sensor.finger == chosen), "")
    check_serial(f"{path}, finger {chosen},", number, serial, force=force)
    rows = recording.wire["finger"] == chosen
    board = board_of(recording.wire[rows], recording.frames["t_us"][rows], chosen, number)
    joined = join(path.name, board, reference[1])
    return Loaded(joined.run, (path, reference[0]), joined)
