"""One finger as the board runs it: recorded counts in, the tare, flags and results of every frame out.

This runs the compiled firmware core (firmware/core/finger.h) round by round, so that a recording can be recomputed by
the board's own code, bit for bit, and with other settings.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import CommandRefusedError
from ..kernels.compiled import Settings, board_settings, c_pointers, checked_words, default_settings
from ..map.board_map import BoardMap, opened
from ..wire import messages_gen as wire
from ..wire import sensor_gen as sensor
from ..wire import slots
from ..wire.dtypes_gen import DTYPES
from ..wire.fields import INVALID_U32
from ..wire.frames import StructArray, age_ms, frames_from_wire, tare_to_q4
from ..wire.identity import is_foreign
from ..wire.native import ffi, lib
from .compute import refuse_foreign_results

ROUND_US = 10_000
#: An EVENT message's fields (protocol/MESSAGES.md), as the board sends them.
EVENT_DTYPE = DTYPES[wire.Event.ID]
_EVENTS_A_ROUND = 24  # more than there can be: a touch and a lift in every other slot

#: What Finger.feed returns: the fields of a FRAME message as the board sends them (protocol/MESSAGES.md: integers, tare
#: in 1/16 count, invalid marks), then ``present`` (0: no valid word came, so the board sends nothing and only seq, t_us
#: and the invalid marks mean anything), ``tare_reason`` (TareReason), ``touch_slot`` (the slot in which a resting
#: finger was first touched, 255: none), ``energy_count2`` (of the filtered signals of a finger at rest, in count^2; 0
#: in other states, where it is not used), ``noise_count2`` (at rest; 0 until measured) and ``threshold_count2`` (the
#: energy that counts as touched).
FINGER_DTYPE = np.dtype([
    *DTYPES[wire.FrameMessage.ID].descr, ("present", "u1"), ("tare_reason", "u1"), ("touch_slot", "u1"),
    ("energy_count2", "=u4"), ("noise_count2", "=u4"), ("threshold_count2", "=u4"),
])  # fmt: skip

_ELECTRODES = len(sensor.ELECTRODE_NAMES)
if FINGER_DTYPE.itemsize != lib.BT_REPLAY_BYTES:
    raise ImportError(
        "the compiled core's rows differ in size from this Python code's; reinstall the package: pip install ."
    )


class Finger:
    """One finger of a board: the tare machine and the kernels, in the state after all rounds so far.

    ``settings`` are the board's; omitted ones have the default. ``index`` (0..4) is the finger's number in the rows.
    ``quantities`` is the subscription, by default the board's own; QuantityFlags.EVENTS adds the slip_level of rounds
    that have PAC. ``wrench_map``, a map or a map's blob, replaces the gains. ``serial``, ASCII, is the sensor's serial
    number, b"" where unknown: a BioTac SP (BTSP, BTTB), or a ``foreign`` sensor, is flagged SENSOR_FAULT and has no
    point, force or torque. Raises ValueError for a setting or an index out of range or a longer serial number than a
    sensor has, InputError for a blob that a board would refuse.

    >>> finger = Finger()
    >>> rows = finger.feed(np.full((30, 19), 3000))
    >>> rows["tare_state"][[0, -1]].tolist()
    [0, 1]
    """

    def __init__(
        self,
        settings: Mapping[wire.Setting, int] | None = None,
        *,
        index: int = 0,
        quantities: wire.QuantityFlags | None = None,
        wrench_map: BoardMap | bytes | None = None,
        serial: bytes = b"",
        foreign: bool = False,
    ) -> None:
        if not 0 <= index < sensor.MAX_SENSORS:
            raise ValueError(f"index is {index}, expected 0 to {sensor.MAX_SENSORS - 1}")
        self._by_default = settings is None and wrench_map is None
        self.settings: Settings = {**default_settings(), **(settings or {})}
        self._settings = board_settings(self.settings)
        self._finger = ffi.new("bt_finger *")
        self._index = index
        self._quantities = quantities
        self._map = None if wrench_map is None else opened(wrench_map)
        self._foreign = foreign or is_foreign(serial)
        self.reset()

    def __repr__(self) -> str:
        mapped = ", with a wrench map" if self._map is not None else ""
        return f"<biotac.Finger {self._index}, {self._next_us / 1e6:.2f} s fed{mapped}>"

    def reset(self) -> None:
        """Return to the state after power-up: no tare, and seq 0 comes next."""
        lib.bt_finger_reset(self._finger, self._index)
        self._finger.foreign = self._foreign
        if self._quantities is not None:
            self._finger.quantities = int(self._quantities)
        self._next_us = 0

    def feed(
        self, counts: Any, pdc: Any = None, tac: Any = None, tdc: Any = None, pac: Any = None, *, t_us: Any = None
    ) -> StructArray:
        """Give the finger n rounds of 10 ms and return FINGER_DTYPE (n,), one row per round.

        ``counts`` (n, 19), ``pdc``, ``tac``, ``tdc`` (n,) and ``pac`` (n, 22) are integers 0..4095, or 0xFFFF where no
        valid word came; a channel that is not given is missing throughout. PAC shows only whether words leapt
        (SENSOR_FAULT). ``t_us`` (n,), the rounds' device times in us, wraps at 2^32 like the board's; by default each
        is 10 ms after the one before. A jump of 90 ms or more is a silence, during which drift went on. Raises
        ValueError for other shapes, types and ranges, before any round is processed; also when ``counts`` are a field
        of rows from a board with other settings, and this finger was given none.
        """
        words, times = self._words_of(counts, pdc, tac, tdc, pac, t_us)
        rows = np.empty(len(words), FINGER_DTYPE)
        if len(words):
            own_map = ffi.NULL if self._map is None else self._map.handle
            lib.bt_replay(self._finger, self._settings, own_map, len(words), *c_pointers(words, times, rows))
        return rows

    def events(
        self, counts: Any, pdc: Any = None, tac: Any = None, tdc: Any = None, pac: Any = None, *, t_us: Any = None
    ) -> StructArray:
        """Give the finger n rounds, as ``feed`` does, and return the EVENTs that a board sends for them.

        Returns EVENT_DTYPE (k,). The finger's state advances, but no frames are computed.
        """
        words, times = self._words_of(counts, pdc, tac, tdc, pac, t_us)
        events = np.zeros(_EVENTS_A_ROUND * len(words), EVENT_DTYPE)
        if not len(words):
            return events
        pointers = c_pointers(words, times, events)
        return events[: lib.bt_replay_events(self._finger, self._settings, len(words), *pointers, len(events))]

    def _words_of(
        self, counts: Any, pdc: Any, tac: Any, tdc: Any, pac: Any, t_us: Any
    ) -> tuple[NDArray[np.uint16], NDArray[np.uint32]]:
        if self._by_default:
            refuse_foreign_results(counts)
        electrodes = checked_words("counts", counts, None, _ELECTRODES)
        n = len(electrodes)
        words = np.full((n, slots.SLOTS_PER_FRAME), wire.INVALID_COUNT, np.uint16)
        words[:, slots.ELECTRODE_SLOT] = electrodes
        for (name, slot), channel in zip(slots.SLOW_SLOTS.items(), (pdc, tac, tdc), strict=True):
            if channel is not None:
                words[:, slot] = checked_words(name, channel, n)
        if pac is not None:
            words[:, slots.PAC_SLOT] = checked_words("pac", pac, n, len(slots.PAC_SLOT))
        times = self._next_us + ROUND_US * np.arange(n, dtype=np.int64) if t_us is None else np.asarray(t_us)
        if times.shape != (n,) or times.dtype.kind not in "iu":
            raise ValueError(f"t_us is {times.dtype} of shape {times.shape}, expected integers of shape ({n},)")
        if n:
            self._next_us = int(times[-1]) + ROUND_US
        return words, (times.astype(np.int64) % 2**32).astype(np.uint32)

    def tare_now(self) -> None:
        """Do TARE_NOW: the latest means become the tare. Raises CommandRefusedError while the signals move."""
        _accept("TARE_NOW", lib.bt_tare_now(ffi.addressof(self._finger, "tare")))

    def set_tare(self, counts: Any, pdc: float | None = None, *, age_s: float | None = None) -> None:
        """Do TARE_SET: use ``counts`` (19,), 0..4095 counts, from the next round on; ``pdc`` likewise, None: unknown.

        ``age_s`` is how long ago this was the finger's tare, in s; None: unknown.

        Values are rounded to 1/16 count, as in the message. Raises ValueError for other shapes and ranges,
        CommandRefusedError if more than two electrodes are railed.
        """
        tare = np.asarray(counts, dtype=np.float64)
        values = tare if pdc is None else np.append(tare, pdc)
        if tare.shape != (_ELECTRODES,):
            raise ValueError(f"the tare has shape {tare.shape}, expected ({_ELECTRODES},)")
        q16 = (tare_to_q4(values).astype(np.uint32) << 12).tolist()
        base = ffi.new("bt_baseline *")
        base.electrode_q16 = q16[:_ELECTRODES]
        base.pdc_q16 = INVALID_U32 if pdc is None else q16[_ELECTRODES]
        _accept("TARE_SET", lib.bt_tare_set(ffi.addressof(self._finger, "tare"), base, age_ms(age_s)))

    def hold(self) -> None:
        """Do HOLD: no new tare until release() or lapse()."""
        lib.bt_tare_hold(ffi.addressof(self._finger, "tare"))

    def release(self) -> None:
        """Do RELEASE: nothing is held any more, so that a signal in DOUBT is a press's residue."""
        lib.bt_tare_release(ffi.addressof(self._finger, "tare"))

    def lapse(self) -> None:
        """End a hold as the board does when the host has been silent for hold_timeout_ms."""
        lib.bt_tare_lapse(ffi.addressof(self._finger, "tare"))

    def tare_message(self) -> wire.Tare:
        """The TARE message that a board sends when the latest round changed the tare; ``seq`` counts from reset."""
        tare = self._finger.tare
        return wire.Tare(
            seq=(self._finger.seq - 1) % 2**16,
            t_us=self._finger.round.t_us,
            finger=self._index,
            tare_state=tare.state,
            reason=tare.reason,
            noise_count2=tare.noise.count2,
            tare_q16=tuple(tare.base.electrode_q16),
            pdc_tare_q16=tare.base.pdc_q16,
        )

    def tare_machine(self) -> Any:
        """A copy of the tare machine's state, a ``bt_tare *``: firmware/core/touch/machine.h, of this version."""
        copy = ffi.new("bt_tare *")
        copy[0] = self._finger.tare
        return copy

    @property
    def tare_counts(self) -> NDArray[np.float64]:
        """The tare in force (19,), in counts, to the tare machine's 1/65536 count; NaN where unknown."""
        q16 = np.array(list(self._finger.tare.base.electrode_q16), np.uint32)
        return np.where(q16 == INVALID_U32, np.nan, q16 / 65536.0)


def to_frames(rows: StructArray) -> StructArray:
    """FRAME_DTYPE (n,), in mm, N and N*mm, from FINGER_DTYPE rows; rounds without an answer are omitted.

    ``seq`` and ``t_us`` are as in the rows, not unwrapped.
    """
    present = rows[rows["present"] != 0]
    return frames_from_wire(present, present["seq"], present["t_us"])


def _accept(command: str, error: int) -> None:
    if error != wire.Error.OK:
        raise CommandRefusedError(f"{command} was refused: {wire.Error(error).name} ({wire.ERROR_DOC[error]})")
