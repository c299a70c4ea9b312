"""A finger's force-plate recording as one .npz that others can calibrate and train with, and that describes itself."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import RecordingError
from ...recording.npz_file import read_npz, to_lin_frame
from ...wire.sensor_gen import FULL_SCALE_COUNT
from .plate_recording import MIN_REST_ROWS, Run, load_run

UNITS = {"E": "count", "E_base": "count", "PDC": "count above its least", "F": "N", "M": "N mm about Lin's origin"}
FRAME = "F and M: X lateral, to E11's side; Y to the tip; Z out of the pad; force on the finger"
TEXTS = ("frame", "sensor", "plate", "licence")  # that ``about`` has to say, beside the units


def share(run: Run, target: Path, *, plate: str, licence: str) -> None:
    """Write ``run`` with all that a stranger needs: units, frame, sensor, plate and licence.

    Counts are rounded to whole ones. ``load_run`` reads it, and so do all verbs with an .npz.
    """
    fields: dict[str, Any] = {
        "E": np.clip(np.rint(run.counts), 0, FULL_SCALE_COUNT).astype(np.uint16),
        "E_base": np.tile(np.rint(run.tare).astype(np.uint16), (MIN_REST_ROWS, 1)),
        "F": to_lin_frame(run.truth[:, :3]),  # the rotation is the inverse of itself
        "serial": run.serial,
    }
    if run.truth.shape[1] > 3:
        fields["M"] = to_lin_frame(run.truth[:, 3:6])
    if run.pdc is not None:
        fields["PDC"] = np.rint(run.pdc - run.pdc.min()).astype(np.uint16)
    about = {"units": {name: UNITS[name] for name in fields if name in UNITS}, "frame": FRAME, "notes": run.notes}
    about |= {"sensor": run.serial or "unknown", "plate": plate, "licence": licence}
    with target.open("wb") as file:
        np.savez_compressed(file, about=json.dumps(about), **fields)


def check_shared(path: Path) -> dict[str, Any]:
    """A shared file's texts, and ``rows``. Raises RecordingError where it lacks something."""
    run = load_run(path)
    try:
        about = json.loads(str(read_npz(path, ("about",))["about"]))
        missing = [name for name in TEXTS if not about.get(name)]
        wrong = [name for name, unit in about["units"].items() if UNITS.get(name) != unit]
    except (KeyError, ValueError, TypeError, AttributeError) as error:
        raise RecordingError(f"{path} does not say what it is ({error}); share it with calibrate wrench") from error
    if missing or wrong:
        raise RecordingError(f"{path}: missing {missing}, other units of {wrong}; share it again with them")
    return {**about, "rows": len(run.counts)}
