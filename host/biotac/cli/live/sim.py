"""biotac sim SOURCE"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from ... import extra
from ...documents import write_new
from ...errors import InputError
from ...recording.replay.playback import Playback
from ...sim.faults import fault_named
from ...sim.live import LiveFingers
from ...sim.load_server import LoadServer
from ...sim.loading import bundled_scenario, load_source
from ...sim.physics import SimFinger
from ...sim.play import with_fault
from ...sim.ports import SIM, start_board
from ...sim.serve import LOCAL
from .. import values
from ..outputs import report
from ..recordings.loading import load
from .board_on_pty import announce, announce_end, served, until_ctrl_c

LOOK_S = 0.5
EXAMPLE = "biotac sim press.toml --fingers 5 --board pico"
SCENARIO_S = 600.0
NO_FAULT = "none"  # ends the fault of a sensor board


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "source",
        metavar="SOURCE",
        nargs="?",
        help="scenario (.toml), recorded counts (.npz, .btd), or a recording (.mcap), which answers as its board did",
    )
    parser.add_argument("--fingers", type=int, help="how many fingers play it, 1 to 5")
    parser.add_argument(
        "--seconds",
        type=values.seconds,
        help="device time (default: scenarios repeat for ten minutes, recordings play once)",
    )
    parser.add_argument(
        "--board",
        choices=(SIM, "pico", "pico2", "posix"),
        metavar="BOARD",
        help="sim (default): the firmware in this process; pico, pico2: an image in an emulator (pico2: fetch it)",
    )
    parser.add_argument("--image", help="flash image for --board pico or pico2 (default: that in build/)")
    parser.add_argument("--pace", type=values.pace, help="real (default) or device seconds per second")
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="FINGER=KIND[@CHANNEL]",
        help="a fault from start to end: 0=unplugged, 1=electrode stuck@E13; may be repeated",
    )
    parser.add_argument(
        "--live",
        metavar="NAMES",
        help="fingers such as index,thumb, without SOURCE: another program gives their load round by round",
    )
    parser.add_argument(
        "--address",
        metavar="IP",
        help=f"serve a TCP port, not a pty, on this address of this computer ({LOCAL}: to its own programs alone)",
    )
    parser.add_argument("--link", type=Path, help="also make this path a symbolic link to the pty")
    parser.add_argument("--new", metavar="FILE", type=Path, help="only write a scenario with every verb, and comments")
    parser.add_argument("--force", action="store_true", help="with --new: overwrite FILE")
    add_sensor_board(parser)


def add_sensor_board(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group(
        "as the sensors of a gateway, by a second Pico (firmware/sensor_board; needs biotac-rig)"
    )
    group.add_argument("--sensor-port", metavar="PORT", help="a sensor board; it plays SOURCE, or the last tape again")
    group.add_argument(
        "--by-time",
        action="store_true",
        help="play by the board's clock: where the gateway's differs, rounds are skipped or repeated",
    )
    kept = group.add_mutually_exclusive_group()
    kept.add_argument(
        "--keep",
        action="store_true",
        help="store SOURCE in the board's flash, up to 3.5 s of five fingers: it plays from power-up on, in a loop",
    )
    kept.add_argument("--forget", action="store_true", help="erase the SOURCE that --keep has stored")


def run(args: argparse.Namespace) -> int:
    """Print the PORT once the board is ready; run for --seconds or until Ctrl-C. Or play on a sensor board."""
    if args.new is not None:
        write_new(args.new, bundled_scenario("verbs.toml").decode(), overwrite=args.force)
        text = f"{args.new}: change it, and play it with `biotac view sim:{args.new}`"
        report(args, {"scenario": str(args.new)}, text)
        return 0
    seconds = args.seconds or (SCENARIO_S if (args.source or "").endswith(".toml") else None)
    if args.sensor_port is not None:
        values.refuse(
            args, ("board", "image", "pace", "link", "address"), "is for a board on a pty; drop it, or --sensor-port"
        )
        return extra.rig("--sensor-port", lambda rig: int(rig.play(args, seconds)))
    values.refuse(args, ("by_time", "keep", "forget"), "is for a sensor board; add --sensor-port PORT")
    if args.live is not None:
        if args.source is not None:
            raise InputError(f"--live takes its loads from lines, and no SOURCE; drop {args.source}")
        values.refuse(args, ("fingers", "seconds", "pace", "fault"), "is for a board with a SOURCE; drop it")
        return serve_loads(args)
    if args.source is None:
        raise InputError("no SOURCE is given, expected a scenario such as press.toml, or recorded counts")
    if args.pace == 0:
        raise InputError(
            "--pace is 0, expected above 0 for a board on a pty; only biotac.open and biotac demo run unpaced"
        )
    if args.source.lower().endswith(".mcap"):
        values.refuse(args, ("fingers", "seconds", "board", "image", "fault"), "is for a simulated board; drop it")
        return play_recording(args)
    if args.image is not None and args.board not in ("pico", "pico2"):
        raise InputError("--image needs a board that has a flash image; add --board pico")
    name = args.source.removeprefix("sim:")
    source = load_source(name, fingers=args.fingers, seconds=seconds)
    for finger, kind, channel in map(fault_of, args.fault):
        source = with_fault(source, finger, kind, channel)
    board = start_board(args.board or SIM, source, pace=args.pace or 1.0, image=args.image)
    with served(board, args) as port:
        facts = {"source": source.name, "fingers": source.samples.shape[1]}
        announce(port, args, source.name, facts)
        while not port.over:
            port.receive(LOOK_S)  # a signal just before an endless wait would not end that
        if args.seconds is None:
            announce_end(source.name)
            while True:
                time.sleep(LOOK_S)
    return 0


def serve_loads(args: argparse.Namespace) -> int:
    """Run a board until Ctrl-C; another program loads the fingers."""
    names = [name for name in args.live.split(",") if name]
    if len({*names, "fault"}) <= len(names):
        raise InputError(f"--live is {args.live}, expected different names, and none of them fault, a key of its lines")
    fingers = LiveFingers({name: SimFinger(1 + number) for number, name in enumerate(names)})
    board = start_board(args.board or SIM, fingers.at_rest(), pace=0.0, live=True, image=args.image)
    with served(board, args) as port:
        server = LoadServer(fingers, board, address=args.address)
        where = f"{args.address or LOCAL}:{server.port}"
        facts = {"loads": server.port, "token": server.token, "fingers": names}
        announce(port, args, f"what comes at {where} after the line {server.token}", facts)
        server.serve()
    return 0


def play_recording(args: argparse.Namespace) -> int:
    """Act as the recorded board until Ctrl-C; playing begins when somebody starts the stream."""
    from ...recording.replay.pty import ReplayPty

    board = ReplayPty(Playback(load(Path(args.source))), args.pace or 1.0)
    with until_ctrl_c(board, args.link):
        announce(board, args, args.source, {"source": args.source})
        while not board.over:
            board.turn(1.0)
        announce_end(args.source)
        while True:
            board.turn(1.0)
    return 0


def fault_of(text: str) -> tuple[int, str, str | None]:
    """Finger, fault and channel of a text such as ``2=stuck_low`` or ``0=electrode stuck@E13``."""
    finger, _, kind = text.partition("=")
    kind, _, channel = kind.partition("@")
    if not finger.isdigit() or not kind:
        raise InputError(f"--fault {text}: expected FINGER=KIND or FINGER=KIND@CHANNEL, as in 1=stuck@E13")
    if kind != NO_FAULT:
        fault_named(kind, channel or None)
    return int(finger), kind, channel or None
