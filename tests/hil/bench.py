"""Two real boards on one bench: a gateway, and a sensor board that plays to it; results begin with the tape.

A gateway's time cannot be held, as a simulated board's is; the tape is held. Sensors send serials but no samples
until somebody streams, and all their fingers then begin in one round, at the source's first row.
"""

import itertools
import threading
import time
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

import biotac
from biotac.doctor.facts import grown
from biotac.errors import BiotacError
from biotac.hand.opening import shake_hands
from biotac.kernels.compiled import default_settings
from biotac.link import open_link
from biotac.link.serial_port import SerialLink
from biotac.sim.fault_gen import EmuFault
from biotac.sim.source import Source
from biotac.wire import messages_gen as wire
from biotac.wire.batches import Batch
from biotac.wire.sensor_gen import MAX_SENSORS, SLOTS
from biotac_rig.sensor_board import SensorBoard

# Before the source: samples, so that the gateway has done with whatever was before; then all sensors are taken out, and
# others come, of whom it knows nothing yet.
SETTLED_ROUNDS, OTHERS_ROUNDS = 30, 2
MID_COUNT = 2048
STARVED_ROUNDS = 30  # until the gateway has asked all of them for their serials
LAST_ROUNDS = 3  # starved, behind the tape: all samples have been sent
LOOK_S = 0.05
COUNTERS = {
    wire.Status: (
        "messages_dropped", "slots_late", "frames_idle", "poc_skipped", "force_skipped", "torque_skipped",
        "wrench_repeated", "frames_shed",
    ),
    wire.SensorStatus: ("words_good", "words_stuck", "words_error", "words_parity"),
}  # fmt: skip

_played = itertools.count(1)


def staged(source: Source) -> Source:
    """For all five sensors, with the words before the tape; no sensor has been there under this name before."""
    frames, fingers, slots = source.samples.shape
    before = SETTLED_ROUNDS + OTHERS_ROUNDS
    samples = np.full((before + frames, MAX_SENSORS, slots), MID_COUNT, np.uint16)
    samples[SETTLED_ROUNDS : before - 1] = EmuFault.SWAPPED
    samples[before:, :fingers] = source.samples
    samples[before:, fingers:] = EmuFault.UNPLUGGED
    run = int(time.time()) % 100_000
    serials = tuple(f"BT{run:05d}{next(_played):07d}{finger}X" for finger in range(MAX_SENSORS))
    return replace(source, samples=samples, serials=serials)


class BenchLink(SerialLink):
    """The gateway's link, which has the sensor board play ``source`` once it is released."""

    def __init__(self, port: str, sensor_port: str, source: Source) -> None:
        self._sensors = SensorBoard(open_link(sensor_port))
        self._over = threading.Event()
        self._playing: threading.Thread | None = None
        try:
            self._stage(staged(source))
            super().__init__(port)
        except BaseException:
            self._sensors.close()
            raise
        self.source = source

    def _stage(self, source: Source) -> None:
        """Wait until the gateway knows all the sensors, and waits for the source."""
        self._sensors.plug(source)
        self._sensors.play(hold_slot=(SETTLED_ROUNDS + OTHERS_ROUNDS) * len(SLOTS))
        self._sensors.feed(until_full=True)
        self._wait_starved(STARVED_ROUNDS)

    def _wait_starved(self, rounds: int) -> None:
        """Until the bus has come to the end of the tape, or to a hold, and asked for so much in vain."""
        starved = None
        while not self._over.is_set():
            status = self._sensors.status()
            if starved is None and status.slots_served < min(status.slots_taken, self._sensors.held_at):
                pass
            elif starved is None:
                starved = status.samples_starved
            elif status.samples_starved - starved >= rounds * len(SLOTS) * MAX_SENSORS:
                return
            self._over.wait(LOOK_S)

    def release(self) -> None:
        """Let the tape run, if it is held."""
        if self._playing is None:
            self._sensors.play()
            self._playing = threading.Thread(target=self._play, name="bench sensors", daemon=True)
            self._playing.start()

    def _play(self) -> None:
        with suppress(BiotacError):  # it went away, and the gateway's frames tell the tests
            self._sensors.feed(ended=self._over)
            self._wait_starved(LAST_ROUNDS)
            self.ended = True

    def close(self) -> None:
        """See Link.close."""
        super().close()
        self._over.set()
        if self._playing is not None:
            self._playing.join()
        self._sensors.close()


