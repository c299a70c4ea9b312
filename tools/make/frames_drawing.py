#!/usr/bin/env python3
"""Write host/docs/frames.svg, the frame of reference, from the sensor's geometry.

tools/make/frames_drawing.py           write it
tools/make/frames_drawing.py --check   exit 1 when it has drifted
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from biotac.core.geometry import ELECTRODE_MM, ELECTRODE_NORMAL, RADIUS_MM, Floats
from biotac.wire import sensor_gen as sensor
from committed import ROOT, write_or_check

WIDTH, HEIGHT = 980, 560
PX_PER_MM = 15.0
TAIL_MM = -16.5  # how much of the finger is drawn
AXIS_MM = 8.5
INK, GREY, CORE, TOUCH = "#1f2937", "#6b7280", "#f3f4f6", "#7c3aed"
AXIS_COLOR = {"x": "#dc2626", "y": "#15803d", "z": "#2563eb"}
EXCITATION_MM = np.array(sensor.EXCITATION_UM) / 1000

Point = tuple[float, float, float] | Floats  # mm
Pixel = tuple[float, float]

#: Electrodes where the drawing shows a push, which acts against the outward normal.
PRESSED = ("E17", "E13", "E7")


def axis(signed: str) -> Floats:
    """The unit vector of a signed axis such as +x or -x."""
    unit: Floats = np.eye(3)["xyz".index(signed[1])]
    return unit if signed[0] == "+" else -unit


class View(NamedTuple):
    """Sensor axes to picture: ``right`` and ``up`` are signed axes such as +x, ``at`` is the origin's pixel."""

    title: str
    right: str
    up: str
    at: Pixel
    title_at: Pixel

    def px(self, point_mm: Point) -> Pixel:
        """The pixel of a point."""
        across, upward = (float(axis(signed) @ point_mm) for signed in (self.right, self.up))
        return self.at[0] + across * PX_PER_MM, self.at[1] - upward * PX_PER_MM

    @property
    def toward(self) -> str:
        """The signed axis that points at the viewer."""
        out = np.cross(axis(self.right), axis(self.up))
        k = int(np.flatnonzero(out)[0])
        return f"{'+' if out[k] > 0 else '-'}{'xyz'[k]}"

    def shows(self, point_mm: Point) -> bool:
        """Not behind the core; from the tip only the tip's own, because the others lie one behind the other."""
        return bool(axis(self.toward) @ point_mm >= (0.5 if self is TIP else -0.5))


SIDE = View("from E1's side", "+x", "+z", (310, 150), (40, 34))
PALMAR = View("from below: the palmar side", "+y", "+x", (810, 200), (640, 34))
TIP = View("from the tip", "+y", "+z", (150, 400), (40, 300))


def push(name: str) -> tuple[Floats, Floats]:
    """The electrode's place, and the direction of the force on the finger of a push there."""
    k = sensor.ELECTRODE_NAMES.index(name)
    return ELECTRODE_MM[k], -ELECTRODE_NORMAL[k] / np.linalg.norm(ELECTRODE_NORMAL[k])


def readings(name: str) -> str:
    """Signs of the components that a push on an electrode gives, without those below a tenth of the largest."""
    at_mm, force = push(name)
    words = []
    for letter, vector in (("F", force), ("M", np.cross(at_mm, force))):
        largest = abs(vector).max()
        if largest > 1e-9:
            sizes = zip("xyz", vector, strict=True)
            words += [f"{letter}{along} {'>' if v > 0 else '<'} 0" for along, v in sizes if abs(v) > largest / 10]
    return ", ".join(words)


# ---- pieces of SVG -------------------------------------------------------------------------------


def text(at: Pixel, words: str, *, size: int = 13, color: str = INK, anchor: str = "start") -> str:
    """A line of words."""
    words = words.replace("<", "&lt;").replace(">", "&gt;")
    return (
        f'<text x="{at[0]:.1f}" y="{at[1]:.1f}" font-size="{size}" fill="{color}" text-anchor="{anchor}">{words}</text>'
    )


def arrow(a: Pixel, b: Pixel, color: str, width: float = 2.0) -> str:
    """A line from a with its head at b."""
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    ux, uy = (b[0] - a[0]) / length, (b[1] - a[1]) / length
    head = 4.0 * width
    x, y = b[0] - head * ux, b[1] - head * uy
    wide = head * 0.45
    tip = f"{b[0]:.1f},{b[1]:.1f} {x - wide * uy:.1f},{y + wide * ux:.1f} {x + wide * uy:.1f},{y - wide * ux:.1f}"
    return (
        f'<line x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{x:.1f}" y2="{y:.1f}" stroke="{color}" stroke-width="{width}"/>'
        f'<polygon points="{tip}" fill="{color}"/>'
    )


def outline(view: View, points: list[Point]) -> str:
    """A closed outline of the core."""
    corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in map(view.px, points))
    return f'<polygon points="{corners}" fill="{CORE}" stroke="{GREY}" />'


