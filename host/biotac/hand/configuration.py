"""``hand.board``: the board's settings, calibrations, wrench maps and faults."""

from __future__ import annotations

import time

from ..board.board import Board
from ..errors import CommandRefusedError, DeviceLostError, WireVersionError
from ..keep.calibration import Calibration, own_settings
from ..map import board_map as maps
from ..map.board_map import BoardMap
from ..wire import messages_gen as wire
from ..wire.sensor_gen import MAX_SENSORS
from . import map_transfer as transfer
from .commands import Finger, Requests
from .faults import Faults, faults_of

RESTART_S = 10.0  # with a patient link, longer by the same factor


class Configuration:
    """Settings, calibrations, maps and faults of a board; each method is a command, and raises as Hand's do."""

    def __init__(self, board: Board, requests: Requests) -> None:
        self._board = board
        self._requests = requests
        #: For programs that build on a hand: any command of MESSAGES.md. ``ask(request, reply)`` returns the reply of
        #: that kind, ``command(request)`` waits for a confirmation, ``send(request)`` for nothing. They raise as Hand's
        #: commands do, except errors of callbacks and recordings.
        self.ask, self.command, self.send = board.ask, board.command, board.send

    def faults(self) -> Faults:
        """The faults since ``clear_faults`` or the board's start, even of a single round.

        The board keeps faults until they are cleared; reading does not clear them.
        """
        return faults_of(self._requests.ask(wire.GetStatus(0), wire.Status), self._requests.names)

    def clear_faults(self) -> Faults:
        """Like ``faults``, and clears those on the board. A fault that is new meanwhile stays for the next call."""
        latched = self.faults()
        self._requests.command(wire.ClearFaults(0, int(latched.board), latched.by_index))
        return latched

    def setting(self, setting: wire.Setting | int) -> int:
        """The value of a setting, in the unit that wire.SETTINGS names."""
        return self._requests.ask(wire.GetSetting(0, setting), wire.SettingValue).value

    def set_setting(self, setting: wire.Setting | int, value: int) -> None:
        """Change a setting until the next reboot; refused while streaming."""
        self._requests.command(wire.SetSetting(0, setting, value), lasting=("setting", int(setting)))

    def save_settings(self) -> None:
        """Save the settings, calibrations and maps in force, so that they survive reboots.

        Not while streaming: the board loses slots meanwhile.
        """
        self._requests.command(wire.SaveSettings(0))

    def reboot_bootloader(self) -> None:
        """Send the board to its bootloader; it disconnects and comes back as a drive."""
        self._requests.command(wire.RebootBootloader(0, wire.BOOTLOADER_MAGIC))

    def restart(self) -> None:
        """Restart the board as a reset would, and wait until it is back. Unsaved changes are lost.

        Raises DeviceLostError unless this hand reconnects, or if the board does not come back within ten seconds.
        """
        connection, before = self._board.connection, self._board.info.boot_id
        self._requests.command(wire.RebootBootloader(0, wire.RESTART_MAGIC))
        lost = DeviceLostError(f"{self._board.link.port} restarts, and has not come back; open it again")
        until_s = time.monotonic() + RESTART_S * self._board.link.patience
        while self._board.info.boot_id == before:  # it may answer once more before it goes
            connection.lose(lost, "rebooted")
            left_s = until_s - time.monotonic()
            if not connection.wait_for(lambda: connection.lost is None or connection.failure, left_s):
                raise lost
            connection.check()

    def measure(self) -> wire.BoardFacts:
        """The board's own measurements: supply, temperature, clock against USB. Unknown where it has none."""
        return self._requests.ask(wire.GetBoardFacts(0), wire.BoardFacts)

    def try_bus_rate(self, khz: int) -> wire.BoardFacts:
        """Clock the sensors' bus at up to this rate until the next stream; 0 is the usual one.

        Values read meanwhile mean nothing; count the sensors' bad words. Refused while streaming.
        """
        return self._requests.ask(wire.SetBusRate(0, khz), wire.BoardFacts)

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
        """The finger's calibration, in place of the settings; None without. See calibration_state."""
        answer = self._calibration(finger)
        return None if answer.state == wire.CalibrationState.NONE else _known(answer)

    def calibration_state(self, finger: Finger) -> wire.CalibrationState:
        """Whether the finger has a calibration, and whether it is in force or belongs to another sensor."""
        return wire.CalibrationState(self._calibration(finger).state)

    def set_calibration(self, finger: Finger, calibration: Calibration) -> None:
        """Give a finger a calibration until the next reboot, or for good with save_settings.

        Refused while streaming, and when the calibration's serial number is not that of the sensor that answered at the
        board started; ``serial=""`` fits any.
        """
        number = self._requests.index(finger)
        request = wire.SetCalibration(
            0, number, calibration.wire_serial(), calibration.made_s, calibration.wire_values()
        )
        self._requests.command(request, lasting=("calibration", number))

    def clear_calibration(self, finger: Finger) -> None:
        """Return a finger to the board's settings, until the next reboot or, with save_settings, for good."""
        number = self._requests.index(finger)
        self._requests.command(wire.ClearCalibration(0, number), lasting=("calibration", number))

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
        return transfer.read(self._board, self._requests.index(finger))

    def map_state(self, finger: Finger) -> wire.CalibrationState:
        """Whether the finger has a map, and whether it is in force or belongs to another sensor."""
        return wire.CalibrationState(transfer.info(self._board, self._requests.index(finger)).state)

    def set_map(self, finger: Finger, new: bytes | BoardMap, *, force: bool = False) -> None:
        """Upload a wrench map and read it back; it is in force until the next reboot, or for good with save_settings.

        Refused while streaming, and when the map's serial number is not that of the sensor that answered at the board's
        start. With ``force`` it is sent without a serial number, so that it fits any sensor, and reads back like that.
        The former map stays in force until the new one is complete. Raises InputError above 20 KiB, the most that a
        board stores, and PortError when other bytes read back.
        """
        blob = maps.for_any_sensor(maps.as_blob(new)) if force else maps.as_blob(new)
        number = self._requests.index(finger)
        board = self._board
        with board.turn():  # as Board.command
            transfer.write(board, number, blob)
            board.connection.lasting.remember(("map", number), lambda: transfer.restore(board, number, blob))

    def clear_map(self, finger: Finger) -> None:
        """Remove a finger's wrench map, until the next reboot or, with save_settings, for good.

        Force then comes from the setting force_model and the gains again.
        """
        number = self._requests.index(finger)
        self._requests.command(wire.ClearMap(0, number), lasting=("map", number))

    def maps(self) -> dict[int, bytes]:
        """The maps in force, by finger."""
        infos = [transfer.info(self._board, finger) for finger in range(MAX_SENSORS)]
        held = {m.finger: self.get_map(m.finger) for m in infos if m.state == wire.CalibrationState.IN_FORCE}
        return {finger: blob for finger, blob in held.items() if blob is not None}

    def _calibration(self, finger: Finger) -> wire.CalibrationMessage:
        return self._requests.ask(wire.GetCalibration(0, self._requests.index(finger)), wire.CalibrationMessage)


def _known(answer: wire.CalibrationMessage) -> Calibration:
    try:
        return Calibration.from_wire(answer.serial, answer.made_s, answer.value)
    except ValueError as error:
        raise WireVersionError(
            f"this library does not know the board's calibration of finger {answer.finger} ({error}); install the "
            "biotac-gateway of the firmware's release"
        ) from error
