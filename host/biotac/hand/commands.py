"""The commands of a board, one method each; what it streams is in stream.py."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from operator import index
from typing import Any, SupportsIndex, TypeAlias, TypeVar

import numpy as np

from ..errors import CommandRefusedError, DeviceLostError, WireVersionError
from ..keep.calibration import Calibration, own_settings
from ..map import board_map as maps
from ..map.board_map import BoardMap
from ..wire import messages_gen as wire
from ..wire.frames import tare_to_q4
from ..wire.sensor_gen import MAX_SENSORS
from . import map_transfer as transfer
from .board import Board
from .faults import Faults, faults_of
from .stream import ALL_FINGERS
from .views import Latest, finger_index

Finger: TypeAlias = str | SupportsIndex
Answer = TypeVar("Answer")


class Commands:
    """Each command raises CommandRefusedError with the board's reason, or DeviceLostError.

    A finger is a name or a chip select; an unknown name raises KeyError. What has failed since the last call (a
    callback, a recording) is raised once the command is done.
    """

    def __init__(self, board: Board, latest: Latest) -> None:
        self._board = board
        self._latest = latest
        self.names = latest.names

    def _ask(self, request: Any, reply: type[Answer]) -> Answer:
        answer = self._board.ask(request, reply)
        self._latest.report()
        return answer

    def _tell(self, request: Any, *, lasting: tuple[str, int] | None = None) -> None:
        self._board.tell(request, lasting=lasting)
        self._latest.report()

    def _index(self, finger: Finger) -> int:
        # Numbers are not checked here: the board knows which ones there are.
        return finger_index(self.names, finger) if isinstance(finger, str) else index(finger)

    def ping(self) -> None:
        """Wait for the board; when this returns, everything it sent before its reply has arrived."""
        self._tell(wire.Ping(0))

    def status(self) -> wire.Status:
        """Counters of the board and its link. The round trip also feeds ``clock``."""
        return self._ask(wire.GetStatus(0), wire.Status)

    def faults(self) -> Faults:
        """What went wrong on the board since ``clear_faults`` or its start, even if only for one round.

        The board keeps faults until they are cleared; reading does not clear them.
        """
        return faults_of(self.status(), self.names)

    def clear_faults(self) -> Faults:
        """Like ``faults``, and clears those on the board. A fault that is new meanwhile stays for the next call."""
        told = self.faults()
        self._tell(wire.ClearFaults(0, int(told.board), told.by_index))
        return told

    def sync(self, round_trips: int = 5) -> None:
        """Feed ``clock`` with round trips: they give it the bound on its error, and later ones the drift."""
        for _ in range(round_trips):
            self.status()

    def sensor_status(self, finger: Finger) -> wire.SensorStatus:
        """Counters and tare state of one sensor."""
        return self._ask(wire.GetSensorStatus(0, self._index(finger)), wire.SensorStatus)

    def sensor_info(self, finger: Finger) -> wire.SensorInfo:
        """What the sensor says about itself."""
        return self._ask(wire.GetSensorInfo(0, self._index(finger)), wire.SensorInfo)

    def point(self, finger: Finger) -> wire.Point:
        """Where ``finger`` is touched right now (``poc_um``), without waiting for the end of a round.

        Noise gives an untouched finger a point too: whether it is touched is in its frames. All INVALID_I16 without a
        tare, or while no electrode has a weight. Raises CommandRefusedError when no sensor answers there.
        """
        return self._ask(wire.GetPoint(0, self._index(finger)), wire.Point)

    def tare(self, finger: Finger) -> None:
        """Tare now. Raises CommandRefusedError while the signals move, KeyError for a finger that is not there."""
        self._tell(wire.TareNow(0, self._latest.present(finger)))

    def set_tare(self, finger: Finger, tare_counts: Any, pdc_counts: float | None = None) -> None:
        """Use a stored tare: ``tare_counts`` (19,) in counts 0..4095, rounded to 1/16 count; ``pdc_counts`` likewise.

        Raises ValueError for another shape or range.
        """
        tare = np.asarray(tare_counts, dtype=np.float64)
        if tare.shape != (19,):
            raise ValueError(f"tare_counts has shape {tare.shape}, expected (19,)")
        tare_q4 = tuple(tare_to_q4(tare).tolist())
        pdc_q4 = wire.INVALID_COUNT if pdc_counts is None else int(tare_to_q4(np.float64(pdc_counts)))
        self._tell(wire.TareSet(0, self._index(finger), tare_q4, pdc_q4))

    def hold(self, *fingers: Finger) -> None:
        """Say that these fingers (names or chip selects; none: all) hold something: no new tare until ``release``.

        A streaming hand keeps the hold alive. It lapses when the board has heard nothing for
        ``hold_timeout_ms`` (2 s by default), and when the board restarts; the ``Gap`` that follows says so, and nothing
        renews it. Raises KeyError
        for a finger that is not there, and then changes nothing.
        """
        mask = self._mask(fingers)
        self._board.tell(wire.Hold(0, mask))
        self._board.reader.gaps.held |= mask & self._board.reader.present
        self._latest.report()

    def release(self, *fingers: Finger) -> None:
        """Say that these fingers hold nothing any more, so that a press's residue is tared. See ``hold``."""
        mask = self._mask(fingers)
        self._board.reader.gaps.held &= ~mask
        self._tell(wire.Release(0, mask))

    @contextmanager
    def grasp(self, *fingers: Finger) -> Iterator[None]:
        """``with hand.grasp("thumb", "index"):`` calls ``hold`` and, however the block ends, ``release``."""
        self._mask(fingers)  # an absent finger is refused before anything is held
        try:
            self.hold(*fingers)
            yield
        finally:
            with suppress(DeviceLostError):  # the board cannot be told; its hold lapses
                self.release(*fingers)

    def _mask(self, fingers: tuple[Finger, ...]) -> int:
        return self._latest.mask([f if isinstance(f, str) else index(f) for f in fingers]) if fingers else ALL_FINGERS

    def setting(self, setting: wire.Setting | int) -> int:
        """The value of a setting, in the unit that wire.SETTINGS names."""
        return self._ask(wire.GetSetting(0, setting), wire.SettingValue).value

    def set_setting(self, setting: wire.Setting | int, value: int) -> None:
        """Change a setting until the next reboot; refused while streaming."""
        self._tell(wire.SetSetting(0, setting, value), lasting=("setting", int(setting)))

    def save_settings(self) -> None:
        """Save the settings, calibrations and maps in force, so that they survive reboots.

        Not while streaming: the board loses slots meanwhile.
        """
        self._tell(wire.SaveSettings(0))

    def reboot_bootloader(self) -> None:
        """Send the board to its bootloader; it disconnects and comes back as a drive."""
        self._tell(wire.RebootBootloader(0, wire.BOOTLOADER_MAGIC))

    def settings(self) -> dict[wire.Setting, int]:
        """All settings. For one that the board's firmware does not have, the default."""
        return {setting: self._known_setting(setting) for setting in wire.Setting}

    def _known_setting(self, setting: wire.Setting) -> int:
        try:
            return self.setting(setting)
        except CommandRefusedError as error:
            if error.error != wire.Error.UNKNOWN_SETTING:
                raise
            return wire.SETTINGS[setting].default

    # ---- calibrations --------------------------------------------------------------------------

    def calibration(self, finger: Finger) -> Calibration | None:
        """The finger's calibration, its own values in place of the settings; None without. See calibration_state."""
        told = self._calibration(finger)
        return None if told.state == wire.CalibrationState.NONE else _known(told)

    def calibration_state(self, finger: Finger) -> wire.CalibrationState:
        """Whether the finger has a calibration, and whether it is in force or belongs to another sensor."""
        return wire.CalibrationState(self._calibration(finger).state)

    def set_calibration(self, finger: Finger, calibration: Calibration) -> None:
        """Give a finger a calibration until the next reboot, or for good with save_settings.

        Refused while streaming, and when its serial number is not that of the sensor that answered there when the
        board started; ``serial=""`` fits any.
        """
        number = self._index(finger)
        request = wire.SetCalibration(
            0, number, calibration.wire_serial(), calibration.made_s, calibration.wire_values()
        )
        self._tell(request, lasting=("calibration", number))

    def clear_calibration(self, finger: Finger) -> None:
        """Return a finger to the board's settings, until the next reboot or, with save_settings, for good."""
        number = self._index(finger)
        self._tell(wire.ClearCalibration(0, number), lasting=("calibration", number))

    def calibrations(self) -> dict[int, Calibration]:
        """The calibrations in force, by finger."""
        answers = [self._calibration(finger) for finger in range(MAX_SENSORS)]
        return {m.finger: _known(m) for m in answers if m.state == wire.CalibrationState.IN_FORCE}

    def finger_settings(self) -> dict[int, dict[wire.Setting, int]]:
        """All settings that a finger's results are computed with, for the fingers with a calibration in force."""
        return own_settings(self.settings(), self.calibrations())

    # ---- wrench maps ---------------------------------------------------------------------------

    def get_map(self, finger: Finger) -> bytes | None:
        """The finger's wrench map as the board stores it, None without; see map_state.

        Raises PortError when it does not arrive intact.
        """
        return transfer.read(self._board, self._index(finger))

    def map_state(self, finger: Finger) -> wire.CalibrationState:
        """Whether the finger has a map, and whether it is in force or belongs to another sensor."""
        return wire.CalibrationState(transfer.info(self._board, self._index(finger)).state)

    def set_map(self, finger: Finger, new: bytes | BoardMap, *, force: bool = False) -> None:
        """Upload a wrench map and read it back; it is in force until the next reboot, or for good with save_settings.

        Refused while streaming, and when its serial number is not that of the sensor that answered there when the
        board started. With ``force`` it is sent without its serial number, so that it fits any sensor, and reads back
        like that. The former map stays in force until the new one is complete. Raises InputError for more bytes than a
        board takes (20 KiB), and PortError when other bytes read back.
        """
        blob = maps.for_any_sensor(maps.as_blob(new)) if force else maps.as_blob(new)
        number = self._index(finger)
        transfer.write(self._board, number, blob)
        self._board.remember(("map", number), lambda: transfer.restore(self._board, number, blob))

    def clear_map(self, finger: Finger) -> None:
        """Remove a finger's wrench map, until the next reboot or, with save_settings, for good.

        Its force then comes from the setting force_model and the gains again.
        """
        number = self._index(finger)
        self._tell(wire.ClearMap(0, number), lasting=("map", number))

    def maps(self) -> dict[int, bytes]:
        """The maps in force, by finger."""
        infos = [transfer.info(self._board, finger) for finger in range(MAX_SENSORS)]
        held = {m.finger: self.get_map(m.finger) for m in infos if m.state == wire.CalibrationState.IN_FORCE}
        return {finger: blob for finger, blob in held.items() if blob is not None}

    def _calibration(self, finger: Finger) -> wire.Calibration:
        return self._ask(wire.GetCalibration(0, self._index(finger)), wire.Calibration)


def _known(told: wire.Calibration) -> Calibration:
    try:
        return Calibration.from_wire(told.serial, told.made_s, told.value)
    except ValueError as error:
        raise WireVersionError(
            f"this library does not know the board's calibration of finger {told.finger} ({error}); install the "
            "biotac-gateway of the firmware's release"
        ) from error
