"""Runs from files, an .npz that has everything or a board's recording and a reference, and where a map comes from.

The provenance is stored in the map's file. Its hash is over the recordings' bytes, in the order given: the same files
give the same hash, and a single changed count gives another.
"""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...documents import Provenance
from ...errors import InputError
from ...recording.reader import Recording
from ...version import __version__
from ...wire.identity import ascii_text
from ..reference.csv_file import read_csv
from ..reference.mcap_file import read_mcap
from ..reference.mounting import Mounting
from ..reference.samples import Reference
from .joined import Joined, board_of, choose_finger, join
from .plate_recording import Run, load_run


def read_reference(text: str, mounting: Mounting | None = None, *, size: bool = False) -> Reference:
    """The reference in ``FILE.csv``, in ``FILE.mcap`` with one wrench topic, or in ``FILE.mcap:TOPIC``.

    ``mounting`` replaces the one in the file; with ``size``, a CSV may have the size of the force alone. Raises
    InputError (RecordingError for the content).
    """
    name, colon, topic = text.rpartition(":")
    if colon and name.lower().endswith(".mcap"):
        return read_mcap(Path(name), mounting, topic)
    path = Path(text)
    suffix = path.suffix.lower()
    if suffix == ".mcap":
        return read_mcap(path, mounting)
    if suffix in (".csv", ".tsv", ".txt"):
        return read_csv(path, mounting, size=size)
    raise InputError(f"{text}: unknown file type: expected .csv, .tsv, .txt, or .mcap with geometry_msgs WrenchStamped")


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
        """The provenance of a map made from this run and these files, at ``made_s`` in seconds since 1970 UTC."""
        digest = hashlib.sha256()
        for path in self.files:
            digest.update(path.read_bytes())
        made = {
            "serial": self.run.serial,
            "made_s": made_s,
            "software": f"biotac-gateway {__version__}",
            "files": [path.name for path in self.files],
            "data_sha256": digest.hexdigest(),
            "reference": "in the same file",
        }
        if self.joined is None:
            return made
        reference = self.joined.reference
        made["reference"] = f"{reference.name} {reference.sensor}".strip()
        return made | {"mounting": reference.mounting.facts(), "alignment": asdict(self.joined.alignment)}

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
    """A checked run from ``path``. ``serial`` is the sensor it is for; a run of another is refused unless forced."""
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
