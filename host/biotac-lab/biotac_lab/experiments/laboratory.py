"""Loads a laboratory's own trial, run through the board's code like an emulated one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from biotac import Recording, RecordingError
from biotac.calibrate.wrench import locate, numbers
from biotac.recording import counts_field, read_npz, to_lin_frame
from biotac.sim import PROFILES, Profile
from biotac.wire import messages, sensor

from ..report import Options
from .trial import Floats, Trial, on_board

FIELDS = ("E", "PDC", "F", "M", "E_base", "t", "z_dir")
ROW_S = 0.01
TOUCHED_N = 0.1  # a plate's reading below this counts as "nothing touches"
_ELECTRODES = len(sensor.ELECTRODE_NAMES)


def load(path: Path, finger: int = 0, needs: tuple[str, ...] = (), *, own_force: bool = False) -> Trial:
    """The trial in an .npz of one finger, or of ``finger`` in a recording of `biotac record`.

    The latter has no truth; ``own_force`` uses the force that the board published with its scales as F.

    Fields of an .npz: ``E`` (n, 19) counts; optionally ``PDC`` (n,) counts, ``F`` (n, 3) N and ``M`` (n, 3) N mm about
    Lin's origin in the recorded axes (X lateral, Y to the tip, Z out of the pad), ``t`` (n,) s, ``E_base`` (m, 19),
    with the board's stored tare as median, and ``z_dir`` (n, 3), a plate's unit normal in the axes of data/README.md.
    ``needs`` names the fields that an experiment requires. Raises RecordingError naming the field.
    """
    if path.suffix.lower() != ".npz":
        return _of_recording(path, finger, needs, own_force)
    fields = read_npz(path, FIELDS)
    _require(path, ("E", *needs), tuple(fields))
    counts = counts_field(path, "E", fields["E"], None, _ELECTRODES)
    n = len(counts)
    pdc = np.full(n, messages.INVALID_COUNT, np.uint16)
    if "PDC" in fields:
        pdc = counts_field(path, "PDC", fields["PDC"], n, None)
    notes = ["tare: the board's own"]
    base = None
    if "E_base" in fields:
        base = np.median(counts_field(path, "E_base", fields["E_base"], None, _ELECTRODES), axis=0)
        notes = [f"tare: median of {len(fields['E_base'])} rows of E_base, given to the board at the start"]
    time_s = np.arange(n, dtype=np.float64) * ROW_S
    if "t" in fields:
        time_s = numbers(path, "t", fields["t"], (n,), "s")
        back = np.flatnonzero(np.diff(time_s) < 0.0)
        if len(back):
            raise RecordingError(
                f"{path}: field t goes back in row {back[0] + 1}: expected times in order; sort the rows"
            )
    unknown = np.full((n, 3), np.nan)
    force, torque = (
        to_lin_frame(numbers(path, name, fields[name], (n, 3), unit)) if name in fields else unknown
        for name, unit in (("F", "N"), ("M", "N mm"))
    )
    normal = _plate_normal(path, fields["z_dir"], n) if "z_dir" in fields else unknown
    torsion, at_mm = unknown[:, 0], unknown
    if "F" in fields and "M" in fields:
        plate = locate(force, torque)
        # below that the plate's point of contact is noise divided by noise
        known = (np.linalg.norm(force, axis=1) > TOUCHED_N) & plate.on_skin
        torsion = np.where(known, plate.torsion_nmm, np.nan)
        at_mm = np.where(known[:, None], plate.point_mm, np.nan)
    rows = on_board(counts, pdc, given=base)
    return Trial(path.name, time_s, (), counts, pdc, rows, force, torque, torsion, at_mm, normal, given=base,
                 notes=tuple(notes))  # fmt: skip


def trials(
    options: Options, emulate: Callable[[int, Profile], Trial], doing: str, needs: tuple[str, ...]
) -> dict[str, Trial]:
    """The trial "recorded" of the options' recording, as load() takes it; or of an emulated finger, new and worn."""
    if options.recording is not None:
        return {"recorded": load(options.recording, options.finger, needs)}
    found: dict[str, Trial] = {}
    for profile in PROFILES:
        options.show(f"{doing} the {profile} sensor")
        found[profile] = emulate(options.seed, profile)
    return found


def _of_recording(path: Path, finger: int, needs: tuple[str, ...], own_force: bool) -> Trial:
    recording = Recording(path)
    _require(path, needs, ("E", "PDC", "F") if own_force else ("E", "PDC"))
    own = recording.frames[recording.frames["finger"] == finger]
    if not len(own):
        present = ", ".join(str(k) for k in np.unique(recording.frames["finger"])) or "none"
        raise RecordingError(
            f"{path}: no frames from finger {finger}; fingers with frames: {present}; choose one with --finger"
        )
    notes = ["tare: the board's own, from the recorded counts", *recording.problems]
    if own_force:
        notes.append("force: as the board published it, with its own scales; there was no force plate")
    unknown = np.full((len(own), 3), np.nan)
    force = np.nan_to_num(own["force_n"]) if own_force else unknown
    time_s = (own["t_us"] - own["t_us"][0]) / 1e6
    counts, pdc = own["counts"].copy(), own["pdc"].copy()
    return Trial(path.name, time_s, (), counts, pdc, on_board(counts, pdc), force, unknown, unknown[:, 0], unknown,
                 unknown, notes=tuple(notes))  # fmt: skip


def _require(path: Path, needs: tuple[str, ...], seen: tuple[str, ...]) -> None:
    missing = [name for name in needs if name not in seen]
    if missing:
        raise RecordingError(
            f"{path}: holds {', '.join(seen) or 'none of the known fields'}: expected {', '.join(needs)} in an .npz; "
            f"save {' and '.join(missing)} too"
        )


def _plate_normal(path: Path, array: npt.NDArray[Any], rows: int) -> Floats:
    z = numbers(path, "z_dir", array, (rows, 3), "unit vectors")
    length = np.linalg.norm(z, axis=1)
    if np.abs(length - 1.0).max() > 0.01:
        row = int(np.argmax(np.abs(length - 1.0)))
        raise RecordingError(
            f"{path}: field z_dir has length {length[row]:.3g} in row {row}: expected unit vectors; "
            f"divide by the length"
        )
    result: Floats = np.column_stack([-z[:, 0], z[:, 1], -z[:, 2]]) / length[:, None]
    return result
