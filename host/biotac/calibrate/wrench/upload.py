"""Uploads a fitted map to the board, and proves that the board computes the fitted map.

Three checks, each of which can fail on its own: the bytes read back are those that were sent (set_map); the board's own
code with these bytes agrees with the float model on recorded counts, within the proven bound on rounding; and the
frames that the board then sends are, bit for bit, what that code computes from their counts.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from ...errors import PortError
from ...hand.hand import Hand
from ...kernels.compiled import default_settings
from ...kernels.geometry import Floats
from ...map.board_map import on_board_q4
from ...map.bound import compare
from ...map.fitted import WrenchMap
from ...wire import messages_gen as wire
from ...wire.dtypes_gen import DTYPES
from ...wire.frames import StructArray

STREAM_S = 0.5
TRIES = 60  # a simulated board that runs ahead has some seconds of unread frames


def upload(
    hand: Hand,
    finger: int,
    fitted: WrenchMap,
    counts: Floats,
    pdc: Floats | None = None,
    *,
    serial: str,
    made_s: int,
    force: bool = False,
) -> dict[str, Any]:
    """Give ``finger`` the map, only for the sensor ``serial`` unless forced.

    The map is in force until the next reboot, or for good with save_settings. Returns, as JSON types, the Comparison
    with the float model on recorded ``counts`` (n, 19) and ``pdc`` (n,), and ``frames_bit_for_bit``: how many frames of
    the board were checked, 0 if it sends no more (a simulated source that has ended). Not while streaming. Raises
    InputError for a map that no board accepts, CommandRefusedError for another sensor, PortError when the board does
    not compute the fitted map.
    """
    on_board = fitted.on_board(serial=serial, made_s=made_s)
    hand.board.set_map(finger, on_board, force=force)
    comparison = compare(fitted, on_board, np.rint(counts), pdc if fitted.with_pdc else None)
    if comparison.outside:
        raise PortError(
            f"{comparison.outside} recorded values differ from the float model by more than rounding allows: "
            f"expected at most {comparison.force_mn_bound:.3f} mN; do not use this map, and report this"
        )
    frames = _mapped_frames(hand, finger)
    _, force_100un, _, torsion_mnmm, _ = on_board_q4(frames, default_settings(), on_board)
    differs = (force_100un != frames["force_100un"]).any(axis=1) | (torsion_mnmm != frames["torsion_mnmm"])
    wrong = int(differs.sum())
    if wrong or not (len(frames) or hand.ended):
        seen = f"{wrong} of {len(frames)} frames do not match it" if len(frames) else "no frame uses it"
        raise PortError(f"the board has the map, but {seen}: expected all to match; restart the board and upload again")
    return {"frames_bit_for_bit": len(frames), **asdict(comparison)}


def _mapped_frames(hand: Hand, finger: int) -> StructArray:
    """FRAME messages of the finger that have all electrodes and a force from the map."""
    found: StructArray = np.empty(0, DTYPES[wire.FrameMessage.ID])
    # frames from before the map may still be unread
    for _ in range(TRIES):
        frames = hand.read_batch(STREAM_S).wire
        frames = frames[(frames["finger"] == finger) & ((frames["flags"] & wire.FrameFlags.MAPPED) != 0)]
        found = frames[(frames["counts"] != wire.INVALID_COUNT).all(axis=1)]
        if len(found) or hand.ended:
            break
    hand.stop()
    return found
