"""Messages of other BioTac drivers, as bytes, bags and topics, from samples (frames, fingers, 44).

As a program, ``PORT SECONDS KIND FINGERS``, a robot's bridge: foxglove-sdk's server. KIND is ros1 or ros2
(BiotacAll with all PAC); lines on stdin: stop and go the topic, change its definition, quit.
"""

import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from biotac.sim.loading import load_source
from biotac.wire import sensor_gen as sensor
from biotac.wire import slots

START_NS = 1_500_000_000 * 10**9
ALL, HAND = "sr_robot_msgs/msg/BiotacAll", "biotac_sensors/msg/BioTacHand"
_BIOTAC = "int16 pac0\nint16 pac1\nint16 pdc\nint16 tac\nint16 tdc\nint16[] electrodes\n"
_TIMES = "uint32 tdc_ns_offset\nuint32 tac_ns_offset\nuint32 pdc_ns_offset\nuint32[22] pac_ns_offset\n"
_DATA = "uint16 tdc_data\nuint16 tac_data\nuint16 pdc_data\nuint16[22] pac_data\nuint16[19] electrode_data\n"


class Robot:
    """A driver: ``kind`` is ALL or HAND, ``pac``, ``timed``: whether BiotacAll has all PAC, BioTacHand times."""

    def __init__(self, kind: str = ALL, *, pac: bool = False, ros1: bool = True, timed: bool = True) -> None:
        self.kind, self.pac, self.ros1, self.timed = kind, pac, ros1, timed
        self.store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        texts = {
            "sr_robot_msgs/msg/Biotac": _BIOTAC + ("int16[] pac\n" if pac else ""),
            ALL: "std_msgs/Header header\nsr_robot_msgs/Biotac[] tactiles\n",
            "biotac_sensors/msg/BioTacData": f"string bt_serial\nuint16 bt_position\n{_DATA}",
            "biotac_sensors/msg/BioTacTime": f"{_TIMES}uint32[19] electrode_ns_offset\n",
            HAND: "std_msgs/Header header\nstring hand_id\nbiotac_sensors/BioTacData[] bt_data\n"
            + "biotac_sensors/BioTacTime bt_time\n" * timed,
        }
        types: dict[str, Any] = {}
        for name, text in texts.items():
            types |= get_types_from_msg(text, name)
        self.store.register(types)
        self.definition = self.store.generate_msgdef(kind, ros_version=1 if ros1 else 2)[0]

    def bytes_of(self, message: Any) -> bytes:
        return bytes((self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr)(message, self.kind))

    def message(self, stamp_ns: int, fingers: list[np.ndarray | None], serials: tuple[str, ...] = ()) -> Any:
        """``fingers``: 44 words each, or 49 of a BioTac SP; None: no sensor, all zeros."""
        types = self.store.types
        stamp = types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9))
        header = types["std_msgs/msg/Header"](**({"seq": 0} if self.ros1 else {}), stamp=stamp, frame_id="rh_distal")
        words = [np.zeros(44, np.int64) if row is None else np.asarray(row, np.int64) for row in fingers]
        slow = [tuple(int(row[s]) for s in (slots.PDC_SLOT, slots.TAC_SLOT, slots.TDC_SLOT)) for row in words]
        if self.kind == ALL:
            own = []
            for row, (pdc, tac, tdc) in zip(words, slow, strict=True):
                pac, e = row[slots.PAC_SLOT], np.append(row[slots.ELECTRODE_SLOT], row[44:]).astype(np.int16)
                more = {"pac": pac.astype(np.int16)} if self.pac else {}
                two = int(pac[-2]), int(pac[-1])
                own.append(types["sr_robot_msgs/msg/Biotac"](*two, pdc, tac, tdc, e, **more))
            return types[ALL](header, own)
        at_ns = (np.arange(44) * 1e9 / sensor.SLOT_HZ).astype(np.uint32)
        times = types["biotac_sensors/msg/BioTacTime"](
            *(int(at_ns[s]) for s in (slots.TDC_SLOT, slots.TAC_SLOT, slots.PDC_SLOT)),
            at_ns[slots.PAC_SLOT], at_ns[slots.ELECTRODE_SLOT],
        )  # fmt: skip
        data = [
            types["biotac_sensors/msg/BioTacData"](
                serials[f] if serials else f"BT2P00000000000{f}", f, tdc, tac, pdc,
                row[slots.PAC_SLOT].astype(np.uint16), row[slots.ELECTRODE_SLOT].astype(np.uint16),
            )
            for f, (row, (pdc, tac, tdc)) in enumerate(zip(words, slow, strict=True))
        ]  # fmt: skip
        return types[HAND](header, "left", data, *[times] * self.timed)

    def write(self, path: Path, samples: Any, *, stamps_ns: Any = None, topics: tuple[str, ...] = ("/rh/tactile",),
              serials: tuple[str, ...] = ()) -> str:  # fmt: skip
        """A bag of these, at 100 Hz; rows of ``samples`` may be lists with None. Returns the bag's PORT."""
        ns = START_NS + 10_000_000 * np.arange(len(samples)) if stamps_ns is None else stamps_ns
        with Writer1(path) if self.ros1 else Writer2(path, version=9) as bag:
            how = {"typestore": self.store}
            connections = [bag.add_connection(topic, self.kind, **how) for topic in topics]
            for row, stamp_ns in zip(samples, np.asarray(ns).tolist(), strict=True):
                raw = self.bytes_of(self.message(stamp_ns, list(row), serials))
                for connection in connections:
                    bag.write(connection, max(0, stamp_ns), raw)
        return f"bag:{path}"


def serve(port: int, seconds: float, kind: str, fingers: int) -> None:
    import foxglove

    commands: list[str] = []
    threading.Thread(target=lambda: commands.extend(line.strip() for line in sys.stdin), daemon=True).start()
    ros1 = kind == "ros1"
    server = foxglove.start_server(port=port)

    def channel(pac: bool) -> tuple[Robot, foxglove.Channel]:
        robot = Robot(ALL, pac=pac, ros1=ros1)
        name = ALL.replace("/msg/", "/") if ros1 else ALL
        schema = foxglove.Schema(name=name, encoding="ros1msg" if ros1 else "ros2msg", data=robot.definition.encode())
        encoding = "ros1" if ros1 else "cdr"
        return robot, foxglove.Channel("/rh/tactile", message_encoding=encoding, schema=schema)

    source = load_source("grasp.toml", fingers=fingers, seconds=20.0).samples
    robot, topic = channel(True)
    print("ready", flush=True)
    begin_s, begin_ns, published, stopped = time.monotonic(), time.time_ns(), 0, False
    for k in range(int(seconds * 100)):
        time.sleep(max(0.0, begin_s + k / 100 - time.monotonic()))
        command = commands.pop(0) if commands else ""
        stopped = command == "stop" or (stopped and command != "go")
        if command == "quit":
            break
        if command == "change":
            topic.close()
            robot, topic = channel(False)
        if not stopped:
            ns = begin_ns + 10_000_000 * k  # when it is due: a message that is missing shows
            topic.log(robot.bytes_of(robot.message(ns, list(source[k % len(source)]))), log_time=ns)
            published += 1
    print(f"published {published}", flush=True)
    server.stop()


if __name__ == "__main__":
    serve(int(sys.argv[1]), float(sys.argv[2]), sys.argv[3], int(sys.argv[4]))
