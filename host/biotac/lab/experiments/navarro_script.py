"""What the emulated hand does for Navarro's experiment, as a scenario: five fingers push a plate one by one."""

from __future__ import annotations

from collections.abc import Sequence

from ...sim.physics import Profile
from ...sim.play import play
from ...sim.scenario import parse_scenario
from ...sim.source import Source

RAMP_S = 0.4
HOLD_S = 1.4
REST_S = 1.5


def presses(fingers: Sequence[int], forces_n: Sequence[float], at: Sequence[str]) -> list[str]:
    """Steps in which each of ``fingers`` presses with each force, at the electrode of the same number in ``at``."""
    steps = []
    for finger in fingers:
        for force_n, place in zip(forces_n, at, strict=True):
            steps += [
                _step(finger, "press", RAMP_S, f'at = "{place}"', f"force_n = {force_n:g}"),
                _step(finger, "hold", HOLD_S),
                _step(finger, "press", RAMP_S, "force_n = 0.0"),
                _step(finger, "rest", REST_S),
            ]
    return steps


def seconds(steps: Sequence[str]) -> float:
    """How long the steps last."""
    return sum(float(line.split("=")[1]) for step in steps for line in step.splitlines() if line.startswith("seconds"))


def scenario(name: str, seeds: Sequence[int], profile: Profile, steps: Sequence[str]) -> str:
    """The text of a scenario: a finger for every seed, at rest at first."""
    sensors = [f'[[finger]]\nseed = {seed}\nprofile = "{profile}"\n' for seed in seeds]
    begin = f'[[step]]\ndo = "rest"\nseconds = {REST_S:g}\n'
    return "\n".join([f'name = "{name}"\n', *sensors, begin, *steps])


def source(name: str, seeds: Sequence[int], profile: Profile, steps: Sequence[str]) -> Source:
    """That scenario, played."""
    return play(parse_scenario(scenario(name, seeds, profile, steps).encode(), file=f"{name}.toml"))


def _step(finger: int, do: str, for_s: float, *more: str) -> str:
    lines = ["[[step]]", f'do = "{do}"', f"fingers = [{finger}]", f"seconds = {for_s:g}", *more]
    return "\n".join(lines) + "\n"