class BenchHand:
    """A Hand with time, sequence numbers and counters that begin with the tape, as those of a board just started do."""

    def __init__(self, hand: biotac.Hand, fingers: int) -> None:
        self._hand = hand
        self._fingers = fingers
        self._t_us: int | None = None
        self._seq: dict[int, int] = {}
        self._before = hand.status()
        self._sensors_before = [hand.sensor_status(finger) for finger in range(MAX_SENSORS)]

    def __getattr__(self, name: str) -> Any:
        return getattr(self._hand, name)

    def __getitem__(self, finger: str) -> Any:
        return self._hand[finger]

    @property
    def fingers(self) -> list[int]:
        """The sensors of the source: until it is played they give no samples."""
        return list(range(self._fingers))

    def status(self) -> wire.Status:
        """See Hand.status."""
        return since(self._hand.status(), self._before)

    def sensor_status(self, finger: int) -> wire.SensorStatus:
        """See Hand.sensor_status."""
        return since(self._hand.sensor_status(finger), self._sensors_before[finger])

    def read(self, seconds: float) -> np.ndarray:
        """See Hand.read."""
        return self.read_batch(seconds).frames

    def read_batch(self, seconds: float) -> Batch:
        """See Hand.read_batch."""
        batch = self._hand.read_batch(seconds)
        rows = batch.wire.copy()
        if self._t_us is None and len(rows):
            self._t_us = int(batch.t_us.min())
        for finger in np.unique(rows["finger"]):
            self._seq.setdefault(int(finger), int(batch.seq[rows["finger"] == finger][0]))
        seq = batch.seq - self._seqs(rows["finger"])
        t_us = batch.t_us - (self._t_us or 0)
        rows["seq"], rows["t_us"] = seq & 0xFFFF, t_us & 0xFFFFFFFF
        return Batch(
            rows, seq, t_us, self._shifted(batch.pac), self._shifted(batch.idle), [*map(self._message, batch.messages)]
        )

    def point(self, finger: int) -> wire.Point:
        """See Hand.point."""
        return self._message(self._hand.point(finger))

    def _seqs(self, fingers: np.ndarray) -> np.ndarray:
        return np.array([self._seq.get(int(finger), 0) for finger in fingers], np.int64)

    def _shifted(self, rows: np.ndarray) -> np.ndarray:
        out = rows.copy()
        out["seq"] -= self._seqs(rows["finger"]).astype(out["seq"].dtype)
        out["t_us"] -= np.array(self._t_us or 0).astype(out["t_us"].dtype)
        return out

    def _message(self, message: Any) -> Any:
        if not isinstance(message, (wire.Tare, wire.Touch, wire.Event, wire.Point)):
            return message
        return replace(message, seq=(message.seq - self._seq.get(message.finger, 0)) & 0xFFFF)


def since(now: Any, before: Any) -> Any:
    """With the counters less the earlier ones."""
    names = COUNTERS[type(now)]
    return replace(now, **{name: grown(before, now, name) for name in names})


def open_bench(port: str, sensor_port: str, source: Source) -> BenchHand:
    """Stage the source, and give the gateway the state of a new one."""
    hand = shake_hands(BenchLink(port, sensor_port, replace(source, tare_q4=None)))
    try:
        as_new(hand)
        if source.tare_q4 is not None:
            for finger, tare_q4 in enumerate(source.tare_q4):
                hand.set_tare(finger, tare_q4 / 16.0)
        return BenchHand(hand, source.samples.shape[1])
    except BaseException:
        hand.close()
        raise


def as_new(hand: biotac.Hand) -> None:
    """No settings, calibrations, maps or subscriptions that a test before has left; saved ones stay."""
    hand.stop()
    now = hand.board.settings()
    for setting, value in default_settings().items():
        if now[setting] != value:
            hand.board.set_setting(setting, value)
    for finger in range(MAX_SENSORS):
        if hand.board.calibration_state(finger) != biotac.CalibrationState.NONE:
            hand.board.clear_calibration(finger)
        if hand.board.map_state(finger) != biotac.CalibrationState.NONE:
            hand.board.clear_map(finger)
    hand.board.clear_faults()


class BenchPty:
    """The gateway's port for any program to open, with sensors that play from release() on."""

    def __init__(self, port: str, sensor_port: str, source: Source) -> None:
        self.path = port
        self._sensors = BenchLink(port, sensor_port, source)

    def release(self) -> None:
        """Let the tape run."""
        self._sensors.release()
        SerialLink.close(self._sensors)  # the port is for others

    def close(self) -> None:
        """The sensors play on until here."""
        self._sensors.close()
