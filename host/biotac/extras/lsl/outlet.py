"""Fingers as Lab Streaming Layer streams, alongside EEG and motion capture. Needs the extra ``lsl``.

>>> import biotac
>>> from biotac.extras.lsl import Outlet
>>> with biotac.open("sim:press.toml?seconds=1") as hand:
...     with Outlet(hand) as outlet:
...         for batch in hand.batches():
...             outlet.push(batch)
...         print(outlet.pushed)
100
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...clock import electrode_t_us, pac_t_us
from ...clock.stamps import Stamps
from ...errors import InputError, installing
from ...export.columns import COLUMNS, PAC_COLUMNS
from ...hand.hand import Hand
from ...hand.silence import Silence
from ...wire import messages_gen as wire
from ...wire import sensor_gen as sensor
from ...wire.batches import Batch
from ...wire.counters import nearest
from ...wire.events import kind_name
from ...wire.fields import Field
from ...wire.frames import StructArray
from ...wire.identity import serial_text
from ...wire.sensor_gen import SLOTS

TYPE = "Tactile"
EVENTS = " events"
_GRIP = ("normal_n", "normal_half_n", "shear_n", "shear_half_n")
_SENT = ("force_n", "torque_nmm", "poc_mm", *_GRIP, "flags", "trust", "counts", "pdc", "tac", "tdc")
_FRAME_COLUMNS = tuple(column for name in _SENT for column in COLUMNS if column.name == name)
_PAC_COLUMN = PAC_COLUMNS[-1]
_PAC_PER_ROUND = len(_PAC_COLUMN.parts)


class Outlet:
    """Three streams for each finger of ``hand``, also one that is plugged in later; push every batch.

    Use it as a context manager. Names begin with ``name``, by default "BioTac" and the board's serial, so that two
    hands are told apart. ``BioTac SERIAL finger0``: one sample per round, 100 per second, of 37 channels: force (N),
    torque (N*mm), point of contact (mm), normal and shear with half their intervals (N), flags, trust, and counts of
    E1..E19, PDC, TAC and TDC; NaN or 65535 where invalid, as in exports, and once when the finger has had no frame
    for 0.1 s (with ``hand.batches(every_s=0.05)`` also when no finger has). ``BioTac SERIAL finger0 PAC``: counts,
    2200 per second. ``BioTac SERIAL finger0 events``: for each EVENT a marker, the name of the EventKind; this needs a
    subscription to events. The first two streams are double64; their descriptions hold
    labels, units and meanings.

    Stamps are device times converted to ``local_clock()`` by ``hand.clock``: the start of the round for a frame, each
    sample's own time for PAC. If the clock cannot convert (a simulated board has no real clock), a batch is stamped
    with the time of arrival, and ``by_arrival`` counts the samples. ``push`` asks for device time twice a second.

    Raises InputError when pylsl or its liblsl is missing.
    """

    def __init__(self, hand: Hand, name: str | None = None) -> None:
        self._lsl = _pylsl()
        self._hand = hand
        self._board = serial_text(hand.info)
        if hand.port.startswith(("sim:", "emu:")):  # all have one serial
            self._board += f"-{hand.info.boot_id:08x}"
        self.name = f"BioTac {self._board}" if name is None else name  #: begins the streams' names
        self.pushed = 0  #: frames so far
        self._stamps = Stamps(hand, self._lsl.local_clock)
        self.infos: list[Any] = []  #: pylsl.StreamInfo of each stream
        self._outlets: dict[tuple[int, str], Any] = {}
        # 0, no bus, is LSL's IRREGULAR_RATE.
        self._rounds_hz = hand.info.slot_hz / len(SLOTS)
        self._silence = Silence()
        self._add_fingers(hand.fingers)

    def push(self, batch: Batch) -> None:
        """Send the rows of ``batch``. Raises DeviceLostError when the board no longer answers."""
        self._stamps.keep()
        fingers = np.union1d(batch.wire["finger"], batch.pac["finger"]).tolist()
        self._add_fingers([finger for finger in fingers if (finger, "") not in self._outlets])
        for finger in fingers:
            frames = batch.frames[batch.frames["finger"] == finger]
            if len(frames):
                self._push(finger, "", samples(frames), frames["t_us"].astype(np.float64))
                self.pushed += len(frames)
            pac = batch.pac[batch.pac["finger"] == finger]
            if len(pac):
                self._push(finger, " PAC", pac["pac"].reshape(-1, 1), pac_t_us(pac["t_us"]).ravel())
        silent = self._silence.rows(batch)
        for finger in silent["finger"].tolist():
            row = silent[silent["finger"] == finger]
            self._push(finger, "", samples(row), row["t_us"].astype(np.float64))
        for event in batch.messages:
            if isinstance(event, wire.Event) and (event.finger, EVENTS) in self._outlets:
                t_us = np.array([nearest(event.t_us, batch.last_t_us() or event.t_us)], np.float64)
                (stamp_s,) = self._stamps.of(t_us, (event.finger, EVENTS)).tolist()
                self._outlets[event.finger, EVENTS].push_sample([kind_name(event)], stamp_s)

    def close(self) -> None:
        """Take the streams off the network. Safe to call twice."""
        self._outlets.clear()
        self.infos.clear()

    def __enter__(self) -> Outlet:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _add_fingers(self, fingers: list[int]) -> None:
        for finger in fingers:
            frame = [(name, column) for column in _FRAME_COLUMNS for name in column.flat_names()]
            self._add(finger, "", self._rounds_hz, frame)
            self._add(finger, " PAC", self._rounds_hz * _PAC_PER_ROUND, [("PAC", _PAC_COLUMN)])
        for finger in fingers:
            self._add(finger, EVENTS, self._lsl.IRREGULAR_RATE, [])

    def _add(self, finger: int, suffix: str, rate_hz: float, labels: list[tuple[str, Field]]) -> None:
        lsl, is_marker = self._lsl, not labels
        kind, format = ("Markers", lsl.cf_string) if is_marker else (TYPE, lsl.cf_double64)
        source = f"biotac-{self._board}-{finger}{suffix.replace(' ', '-')}"
        info = lsl.StreamInfo(f"{self.name} finger{finger}{suffix}", kind, len(labels) or 1, rate_hz, format, source)
        about = info.desc()
        for name, value in describe(self._hand, finger).items():
            about.append_child_value(name, value)
        listed = about.append_child("channels")
        for label, column in labels:
            channel = listed.append_child("channel")
            for name, value in (("label", label), ("unit", column.unit), ("type", TYPE), ("meaning", column.what)):
                channel.append_child_value(name, value)
        self.infos.append(info)
        self._outlets[finger, suffix] = lsl.StreamOutlet(info)

    def _push(self, finger: int, suffix: str, values: NDArray[Any], t_us: NDArray[np.float64]) -> None:
        stamps_s = self._stamps.of(t_us, (finger, suffix))
        self._outlets[finger, suffix].push_chunk(values.astype(np.float64), stamps_s.tolist())

    @property
    def by_arrival(self) -> int:
        """Number of samples so far that were stamped with their arrival."""
        return self._stamps.by_arrival


def samples(frames: StructArray) -> NDArray[np.float64]:
    """FRAME_DTYPE (n,) as samples of a frame stream, float64 (n, 37)."""
    return np.column_stack([frames[name].astype(np.float64) for name in _SENT])


def describe(hand: Hand, finger: int) -> dict[str, str]:
    """Description entries that apply to all channels of a finger's streams."""
    late_ms = float(electrode_t_us(0.0).mean()) / 1000
    return {
        "manufacturer": "SynTouch",
        "finger": str(finger),
        "board_serial": serial_text(hand.info),
        "port": hand.port,
        "axes": "x to the tip, y to E11's side, z dorsal; origin at the centre of the tip sphere",
        "stamp": f"start of the round; its electrodes were sampled {late_ms:.2f} ms later on average",
        "core_radius_m": f"{sensor.CORE_RADIUS_UM / 1e6:g}",
    }


def _pylsl() -> Any:
    try:
        import pylsl
    except ImportError as error:
        raise InputError(f"LSL needs pylsl, which is not installed; {installing('lsl')}") from error
    except RuntimeError as error:  # the wheel of some systems, and every pylsl before 1.18, lacks liblsl
        cure = "pip install --upgrade pylsl, or liblsl from conda-forge or github.com/sccn/liblsl, named by PYLSL_LIB"
        raise InputError(f"pylsl is installed, and finds no liblsl; {cure}") from error
    return pylsl
