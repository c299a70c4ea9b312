"""References as text: a header that names every column with its unit, then one row for each sample.

    # sensor: ATI Nano17 FT12345
    # mounting: {"rotation": ..., "offset_mm": ..., "reads": "force on finger"}
    t_s,Fx_N,Fy_N,Fz_N,Mx_Nmm,My_Nmm,Mz_Nmm

Units may also be in brackets: ``Fx [N]``, ``Tx (N m)``. Where the size of the force is enough, ``force_n`` may stand
in place of its axes. Columns with other names are ignored. A column without a unit
is refused: a calibration would not notice a factor such as millimetres for metres.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np

from ...cells import numbers
from ...errors import DeviceLostError, InputError, RecordingError, exists_error
from ...kernels.geometry import Floats
from .mounting import Mounting, from_json
from .samples import Reference, Samples, checked

COLUMNS = ("t_s", "Fx_N", "Fy_N", "Fz_N", "Mx_Nmm", "My_Nmm", "Mz_Nmm")
ROW = "%.6f" + ",%.6g" * 6 + "\n"
# in the order of the result; torque may be named M or T
_NAMES = ("t", "fx", "fy", "fz", "mx", "my", "mz")
_SIZE = ("t", "force")
_UNITS = {"t": {"s": 1.0}, "f": {"N": 1.0, "n": 1.0}, "m": {"Nmm": 1.0, "Nm": 1000.0}}
_COLUMN = re.compile(r"^(t|time|force|[FMT][xyz])(?:\s*[\[(]([^\])]*)[\])]|_(.+))?$", re.IGNORECASE)
SILENCE_S = 5.0  # programs write in pieces
_WANTED = "t in s, forces in N, torques in N mm or N m"


def read_csv(path: Path, mounting: Mounting | None = None, *, size: bool = False) -> Reference:
    """The reference in ``path``; ``mounting`` replaces the file's own. With ``size`` it may be of one axis: |F|."""
    own, head, read = open_table(path)
    chosen = mounting or _mounting_in(path, own)
    use, scale = _columns(path, head, size=size)
    table = read(use)
    samples = checked(str(path), Samples(table[:, 0], table[:, 1:] * scale))
    return Reference(path.name, samples, chosen, own.get("sensor", ""))


def _mounting_in(path: Path, own: dict[str, str]) -> Mounting:
    if "mounting" not in own:
        raise RecordingError(
            f"{path}: does not say how the sensor is mounted on the finger: expected --mounting FILE.toml, or "
            "--mounting lin if axes and origin are already Lin's"
        )
    return from_json(own["mounting"], f"{path}: line '# mounting:'")


