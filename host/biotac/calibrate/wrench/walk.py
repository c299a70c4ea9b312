"""A guided calibration on a board: reads it and the reference, records both, and lets the procedure judge.

Both files are complete up to the last second at any time, so whatever ends this, they can be fitted later.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ...errors import CommandRefusedError
from ...hand.hand import Hand
from ..reference.csv_file import CsvWriter
from ..reference.live import Reader
from .procedure import Event, Procedure, Step

Show = Callable[[Event], None]


@dataclass(frozen=True)
class Places:
    """Where the board's recording (.mcap) and the reference (.csv) go."""

    recording: Path
    reference: Path


def walk(
    hand: Hand,
    reader: Reader,
    procedure: Procedure,
    places: Places,
    *,
    overwrite: bool = False,
    show: Show = lambda event: None,
    progress: Callable[[str], None] = lambda text: None,
) -> None:
    """Until the procedure is done, the board's source ends, or a KeyboardInterrupt, which ends the procedure too.

    The board streams no more afterwards. Raises InputError when a file exists or cannot be written, DeviceLostError
    when the board or the reference goes away; what was recorded until then is kept.
    """
    writer = CsvWriter(places.reference, procedure.mounting, reader.sensor, overwrite=overwrite)
    try:
        recorder = hand.record(places.recording, overwrite=overwrite)
        try:
            _loop(hand, reader, procedure, writer, show, progress)
            if procedure.step is not Step.DONE:
                procedure.finish("the simulated finger's script is over")
        except KeyboardInterrupt:
            procedure.finish("ended on your word")
        finally:
            recorder.close()
    finally:
        writer.close()
    for event in procedure.take_events():
        show(event)
    # also a board whose source has ended: it streams nothing, and still calls itself busy
    hand.stop()


def _loop(
    hand: Hand, reader: Reader, procedure: Procedure, writer: CsvWriter, show: Show, progress: Callable[[str], None]
) -> None:
    first_us: int | None = None
    for batch in hand.batches():
        last_us = batch.last_t_us()
        if last_us is not None:
            first_us = last_us if first_us is None else first_us
            samples = reader.read((last_us - first_us) / 1e6)
            # kept before it is judged
            writer.add(samples)
            procedure.frames(batch.frames)
            procedure.samples(samples)
        if procedure.wants_tare:
            try:
                hand.tare(procedure.finger)
                procedure.tared(accepted=True)
            except CommandRefusedError:
                procedure.tared(accepted=False)
        for event in procedure.take_events():
            show(event)
        progress(procedure.status())
        if procedure.step is Step.DONE:
            return
