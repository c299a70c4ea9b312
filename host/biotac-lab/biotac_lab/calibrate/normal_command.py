"""biotac-lab normal FILE"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from biotac import InputError

from ..experiments import laboratory, plate_normal
from ..report import Show, Table
from . import normal

ABOUT = "The normal at the point of contact, corrected by a recording of a flat plate whose normal was measured."
EXAMPLE = "biotac-lab normal trial.npz --out index.normal.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the recording, and where the correction goes."""
    parser.add_argument("file", metavar="FILE", type=Path, help="an .npz with E, PDC and z_dir")
    parser.add_argument("--out", metavar="FILE", type=Path, help="the correction goes here (.normal.json)")
    parser.add_argument("--force", action="store_true", help="overwrite existing files")


def run(args: argparse.Namespace, show: Show) -> int:
    """Print the error on held-out contacts, then fit all contacts."""
    check_free(args.out, overwrite=args.force)
    looks = plate_normal.looks(laboratory.load(args.file, needs=("PDC", "z_dir")))
    fitted = normal.fit(looks)
    before = plate_normal.angles_deg(looks.points_mm, looks.normals)
    after = normal.angles_deg(normal.held_out(looks), looks.normals)
    facts = {
        "file": args.file.name,
        "frames": len(before),
        "contacts": len(np.unique(looks.contact)),
        "before_deg": np.percentile(before, (50, 90)).tolist(),
        "held_out_deg": np.percentile(after, (50, 90)).tolist(),
    }
    if args.out is not None:
        args.out.write_text(normal.dumps(fitted), encoding="utf-8")
        facts["written"] = str(args.out)
    rows = [["the formula's normal", *facts["before_deg"]], ["each contact held out", *facts["held_out_deg"]]]
    about = f"{facts['frames']} frames of {facts['contacts']} contacts."
    table = Table(facts["file"], ["deg", "median", "90th percentile"], rows, about, digits=2)
    print(json.dumps(facts) if args.json else "\n".join(table.page()))
    return 0


def check_free(path: Path | None, *, overwrite: bool) -> None:
    """Raises InputError if the file, where one is named, exists and may not be overwritten."""
    if path is not None and path.exists() and not overwrite:
        raise InputError(f"{path} exists; overwrite it (--force) or name another")
