"""A fitted map onto the board, and proof that what the board computes is what was fitted.

Three steps, each of which can fail on its own: the bytes that come back are those that were sent; the board's own
code on those bytes agrees with the float model on recorded counts, within what quantising is proved to cost; and
frames that the board then sends are, bit for bit, what that code makes of their counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.board_map import from_blob, pdc_above_rest_q4
from ...errors import PortError
from ...hand.compatibility import MAP_SINCE_MINOR, need
from ...hand.hand import Hand
from ...wire import messages_gen as wire
from ...wire.dtypes_gen import DTYPES
from ...wire.frames import StructArray
from ...wire.map_gen import HEADER_BYTES
from . import board
from .board import Comparison
from .fitted import WrenchMap
from .run import Run

STREAM_S = 0.5
TRIES = 60  # a simulated board that runs ahead leaves some seconds of frames unread


@dataclass(frozen=True)
class Verified:
    """``comparison`` with the float model on the run's rows; ``frames`` of the board were right, bit for bit.

    ``frames`` is 0 where the board sends none any more (a simulated source that has ended).
    """

    comparison: Comparison
    frames: int

    def facts(self) -> dict[str, Any]:
        """As JSON types."""
        return {"frames_bit_for_bit": self.frames, **self.comparison.as_dict()}


def upload(
    hand: Hand, finger: int, its: WrenchMap, run: Run, *, serial: str, made_s: int, force: bool = False
) -> Verified:
    """Give ``finger`` the map, for ``serial``'s sensor alone unless forced. It lasts until save_settings or a reboot.

    Not while streaming. Raises WireVersionError for a board older than maps, InputError for a map that no board
    takes, CommandRefusedError for another sensor, PortError when the board does not do what was fitted.
    """
    need(hand.info, MAP_SINCE_MINOR, "wrench maps")
    sent = board.quantise(its, serial=serial, made_s=made_s).blob
    hand.set_map(finger, sent, force=force)
    blob = hand.get_map(finger)
    # a forced map's header has no serial number; blocks and coefficients are the same
    if blob is None or blob[HEADER_BYTES:] != sent[HEADER_BYTES:]:
        seen = "none" if blob is None else f"another one of {len(blob)} bytes"
        raise PortError(
            f"the board took the map of {len(sent)} bytes and has {seen}: expected it back; upload it again"
        )
    on_board = from_blob(blob)
    comparison = board.compare(its, on_board, np.rint(run.counts), run.pdc if its.with_pdc else None)
    if comparison.outside:
        raise PortError(
            f"on {comparison.outside} recorded values the board's code is further from the float model than it can be: "
            f"expected at most {comparison.force_mn_bound:.3f} mN; do not use it, and report this"
        )
    frames = _mapped_frames(hand, finger)
    if hand.ended and not len(frames):
        return Verified(comparison, 0)
    force_100un, _, torsion_mnmm = on_board.results(frames["counts"], frames["tare_q4"], pdc_above_rest_q4(frames))
    differs = (force_100un != frames["force_100un"]).any(axis=1) | (torsion_mnmm != frames["torsion_mnmm"])
    wrong = int(differs.sum())
    if wrong or not len(frames):
        seen = f"{wrong} of {len(frames)} frames are not what its map says" if len(frames) else "no frame uses the map"
        raise PortError(f"the board has the map, and {seen}: expected all; restart the board and upload again")
    return Verified(comparison, len(frames))


def _mapped_frames(hand: Hand, finger: int) -> StructArray:
    """Whole FRAME messages of the finger whose force is its map's."""
    found: StructArray = np.empty(0, DTYPES[wire.Frame.ID])
    # what arrived before the map did may still wait to be read
    for _ in range(TRIES):
        frames = hand.read_batch(STREAM_S).wire
        frames = frames[(frames["finger"] == finger) & ((frames["flags"] & wire.FrameFlags.MAPPED) != 0)]
        found = frames[(frames["counts"] != wire.INVALID_COUNT).all(axis=1)]
        if len(found) or hand.ended:
            break
    hand.stop()
    return found
