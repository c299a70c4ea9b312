"""The rows of tests/faults/matrix.toml with `play`: every rig, the same verdict for all."""

import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from held_press import fault, held_press, of_finger

import biotac
from biotac import FrameFlags
from biotac.documents import tomllib
from biotac.sim.fault_gen import EmuFault
from biotac.sim.loading import load_source
from biotac.sim.source import Source
from biotac.wire import messages_gen as wire
from biotac.wire.slots import ELECTRODE_SLOT
from rig import ROOT, Rig

ROWS = [row for row in tomllib.loads((ROOT / "tests/faults/matrix.toml").read_text())["row"] if "play" in row]
HEALTHY = held_press(2, rest_s=0.5)
HURT, WITNESS = 0, 1
OFF_N = 0.1
EDGE_ROUNDS = 3
SWEEP_ROUNDS = 8  # once in so many it is judged whether a touch is over
BACK_S = 0.15  # a sensor that was silent is asked for its serial, for some rounds
DOUBT = (
    FrameFlags.UNTARED | FrameFlags.POC_INVALID | FrameFlags.ELECTRODE_MISSING | FrameFlags.RAIL | FrameFlags.FAULT
    | FrameFlags.DOUBT | FrameFlags.SENSOR_UNSURE | FrameFlags.SENSOR_OTHER
)  # fmt: skip
LATCHED = DOUBT & ~(FrameFlags.UNTARED | FrameFlags.POC_INVALID | FrameFlags.DOUBT) | (
    FrameFlags.PDC_MISSING | FrameFlags.TAC_MISSING | FrameFlags.TDC_MISSING
)  # fmt: skip
healthy_runs: dict[tuple[str, str], biotac.Batch] = {}


def lasting(wrong: np.ndarray, touched: np.ndarray) -> np.ndarray:
    """Wrong rows that outlast the edge of a touch: there one word more or less decides a round, or a sweep."""
    out = wrong.copy()
    edges = np.flatnonzero(np.diff(wrong, prepend=False, append=False))
    for begin, end in edges.reshape(-1, 2):
        is_end = touched[max(begin - 1, 0)] and not touched[min(end, len(touched) - 1)]
        out[begin:end] = end - begin > (SWEEP_ROUNDS if is_end else EDGE_ROUNDS)
    return out


def faults_of(play: dict[str, Any]) -> list[tuple[float, float]]:
    """When each begins, and for how long."""
    if "a_bit" in play:
        return []
    if "noise" not in play:
        return [(play["at_s"], play.get("seconds", 0.01))]
    draw, millisecond = random.Random(17), 0.001
    return [(k * millisecond, millisecond) for k in range(200, 2900) if draw.random() < play["noise"]]


def scenario(play: dict[str, Any]) -> str:
    kind, channel = play["kind"], play.get("channel")
    return HEALTHY + "".join(fault(kind, round(at_s, 3), seconds, HURT, channel) for at_s, seconds in faults_of(play))


def noisy(source: Source, a_bit: float) -> tuple[Source, np.ndarray, np.ndarray]:
    """Every bit of the hurt finger's words flips once in 1 / ``a_bit``; also which words have wrong parity, and which
    are wrong with good parity: two bits of a byte have flipped. Both (rounds, 44)."""
    odd = np.array([bin(byte).count("1") % 2 == 1 for byte in range(256)])
    counts = source.samples[:, HURT].astype(np.int64)
    high, low = (byte | ~odd[byte] for byte in (counts >> 5 << 1, (counts & 31) << 3))
    flips = (np.random.default_rng(17).random((*counts.shape, 16)) < a_bit) @ (1 << np.arange(16))
    high, low = high ^ flips >> 8, low ^ flips & 255
    wrong = ~(odd[high] & odd[low])
    samples = source.samples.copy()
    samples[:, HURT] = np.where(wrong, EmuFault.BAD_PARITY, high >> 1 << 5 | low >> 3)
    return replace(source, samples=samples), wrong, ~wrong & (samples[:, HURT] != counts)


