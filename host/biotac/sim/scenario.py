"""The scenario format: a TOML timeline of the loads on the fingers.

Top level: ``name``; ``about``, a clause; ``seed`` (default 1); ``fingers`` (default: one per [[finger]], else 1);
``[[finger]]``: ``seed``, ``profile`` ("new" or "worn"), ``serial``.
``[[step]]``, played in order, each with ``seconds`` and optionally ``fingers = [0, ...]`` (others
hold meanwhile):

=============  ========================================================================
``do``         keys
=============  ========================================================================
rest           let go within the first 0.1 s, then nothing touches
press          ``force_n``; to start a contact also ``at = "E17"`` or ``at_mm = [x, y]``
               and optionally ``tip_mm`` (width of the flat, default 7); 0 releases
hold           keep everything as it is
shear          ``shear_n = [x, y]``: tangential force to the tip and to E11's side
twist          ``torsion_nmm``: about the outward normal
slide          ``to = "E13"`` or ``to_mm = [x, y]``
slip           ``mm_s``: what touches slides over the skin, as long as the step lasts; the contact stays where it is
temperature    ``celsius``; contacts stay
=============  ========================================================================

Changes run straight over the step's time and stay until changed again. ``[[fault]]``: ``at_s``,
``seconds``, ``finger``, ``kind`` (a fault of faults.py: "unplugged", "electrode stuck"), optionally ``channel``: of
the bus (default: all), or the electrode that breaks (default: E17).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..core import geometry as surface
from ..errors import ScenarioError
from ..wire import sensor_gen as _sensor
from .faults import BETWEEN_FINGERS, EVERY_FAULT
from .physics import PROFILES, SEED_MAX, Profile
from .source import MAX_SECONDS
from .tables import TomlTable, parse_toml
from .timeline import Pose, Track

RELEASE_S = 0.1
# A flat surface presses as far as the model goes, 3.5 mm to each side (host/docs/reference/sensor_model.md).
FLAT_MM = 7.0
FORCE_MAX_N = 50.0
SHEAR_MAX_N = 20.0
TORSION_MAX_NMM = 100.0
SLIP_MAX_MM_S = 200.0
# Repeated for an hour on five fingers, the worst scenario takes about 8 s on a busy processor (half of it for any hour)
# and 350 MB.
FINGER_SECONDS_MAX = 900.0  # all fingers together
MOVING_MAX_S = 160.0  # likewise, with a load that changes: each frame of it costs 0.15 ms
FAULTS_MAX_S = 10_000.0  # all together; the time to play them grows with it

STEP_KEYS: dict[str, tuple[str, ...]] = {
    "rest": (),
    "press": ("force_n", "at", "at_mm", "tip_mm"),
    "hold": (),
    "shear": ("shear_n",),
    "twist": ("torsion_nmm",),
    "slide": ("to", "to_mm"),
    "slip": ("mm_s",),
    "temperature": ("celsius",),
}


@dataclass(frozen=True)
class FingerSpec:
    """A finger's sensor; ``serial`` is the serial number that it reports, 16 characters."""

    seed: int
    profile: Profile
    serial: str


@dataclass(frozen=True)
class Fault:
    """A fault of faults.py while it lasts; ``channel`` None: every channel of the bus, or the pad's middle."""

    at_s: float
    seconds: float
    finger: int
    kind: str
    channel: str | None


@dataclass(frozen=True)
class Scenario:
    """A valid scenario: one track and one sensor per finger, all tracks equally long."""

    name: str
    fingers: tuple[FingerSpec, ...]
    tracks: tuple[Track, ...]
    faults: tuple[Fault, ...]
    seconds: float
    about: str = ""


