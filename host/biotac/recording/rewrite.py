"""A recording written again, block by block: a part, the undamaged blocks, or all with other frames."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from ..errors import InputError
from ..wire.decoder import packed
from . import layout
from .mcap_file import RecordingFile
from .reader import Recording

Messages = Iterator[tuple[int, bytes]]


def rewrite(
    recording: Recording,
    out: Path,
    metadata: Mapping[str, str],
    change: Callable[[Messages], Messages] = lambda messages: messages,
    *,
    blocks: range | None = None,
    show: Callable[[float], None] = lambda share: None,
) -> None:
    """Write ``blocks`` (default: all), with gaps and all labels that hold in them; ``change`` makes their messages."""
    numbers = range(len(recording.arrived_ns)) if blocks is None else blocks
    heads = [recording.heads()[k].head for k in numbers]
    begin_us = next((head.first_us for head in heads if head.first_us is not None), 0)
    labels = [
        label
        for label in recording.labels  # in order of time
        if label.t_us is None or begin_us <= max(label.end_us or label.t_us, recording.begin_us)
    ]
    at_us = begin_us
    with out.open("xb") as stream:
        file = RecordingFile(stream, dict(metadata))
        file.shift_us = (begin_us & 0xFFFFFFFF) - begin_us
        for done, (k, head) in enumerate(zip(numbers, heads, strict=True), 1):
            for gap in recording.gaps_before(k):
                file.add_gap(gap)
            packets = packed(change(recording.messages_in(k)))
            times_ns = recording.arrived_ns[k], recording.all_here_ns[k]
            file.add(packets, *times_ns, lambda *_, k=k: recording.applied_in(k), head.rejected)
            at_us = head.last_us or at_us
            while labels and (labels[0].t_us or 0) <= at_us:
                file.add_label(labels.pop(0))
            show(done / len(numbers))
        file.close()


def cut(recording: Recording, out: Path, start_s: float = 0.0, stop_s: float | None = None) -> tuple[float, float]:
    """Write the blocks, of about a second, that have rows from ``start_s`` to ``stop_s``, device seconds since the
    first row; returns the first and last row's time in s. Messages, times and losses stay as they are.

    Raises InputError when there is no row in that time.
    """
    begin_us = recording.begin_us
    chosen = [
        (k, block.head.first_us, block.head.last_us)
        for k, block in enumerate(recording.heads())
        if block.head.first_us is not None
        and block.head.last_us is not None
        and block.head.last_us >= begin_us + start_s * 1e6
        and (stop_s is None or block.head.first_us < begin_us + stop_s * 1e6)
    ]
    if not chosen:
        duration_s = (recording.end_us - begin_us) / 1e6
        raise InputError(f"{recording.path} has {duration_s:.1f} s and no row from {start_s:g} s on in that time")
    (first, from_us, _), (last, _, to_us) = chosen[0], chosen[-1]
    metadata = recording.metadata | {layout.CUT_FROM: recording.path.name}
    rewrite(recording, out, metadata, blocks=range(first, last + 1))
    return (from_us - begin_us) / 1e6, (to_us - begin_us) / 1e6
