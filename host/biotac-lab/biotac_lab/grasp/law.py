"""The law under test: the example grip.py, or a file like it; or grip.c, on the C client of a clone."""

from __future__ import annotations

import ctypes
import runpy
import subprocess
import tempfile
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from biotac import EventKind, Frame, InputError
from biotac.wire import DTYPES, encode, messages

_BESIDE = Path(__file__).with_name("grip.py")  # in a wheel (pyproject.toml)
EXAMPLE = _BESIDE if _BESIDE.exists() else Path(__file__).resolve().parents[3] / "docs/guides/examples/grip.py"
#: What a chip has of its own, for firmware/client/example_bare.c and the law.
_CHIP = """
static const unsigned char *next, *end;
static unsigned long ms;
int uart_next(void) { return next < end ? *next++ : -1; }
void uart_send(const unsigned char *data, unsigned long bytes) { (void)data; (void)bytes; }
unsigned now_ms(void) { return (unsigned)ms; }
void close_at(float mm_s) { (void)mm_s; }
void hand_poll(void); void grip_round(void);
void chip_round(const unsigned char *data, int bytes)
{
    next = data; end = data + bytes; ms += 10;
    hand_poll(); grip_round();
}
"""


@cache
def load(path: Path) -> Any:
    """The file's ``Grip``, or for C what makes one. Raises InputError."""
    if not path.is_file():
        raise InputError(f"there is no law at {path}; give one like host/docs/guides/examples/grip.py")
    if path.suffix == ".c":
        return partial(InC, _built(path))
    made = runpy.run_path(str(path)).get("Grip")
    if made is None:
        raise InputError(f"{path} has no class Grip; take {EXAMPLE} as a pattern")
    return made


def _built(path: Path) -> ctypes.CDLL:
    client = path.resolve().parents[4] / "firmware/client"
    with tempfile.TemporaryDirectory() as folder:
        chip, made = Path(folder) / "chip.c", Path(folder) / "law.so"
        chip.write_text(_CHIP)
        sources = [str(path), str(chip), str(client / "example_bare.c"), str(client / "biotac_client.c")]
        command = ["cc", "-std=c11", "-O2", "-shared", "-fPIC", f"-I{client}", *sources, "-lm", "-o", str(made)]
        try:
            subprocess.run(command, check=True, capture_output=True)
        except (OSError, subprocess.CalledProcessError) as error:
            raise InputError(f"{path} was not built ({error}); it needs cc and a clone's {client}") from error
        return ctypes.CDLL(str(made))


class _Grip(ctypes.Structure):
    """grip.c's ``struct grip``."""

    _floats = ("least_n", "most_n", "friction", "stiffness", "speed_mm_s", "normal_n", "shear_n", "way_mm", "first_n")
    _ints = ("deaf_until", "round", "reflex_until", "holds", "settled", "slips", "sure")
    _fields_ = (*((name, ctypes.c_float) for name in _floats), *((name, ctypes.c_int) for name in _ints))


class InC:
    """grip.c, which gets each round as the bytes that a gateway sends; one at a time in a process."""

    def __init__(self, library: ctypes.CDLL, *, least_n: float = 0.8, most_n: float = 12.0, **_: Any) -> None:
        self._library, self._grip = library, _Grip.in_dll(library, "grip")
        library.grip_begin(ctypes.c_float(least_n), ctypes.c_float(most_n))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._grip, name)

    def step(self, frames: list[Frame | None], slipped: bool) -> float:
        """See grip.py."""
        rows = [_row(messages.Event, kind=EventKind.SLIP)] if slipped else []
        for frame in frames:
            if frame is not None:
                force = np.where(np.isfinite(frame.force_n), np.rint(frame.force_n * 1e4), -(2.0**31))
                rows.append(_row(messages.Frame, finger=frame.finger, flags=int(frame.flags), force_100un=force))
        sent = b"".join(rows)
        self._library.chip_round(sent, len(sent))
        return float(self._grip.speed_mm_s)


def _row(message: Any, **fields: Any) -> bytes:
    row = np.zeros(1, DTYPES[message.ID])
    for name, value in fields.items():
        row[name] = value
    return encode(message.ID, row.tobytes())
