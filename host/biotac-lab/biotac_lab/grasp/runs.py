"""Many grasps, in blocks of things, on several processes; what is done already is not done again."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from hashlib import sha256
from importlib.metadata import distribution
from importlib.resources import files
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from ..report import Facts, Show
from . import law
from .felt import SHARES, TrueForce
from .plant import Plant, Thing, things
from .trial import grasp

BLOCK = 10  # things that one hand grasps, one after the other
WITHOUT_BOARD: dict[str, dict[str, Any]] = {
    "true": {}, "low": {"off_n": -1.0}, "high": {"off_n": 1.0, "deaf": True}, "deaf": {"deaf": True}, "constant": {},
}  # fmt: skip
CONSTANT_N = 3.0
CONTROLLERS = {
    "true": "true force", "low": "1 N too low", "high": "1 N too high, deaf", "deaf": "true force, deaf to slip",
    "constant": f"constant {CONSTANT_N:g} N",
}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """All that determines a grasp but the thing's number; ``code`` stands for the law, this package and the gateway."""

    controller: str
    fault: str
    pair: int
    seed: int
    plant: str
    fingers: int
    code: str


def digest(law_file: Path) -> str:
    """Of the law, this package and the gateway; what was compiled, by the hashes that its installer kept."""
    python = [*Path(__file__).parent.glob("*.py"), *Path(str(files("biotac"))).rglob("*.py")]
    compiled = (distribution("biotac-gateway").read_text("RECORD") or "").encode()
    return sha256(b"".join([compiled, *(path.read_bytes() for path in (law_file, *sorted(python)))])).hexdigest()[:16]


def grasps(case: Case, first: int, count: int, law_file: Path, trace: list[Any] | None = None) -> list[Facts]:
    """The outcomes of a block: things ``first`` on. ``trace`` is that of the last one."""
    make, rows = law.load(law_file), []
    press = {"least_n": CONSTANT_N, "most_n": CONSTANT_N} if case.controller == "constant" else {}
    with _sense(case) as (sense, towards):
        for number, thing in enumerate(things(first + count, case.seed + case.pair)[first:], first):
            rule = make(towards=towards, shares=SHARES[case.fingers], **press)
            outcome = grasp(_plant(case.plant, thing), rule, sense, bool(case.fault), trace if number == first + count - 1 else None)
            rows.append({"case": asdict(case), "thing": number, **outcome})
    return rows


def _plant(name: str, thing: Thing) -> Any:
    if name == "numpy":
        return Plant(thing)
    from .mujoco_plant import MujocoPlant  # the extra

    return MujocoPlant(thing)


@contextmanager
def _sense(case: Case) -> Iterator[tuple[Any, Any]]:
    yield TrueForce(case.fingers, **WITHOUT_BOARD[case.controller]), [(0.0, 0.0, 1.0)] * case.fingers


def run(
    cases: Iterable[Case], objects: int, law_file: Path, jobs: int, kept: Path | None, show: Show
) -> dict[Case, list[Facts]]:
    """The outcomes of each case's things, in order; ``kept`` has those of earlier runs and gets the new ones."""
    done: dict[Case, dict[int, Facts]] = {case: {} for case in cases}
    for row in _kept(kept):
        done.get(Case(**row["case"]), {})[row["thing"]] = row
    blocks = [
        (case, first, min(BLOCK, objects - first))
        for case, rows in done.items()
        for first in range(0, objects, BLOCK)
        if not set(range(first, min(first + BLOCK, objects))) <= set(rows)
    ]
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        waiting = [pool.submit(grasps, *block, law_file) for block in blocks]
        try:
            for number, ready in enumerate(as_completed(waiting), 1):
                rows = ready.result()
                for row in rows:
                    done[Case(**row["case"])][row["thing"]] = row
                if kept is not None:
                    with kept.open("a", encoding="utf-8") as file:
                        file.write("".join(json.dumps(row) + "\n" for row in rows))
                show(f"grasps: {number} of {len(blocks)} blocks")
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return {case: [rows[number] for number in range(objects)] for case, rows in done.items()}


def _kept(path: Path | None) -> Iterator[Facts]:
    """The rows of earlier runs; a line that was cut off when one was stopped is none."""
    if path is not None and path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            try:
                yield json.loads(line)
            except json.JSONDecodeError:
                continue
