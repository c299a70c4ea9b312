"""Many grasps on several processes, each by a separate hand; finished ones are not done again."""

from __future__ import annotations

import json
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from importlib.metadata import distribution
from importlib.resources import files
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from ..report import Facts, Show
from . import law
from .calibrations import calibrate
from .felt import FINGERS, SHARES, Board, TrueForce, towards
from .lagging_plant import LaggingPlant
from .plant import Plant, items
from .trial import grasp

CONSTANT_N = 3.0
PLANTS = "numpy", "mujoco", "lagging"
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
    lag_ms: int | None = None

    @property
    def seeds(self) -> list[int]:
        """Of the simulated fingers."""
        return [11 + 10 * self.pair + k for k in range(self.fingers)]

    @property
    def calibration(self) -> Case:
        """The facts that determine the hand's calibration."""
        return replace(self, controller="calibration", fault="", seed=0, plant="", at="", lag_ms=None)


def digest(law_file: Path | None) -> str:
    """Of the law, this package and the gateway; of compiled files, the hashes that the installer stored."""
    own = [path for path in Path(__file__).parent.iterdir() if path.suffix in (".py", ".xml")]
    python = [*own, *Path(str(files("biotac"))).rglob("*.py")]
    compiled = (distribution("biotac-gateway").read_text("RECORD") or "").encode()
    paths = [*([law_file] if law_file else []), *sorted(python)]
    return sha256(b"".join([compiled, *(path.read_bytes() for path in paths)])).hexdigest()[:16]


def run_trial(
    case: Case, number: int, law_file: Path | None, made: Any = None, trace: list[Any] | None = None
) -> Facts:
    """The outcome of a thing in a hand with the calibration ``made``; ``trace`` is trial.grasp's."""
    true, press = case.controller in TRUE, {}
    if case.controller == "constant":
        press = {"least_n": CONSTANT_N, "most_n": CONSTANT_N}
    to = [towards("E17" if true else case.at)] * case.fingers
    rule = law.load(law_file)["Grip"](towards=to, shares=SHARES[case.fingers], **press)
    if true:
        sense = TrueForce(case.fingers, **TRUE[case.controller])
    else:
        own = {"own": "maps", "lin": "gains"}.get(case.controller, "")
        sense = Board(case.seeds, case.profile, case.at, **({own: made[own]} if own else {}))
    item = items(number + 1, case.seed + case.pair)[number]
    try:
        lag_s = None if case.lag_ms is None else case.lag_ms / 1e3
        return grasp(_plant(case.plant)(item, lag_s), rule, sense, case.fault, trace)
    finally:
        sense.close()


def _plant(name: str) -> Any:
    if name != "mujoco":
        return {"numpy": Plant, "lagging": LaggingPlant}[name]
    from .mujoco_plant import MujocoPlant  # the extra

    return MujocoPlant


def run(
    cases: Iterable[Case], objects: int, law_file: Path | None, jobs: int, kept: Path | None, show: Show
) -> dict[tuple[Case, int], Facts]:
    """The outcomes by case and thing, and each hand's calibration, as thing 0 of Case.calibration.

    ``kept`` has those of earlier runs and gets the new ones.
    """
    cases, done = list(cases), dict[tuple[Case, int], Facts]()
    if kept is not None and kept.exists():
        whole = kept.read_text(encoding="utf-8").rpartition("\n")[0]  # without a row that was cut off
        kept.write_text(whole + "\n" * bool(whole), encoding="utf-8")
        for row in map(json.loads, whole.splitlines()):
            done[Case(**row["case"]), row["thing"]] = row["outcome"]
    calls: list[dict[tuple[Case, int], tuple[Any, ...]]] = [
        {
            (case.calibration, 0): (calibrate, dict(zip(FINGERS[case.fingers], case.seeds, strict=True)), case.profile)
            for case in cases if case.controller in ("own", "lin")
        },
        {(case, number): (run_trial, case, number, law_file) for case in cases for number in range(objects)},
    ]  # fmt: skip
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for stage, todo in zip(("calibrations", "grasps"), calls, strict=True):
            waiting = {
                pool.submit(*call, *([done.get((key[0].calibration, 0))] if call[0] is run_trial else [])): key
                for key, call in todo.items() if key not in done
            }  # fmt: skip
            try:
                for number, ready in enumerate(as_completed(waiting), 1):
                    case, item = key = waiting[ready]
                    done[key] = ready.result()
                    if kept is not None:
                        with kept.open("a", encoding="utf-8") as file:
                            file.write(json.dumps({"case": asdict(case), "thing": item, "outcome": done[key]}) + "\n")
                    show(f"{stage}: {number} of {len(waiting)}")
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise
    return done
