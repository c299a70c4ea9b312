"""Where a calibration comes from: kept in the map's own file, so that it can be asked years later.

The hash is of the recordings' bytes, in the order given: the same files give the same hash, and one changed count
another.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...documents import read_json
from ...errors import InputError
from ...version import __version__

KEY = "provenance"
_BYTES = 1 << 20


@dataclass(frozen=True)
class Provenance:
    """``serial`` is the sensor's, "" where nobody knows; ``made_s`` seconds since 1970.

    ``alignment`` and ``mounting`` are None where force and counts came in one file.
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
        """The date in words, UTC."""
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
    """Of recordings that are there; ``made_s`` is the caller's, a library has no date."""
    digest = hashlib.sha256()
    for path in files:
        with path.open("rb") as stream:
            while part := stream.read(_BYTES):
                digest.update(part)
    names = tuple(path.name for path in files)
    software = f"biotac-gateway {__version__}"
    return Provenance(serial, made_s, software, names, digest.hexdigest(), reference, mounting, alignment)


def embed(map_text: str, provenance: Provenance) -> str:
    """A map's JSON with its provenance; fitted.loads passes over it."""
    return json.dumps(json.loads(map_text) | {KEY: asdict(provenance)}) + "\n"


def read(path: Path) -> Provenance | None:
    """A map file's provenance; None for one that has none. Raises InputError for a damaged one."""
    try:
        facts = read_json(path).get(KEY)
        if facts is None:
            return None
        return Provenance(**{**facts, "files": tuple(facts["files"])})
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: {error}: expected a map as `biotac calibrate wrench --out` writes it") from None


def check_serial(where: str, made_for: str, serial: str, *, force: bool = False) -> None:
    """Refuse one sensor's data or calibration for another, unless forced. Raises InputError.

    A side that does not know its number ("") is let through: there is nothing to compare.
    """
    if made_for and serial and made_for != serial and not force:
        raise InputError(
            f"{where} is of sensor {made_for}, and this is {serial}: expected the same; take that sensor's own, or say "
            "--force"
        )