def parse_scenario(data: bytes, *, file: str) -> Scenario:
    """Read a scenario. Raises ScenarioError naming ``file``, the line, the table and the key."""
    values, lines = parse_toml(data, file)
    if not values:
        raise ScenarioError(f"{file}:1: the file is empty: expected a name and [[step]] tables; add them")
    top = TomlTable(values, file, "", lines, 0)
    top.only(("name", "about", "seed", "fingers", "finger", "step", "fault"))
    name = top.text("name", r"[^\x00-\x1f]{1,64}", "1 to 64 printable characters")
    seed = top.integer("seed", 0, SEED_MAX, default=1)
    specs = _fingers(top, seed)
    steps = top.tables("step")
    if not steps:
        raise top.error("step", "is missing", "at least one [[step]] table", "add one")
    tracks = tuple(Track() for _ in specs)
    for step in steps:
        _add_step(step, tracks)
    faults = tuple(_fault(table, len(specs), tracks[0].seconds) for table in top.tables("fault"))
    if sum(fault.seconds for fault in faults) > FAULTS_MAX_S:
        raise top.error("fault", "lasts too long", f"at most {FAULTS_MAX_S:g} s in total", "remove some")
    about = top.text("about", r"[^\x00-\x1f]{1,120}", "1 to 120 printable characters", default="")
    return Scenario(name, specs, tracks, faults, tracks[0].seconds, about)


def default_serial(seed: int) -> str:
    """Serial number of a sensor that names none; 16 characters that begin with BT."""
    return f"BTSIM{seed:011d}"


def _fingers(top: TomlTable, seed: int) -> tuple[FingerSpec, ...]:
    tables = top.tables("finger")
    count = len(tables) or 1
    if "fingers" in top:
        stated = top.integer("fingers", 1, _sensor.MAX_SENSORS)
        if tables and stated != count:
            raise top.error(
                "fingers", f"is {stated}, with {count} [[finger]] tables", "the same number", "correct one of them"
            )
        count = stated
    if count > _sensor.MAX_SENSORS:
        raise top.error("finger", f"has {count} tables", f"at most {_sensor.MAX_SENSORS}", "remove some")
    if not tables:
        return tuple(FingerSpec(seed + k, "new", default_serial(seed + k)) for k in range(count))
    specs = []
    for index, table in enumerate(tables):
        table.only(("seed", "profile", "serial"))
        own = table.integer("seed", 0, SEED_MAX, default=seed + index)
        word = table.choice("profile", PROFILES, default="new")
        profile = next(known for known in PROFILES if known == word)  # narrows str to Profile
        expected = "16 letters and digits that begin with BT"
        serial = table.text("serial", r"BT[0-9A-Za-z]{14}", expected, default=default_serial(own))
        specs.append(FingerSpec(own, profile, serial))
    return tuple(specs)


def _add_step(step: TomlTable, tracks: tuple[Track, ...]) -> None:
    do = step.choice("do", tuple(STEP_KEYS))
    step.only(("do", "seconds", "fingers", *STEP_KEYS[do]), f" for {do}")
    seconds = step.number("seconds", 0.01, MAX_SECONDS, "s")
    most_s = FINGER_SECONDS_MAX / len(tracks)
    if tracks[0].seconds + seconds > most_s:
        expected = f"at most {most_s:g} s in total with {len(tracks)} finger(s)"
        raise step.error("seconds", "makes the scenario too long", expected, "shorten it, and repeat it with ?seconds=")
    acting = step.indices("fingers", len(tracks), default=range(len(tracks)))
    for index, track in enumerate(tracks):
        if index not in acting or do == "hold":
            track.ramp(seconds, track.pose)
        elif do == "rest":
            release_s = min(RELEASE_S, seconds / 2)
            track.ramp(release_s, track.pose.released())
            track.ramp(seconds - release_s, track.pose)
        elif do == "temperature":
            celsius = step.number("celsius", 5.0, 60.0, "C")
            track.ramp(seconds, replace(track.pose, celsius=celsius))
        elif do == "press":
            _press(step, track, seconds)
        else:
            _move(step, do, track, seconds, index)
    if sum(track.moving_s for track in tracks) > MOVING_MAX_S:
        expected = f"at most {MOVING_MAX_S:g} s of changing load, summed over the fingers"
        raise step.error("seconds", "makes the load change for too long", expected, "shorten it, or hold")


