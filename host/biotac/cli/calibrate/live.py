"""biotac calibrate wrench --live PORT"""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator
from pathlib import Path

import biotac

from ...calibrate.reference.mounting import Mounting, read_mounting
from ...calibrate.reference.net_ft import PREFIX, NetFtReader, parse_address
from ...calibrate.reference.samples import Reader
from ...calibrate.wrench.guided import Procedure, walk
from ...calibrate.wrench.sources import check_serial
from ...errors import BiotacError, InputError
from ...sim.nano17 import Nano17
from ...sim.nano17_reader import Nano17Reader
from ...sim.source import Source
from ...wire.identity import ascii_text
from .. import outputs
from ..progress import Progress

EMULATED = "nano17"


def record(args: argparse.Namespace, hand: biotac.Hand, finger: int) -> tuple[Path, list[str]]:
    """Guide through the procedure; return the recording, with the reference's .csv beside it, and what is missing.

    Raises KeyboardInterrupt, with a message, if it was ended before there was anything to fit.
    """
    serial = ascii_text(hand.sensor_info(finger).serial)
    check_serial(f"finger {finger}", serial, args.serial, force=args.force)
    path = args.out / f"{serial or f'finger{finger}'}.mcap"
    recorded = f"the recorded data is in {path} and {path.with_suffix('.csv')}"
    progress = Progress()

    def show(event: str) -> None:
        progress.done()
        outputs.note(event)

    with _reader(args, hand, finger) as (reader, mounting):
        outputs.make_folder(args.out)
        procedure = Procedure(finger, mounting)
        try:
            walk(hand, reader, procedure, path, overwrite=args.force, show=show, progress=progress.show)
        except BiotacError:
            if path.exists():
                outputs.note(recorded)
            raise
        finally:
            progress.done()
        lost = reader.stats
    if lost.lost or lost.late or lost.bad:
        outputs.note(f"reference: {lost.lost} samples lost, {lost.late} late, {lost.bad} bad")
    if procedure.zero is None:
        raise KeyboardInterrupt(f"ended while {procedure.last_step.value.partition(':')[0]}; {recorded}")
    return path, procedure.coverage.missing()


@contextlib.contextmanager
def _reader(args: argparse.Namespace, hand: biotac.Hand, finger: int) -> Iterator[tuple[Reader, Mounting]]:
    if len(args.reference) != 1:
        raise InputError(f"{len(args.reference)} --reference with --live: expected one, {PREFIX}HOST or {EMULATED}")
    (text,) = args.reference
    if text == EMULATED:
        if not isinstance(hand.link.source, Source):
            raise InputError(
                f"{EMULATED} is emulated and works only with a simulated finger: expected --live sim:SCENARIO"
            )
        nano17 = Nano17() if args.mounting is None else Nano17(read_mounting(args.mounting))
        yield Nano17Reader(hand.link.source, finger, nano17), nano17.mounting
        return
    if not text.startswith(PREFIX):
        raise InputError(f"{text}: expected {PREFIX}HOST (a Net F/T box) or {EMULATED} (emulated)")
    if args.mounting is None:
        raise InputError(f"the mounting of {text} on the finger is unknown: expected --mounting FILE.toml")
    mounting = read_mounting(args.mounting)
    with contextlib.closing(NetFtReader(parse_address(text))) as reader:
        yield reader, mounting
