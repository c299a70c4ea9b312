"""How a force/torque sensor is mounted on a finger: the transform from the sensor's axes and origin to Lin's.

The sensor must move with the finger (it carries the finger, or the finger's holder), so that one rotation and one
offset hold for the whole run. In a TOML file:

    rotation = [[0, 1, 0], [1, 0, 0], [0, 0, -1]]  # rows: Lin's x, y, z in the sensor's axes
    offset_mm = [-30.0, 0.0, 12.0]                 # the sensor's origin, seen from Lin's
    reads = "force on finger"                      # or "force on sensor", its opposite
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...documents import TOML_BYTES, parse_json, parse_toml, read_text
from ...errors import InputError
from ...kernels.geometry import Floats

READS = ("force on finger", "force on sensor")
MAX_SKEW = 1e-3  # of R R' - 1: a rotation with three decimals passes, one with a forgotten minus does not
MAX_OFFSET_MM = 500.0
KEYS = ("rotation", "offset_mm", "reads")


@dataclass(frozen=True)
class Mounting:
    """Transform from a sensor's readings to the wrench on the finger in Lin's frame.

    ``rotation`` (3, 3) turns vectors from the sensor's axes to Lin's. ``offset_mm`` (3,) is the sensor's origin in
    Lin's frame. ``sign`` is -1 if the sensor reads the force on itself. Raises InputError for a matrix that is not a
    rotation, or an offset above MAX_OFFSET_MM.
    """

    rotation: Floats
    offset_mm: Floats
    sign: float = 1.0

    def __post_init__(self) -> None:
        rotation, offset = self.rotation, self.offset_mm
        if rotation.shape != (3, 3) or not np.isfinite(rotation).all():
            raise InputError(f"rotation has shape {rotation.shape}: expected 3 rows of 3 finite numbers")
        if offset.shape != (3,) or not np.isfinite(offset).all() or np.abs(offset).max() > MAX_OFFSET_MM:
            raise InputError(f"offset_mm is {offset.tolist()}: expected 3 numbers of up to {MAX_OFFSET_MM:g} mm")
        with np.errstate(over="ignore", invalid="ignore"):  # of entries such as 1e200
            skew = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
        if not skew <= MAX_SKEW:
            raise InputError(
                f"rotation is not orthonormal, R R' is off by {skew:.3g}: expected at most {MAX_SKEW:g}; rows must be "
                "unit vectors at right angles"
            )
        if np.linalg.det(rotation) < 0.0:
            raise InputError("rotation mirrors (its determinant is -1): expected +1; change the sign of one row")

    def to_finger(self, wrench: Floats) -> Floats:
        """Force on the finger, and moment about Lin's origin, from readings (n, 3) in N or (n, 6) with N mm."""
        force: Floats = self.sign * wrench[:, :3] @ self.rotation.T
        if wrench.shape[1] == 3:
            return force
        moment = self.sign * wrench[:, 3:] @ self.rotation.T + np.cross(self.offset_mm, force)
        return np.column_stack([force, moment])

    def to_sensor(self, wrench: Floats) -> Floats:
        """The sensor's reading for a wrench (n, 6) in Lin's frame: the inverse of to_finger."""
        force = wrench[:, :3]
        moment = wrench[:, 3:] - np.cross(self.offset_mm, force)
        return self.sign * np.column_stack([force @ self.rotation, moment @ self.rotation])

    def facts(self) -> dict[str, Any]:
        """The mounting as JSON types; from_json() reads them."""
        reads = READS[0] if self.sign > 0 else READS[1]
        return {"rotation": self.rotation.tolist(), "offset_mm": self.offset_mm.tolist(), "reads": reads}


#: For readings that are already the force on the finger in Lin's axes and about Lin's origin.
LIN = Mounting(np.eye(3), np.zeros(3))


def read_mounting(text: str) -> Mounting:
    """The mounting in a TOML file, or LIN for the word ``lin``. Raises InputError with the fault."""
    form = f"TOML with {', '.join(KEYS)}, or the word lin"
    return LIN if text == "lin" else _read(lambda: parse_toml(read_text(Path(text), TOML_BYTES)), text, form)


def from_json(text: str, where: str) -> Mounting:
    """The mounting in one line of JSON, as in a recorded reference. Raises InputError that begins with ``where``."""
    return _read(lambda: parse_json(text), where, f"a JSON object with {', '.join(KEYS)}")


def _read(load: Callable[[], Any], where: str, form: str) -> Mounting:
    """The mounting from the facts that ``load`` gives. Raises InputError that begins with ``where``."""
    try:
        return _mounting_of(dict(load()))
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    except (OSError, TypeError, ValueError) as error:
        seen = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"{where}: {seen}: expected {form}") from None


def _mounting_of(facts: Mapping[str, Any]) -> Mounting:
    """Raises ValueError for a key that is missing or unknown, InputError for a value that none can have."""
    missing, unknown = [key for key in KEYS if key not in facts], sorted(set(facts) - set(KEYS))
    if missing or unknown:
        raise ValueError(f"key {missing[0]!r} is missing" if missing else f"key {unknown[0]!r} is unknown")
    if facts["reads"] not in READS:
        raise InputError(f"reads is {facts['reads']!r}: expected {READS[0]!r} or {READS[1]!r}")
    try:
        rotation, offset_mm = (np.array(facts[key], dtype=np.float64) for key in ("rotation", "offset_mm"))
    except (TypeError, ValueError, OverflowError):
        raise InputError("rotation or offset_mm is not numeric: expected 3 by 3 numbers and 3") from None
    return Mounting(rotation, offset_mm, 1.0 if facts["reads"] == READS[0] else -1.0)