def _press(step: TomlTable, track: Track, seconds: float) -> None:
    force_n = step.number("force_n", 0.0, FORCE_MAX_N, "N")
    if track.pose.force_n > 0.0:
        for key in ("at", "at_mm", "tip_mm"):
            if key in step:
                raise step.error(
                    key, "is given during a contact", "it only where a contact starts",
                    "remove it, rest first, or use slide",
                )  # fmt: skip
        end = replace(track.pose, force_n=force_n) if force_n > 0.0 else track.pose.released()
        track.ramp(seconds, end)
        return
    if force_n == 0.0:
        raise step.error("force_n", "is 0 but nothing touches", "more than 0 N to start a contact")
    x_mm, y_mm = _point_mm(step, "at", "at_mm")
    tip_mm = step.number("tip_mm", 0.5, 10.0, "mm", default=FLAT_MM)
    start = Pose(x_mm=x_mm, y_mm=y_mm, tip_mm=tip_mm, celsius=track.pose.celsius)
    track.ramp(seconds, replace(start, force_n=force_n), start=start)


def _move(step: TomlTable, do: str, track: Track, seconds: float, finger: int) -> None:
    pose = track.pose
    if pose.force_n == 0.0:
        raise step.error("do", f"is '{do}' but nothing touches finger {finger}", "a contact", "press first")
    if do == "shear":
        x_n, y_n = step.pair("shear_n", SHEAR_MAX_N, "N")
        pose = replace(pose, shear_x_n=x_n, shear_y_n=y_n)
    elif do == "slip":
        slipping = replace(pose, slip_mm_s=step.number("mm_s", 0.1, SLIP_MAX_MM_S, "mm/s"))
        track.ramp(seconds, slipping, start=slipping)
        track.pose = pose
        return
    elif do == "twist":
        torsion = step.number("torsion_nmm", -TORSION_MAX_NMM, TORSION_MAX_NMM, "N mm")
        pose = replace(pose, torsion_nmm=torsion)
    else:
        x_mm, y_mm = _point_mm(step, "to", "to_mm")
        pose = replace(pose, x_mm=x_mm, y_mm=y_mm)
    track.ramp(seconds, pose)


def _point_mm(step: TomlTable, name_key: str, pair_key: str) -> tuple[float, float]:
    """The contact's x and y: over a named electrode, or given."""
    if name_key in step and pair_key in step:
        raise step.error(pair_key, f"is given beside '{name_key}'", "one of the two", "remove one")
    if name_key in step or pair_key not in step:
        name = step.choice(name_key, _sensor.ELECTRODE_NAMES)
        over = surface.project(surface.ELECTRODE_MM[[_sensor.ELECTRODE_NAMES.index(name)]])[0]
        return float(over[0]), float(over[1])
    x_mm, y_mm = step.pair(pair_key, -surface.PROXIMAL_END_MM, "mm")
    if not surface.is_on_surface(x_mm, y_mm):
        raise step.error(
            pair_key, f"is [{x_mm:g}, {y_mm:g}]",
            f"a point on the ventral surface: x from {surface.PROXIMAL_END_MM:g}, |y| up to "
            f"{surface.RADIUS_MM:g}, and x^2 + y^2 up to {surface.RADIUS_MM:g}^2 where x > 0",
        )  # fmt: skip
    return x_mm, y_mm


def _fault(table: TomlTable, fingers: int, scenario_s: float) -> Fault:
    table.only(("at_s", "seconds", "finger", "kind", "channel"))
    kind = table.choice("kind", EVERY_FAULT)
    if kind in BETWEEN_FINGERS and fingers == 1:
        raise table.error("kind", f"is '{kind}' with one finger", "a second finger", "add one")
    channel = table.choice("channel", tuple(dict.fromkeys(_sensor.SLOTS))) if "channel" in table else None
    at_s = table.number("at_s", 0.0, scenario_s - 0.01 if scenario_s > 0.01 else 0.0, "s")
    return Fault(
        at_s=at_s,
        # a fault may not end after the scenario: the source would not play that part
        seconds=table.number("seconds", 0.001, round(scenario_s - at_s, 9), "s"),
        finger=table.integer("finger", 0, fingers - 1),
        kind=kind,
        channel=channel,
    )