def arc(make: Callable[[float, float], Point], first_deg: int, last_deg: int) -> list[Point]:
    """Points of a circle of the core's radius; ``make`` makes a point of cosine and sine."""
    steps = range(first_deg, last_deg + 1, 6)
    return [make(RADIUS_MM * math.cos(math.radians(deg)), RADIUS_MM * math.sin(math.radians(deg))) for deg in steps]


def axes(view: View) -> Iterator[str]:
    """Two axes as arrows, the third as a dot (towards the viewer) or a cross (away)."""
    for signed in (view.right, view.up):
        color = AXIS_COLOR[signed[1]]
        end = AXIS_MM * axis(f"+{signed[1]}")
        yield arrow(view.at, view.px(end), color, 2.5)
        x, y = view.px(1.09 * end)
        yield text((x, y + 5), signed[1], size=17, color=color, anchor="middle")
    x, y = view.at
    color = AXIS_COLOR[view.toward[1]]
    yield f'<circle cx="{x}" cy="{y}" r="7" fill="#fff" stroke="{color}" stroke-width="2"/>'
    if view.toward[0] == "+":
        yield f'<circle cx="{x}" cy="{y}" r="2.5" fill="{color}"/>'
    else:
        for a in (-4, 4):
            yield f'<line x1="{x - 4}" y1="{y - a}" x2="{x + 4}" y2="{y + a}" stroke="{color}" stroke-width="2"/>'
    yield text((x - 20, y + 20), view.toward[1], size=17, color=color)


def electrodes(view: View) -> Iterator[str]:
    """The electrodes visible from there, with names; excitation electrodes as squares."""
    for name, at_mm in zip(sensor.EXCITATION_NAMES, EXCITATION_MM, strict=True):
        x, y = view.px(at_mm)
        if view.shows(at_mm):
            yield f'<rect x="{x - 5:.1f}" y="{y - 5:.1f}" width="10" height="10" fill="#fff" stroke="{GREY}"/>'
            yield text((x, y + 17), name, size=10, color=GREY, anchor="middle")
    for name, at_mm in zip(sensor.ELECTRODE_NAMES, ELECTRODE_MM, strict=True):
        x, y = view.px(at_mm)
        if view.shows(at_mm):
            yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="10" fill="#fef3c7" stroke="#b45309"/>'
            yield text((x, y + 3.5), name.removeprefix("E"), size=10, anchor="middle")


def bodies() -> Iterator[str]:
    """The core's outline in each view."""
    yield outline(SIDE, [(TAIL_MM, 0, 0), (TAIL_MM, 0, -RADIUS_MM), *arc(lambda c, s: (s, 0, -c), 0, 90)])
    left: list[Point] = [(TAIL_MM, -RADIUS_MM, 0), (0, -RADIUS_MM, 0)]
    yield outline(PALMAR, [*left, *arc(lambda c, s: (s, -c, 0), 6, 174), (0, RADIUS_MM, 0), (TAIL_MM, RADIUS_MM, 0)])
    yield outline(TIP, arc(lambda c, s: (0, c, -s), 0, 180))


def pushes() -> Iterator[str]:
    """A force on the finger at each pressed electrode, in a view that shows it."""
    for name, view in zip(PRESSED, (SIDE, TIP, SIDE), strict=True):
        at_mm, force = push(name)
        begin = view.px(at_mm - 5.5 * force)
        yield arrow(begin, view.px(at_mm - force), TOUCH, 3)
        x, y = begin
        yield text((x + 8, y + 6), f"pressed at {name}", size=12, color=TOUCH)


def legend() -> Iterator[str]:
    """Text that belongs to no view."""
    lines = [
        "Right-handed. Origin: the centre of the tip's sphere,",
        f"r = {RADIUS_MM:g} mm; points of contact lie on the core's surface.",
        "Force and torque are what acts on the finger;",
        "torque is about the origin, by the right-hand rule.",
        "Round: E1 to E19. Square: excitation.",
    ]
    for k, line in enumerate(lines):
        yield text((370, 380 + 20 * k), line, size=12)
    for k, name in enumerate(PRESSED):
        yield text((370, 490 + 20 * k), f"pressed at {name}: {readings(name)}", size=12, color=TOUCH)


def drawing() -> str:
    """The whole SVG."""
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" '
        'font-family="sans-serif" role="img">',
        "<!-- Generated by tools/make/frames_drawing.py from protocol/sensor.toml; do not edit. -->",
        "<title>The finger's frame of reference, its electrodes and the signs of force and torque</title>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>',
        *bodies(),
    ]
    for view in (SIDE, PALMAR, TIP):
        parts.append(text(view.title_at, view.title, size=15))
        parts += [*axes(view), *electrodes(view)]
    return "\n".join([*parts, *pushes(), *legend(), "</svg>"]) + "\n"


if __name__ == "__main__":
    sys.exit(write_or_check({ROOT / "host/docs/frames.svg": drawing()}, "protocol/sensor.toml"))
