"""Many grasps on several processes, each by a hand of its own; what is done already is not done again."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from hashlib import sha256
from importlib.metadata import distribution
from importlib.resources import files
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from ..report import Facts, Show
from . import law
from .calibrations import calibrate
from .felt import FINGERS, SHARES, Board, TrueForce, towards
from .plant import Plant, things
from .trial import grasp

CONSTANT_N = 3.0
#: Without a board, and with one.
TRUE: dict[str, dict[str, Any]] = {
    "true": {}, "low": {"off_n": -1.0}, "high": {"off_n": 1.0, "deaf": True}, "deaf": {"deaf": True}, "constant": {},
}  # fmt: skip
CONTROLLERS = {
    "true": "true force", "low": "1 N too low", "high": "1 N too high, deaf", "deaf": "true force, deaf to slip",
    "constant": f"constant {CONSTANT_N:g} N", "own": "own map", "lin": "Lin's gains, fitted", "default": "default map",
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
    profile: str
    at: str
    code: str

    @property
    def seeds(self) -> list[int]:
        """Of the simulated fingers."""
        return [11 + 10 * self.pair + k for k in range(self.fingers)]

    def hand(self) -> tuple[Any, ...]:
        """What a calibration is made of."""
        return self.pair, self.fingers, self.profile, self.code


def digest(law_file: Path) -> str:
    """Of the law, this package and the gateway; what was compiled, by the hashes that its installer kept."""
    python = [*Path(__file__).parent.glob("*.py"), *Path(str(files("biotac"))).rglob("*.py")]
    compiled = (distribution("biotac-gateway").read_text("RECORD") or "").encode()
    return sha256(b"".join([compiled, *(path.read_bytes() for path in (law_file, *sorted(python)))])).hexdigest()[:16]


def one(case: Case, number: int, law_file: Path, made: Any = None, trace: list[Any] | None = None) -> Facts:
    """The outcome of a thing in a hand with the calibration ``made``; ``trace`` is trial.grasp's."""
    press = {"least_n": CONSTANT_N, "most_n": CONSTANT_N} if case.controller == "constant" else {}
    to = np.array([0.0, 0.0, 1.0]) if case.controller in TRUE else towards(case.at)
    rule = law.load(law_file)(towards=[to] * case.fingers, shares=SHARES[case.fingers], **press)
    if case.controller in TRUE:
        sense = TrueForce(case.fingers, **TRUE[case.controller])
    else:
        maps = {name: bytes.fromhex(text) for name, text in made["maps"].items()} if case.controller == "own" else None
        sense = Board(case.seeds, case.profile, case.at, maps, made["gains"] if case.controller == "lin" else None)
    try:
        outcome = grasp(
            _plant(case.plant)(things(number + 1, case.seed + case.pair)[number]), rule, sense, case.fault, trace
        )
    finally:
        sense.close()
    return {"case": asdict(case), "thing": number, **outcome}


def _plant(name: str) -> Any:
    if name == "numpy":
        return Plant
    from .mujoco_plant import MujocoPlant  # the extra

    return MujocoPlant


def run(
    cases: Iterable[Case], objects: int, law_file: Path, jobs: int, kept: Path | None, show: Show
) -> tuple[dict[Case, list[Facts]], dict[Case, Any]]:
    """The outcomes of each case's things, in order, and its hand's calibration.

    ``kept`` has those of earlier runs and gets the new ones.
    """
    done: dict[Case, dict[int, Facts]] = {case: {} for case in cases}
    made: dict[tuple[Any, ...], Any] = {}
    if kept is not None and kept.exists():
        whole = kept.read_text(encoding="utf-8").rpartition("\n")[0]  # without a row that was cut off
        kept.write_text(whole + "\n" * bool(whole), encoding="utf-8")
        for row in map(json.loads, whole.splitlines()):
            if "hand" in row:
                made[tuple(row["hand"])] = row["made"]
            else:
                done.get(Case(**row["case"]), {})[row["thing"]] = row

    def keep(row: Facts) -> None:
        if kept is not None:
            with kept.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")

    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:

        def each(what: str, work: dict[Any, tuple[Any, ...]], then: Callable[[Any, Any], None]) -> None:
            waiting = {pool.submit(*call): key for key, call in work.items()}
            try:
                for number, ready in enumerate(as_completed(waiting), 1):
                    then(waiting[ready], ready.result())
                    show(f"{what}: {number} of {len(work)}")
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise

        hands = {case.hand(): case for case in done if case.controller in ("own", "lin") and case.hand() not in made}
        calls = {
            hand: (calibrate, dict(zip(FINGERS[case.fingers], case.seeds, strict=True)), case.profile)
            for hand, case in hands.items()
        }

        def calibrated(hand: Any, new: Any) -> None:
            made[hand] = new
            keep({"hand": hand, "made": new})

        def grasped(key: Any, row: Facts) -> None:
            done[key[0]][key[1]] = row
            keep(row)

        each("calibrations", calls, calibrated)
        grasps = {
            (case, number): (one, case, number, law_file, made.get(case.hand()))
            for case, rows in done.items() for number in range(objects) if number not in rows
        }  # fmt: skip
        each("grasps", grasps, grasped)
    return {case: [rows[k] for k in range(objects)] for case, rows in done.items()}, {
        case: made.get(case.hand()) for case in done
    }
