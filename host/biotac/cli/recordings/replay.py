"""biotac replay REC"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from ...errors import InputError
from ...hand.opening import shake_hands
from ...recording.replay.link import ReplayLink
from ...recording.replay.playback import Playback
from .. import values
from ..live import stream
from ..live.board_on_pty import tell, tell_over, until_ctrl_c
from .loading import load

EXAMPLE = "biotac replay grasp.mcap --from 12.5 --pace 2"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", metavar="REC", type=Path, help="file written by biotac record")
    parser.add_argument("--from", dest="from_s", type=moment, default=0.0, help="seconds since its first frame")
    parser.add_argument("--to", dest="to_s", type=moment, help="seconds since its first frame")
    parser.add_argument("--pace", type=values.pace, default=1.0, help="real (default), fast, or seconds per second")
    parser.add_argument("--rate", type=values.rate, default=10.0, help="lines per second and finger (0: all)")
    parser.add_argument("--pty", action="store_true", help="be a board on a pty that any serial program can open")
    parser.add_argument("--link", type=Path, help="with --pty: also make this path a symbolic link to the pty")


def moment(text: str) -> float:
    """Seconds, 0 or more."""
    value = values.number(text)
    if not 0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a time; expected seconds, 0 or more")
    return value


def run(args: argparse.Namespace) -> int:
    """Play to the end or Ctrl-C; stderr says what the recording lacks."""
    if args.link is not None and not args.pty:
        raise InputError("--link is for a pty; add --pty")
    recording = load(args.recording)
    playback = Playback(recording, from_s=args.from_s, to_s=args.to_s)
    if args.pty:
        return on_pty(args, playback)
    with shake_hands(ReplayLink(f"replay:{args.recording}", playback, pace=args.pace)) as hand:
        stream.show(hand, rate=args.rate, as_json=args.json)
    return 0


def on_pty(args: argparse.Namespace, playback: Playback) -> int:
    """Act as a board until Ctrl-C; playing begins when somebody starts its stream."""
    from ...recording.replay.pty import ReplayPty

    board = ReplayPty(playback, args.pace)
    name = str(args.recording)
    with until_ctrl_c(board, args.link):
        tell(board, args, name, {"recording": name})
        announced = False
        while True:
            board.turn(1.0)
            if board.over and not announced:
                announced = True
                tell_over(name)
    return 0
