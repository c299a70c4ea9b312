"""A recording in a few lines: for `biotac info`, and for Python's and Jupyter's display."""

from __future__ import annotations

from collections import Counter
from datetime import datetime, timezone
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..wire.frames import StructArray
from ..wire.identity import ascii_text
from ..wire.messages_gen import LATCHED_FLAGS, FrameFlags


def summary(recording: Any, flags: StructArray | None = None) -> dict[str, Any]:
    """Facts of a Recording, for JSON. ``flags`` (finger, flags) of all frames adds shares of them: CONTACT and faults
    of all, the others of those in contact.
    """
    heads = recording.heads()
    frames: Counter[int] = Counter()
    for block in heads:
        frames.update({row.finger: row.frames for row in block.head.rows if row.frames})
    name_of = {finger: name for name, finger in recording.names.items()}
    serials = {sensor.finger: ascii_text(sensor.serial) for sensor in recording.sensors}
    fingers: dict[str, dict[str, Any]] = {
        str(finger): {"name": name_of.get(finger), "serial": serials.get(finger), "frames": frames[finger]}
        for finger in sorted({*frames, *serials})
    }
    if flags is not None:
        for finger, about in fingers.items():
            own = flags["flags"][flags["finger"] == int(finger)]
            touched = own[(own & FrameFlags.CONTACT) != 0]  # at rest there is no point of contact, and that is no fault
            about["flags"] = _shares(own, FrameFlags.CONTACT) | _shares(touched, ~FrameFlags.CONTACT)
            about["faults"] = _shares(own, LATCHED_FLAGS)
    return {
        "recording": str(recording.path),
        "begin": datetime.fromtimestamp(recording.begin_ns / 1e9, timezone.utc).isoformat(timespec="seconds"),
        "duration_s": (recording.end_us - recording.begin_us) / 1e6,
        "port": recording.metadata["port"],
        "firmware": recording.metadata["firmware"],
        "fingers": fingers,
        "frames_lost": max((block.head.frames_lost for block in heads), default=0),
        "gaps": sum(len(block.head.gaps) for block in heads),
        "labels": labels(recording),
    }


def _shares(flags: NDArray[np.uint32], of: FrameFlags) -> dict[str, float]:
    shares = {flag.name or "": float(np.mean((flags & flag) != 0)) for flag in FrameFlags if flag in of and len(flags)}
    return {flag: share for flag, share in shares.items() if share}


def _percent(shares: dict[str, float]) -> str:
    return ", ".join(f"{flag} {share:.1%}" for flag, share in shares.items())


def labels(recording: Any) -> list[dict[str, Any]]:
    """A Recording's labels, for JSON."""
    return [
        {"text": label.line(), "at_s": at(recording, label.t_us), "until_s": at(recording, label.end_us)}
        | {"finger": label.finger}
        for label in recording.labels
    ]


def at(recording: Any, t_us: int | None) -> float | None:
    """Seconds since the first row; 0 for a label before it."""
    return None if t_us is None else max(0, t_us - recording.begin_us) / 1e6


def lines(facts: dict[str, Any]) -> list[str]:
    """``summary`` for people."""
    out = [
        f"{facts['recording']}: {facts['duration_s']:.1f} s from {facts['begin']}, {facts['frames_lost']} frames lost, "
        f"{facts['gaps']} gap(s)",
        f"port {facts['port']}, firmware {facts['firmware']}",
    ]
    for finger, about in facts["fingers"].items():
        shares = dict(about.get("flags", {}))
        within, faults = f"{shares.pop('CONTACT', 0.0):.1%} in contact", about.get("faults", {})
        within += f", of these {_percent(shares)}" if shares else ""
        out.append(
            f"finger {finger}: {about['name'] or 'no name'}, sensor {about['serial'] or 'unknown'}, "
            f"{about['frames']} frames"
            + (f"; {within}" if "flags" in about else "")
            + (f"; of all {_percent(faults)}" if faults else "")
        )
    return [*out, *map(label_line, facts["labels"])]


def label_line(label: dict[str, Any]) -> str:
    """One of ``labels`` for people."""
    span = "" if label["until_s"] is None else f" to {label['until_s']:.2f} s"
    when = "all of it" if label["at_s"] is None else f"{label['at_s']:.2f} s{span}"
    of_finger = "" if label["finger"] is None else f", finger {label['finger']}"
    return f"label, {when}{of_finger}: {label['text']}"
