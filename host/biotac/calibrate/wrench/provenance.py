"""Where a calibration comes from: kept in the map's own file, so that it is still known years later.

The hash is over the recordings' bytes, in the order given: the same files give the same hash, and a single changed
count gives another.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...documents import read_json
from ...errors import InputError
from ...version import __version__

KEY = "provenance"


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


def read(path: Path) -> Provenance | None:
    """A map file's provenance, None if it has none. Raises InputError for a damaged one."""
    try:
        facts = read_json(path).get(KEY)
        if facts is None:
            return None
        return Provenance(**{**facts, "files": tuple(facts["files"])})
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: {error}: expected a map written by `biotac calibrate wrench --out`") from None


def check_serial(where: str, made_for: str, serial: str, *, force: bool = False) -> None:
    """Refuse one sensor's data or calibration for another, unless forced. Raises InputError.

    If either serial number is unknown (""), nothing is refused.
    """
    if made_for and serial and made_for != serial and not force:
        raise InputError(
            f"{where} is of sensor {made_for}, but this is {serial}: expected the same; use this sensor's own, or add "
            "--force"
        )
