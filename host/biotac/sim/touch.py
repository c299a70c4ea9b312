"""The load on a simulated finger in one round, as a program gives it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from numbers import Real
from typing import Any, TypeAlias

import numpy as np

from ..core import geometry as surface
from ..errors import InputError
from ..wire import sensor_gen as _sensor
from .physics import REST_CELSIUS, States
from .scenario import FLAT_MM, FORCE_MAX_N, SHEAR_MAX_N, SLIP_MAX_MM_S, TORSION_MAX_NMM

Place: TypeAlias = str | tuple[float, float]


@dataclass(frozen=True)
class SimTouch:
    """One contact at the end of a round.

    ``normal_n`` >= 0 presses into the finger; ``shear_n`` is tangential, towards the tip and towards E11's side;
    ``torsion_nmm`` is about the outward normal. ``at`` is an electrode, or x and y in mm on the ventral surface;
    ``tip_mm`` the width of the flat that presses; ``slip_mm_s`` how fast it slides over the skin. ``celsius`` is the
    finger's temperature, touched or not. Values beyond a scenario's limits are refused with InputError.
    """

    normal_n: float = 0.0
    shear_n: tuple[float, float] = (0.0, 0.0)
    at: Place = "E17"
    torsion_nmm: float = 0.0
    tip_mm: float = FLAT_MM
    slip_mm_s: float = 0.0
    celsius: float = REST_CELSIUS

    def __post_init__(self) -> None:
        if np.ndim(self.shear_n) != 1 or len(self.shear_n) != 2:
            raise InputError(f"SimTouch: shear_n is {self.shear_n}, expected two numbers, to the tip and to E11's side")
        limits = (
            ("normal_n", self.normal_n, 0.0, FORCE_MAX_N),
            *(("shear_n", value, -SHEAR_MAX_N, SHEAR_MAX_N) for value in self.shear_n),
            ("torsion_nmm", self.torsion_nmm, -TORSION_MAX_NMM, TORSION_MAX_NMM),
            ("tip_mm", self.tip_mm, 0.5, 10.0),
            ("slip_mm_s", self.slip_mm_s, 0.0, SLIP_MAX_MM_S),
            ("celsius", self.celsius, 5.0, 60.0),
        )
        for name, value, low, high in limits:
            if not _is_number(value) or not low <= value <= high:  # NaN too
                raise InputError(
                    f"SimTouch: {name} is {value!r}, expected {low:g} to {high:g}; correct what computes it"
                )
        is_point = isinstance(self.at, tuple) and len(self.at) == 2 and all(map(_is_number, self.at))
        if not is_point and not (isinstance(self.at, str) and self.at in _sensor.ELECTRODE_NAMES):
            raise InputError(f"SimTouch: at is {self.at!r}, expected an electrode, E1 to E19, or (x_mm, y_mm)")
        _place_mm(self.at)


def _is_number(value: object) -> bool:
    return isinstance(value, (float, int, Real)) and not isinstance(value, bool)  # an ABC is slow: it comes last


class Course(tuple["SimTouch | Sequence[SimTouch]", ...]):
    """A round's course: the load at the end of each of several equal parts, the last at the round's end."""


#: One finger's load in a round: a contact, several at once, or a course of either; None: nothing touches.
Load: TypeAlias = "SimTouch | Sequence[SimTouch] | Course | None"


@lru_cache(maxsize=256)
def _place_mm(at: Place) -> tuple[float, float]:
    """The point's x and y in mm."""
    if isinstance(at, str):
        over = surface.project(surface.ELECTRODE_MM[[_sensor.ELECTRODE_NAMES.index(at)]])[0]
        return float(over[0]), float(over[1])
    x_mm, y_mm = at
    if not surface.is_on_surface(x_mm, y_mm):
        raise InputError(
            f"SimTouch: at is ({x_mm:g}, {y_mm:g}) mm, expected a point on the ventral surface: x from "
            f"{surface.PROXIMAL_END_MM:g}, |y| up to {surface.RADIUS_MM:g}"
        )
    return x_mm, y_mm


def states(load: Load) -> tuple[States, ...]:
    """The states of each contact of a load, one row for each part of a course, else one."""
    if load is None or type(load) is SimTouch:  # which most are
        return (_states_of((_pose(load or _NOTHING),)),)
    course = load if isinstance(load, Course) else (load,)
    parts = [_contacts(part) for part in course or (None,)]
    most = max(len(part) for part in parts)
    columns = [[part[k] if k < len(part) else SimTouch(celsius=part[0].celsius) for part in parts] for k in range(most)]
    return tuple(_states_of(tuple(map(_pose, column))) for column in columns)


_NOTHING = SimTouch()


@lru_cache(maxsize=64)  # the effects of an unchanged load are computed once
def _states_of(poses: tuple[tuple[float, ...], ...]) -> States:
    return States.of_poses(np.array(poses, float))


def _contacts(load: Any) -> tuple[SimTouch, ...]:
    contacts = () if load is None else tuple(load) if type(load) in (list, tuple) else (load,)
    for contact in contacts:
        if not isinstance(contact, SimTouch):
            seen = type(contact).__name__
            raise InputError(f"a load has a {seen}, expected a SimTouch, a list of them, a Course of either, or None")
    celsius = sorted({contact.celsius for contact in contacts})
    if len(celsius) > 1:
        raise InputError(f"a load has contacts of celsius {celsius}, expected one for all: it is the finger's own")
    return contacts or (_NOTHING,)


def _pose(touch: SimTouch) -> tuple[float, ...]:
    """The fields of timeline.Pose in order."""
    where = *_place_mm(touch.at), touch.normal_n, *touch.shear_n
    return *where, touch.torsion_nmm, touch.tip_mm, touch.celsius, touch.slip_mm_s