def run(rig: Rig, source: Path | Source) -> tuple[biotac.Batch, wire.SensorStatus, biotac.Faults]:
    rig.need("scenarios")
    hand = rig.open_with(source) if isinstance(source, Source) else rig.open(str(source))
    hand.board.set_setting(wire.Setting.THERMAL_GAIN_MILLI, 0)  # results rest on the electrodes alone
    batch = hand.read_batch(100)
    assert hand.stats.frames_lost == hand.stats.crc_errors == 0
    status, latched = hand.sensor_status(HURT), hand.board.faults()
    rig.close()
    return batch, status, latched


def healthy(rig: Rig, tmp_path: Path, recorded: bool) -> biotac.Batch:
    """Without the fault; ``recorded``: the counts, played from a file."""
    key = rig.name, str(recorded)
    if key not in healthy_runs:
        path = tmp_path / "healthy.toml"
        path.write_text(HEALTHY)
        if recorded:
            path = counts_file(tmp_path / "healthy.npz", healthy(rig, tmp_path, False).frames)
        healthy_runs[key] = run(rig, path)[0]
    return healthy_runs[key]


def counts_file(path: Path, frames: np.ndarray, play: dict[str, Any] | None = None) -> Path:
    """The hurt finger's counts, with words that have good parity and are wrong."""
    faulty = of_finger(frames, HURT)
    counts = faulty["counts"].copy()
    if play is not None:
        counts[round(play["at_s"] * 100), : play["electrodes"]] = play["count"]
    np.savez(path, E=counts, PDC=faulty["pdc"], TAC=faulty["tac"], TDC=faulty["tdc"])
    return path


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["fault"])
def test_what_is_wrong_is_told(rig: Rig, tmp_path: Path, row: dict[str, Any]) -> None:
    play = row["play"]
    recorded = "electrodes" in play
    good = healthy(rig, tmp_path, recorded).frames
    source: Path | Source
    unseen: np.ndarray | bool = False
    if "a_bit" in play:
        path = tmp_path / "healthy.toml"
        path.write_text(HEALTHY)
        source, wrong_parity, wrong_count = noisy(load_source(path), play["a_bit"])
        unseen = wrong_count[:, ELECTRODE_SLOT].any(axis=1)
    elif recorded:
        source = counts_file(tmp_path / "hurt.npz", healthy(rig, tmp_path, False).frames, play)
    else:
        source = tmp_path / "hurt.toml"
        source.write_text(scenario(play))
    batch, status, latched = run(rig, source)
    frames = batch.frames
    assert of_finger(frames, WITNESS).tobytes() == of_finger(good, WITNESS).tobytes()
    good, faulty = of_finger(good, HURT), of_finger(frames, HURT)
    begin_us = good["t_us"][0]
    missing_s = (np.setdiff1d(good["t_us"], faulty["t_us"]) - begin_us) / 1e6
    windows = [(at_s - 0.01, at_s + seconds + BACK_S) for at_s, seconds in faults_of(play)]
    assert all(any(begin <= at_s <= end for begin, end in windows) for at_s in missing_s)
    good = good[np.isin(good["t_us"], faulty["t_us"])]
    off_n = np.abs(faulty["force_n"] - good["force_n"]).max(axis=1)  # NaN: no force
    touched, seen = ((rows["flags"] & FrameFlags.CONTACT) != 0 for rows in (good, faulty))
    wrong = (off_n > OFF_N) & ~np.asarray(unseen) | lasting(touched != seen, touched)
    unsaid = np.flatnonzero(wrong & ((faulty["flags"] & DOUBT) == 0))
    assert not len(unsaid), [(int(k), off_n[k], FrameFlags(int(faulty["flags"][k]))) for k in unsaid[:5]]
    for name in row.get("flags", []):
        assert (faulty["flags"] & FrameFlags[name]).any(), name
    for finger in (HURT, WITNESS):  # the board still knows all that a FRAME has told
        sent = int(np.bitwise_or.reduce(of_finger(frames, finger)["flags"])) & LATCHED
        assert latched.by_index[finger] & sent == sent
    if "counter" in row:
        assert getattr(status, row["counter"]) > 0
    if "a_bit" in play:
        assert status.words_parity == wrong_parity.sum()
        assert np.array_equal(faulty["counts"] == wire.INVALID_COUNT, wrong_parity[:, ELECTRODE_SLOT])
