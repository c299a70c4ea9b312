"""Run by tools/bench/front: count on the emulated boards, measure errors, write the front."""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from pathlib import Path

import boards

from . import front, measure


def main() -> int:
    effort = measure.Effort()
    parser = argparse.ArgumentParser(prog="tools/bench/front", description="Every kernel's cost and accuracy.")
    parser.add_argument("--out", type=Path, default=boards.BUILD / "front", help="default build/bench/front")
    parser.add_argument("--commit", action="store_true", help="refresh host/docs/front.png")
    parser.add_argument("--errors", action="store_true", help="errors and host times only, no boards and no picture")
    parser.add_argument("--json", action="store_true", help="print front.json instead of front.md")
    parser.add_argument("--frames", type=int, default=effort.frames, help="frames per class (default %(default)s)")
    parser.add_argument(
        "--restarts", type=int, default=effort.restarts, help="restarts of the hill climbing (default %(default)s)"
    )
    parser.add_argument("--steps", type=int, default=effort.steps, help="steps of each restart (default %(default)s)")
    args = parser.parse_args()
    if args.frames < 1 or args.restarts < 1 or args.steps < 1:
        parser.error("--frames, --restarts and --steps must be 1 or more")
    if args.commit and args.errors:
        parser.error("--commit needs the picture, which --errors leaves out; drop one of them")
    args.out.mkdir(parents=True, exist_ok=True)
    cores = {}
    if not args.errors:
        boards.need()
        cores = boards.counts()
    facts = front.facts(measure.measure(measure.Effort(args.frames, args.restarts, args.steps)), cores)
    table, text = front.page(facts), json.dumps(facts, indent=1) + "\n"
    (args.out / "front.md").write_text(table, encoding="utf-8")
    (args.out / "front.json").write_text(text, encoding="utf-8")
    if cores:
        front.draw(facts, args.out / "front.png")
    if args.commit:
        shutil.copy(args.out / "front.png", boards.ROOT / "host" / "docs" / "front.png")
    print(text if args.json else table, end="")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (boards.Failed, OSError) as error:
        sys.exit(f"tools/bench/front: {error}")