def open_table(path: Path) -> tuple[dict[str, str], list[str], Callable[..., Floats]]:
    """The values of '# key: value' lines, the header's names, and a function from column indices to numbers (n, k).

    Columns are separated by comma, semicolon or tab. The function reads the rows of the file, or those in a text that
    it is given. Raises RecordingError for a file without text or header; the function raises it for a cell that is not
    a number.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        seen = error.strerror if isinstance(error, OSError) else "it is not text"
        raise RecordingError(f"{path}: cannot be read ({seen}): expected a CSV file of a force/torque sensor") from None
    own, head, body = {}, "", ""
    for match in re.finditer(r"[^\n]*\n?", text):
        line = match[0].strip()
        if line and not line.startswith("#"):
            # a last row without its end was cut by a full disk or a kill: its last number may lack digits
            head, body = line, text[match.end() : text.rfind("\n") + 1]
            break
        key, colon, value = line.lstrip("# ").partition(":")
        if colon:
            own[key.strip()] = value.strip()
    if not head:
        raise RecordingError(f"{path}: no header line: expected one that names every column")
    separator = max(",;\t", key=head.count)

    def read(indices: Sequence[int], rows: str = body) -> Floats:
        if not rows.strip():
            return np.empty((0, len(indices)))
        try:
            return numbers(rows.splitlines(), separator, indices)
        except ValueError as error:
            raise RecordingError(
                f"{path}: {error}: expected a number in every column, with a decimal point, or nothing, NA or null"
            ) from None

    return own, [name.strip().strip('"') for name in head.split(separator)], read


def _columns(path: Path, names: list[str], *, size: bool = False) -> tuple[list[int], Floats]:
    """Indices of the columns t, F and, if there are any, M, or with ``size`` t and force; and the factors for F and M.

    The factors convert to N and N mm. Raises RecordingError for a column that is missing, doubled or without a known
    unit.
    """
    found: dict[str, tuple[int, float]] = {}
    for index, cell in enumerate(names):
        match = _COLUMN.match(cell)
        if match is None:
            continue
        word = match[1].lower()
        name = {"time": "t", "t": "t", "force": "force"}.get(word) or word.replace("t", "m", 1)
        unit = (match[2] or match[3] or "").strip()
        if not unit:
            raise RecordingError(f"{path}: column {cell!r} has no unit: expected {_WANTED}, as in {COLUMNS[4]}")
        factor = _UNITS[name[0]].get(re.sub(r"[\s*.·-]", "", unit))
        if factor is None:
            raise RecordingError(f"{path}: column {cell!r} is in {unit!r}: expected {_WANTED}; convert it")
        if name in found:
            raise RecordingError(f"{path}: column {cell!r} is there twice: expected once; remove one")
        found[name] = (index, factor)
    torques = [name for name in _NAMES[4:] if name in found]
    wanted = _SIZE if size and "force" in found else _NAMES if torques else _NAMES[:4]
    missing = [COLUMNS[_NAMES.index(name)] for name in wanted if name not in found]
    if missing:
        either = " or t_s,force_n" if size else ""
        raise RecordingError(
            f"{path}: no column {missing[0]}: expected {','.join(COLUMNS)}, or the same without torque{either}"
        )
    return [found[name][0] for name in wanted], np.array([found[name][1] for name in wanted[1:]])


class GrowingCsv:
    """A SensorReader of a file that grows while the sensor's program runs; it reads the rows after this call.

    ``steady_s`` is the clock that measures silence. Raises RecordingError for a header that cannot be used.
    """

    def __init__(
        self, path: Path, mounting: Mounting | None = None, *, steady_s: Callable[[], float] = time.monotonic
    ) -> None:
        own, head, self._parse = open_table(path)
        self.mounting = mounting or _mounting_in(path, own)
        self.sensor = own.get("sensor", path.name)
        self._path, self._steady_s = path, steady_s
        self._use, self._scale = _columns(path, head)
        self._file = path.open("rb")
        self._begun = self._file.read().rpartition(b"\n")[2]  # a row that is being written
        self._grew_s = steady_s()

    def read(self, board_s: float = 0.0) -> Samples:
        """The rows that are new and whole. Raises DeviceLostError when none came for SILENCE_S."""
        whole, end, self._begun = (self._begun + self._file.read()).rpartition(b"\n")
        table = self._parse(self._use, (whole + end).decode(errors="replace"))
        now_s = self._steady_s()
        if len(table):
            self._grew_s = now_s
        elif now_s - self._grew_s > SILENCE_S:
            raise DeviceLostError(
                f"{self._path} has not grown for {now_s - self._grew_s:.1f} s: expected the force sensor's program to "
                "append rows; check that it records, and does not keep them to itself"
            )
        return Samples(table[:, 0], table[:, 1:] * self._scale)

    def close(self) -> None:
        """Close the file. Safe to call twice."""
        self._file.close()


class CsvWriter:
    """Writes a reference; every ``add`` is flushed to the operating system, so that a kill loses nothing."""

    def __init__(self, path: Path, mounting: Mounting, sensor: str, *, overwrite: bool = False) -> None:
        self.path = path
        try:
            self._stream: TextIO = path.open("w" if overwrite else "x", encoding="utf-8", newline="\n")
        except FileExistsError:
            raise exists_error(path) from None
        except OSError as error:
            raise InputError(f"{path} cannot be written ({error.strerror}); choose another folder") from None
        self._stream.write(f"# sensor: {' '.join(sensor.split())}\n# mounting: {json.dumps(mounting.facts())}\n")
        self._stream.write(",".join(COLUMNS) + "\n")
        self._stream.flush()

    def add(self, samples: Samples) -> None:
        """Append samples of six axes."""
        rows = np.column_stack([samples.t_s, samples.wrench])
        self._stream.write(ROW * len(rows) % tuple(rows.ravel().tolist()))  # np.savetxt takes several times as long
        self._stream.flush()

    def close(self) -> None:
        """Close the file. Safe to call twice."""
        self._stream.close()
