"""Calibration: values of the per-finger settings, made for one sensor."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..wire import messages_gen as wire
from ..wire.identity import SENSOR_SERIAL_BYTES, ascii_text

_DEFAULT = {setting: spec.default for setting, spec in wire.SETTINGS.items()}


@dataclass(frozen=True)
class Calibration:
    """One finger's own values, made for one sensor; they replace the board's settings for that finger.

    ``force_gain_nn`` is x, y, z and ``torque_gain_nn`` is y, z, in nN per count. ``pressure_gain_nn`` is in nN per
    count of pressure, 0 for a finger that is not calibrated by pressure. ``serial`` is the serial number of the sensor
    it was made for, "" for any sensor. ``made_s`` is when it was made, in seconds since 1970 UTC, 0 when unknown.
    Raises ValueError for a value of the wrong type or out of range (for settings: wire.SETTINGS).
    """

    poc_weights: int = _DEFAULT[wire.Setting.POC_WEIGHTS]
    force_gain_nn: tuple[int, int, int] = (
        _DEFAULT[wire.Setting.FORCE_GAIN_X_NN],
        _DEFAULT[wire.Setting.FORCE_GAIN_Y_NN],
        _DEFAULT[wire.Setting.FORCE_GAIN_Z_NN],
    )
    torque_gain_nn: tuple[int, int] = (
        _DEFAULT[wire.Setting.TORQUE_GAIN_Y_NN],
        _DEFAULT[wire.Setting.TORQUE_GAIN_Z_NN],
    )
    thermal_gain_milli: int = _DEFAULT[wire.Setting.THERMAL_GAIN_MILLI]
    serial: str = ""
    made_s: int = 0
    pressure_gain_nn: int = _DEFAULT[wire.Setting.PRESSURE_GAIN_NN]

    def __post_init__(self) -> None:
        for name, count in (("force_gain_nn", 3), ("torque_gain_nn", 2)):
            gains = tuple(_whole(name, value) for value in getattr(self, name))
            if len(gains) != count:
                raise ValueError(f"{name} has {len(gains)} values, expected {count}")
            object.__setattr__(self, name, gains)
        for name in ("poc_weights", "thermal_gain_milli", "pressure_gain_nn", "made_s"):
            object.__setattr__(self, name, _whole(name, getattr(self, name)))
        for setting, value in self.settings().items():
            spec = wire.SETTINGS[setting]
            if not spec.low <= value <= spec.high:
                raise ValueError(f"{setting.name.lower()} is {value}, expected {spec.low} to {spec.high} {spec.unit}")
        if not 0 <= self.made_s < 2**32:
            raise ValueError(f"made_s is {self.made_s}, expected seconds since 1970, or 0 when unknown")
        plain = isinstance(self.serial, str) and self.serial.isascii() and self.serial.isprintable()
        if not plain or len(self.serial) > SENSOR_SERIAL_BYTES:
            raise ValueError(f"serial is {self.serial!r}, expected up to {SENSOR_SERIAL_BYTES} ASCII characters")

    def settings(self) -> dict[wire.Setting, int]:
        """The per-finger settings with these values."""
        return dict(zip(wire.CALIBRATION_SETTINGS, self.wire_values(), strict=True))

    def wire_values(self) -> tuple[int, ...]:
        """The values in the order of messages and records, wire.CALIBRATION_SETTINGS."""
        gains = (*self.force_gain_nn, *self.torque_gain_nn)
        return (self.poc_weights, *gains, self.thermal_gain_milli, self.pressure_gain_nn)

    def wire_serial(self) -> tuple[int, ...]:
        """The serial number as messages and records hold it: 16 bytes, padded with zeros."""
        return tuple(self.serial.encode("ascii").ljust(SENSOR_SERIAL_BYTES, b"\0"))

    def changed(self, changes: Mapping[wire.Setting, int]) -> Calibration:
        """A copy with other values for some settings; ``changes`` to settings that are not per-finger are ignored."""
        own = {**self.settings(), **changes}
        return self.from_wire(self.wire_serial(), self.made_s, [own[s] for s in wire.CALIBRATION_SETTINGS])

    @classmethod
    def from_wire(cls, serial: Sequence[int], made_s: int, value: Sequence[int]) -> Calibration:
        """The calibration in a message or a record. Raises ValueError for values out of range."""
        weights, x, y, z, torque_y, torque_z, thermal, pressure = value
        return cls(weights, (x, y, z), (torque_y, torque_z), thermal, ascii_text(serial), made_s, pressure)


def own_settings(
    settings: Mapping[wire.Setting, int], calibrations: Mapping[int, Calibration]
) -> dict[int, dict[wire.Setting, int]]:
    """The settings that each finger's results are computed with, for the fingers in ``calibrations``."""
    return {finger: {**settings, **calibration.settings()} for finger, calibration in calibrations.items()}


def _whole(name: str, value: object) -> int:
    if isinstance(value, bool):
        raise ValueError(f"{name} is {value}, expected a whole number")
    try:
        return operator.index(value)  # type: ignore[arg-type]
    except TypeError as error:
        raise ValueError(f"{name} is {value!r}, expected a whole number") from error
