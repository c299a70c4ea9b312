"""Runs from files: an .npz that has everything, or a board's recording and a reference."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...recording import Recording
from ...wire.identity import ascii_text
from ..reference.samples import Reference
from .joined import Joined, board_of, choose_finger, join
from .provenance import Provenance, check_serial, of_files
from .run import Run, load_run


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
        its = joined.reference
        words = f"{its.name} {its.sensor}".strip()
        mounting, alignment = its.mounting.facts(), asdict(joined.alignment)
        return of_files(self.run.serial, self.files, words, made_s=made_s, mounting=mounting, alignment=alignment)

    def facts(self) -> dict[str, Any]:
        """Results of joining, as JSON types; empty for an .npz."""
        if self.joined is None:
            return {}
        its = self.joined
        share = None if np.isnan(its.on_skin_share) else its.on_skin_share
        return {"alignment": asdict(its.alignment), "reference_zero": its.zero.tolist(), "on_skin_share": share}


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
    number = next((ascii_text(its.serial) for its in recording.sensors if its.finger == chosen), "")
    check_serial(f"{path}, finger {chosen},", number, serial, force=force)
    rows = recording.wire["finger"] == chosen
    board = board_of(recording.wire[rows], recording.frames["t_us"][rows], chosen, number)
    joined = join(path.name, board, reference[1])
    return Loaded(joined.run, (path, reference[0]), joined)
