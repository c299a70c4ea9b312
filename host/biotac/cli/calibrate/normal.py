"""biotac calibrate normal FILE"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from ...calibrate import normal
from ...lab.experiments import laboratory, plate_normal
from ...partial_file import whole
from .. import outputs

NAME = "normal"
HELP = "The normal at the point of contact, corrected by a recording of a flat plate whose normal was measured."
EXAMPLE = "biotac calibrate normal trial.npz --out index.normal.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the recording, and where the correction goes."""
    parser.add_argument("file", metavar="FILE", type=Path, help="an .npz with E, PDC and z_dir (experiments.md)")
    parser.add_argument("--out", metavar="FILE", type=Path, help="the correction goes here (.normal.json)")
    parser.add_argument("--force", action="store_true", help="overwrite existing files")


def run(args: argparse.Namespace) -> int:
    """Print the error on held-out contacts, then fit all contacts."""
    outputs.check_file(args.out, overwrite=args.force)
    looks = plate_normal.looks(laboratory.load(args.file, needs=("PDC", "z_dir")))
    its = normal.fit(looks)
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
        with whole(args.out, overwrite=args.force) as place:
            place.write_text(normal.dumps(its), encoding="utf-8")
        facts["written"] = str(args.out)
    lines = [
        f"{facts['file']}: {facts['frames']} frames of {facts['contacts']} contacts; median and 90th percentile",
        "  the formula's normal:           " + "  ".join(f"{angle:5.2f}" for angle in facts["before_deg"]) + " deg",
        "  each contact held out:          " + "  ".join(f"{angle:5.2f}" for angle in facts["held_out_deg"]) + " deg",
        *([f"  written: {facts['written']}"] if "written" in facts else []),
    ]
    print(json.dumps(facts) if args.json else "\n".join(lines))
    return 0
