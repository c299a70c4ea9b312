"""A held press at E17 on which bus faults are tried, and the faults themselves, as scenario texts."""

import numpy as np


def held_press(fingers: int, *, hold_s: float = 1.0, force_n: float = 3.0, rest_s: float = 0.0) -> str:
    """At rest for a second, pressed for half a second, held, and for ``rest_s`` let go."""
    text = (
        f'name = "held"\nseed = 5\nfingers = {fingers}\n'
        '[[step]]\ndo = "rest"\nseconds = 1.0\n'
        f'[[step]]\ndo = "press"\nseconds = 0.5\nat = "E17"\nforce_n = {force_n}\n'
        f'[[step]]\ndo = "hold"\nseconds = {hold_s}\n'
    )
    return text + (f'[[step]]\ndo = "rest"\nseconds = {rest_s}\n' if rest_s else "")


def fault(kind: str, at_s: float, seconds: float, finger: int = 1, channel: str | None = None) -> str:
    """Text to be put behind a scenario's."""
    where = "" if channel is None else f'channel = "{channel}"\n'
    return f'[[fault]]\nat_s = {at_s}\nseconds = {seconds}\nfinger = {finger}\nkind = "{kind}"\n{where}'


def of_finger(frames: np.ndarray, finger: int) -> np.ndarray:
    """That finger's."""
    return frames[frames["finger"] == finger]
