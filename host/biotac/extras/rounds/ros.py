"""Messages of ROS drivers, of any variant: decoded by the definition that comes with them, and read by field names."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from ...errors import error_text
from ...wire import sensor_gen as sensor
from ...wire import slots
from ...wire.identity import SENSOR_SERIAL_BYTES
from .message import SLOT_US, Found, Message, RefusedError

#: By the type's last word: Shadow's sr_robot_msgs/BiotacAll, and biotac_sensors/BioTacHand of Penn and KTH.
TYPES = ("BiotacAll", "BioTacHand")
MAX_BYTES = 1 << 20
Decode = Callable[[bytes, int], Message]


def is_known(kind: str) -> bool:
    """Whether a type's name is one of TYPES, in any package."""
    return kind.split("/")[-1] in TYPES


def decoder(kind: str, definition: str, *, ros1: bool, idl: bool = False) -> Decode:
    """A function from a message's bytes, and the time at which it was logged, to a Message.

    Raises RefusedError for a definition that cannot be read; so does the function for a message.
    """
    name = kind if "/msg/" in kind else kind.replace("/", "/msg/")
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    try:
        types = get_types_from_idl(definition) if idl else get_types_from_msg(definition, name)
        store.register({k: v for k, v in types.items() if k not in store.types})
    except Exception as error:  # it is another program's text
        raise RefusedError(f"the definition of {kind} cannot be read ({error})") from error
    deserialize = store.deserialize_ros1 if ros1 else store.deserialize_cdr
    read = _all if kind.endswith("BiotacAll") else _hand

    def decode(raw: bytes, logged_ns: int) -> Message:
        if len(raw) > MAX_BYTES:
            raise RefusedError(f"a message of {len(raw)} bytes, expected at most {MAX_BYTES}")
        try:
            message: Any = deserialize(raw, name)
            header = getattr(message, "header", None)
            return read(message, 0 if header is None else _stamp_ns(header.stamp), logged_ns)
        except RefusedError:
            raise
        except Exception as error:  # a hostile message can fail anywhere in rosbags
            raise RefusedError(f"{kind} of {len(raw)} bytes is no such message ({error_text(error)})") from None

    return decode


def _stamp_ns(stamp: Any) -> int:
    if not (0 <= stamp.sec < 2**32 and 0 <= stamp.nanosec < 10**9):
        raise RefusedError(f"the stamp is {stamp.sec} s and {stamp.nanosec} ns, expected 0 to 10^9 ns")
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _all(message: Any, stamp_ns: int, logged_ns: int) -> Message:
    """sr_robot_msgs/BiotacAll: first, middle, ring, little finger, thumb, which are our default names."""
    tactiles = message.tactiles
    if len(tactiles) > sensor.MAX_SENSORS:
        raise RefusedError(f"tactiles has {len(tactiles)} entries, expected at most {sensor.MAX_SENSORS}")
    found = Found()
    for f, own in enumerate(tactiles):
        pac = getattr(own, "pac", ())  # all since the message before; without it, the last two
        pac = pac if len(pac) else [getattr(own, name) for name in ("pac0", "pac1") if hasattr(own, name)]
        found.add(f, own.electrodes, own.pdc, getattr(own, "tac", None), getattr(own, "tdc", None), pac)
    return found.message(stamp_ns, places=sensor.MAX_SENSORS, logged_ns=logged_ns)


def _hand(message: Any, stamp_ns: int, logged_ns: int) -> Message:
    """biotac_sensors/BioTacHand: sensors by position, all slots with their times."""
    found, positions = Found(), tuple(int(own.bt_position) for own in message.bt_data)
    if len(set(positions)) != len(positions):
        raise RefusedError(f"sensors at positions {', '.join(map(str, positions))}, expected each once")
    for own in message.bt_data:
        serial = own.bt_serial.encode("ascii", "replace")[:SENSOR_SERIAL_BYTES]
        channels = own.electrode_data, own.pdc_data, own.tac_data, own.tdc_data, own.pac_data
        found.add(f"at position {own.bt_position}", *channels, serial)
    more = {"logged_ns": logged_ns, "positions": positions, "slot_us": _slot_us(getattr(message, "bt_time", None))}
    return found.message(stamp_ns, places=len(positions), **more)


def _slot_us(times: Any) -> Any:
    """Each slot's time after the stamp, if they are given and the frame was sampled in our order; else None."""
    at_ns = np.empty(slots.SLOTS_PER_FRAME)
    all_slots: dict[str, Any] = {"electrode": slots.ELECTRODE_SLOT, "pac": slots.PAC_SLOT, **slots.SLOW_SLOTS}
    for name, slot in all_slots.items():
        at_ns[slot] = getattr(times, f"{name}_ns_offset", np.nan)
    ours = (np.abs(at_ns / 1e3 - SLOT_US) < 1e6 / sensor.SLOT_HZ / 2).all()
    return (at_ns / 1e3).astype(np.uint32) if ours else None
