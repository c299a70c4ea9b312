"""Recomputing a recording's results from the counts with other settings, into a new recording."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..board.stream import RESULTS
from ..core.finger import ROUND_US, Finger
from ..errors import CommandRefusedError, InputError
from ..keep.calibration import own_settings
from ..kernels.compiled import completed, grip_mn, pressure_force_100un, trust_of
from ..map import board_map
from ..map.board_map import BoardMap, opened
from ..version import __version__
from ..wire import messages_gen as wire
from ..wire import sensor_gen as sensor
from ..wire import slots
from ..wire.fields import INVALID_U32
from ..wire.frames import StructArray
from ..wire.identity import is_foreign
from ..wire.native import lib
from .reader import Recording
from .recorded_board import in_force
from .rewrite import Messages, rewrite
from .rounds import Command, FingerRounds, frames_and_tares, with_silence

Settings = dict[wire.Setting, int]
Show = Callable[[float], None]

#: Settings used by the maths after the tare; all others act on the tare machine and the stream.
RESULT_SETTINGS = {wire.Setting.FORCE_MODEL, *wire.CALIBRATION_SETTINGS} - {wire.Setting.THERMAL_GAIN_MILLI}
_KERNEL_FLAGS = wire.FrameFlags.POC_INVALID | wire.FrameFlags.POPULATION | wire.FrameFlags.OUTSIDE
_ACTIVE_Q4: int = lib.BT_THRESHOLD_ACTIVE_Q4
_ACTIVE_FOR_TORSION: int = lib.BT_THRESHOLD_ACTIVE_FOR_TORSION


def recompute(
    recording: Recording,
    out: Path,
    changes: Settings,
    *,
    keep_tare: bool = False,
    maps: Mapping[int, BoardMap | bytes] | None = None,
    show: Show = lambda share: None,
) -> list[str]:
    """Write ``recording`` to ``out``, with results recomputed under the settings as modified by ``changes``.

    The tare machine runs again over all counts, with the tares that the host set. With ``keep_tare``, each frame has
    the recorded tare and state, and only the results are recomputed. ``maps`` are the wrench maps in force, or their
    blobs, by finger; None: the recording's own. Returns notes for the user, as text. Raises InputError when the
    recording cannot be run through the tare machine, or a setting is out of range.
    """
    for setting, value in changes.items():
        spec = wire.SETTINGS[setting]
        if not spec.low <= value <= spec.high:
            raise InputError(
                f"{setting.name.lower()} is {value}, expected {spec.low} to {spec.high} {spec.unit}; choose another"
            )
    if not len(recording.wire):
        raise InputError(f"{recording.path} holds no frames; there is nothing to recompute")
    settings = recording.settings | changes
    calibrations = {finger: calibration.changed(changes) for finger, calibration in recording.calibrations.items()}
    own = own_settings(settings, calibrations)
    board_maps = {f: opened(own_map) for f, own_map in (recording.maps if maps is None else maps).items()}
    for finger in np.unique(recording.wire["finger"][(recording.wire["flags"] & wire.FrameFlags.MAPPED) != 0]).tolist():
        if finger not in board_maps:
            raise InputError(
                f"finger {finger} of {recording.path} used a wrench map that is not available; expected that "
                "map: record again with the board that has it"
            )
    notes: list[str] = []
    if keep_tare:
        if idle := sorted(s.name.lower() for s in set(changes) - RESULT_SETTINGS):
            raise InputError(f"{idle[0]} has no effect when tares are kept; omit --keep-tare")
        new, tares = _with_kept_tares(recording, settings, own, board_maps), None
        show(0.5)
    else:
        new, tares = _through_the_machine(recording, settings, own, board_maps, notes, lambda share: show(share / 2))
    made = {
        "from": recording.path.name,
        "software": __version__,
        "keep_tare": keep_tare,
        "changes": {s.name.lower(): value for s, value in changes.items()},
    }
    blobs = {finger: own_map.blob for finger, own_map in board_maps.items()}
    metadata = recording.metadata | in_force(settings, calibrations, blobs) | {"recomputed": json.dumps(made)}
    rewrite(recording, out, metadata, _replaced(new, tares), show=lambda share: show(0.5 + share / 2))
    return notes


def _with_kept_tares(
    recording: Recording, settings: Settings, own: Mapping[int, Settings], maps: Mapping[int, BoardMap]
) -> StructArray:
    """FRAME messages as recorded, with results that the kernels recompute from their counts and tares."""
    new: StructArray = recording.wire.copy()
    for finger in np.unique(new["finger"]):
        # Frames of another sensor have no results: the settings are not that sensor's.
        refused = wire.FrameFlags.SENSOR_OTHER | wire.FrameFlags.NOT_ASKED
        known = (new["flags"] & wire.FrameFlags.UNTARED == 0) & (new["flags"] & refused != refused)
        at = np.flatnonzero((new["finger"] == finger) & known & ~_is_foreign(recording, int(finger)))
        new[at] = _recomputed(new[at], own.get(int(finger), settings), maps.get(int(finger)))
    return new


def _recomputed(frames: StructArray, settings: Settings, own_map: BoardMap | None) -> StructArray:
    used = completed(frames)
    poc_um, force_100un, torque_mnmm, torsion_mnmm, kernel_flags = board_map.on_board_q4(used, settings, own_map)
    # The half widths depend on the noise, too, which a frame does not hold: unchanged results have the recorded ones.
    changed = ((frames["poc_um"] != poc_um) | (frames["force_100un"] != force_100un)).any(axis=1)
    for name in ("normal_half_mn", "shear_half_mn"):
        frames[name][changed] = wire.INVALID_COUNT
    frames["poc_um"], frames["force_100un"], frames["torque_mnmm"] = poc_um, force_100un, torque_mnmm
    frames["torsion_mnmm"] = torsion_mnmm
    frames["normal_mn"], frames["shear_mn"] = grip_mn(poc_um, force_100un).T
    frames["pressure_force_100un"] = pressure_force_100un(
        frames["pdc_filtered_q4"], frames["pdc_tare_q4"], settings[wire.Setting.PRESSURE_GAIN_NN]
    )
    computed = _KERNEL_FLAGS | wire.FrameFlags.TORSION_OK | wire.FrameFlags.NOT_ASKED | wire.FrameFlags.MAPPED
    flags = frames["flags"] & ~np.uint32(computed) | kernel_flags & np.uint32(_KERNEL_FLAGS)
    flags |= np.uint32(0 if own_map is None else wire.FrameFlags.MAPPED)
    flags |= np.where(_torsion_ok(frames, poc_um), np.uint32(wire.FrameFlags.TORSION_OK), np.uint32(0))
    frames["flags"] = flags
    frames["trust"] = trust_of(frames)
    return frames


def _torsion_ok(frames: StructArray, poc_um: NDArray[np.int16]) -> NDArray[np.bool_]:
    """TORSION_OK of SPEC.md, as far as a frame can tell: whether the energy suffices is known from the old flags."""
    down = (poc_um[:, 2] <= -sensor.CORE_RADIUS_UM // 2) & (poc_um[:, 2] != wire.INVALID_I16)
    missing = (frames["counts"] == wire.INVALID_COUNT) | (frames["tare_q4"] == wire.INVALID_COUNT)
    moved = np.abs(frames["counts"].astype(np.int32) * 16 - frames["tare_q4"]) >= _ACTIVE_Q4
    active = (moved & ~missing).sum(axis=1) >= _ACTIVE_FOR_TORSION
    trouble = (frames["flags"] & wire.FrameFlags.ELECTRODE_OUT) != 0
    had = (frames["flags"] & wire.FrameFlags.TORSION_OK) != 0
    strong = (frames["flags"] & wire.FrameFlags.POC_LOW) == 0
    return np.asarray(down & active & ~trouble & (had | strong))


def _through_the_machine(
    recording: Recording,
    settings: Settings,
    own: Mapping[int, Settings],
    maps: Mapping[int, BoardMap],
    notes: list[str],
    show: Show,
) -> tuple[StructArray, dict[int, wire.Tare]]:
    """FRAME messages in order of arrival, and TARE messages by the row that each precedes."""
    new = np.empty_like(recording.wire)
    tares: dict[int, wire.Tare] = {}
    ran = 0

    def ran_rows(rows: int) -> None:
        nonlocal ran
        ran += rows
        show(min(1.0, ran / (2 * len(new))))

    for at, rounds in machine_rounds(recording, maps, notes):
        frames, changes = frames_and_tares(rounds, own.get(rounds.finger, settings), ran_rows)
        if len(frames) != len(at):
            raise InputError(
                f"{recording.path}: finger {rounds.finger} has frames without a single valid count; add --keep-tare to "
                "use the recorded tares"
            )
        frames["seq"] = recording.wire["seq"][at]
        frames["flags"] |= recording.wire["flags"][at] & np.uint32(wire.FrameFlags.SENSOR_UNSURE)  # not in counts
        frames["trust"] = trust_of(frames)
        new[at] = frames
        for row, message in changes.items():
            tares[int(at[row])] = dataclasses.replace(message, seq=int(frames["seq"][row]))
    return new, tares


def machine_rounds(
    recording: Recording, maps: Mapping[int, BoardMap | bytes], notes: list[str]
) -> Iterator[tuple[NDArray[np.int64], FingerRounds]]:
    """By finger, the rows in ``recording.wire`` and the rounds for the tare machine.

    Raises InputError where rounds are missing, or are of two sensors.
    """
    if len(recording.idle) or recording.frames_lost or recording.disordered:
        seen = "heartbeats" if len(recording.idle) else "lost frames" if recording.frames_lost else "a restart"
        raise InputError(
            f"{recording.path} has {seen}, but the tare machine needs the counts of every round; record all of them "
            "(without --touched), or recompute with --keep-tare"
        )
    if np.any(recording.wire["flags"] & wire.FrameFlags.SENSOR_OTHER):
        raise InputError(
            f"{recording.path} has a sensor that was plugged in during the recording and tared afresh; cut it "
            "there, or recompute with --keep-tare"
        )
    for finger in np.unique(recording.wire["finger"]).tolist():
        at = np.flatnonzero(recording.wire["finger"] == finger)
        own_map = maps.get(finger)
        yield at, with_silence(_rounds(recording, at, None if own_map is None else opened(own_map), notes))


def _rounds(recording: Recording, at: NDArray[np.int64], own_map: BoardMap | None, notes: list[str]) -> FingerRounds:
    sent = recording.wire[at]
    finger = int(sent["finger"][0])
    row_of = {int(seq): row for row, seq in reversed(list(enumerate(sent["seq"])))}
    tares: dict[int, Command] = {}
    # Hold, release and lapsed hold of the finger, by row: from the flag HELD, release from the TARE message.
    edges = np.diff(((sent["flags"] & wire.FrameFlags.HELD) != 0).astype(np.int8), prepend=np.int8(0))
    holds = {row: Finger.hold if edges[row] > 0 else Finger.lapse for row in np.flatnonzero(edges).tolist()}
    for message in recording.messages:
        if not isinstance(message, wire.Tare) or message.finger != finger or message.seq not in row_of:
            continue
        row = row_of[message.seq]
        if message.reason == wire.TareReason.HOST_RELEASE:
            holds[row] = Finger.release
        elif message.reason in (wire.TareReason.HOST_NOW, wire.TareReason.HOST_SET):
            q16 = np.array([*message.tare_q16, message.pdc_tare_q16])
            counts = np.where(q16 == INVALID_U32, np.nan, q16 / 65536)
            _add_tare(tares, row, counts, message.reason == wire.TareReason.HOST_NOW)
    if 0 not in tares and not int(sent["flags"][0]) & wire.FrameFlags.UNTARED:
        q4 = np.append(sent["tare_q4"][0], sent["pdc_tare_q4"][0])
        _add_tare(tares, 0, np.where(q4 == wire.INVALID_COUNT, np.nan, q4 / 16), False)
        notes.append(
            f"finger {finger} was tared before the recording began; its first frame's tare is used at the start"
        )
    if int(sent["flags"][0]) & (wire.FrameFlags.SENSOR_FAULT | wire.FrameFlags.ELECTRODE_OUT):
        notes.append(f"finger {finger} was broken before the recording began, by what the recording does not show")
    quantities = RESULTS | wire.QuantityFlags.REST_FRAMES
    t_us = recording.frames["t_us"][at]
    pac = _pac_at(t_us, recording.pac[recording.pac["finger"] == finger])
    if (sent["flags"] & wire.FrameFlags.SENSOR_FAULT).any() and (pac == wire.INVALID_COUNT).all():
        notes.append(f"finger {finger}: PAC was not recorded, by which the board knows another sensor's words")
    commands = {row: [given[row] for given in (tares, holds) if row in given] for row in {*tares, *holds}}
    pdc, tac, tdc = (sent[name] for name in ("pdc", "tac", "tdc"))
    foreign = _is_foreign(recording, finger)
    return FingerRounds(finger, sent["counts"], pdc, tac, tdc, pac, t_us, commands, quantities, own_map, foreign)


def _is_foreign(recording: Recording, finger: int) -> bool:
    """Whether the sensor is no BioTac with 19 electrodes: by the serial number, or by the board's flag."""
    statuses = [m for m in recording.messages if isinstance(m, wire.SensorStatus) and m.finger == finger]
    by_serial = any(is_foreign(info.serial) for info in recording.sensors if info.finger == finger)
    return by_serial or any(m.sensor_fault == wire.SensorFault.OTHER_KIND for m in statuses)


