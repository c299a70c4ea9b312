"""A part of a recording, or what is left of a damaged one, as a recording of its own."""

from __future__ import annotations

from itertools import groupby
from operator import itemgetter
from pathlib import Path

from ..errors import InputError
from . import layout
from .mcap_file import RecordingFile
from .reader import Recording


def cut(recording: Recording, place: Path, start_s: float = 0.0, stop_s: float | None = None) -> tuple[float, float]:
    """Write the blocks, of about a second, that have rows from ``start_s`` to ``stop_s``, device seconds since the
    first row, with their gaps and all labels that hold in them; returns the first and last row's time in s.

    Bytes, times and losses stay as they are. Raises InputError when there is no row in that time.
    """
    begin_us = recording.begin_us
    chosen = [
        k
        for k, block in enumerate(recording.heads())
        if block.rest.first_us is not None
        and block.rest.last_us is not None
        and block.rest.last_us >= begin_us + start_s * 1e6
        and (stop_s is None or block.rest.first_us < begin_us + stop_s * 1e6)
    ]
    if not chosen:
        duration_s = (recording.end_us - begin_us) / 1e6
        raise InputError(f"{recording.path} has {duration_s:.1f} s and no row from {start_s:g} s on in that time")
    first, last = (recording.heads()[k].rest for k in (chosen[0], chosen[-1]))
    from_us, to_us = first.first_us or begin_us, last.last_us or begin_us
    labels = [
        label for label in recording.labels if label.t_us is None or from_us <= (label.end_us or label.t_us)
    ]  # in order of time
    file = RecordingFile(place.open("xb"), recording.metadata | {layout.CUT_FROM: recording.path.name})
    for k, packets in groupby(recording.packets(from_us), key=itemgetter(0)):
        if k > chosen[-1]:
            break
        for gap in recording.gaps_before(k):
            file.add_gap(gap)
        data = b"".join(packet.data for _, packet in packets)
        file.add(data, recording.arrived_ns[k], recording.all_here_ns[k])
        block_us = recording.heads()[k].rest.last_us or from_us
        while labels and (labels[0].t_us or 0) <= block_us:
            file.add_label(labels.pop(0))
    file.close()
    return (from_us - begin_us) / 1e6, (to_us - begin_us) / 1e6
