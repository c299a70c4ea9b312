"""The first evening as a page: bringup.md, with a picture beside it where matplotlib is installed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..markdown import table
from ..picture import picture
from ..wire.identity import ascii_text, board_text, version_text
from . import bringup
from .bringup import Bringup
from .catalogue import Finding
from .facts import Facts

EMULATED = """\
This board is emulated. Its program is the real image, and so are its commands, its slots and what follows from them.
Made up are: supply, temperature, ids, the time an erase takes, its USB and this computer's share in it, the bus's
margin, and the fingers. Only silicon can tell those, and whether the chip does what its data sheet says."""
REAL = """\
Measured by no program: the ripple of V+ at the sensors (less than 20 mV), the shape of SCK and MISO there, and whether
every select is at the finger you think: press each in `biotac view`. Ten restarts are resets, not cold starts: pull the
plug for a minute, twenty times. The order that wastes least: cold starts, a sensor board (`--sensor-port`), one BioTac
by core at 1 MHz (words, then its serial number, then up), five (host/docs/start/bring_up.md)."""


def write(path: Path, seen: Bringup, facts: Facts, findings: Sequence[Finding]) -> None:
    """Write the page to ``path``, and the picture beside it."""
    lines = ["# Bring-up", "", *_head(facts), *_findings(findings), *_board(seen), *_fingers(seen, facts)]
    lines += [*_bus(seen, facts), *_link(seen)]
    if len(seen.frames):
        try:
            _draw(path.with_suffix(".png"), seen, facts, findings)
            lines += [f"![Noise, bus margin, pressure against force, latency]({path.with_suffix('.png').name})", ""]
        except InputError as error:
            lines += [str(error), ""]
    lines += ["## What this cannot tell", "", EMULATED if seen.emulated else REAL, ""]
    path.write_text("\n".join(lines), encoding="utf-8")


def _head(facts: Facts) -> list[str]:
    if facts.board is None:
        return [f"{facts.port or 'no port'}: {facts.error or 'nothing to examine'}", ""]
    hello = facts.board.hello
    return [
        f"{facts.port}: {board_text(hello.board)}, firmware {version_text(hello)}, image {hello.image_crc32:08x}",
        "",
    ]


def _findings(findings: Sequence[Finding]) -> list[str]:
    lines = ["## Findings", "", *([] if findings else ["None: everything measured is within its range.", ""])]
    for finding in findings:
        lines += [
            f"* **{finding.code}** ({finding.entry.severity}): {finding.seen}.",
            f"  *Cure:* {finding.entry.cure}",
        ]
    return [*lines, ""] if findings else lines


def _board(seen: Bringup) -> list[str]:
    if not seen.chip:
        return ["The board measures nothing of itself: its firmware or its kind does not.", ""]
    rows = [[measured.name, measured.seen, measured.expected] for measured in bringup.measures(seen)]
    if seen.restarts:
        took_s = [restart.seconds for restart in seen.restarts]
        rows.append(
            ["restarts", f"{len(took_s)} of {bringup.RESTARTS}, {min(took_s):.1f} to {max(took_s):.1f} s", "all"]
        )
    return ["## The board", "", *table(["what", "seen", "expected"], rows)]


def _fingers(seen: Bringup, facts: Facts) -> list[str]:
    if facts.board is None or not facts.board.present:
        return []
    rows = []
    for finger in facts.board.present:
        serial = next(ascii_text(info.serial) for info in facts.board.sensors if info.finger == finger)
        noise = bringup.noise_counts(seen.rows_of(finger))
        gain, most_n = bringup.pdc_per_n(seen.rows_of(finger))
        warm = bringup.pdc_per_c(seen.rows_of(finger))
        parity = facts.board.more(finger, "words_parity")
        cells = [f"{noise.min():.2f} to {noise.max():.2f}", f"{gain:.0f} ({most_n:.1f} N)", f"{warm:+.0f}"]
        rows.append([str(finger), serial, str(parity), *("-" if "nan" in cell else cell for cell in cells)])
    head = ["finger", "serial number", "bad parity", "noise of electrodes, counts", "PDC a newton", "PDC a degree"]
    return ["## Fingers", "", *table(head, rows)]


def _bus(seen: Bringup, facts: Facts) -> list[str]:
    if not seen.words or facts.board is None:
        return []
    present = facts.board.present
    rows = [
        [f"{khz / 1000:.2f}", *(f"{words[f, 1]} of {words[f].sum()}" for f in present)]
        for khz, words in seen.words.items()
    ]
    head = ["MHz", *(f"finger {finger}" for finger in present)]
    return [
        "## The sensors' bus, the usual rate first: words that were not good",
        "",
        *table(head, rows),
    ]


def _link(seen: Bringup) -> list[str]:
    if not seen.ping_s:
        return []
    ms = 1000 * np.array(seen.ping_s)
    rows = [
        ["ping, median", f"{np.median(ms):.2f} ms"],
        ["ping, 99 of 100", f"{np.quantile(ms, 0.99):.2f} ms"],
        ["ping, worst", f"{ms.max():.2f} ms"],
        ["to the board", f"{seen.up_bytes_s / 1000:.0f} kB/s"],
        ["from the board", f"{seen.down_bytes_s / 1000:.0f} kB/s"],
    ]
    return ["## This computer's USB", "", *table([f"of {len(ms)} pings; of large messages", "seen"], rows)]


def _draw(path: Path, seen: Bringup, facts: Facts, findings: Sequence[Finding]) -> None:
    present = facts.board.present if facts.board is not None else []
    with picture(path) as page:
        page.set_size_inches(10, 7)
        found = ", ".join(sorted({finding.code for finding in findings}))
        page.suptitle(f"Outside its range: {found}" if found else "Everything measured is within its range")
        (noise, bus), (press, ping) = page.subplots(2, 2)
        for finger in present:
            rows = seen.rows_of(finger)
            noise.plot(range(1, 20), bringup.noise_counts(rows), "o-", label=f"finger {finger}")
            rise, force_n = rows["pdc"] - rows["pdc_tare"], np.linalg.norm(rows["force_n"], axis=1)
            press.plot(force_n, rise, ".", markersize=2, label=f"finger {finger}")
            khz = np.array(list(seen.words))
            bad = [100 * words[finger, 1] / max(1, words[finger].sum()) for words in seen.words.values()]
            bus.plot(khz / 1000, bad, "o-", label=f"finger {finger}")
        noise.set(title="Noise at rest", xlabel="electrode", ylabel="counts", ylim=(0, None), xticks=range(1, 20, 2))
        bus.set(title="Sensors' bus: bad words by its rate", xlabel="MHz", ylabel="words not good, %", ylim=(-5, 105))
        if seen.words:
            least = bringup.MARGIN * next(iter(seen.words)) / 1000
            line = bus.axvline(least, color="0.5", linestyle="--", label=f"good at least up to {least:.1f} MHz")
            bus.legend(handles=[line])
        at_least = f"at least {bringup.PDC_PER_N:g} counts per newton"
        line = press.axline((0, 0), slope=bringup.PDC_PER_N, color="0.5", linestyle="--", label=at_least)
        press.legend(handles=[line], loc="lower right")
        press.set(title="Static pressure", xlabel="force by the board, N",
                  ylabel="PDC above rest, counts")  # fmt: skip
        if seen.ping_s:
            ms = 1000 * np.array(seen.ping_s)
            shown_ms = float(1.5 * np.quantile(ms, 0.99))
            ping.hist(ms, 60, range=(0, shown_ms))
            ping.axvline(np.median(ms), color="0.5", linestyle="--", label=f"median; slowest {ms.max():.0f} ms")
            ping.legend()
        ping.set(title=f"{len(seen.ping_s)} pings", xlabel="ms to the board and back", ylabel="how many", yscale="log")
        if present:
            noise.legend()
