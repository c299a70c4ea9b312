"""What a calibration is: values for the per-finger settings, made for one sensor."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..wire import messages_gen as wire
from ..wire.identity import ascii_text

SERIAL_BYTES = 16
_DEFAULT = {setting: spec.default for setting, spec in wire.SETTINGS.items()}


@dataclass(frozen=True)
class Calibration:
    """Values of one finger's own in place of the board's settings, for one sensor.

    ``force_gain_nn`` is x, y, z and ``torque_gain_nn`` y, z, in nN per count; ``pressure_gain_nn`` in nN per count of
    pressure, 0 for a finger that is not calibrated by pressure. ``serial`` is the number of the
    sensor it was made for, "" for any sensor; ``made_s`` when, in seconds since 1970 UTC, 0 when unknown. Raises
    ValueError for a value out of its setting's range (wire.SETTINGS).
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
        plain = isinstance(self.serial, str) and self.serial.isascii() and (self.serial.isprintable())
        if not plain or len(self.serial) > SERIAL_BYTES:
            raise ValueError(f"serial is {self.serial!r}, expected up to {SERIAL_BYTES} ASCII characters")

    def settings(self) -> dict[wire.Setting, int]:
        """The per-finger settings with these values."""
        x, y, z = self.force_gain_nn
        torque_y, torque_z = self.torque_gain_nn
        return {
            wire.Setting.POC_WEIGHTS: self.poc_weights,
            wire.Setting.FORCE_GAIN_X_NN: x,
            wire.Setting.FORCE_GAIN_Y_NN: y,
            wire.Setting.FORCE_GAIN_Z_NN: z,
            wire.Setting.TORQUE_GAIN_Y_NN: torque_y,
            wire.Setting.TORQUE_GAIN_Z_NN: torque_z,
            wire.Setting.THERMAL_GAIN_MILLI: self.thermal_gain_milli,
            wire.Setting.PRESSURE_GAIN_NN: self.pressure_gain_nn,
        }

    def wire_values(self) -> tuple[int, ...]:
        """The values in the order of the messages and records."""
        own = self.settings()
        return tuple(own[setting] for setting in wire.CALIBRATION_SETTINGS)

    def wire_serial(self) -> tuple[int, ...]:
        """The serial number as the messages and records hold it."""
        return tuple(self.serial.encode("ascii").ljust(SERIAL_BYTES, b"\0"))

    def changed(self, changes: Mapping[wire.Setting, int]) -> Calibration:
        """The same with other values for some settings; those that are not a finger's own are left out."""
        own = {**self.settings(), **changes}
        return self.from_wire(self.wire_serial(), self.made_s, [own[s] for s in wire.CALIBRATION_SETTINGS])

    @classmethod
    def from_wire(cls, serial: Sequence[int], made_s: int, value: Sequence[int]) -> Calibration:
        """Of what a message or a record holds; ValueError for what none may."""
        own = dict(zip(wire.CALIBRATION_SETTINGS, value, strict=True))
        return cls(
            own[wire.Setting.POC_WEIGHTS],
            (
                own[wire.Setting.FORCE_GAIN_X_NN],
                own[wire.Setting.FORCE_GAIN_Y_NN],
                own[wire.Setting.FORCE_GAIN_Z_NN],
            ),
            (own[wire.Setting.TORQUE_GAIN_Y_NN], own[wire.Setting.TORQUE_GAIN_Z_NN]),
            own[wire.Setting.THERMAL_GAIN_MILLI],
            ascii_text(serial),
            made_s,
            own[wire.Setting.PRESSURE_GAIN_NN],
        )


def own_settings(
    settings: Mapping[wire.Setting, int], calibrations: Mapping[int, Calibration]
) -> dict[int, dict[wire.Setting, int]]:
    """Finger to the settings that its results come from, for those with a calibration in force."""
    return {finger: {**settings, **its.settings()} for finger, its in calibrations.items()}


def _whole(name: str, value: object) -> int:
    if isinstance(value, bool):
        raise ValueError(f"{name} is {value}, expected a whole number")
    try:
        return operator.index(value)  # type: ignore[arg-type]
    except TypeError as error:
        raise ValueError(f"{name} is {value!r}, expected a whole number") from error