def _pac_at(t_us: NDArray[np.int64], rows: StructArray) -> NDArray[np.uint16]:
    """PAC (n, 22) of the rounds that began at ``t_us`` (n,), INVALID_COUNT where none was recorded."""
    pac = np.full((len(t_us), len(slots.PAC_SLOT)), wire.INVALID_COUNT, np.uint16)
    at = np.searchsorted(t_us, rows["t_us"], "right") - 1
    recorded = (at >= 0) & (rows["t_us"] - t_us[at] < ROUND_US)
    pac[at[recorded]] = rows["pac"][recorded]
    return pac


def _add_tare(tares: dict[int, Command], row: int, values: NDArray[np.float64], now: bool) -> None:
    """Add a tare of 19 electrodes and pressure to ``tares``; one without all electrodes cannot be set again."""
    if not np.isnan(values[:-1]).any():
        tares[row] = partial(_tare, values, now)


def _tare(values: NDArray[np.float64], now: bool, finger: Finger) -> None:
    """``now``: the host asked for the latest means; a finger that has none gets the board's."""
    with suppress(CommandRefusedError):
        if now:
            finger.tare_now()
            return
    finger.set_tare(values[:-1], None if np.isnan(values[-1]) else float(values[-1]))


def _replaced(new: StructArray, tares: dict[int, wire.Tare] | None) -> Callable[[Messages], Messages]:
    """Messages as they were, with FRAMEs replaced, and TAREs too unless ``tares`` is None."""
    rows = iter(range(len(new)))

    def change(messages: Messages) -> Messages:
        for message_id, payload in messages:
            if message_id == wire.FrameMessage.ID:
                row = next(rows)
                if tares is not None and row in tares:
                    yield wire.Tare.ID, tares[row].pack()
                yield message_id, new[row].tobytes()
            elif message_id != wire.Tare.ID or tares is None:
                yield message_id, payload

    return change
