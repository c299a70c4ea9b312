"""References from files, by suffix."""

from __future__ import annotations

from pathlib import Path

from ...errors import InputError
from .csv_file import read_csv
from .mcap_file import read_mcap
from .mounting import Mounting
from .samples import Reference


def read_reference(text: str, mounting: Mounting | None = None) -> Reference:
    """The reference in ``FILE.csv``, in ``FILE.mcap`` with one wrench topic, or in ``FILE.mcap:TOPIC``.

    ``mounting`` replaces the one in the file. Raises InputError (RecordingError for the content).
    """
    name, colon, topic = text.rpartition(":")
    if colon and name.lower().endswith(".mcap"):
        return read_mcap(Path(name), mounting, topic)
    path = Path(text)
    suffix = path.suffix.lower()
    if suffix == ".mcap":
        return read_mcap(path, mounting)
    if suffix in (".csv", ".tsv", ".txt"):
        return read_csv(path, mounting)
    raise InputError(f"{text}: unknown file type: expected .csv, .tsv, .txt, or .mcap with geometry_msgs WrenchStamped")
