"""Every on-board result against the float64 reference, computed from the frame's own counts and tare.

The bounds follow from the board's number formats alone. firmware/reference/kernel_bounds.h derives them, and
tests/core/solve/test_kernels.c searches for inputs that come close.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernels.compiled import NN_PER_N, TORQUE_GAINS, Results, Settings, completed, reference_q4
from ..map import population
from ..map.board_map import BoardMap, opened, pdc_above_rest_q4
from ..map.bound import error_bound
from ..map.float64 import replace_gains
from ..map.published import Verdict, published
from ..wire import map_gen as _map
from ..wire import messages_gen as wire
from ..wire.frames import UM_PER_MM, StructArray, electrode_signals, to_units
from ..wire.native import ffi, lib
from ..wire.sensor_gen import CORE_RADIUS_UM
from .pressure_check import FORCE_BOUND_N, PressureCheck

#: Of the PoC's distance and of each axis of force, see firmware/reference/kernel_bounds.h.
POC_BOUND_UM: float = lib.bt_poc_bound_um
FORCE_BOUND_MN: float = lib.bt_force_bound_mn

#: Name, unit, value sent, steps per unit, true value, and largest difference allowed; each (n, axes).
Quantity = tuple[str, str, NDArray[Any], int, NDArray[np.float64], NDArray[np.float64] | float]

FINDINGS = 20  # violations described in words; the rest are only counted


def torque_bound_nmm(messages: StructArray, truth: Results, settings: Settings) -> NDArray[np.float64]:
    """Bound of each torque axis, N*mm, shape (n, 3): it grows with the signals and, for x, the force.

    firmware/reference/kernel_bounds.h has the formulas.
    """
    size = np.nansum(np.abs(electrode_signals(messages)), axis=1)
    gains = np.array([abs(settings[s]) / NN_PER_N for s in TORQUE_GAINS])
    with np.errstate(divide="ignore", invalid="ignore"):
        sums = np.nan_to_num(np.abs(truth.torque_nmm[:, 1:]) * 1000 / gains, posinf=0.0)
    force = np.abs(truth.force_n[:, 1:]).sum(axis=1)
    out = np.empty((len(messages), 3))
    columns = [np.ascontiguousarray(a) for a in (size, sums, force, gains)]
    pointers = [ffi.from_buffer("double[]", a) for a in (*columns, out)]
    lib.bt_torque_bounds_mnmm(len(messages), *pointers)
    return out / 1000


@dataclass
class CrossCheck:
    """Outcome over any number of frames. Maxima are over valid results, and 0 while there are none."""

    frames: int = 0
    violations: int = 0
    poc_um_max: float = 0.0
    force_mn_max: float = 0.0
    torque_nmm_max: float = 0.0
    torque_nmm_bound: float = 0.0  # the largest that applied to any frame
    pressure: PressureCheck = field(default_factory=PressureCheck)
    mapped: int = 0  # frames with a wrench map; their force has a bound of its own
    mapped_force_mn_bound: float = 0.0  # the largest of those, and of frames with the population map
    findings: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """As JSON types: the maxima beside their bounds."""
        return {
            "frames": self.frames,
            "violations": self.violations,
            "poc_um_max": self.poc_um_max,
            "poc_um_bound": POC_BOUND_UM,
            "force_mn_max": self.force_mn_max,
            "force_mn_bound": max(FORCE_BOUND_MN, self.mapped_force_mn_bound),
            "torque_nmm_max": self.torque_nmm_max,
            "torque_nmm_bound": self.torque_nmm_bound,
            "pressure_mn_max": self.pressure.force_n_max * 1e3,
            "pressure_mn_bound": FORCE_BOUND_N * 1e3,
            "pdc_filtered_max": self.pressure.filter_max,
            "pdc_filtered_bound": self.pressure.filter_bound,
            "pdc_filter_starts": self.pressure.starts,
            "mapped": self.mapped,
            "findings": self.findings,
        }

    def add(
        self,
        messages: StructArray,
        settings: Settings,
        own: Mapping[int, Settings] | None = None,
        maps: Mapping[int, BoardMap | bytes] | None = None,
    ) -> None:
        """Check FRAME messages (n,) as sent on the wire, live or from a file.

        ``own`` has the settings of fingers with a calibration (Hand.board.finger_settings, Recording.finger_settings).
        ``maps`` has the wrench maps in force or their blobs (Hand.board.maps, Recording.maps). Raises InputError for a
        map that a board would refuse.
        """
        own, maps = own or {}, maps or {}
        # A repeated wrench belongs to an earlier FRAME, and is checked there.
        messages = completed(messages[(messages["flags"] & wire.FrameFlags.REPEATED) == 0])
        mapped = (messages["flags"] & wire.FrameFlags.MAPPED) != 0
        for finger in np.unique(messages["finger"][mapped]).tolist():
            rows = messages[mapped & (messages["finger"] == finger)]
            if finger in maps:
                self._add(rows, own.get(finger, settings), opened(maps[finger]))
            else:
                self._find_all(rows, np.ones(len(rows), bool), "MAPPED is set, but this finger's wrench map is unknown")
        for finger, calibrated in own.items():
            self._add(messages[~mapped & (messages["finger"] == finger)], calibrated)
        self._add(messages[~mapped & ~np.isin(messages["finger"], list(own))], settings)

    def _add(self, messages: StructArray, settings: Settings, own_map: BoardMap | None = None) -> None:
        if not len(messages):
            return
        untared = (messages["flags"] & wire.FrameFlags.UNTARED) != 0
        truth = reference_q4(messages["counts"], messages["tare_q4"], settings)
        force_bound: NDArray[np.float64] | float = FORCE_BOUND_MN
        torsion, torsion_bound = (np.full((len(messages), 1), value) for value in (np.nan, 0.0))
        used = population.on_board() if own_map is None and population.in_force(settings) else own_map
        if used is None:
            torque_bound = torque_bound_nmm(messages, truth, settings)
        else:
            force_bound, torque_bound, torsion_bound, verdict = _by_map(messages, used, truth, torsion, settings)
            self.mapped += 0 if own_map is None else len(messages)
            self._compare_flags(messages, verdict, used)
        if not isinstance(force_bound, float):
            self.mapped_force_mn_bound = max(self.mapped_force_mn_bound, float(force_bound.max()))
        for own_bound in (torque_bound, torsion_bound):
            self.torque_nmm_bound = max(self.torque_nmm_bound, float(own_bound[~untared].max(initial=0.0)))
        quantities: tuple[Quantity, ...] = (
            ("PoC", "um", messages["poc_um"], 1, truth.poc_mm * 1e3, POC_BOUND_UM),
            ("force", "mN", messages["force_100un"], 10, truth.force_n * 1e3, force_bound),
            ("torque", "N*mm", messages["torque_mnmm"], 1000, truth.torque_nmm, torque_bound),
            ("torsion", "N*mm", messages["torsion_mnmm"][:, None], 1000, torsion, torsion_bound),
        )
        largest = {}
        for quantity in quantities:
            name, _, sent, per_unit, values, _ = quantity
            values[untared | not_asked(messages, sent)] = np.nan  # without a tare there is no true value
            error = np.abs(to_units(sent, per_unit) - values)
            if name == "PoC":  # the PoC is one point: the error is a distance; force and torque count per axis
                error = np.sqrt((error**2).sum(axis=1, keepdims=True))
            largest[name] = worst(error)
            self._compare(messages, quantity, error)
        self.poc_um_max = max(self.poc_um_max, largest["PoC"])
        self.force_mn_max = max(self.force_mn_max, largest["force"])
        self.torque_nmm_max = max(self.torque_nmm_max, largest["torque"], largest["torsion"])
        flagged = (messages["flags"] & wire.FrameFlags.POC_INVALID) != 0
        marked = (messages["poc_um"] == wire.INVALID_I16).any(axis=1)
        wrong = (flagged != marked) & ~not_asked(messages, messages["poc_um"])
        self._find_all(messages, wrong, "the POC_INVALID flag contradicts the PoC")
        for row, finding in self.pressure.add(messages, settings):
            self._find(messages, row, finding)
        self.frames += len(messages)

    def _compare_flags(self, messages: StructArray, verdict: Verdict, used: BoardMap) -> None:
        """With a force POPULATION or MAPPED must be set, and OUTSIDE where the signals are unlike the training."""
        made = (messages["force_100un"] != wire.INVALID_I32).all(axis=1)
        own = wire.FrameFlags.POPULATION if used is population.on_board() else wire.FrameFlags.MAPPED
        wanted = own | verdict.flags
        seen = messages["flags"] & (wire.FrameFlags.POPULATION | wire.FrameFlags.MAPPED | wire.FrameFlags.OUTSIDE)
        self._find_all(messages, made & (seen != wanted), "POPULATION or OUTSIDE contradicts the signals")

    def _find_all(self, messages: StructArray, wrong: NDArray[np.bool_], finding: str) -> None:
        for k in np.flatnonzero(wrong):
            self._find(messages, int(k), finding)

    def _find(self, messages: StructArray, k: int, finding: str) -> None:
        self.violations += 1
        if len(self.findings) < FINDINGS:
            frame = f"finger {messages['finger'][k]} frame {messages['seq'][k]} ({messages['t_us'][k] / 1e6:.3f} s)"
            self.findings.append(f"{frame}: {finding}")

    def _compare(self, messages: StructArray, quantity: Quantity, error: NDArray[np.float64]) -> None:
        name, unit, sent, _, truth, bound = quantity
        one_sided = np.any(np.isnan(to_units(sent, 1)) != np.isnan(truth), axis=1)
        outside = np.any(error > bound, axis=1)
        for k in np.flatnonzero(one_sided | outside):
            if one_sided[k]:
                self._find(messages, int(k), f"{name} is valid on one side only")
                continue
            limits = np.broadcast_to(bound, error.shape)[k]
            axis = int(np.nanargmax(error[k] - limits))
            suffix = f" {'xyz'[axis]}" if error.shape[1] == 3 else ""
            off = f"off by {error[k, axis]:.4g} {unit}, bound {limits[axis]:.4g} {unit}"
            self._find(messages, int(k), f"{name}{suffix} {off}")


def _by_map(
    messages: StructArray, used: BoardMap, truth: Results, torsion: NDArray[np.float64], settings: Settings
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], Verdict]:
    """Replace force and torque in ``truth``, and ``torsion`` (n, 1), by the exact results of an own map's integers.

    The package's map counts as trained. Returns the bounds of force, mN, and torque, N*mm, both (n, 3), and of torsion,
    N*mm, (n, 1); then the map's verdict.
    """
    wanted = population.unrounded(population.blocks()) if used is population.on_board() else None
    frames = messages["counts"], messages["tare_q4"], pdc_above_rest_q4(messages)
    (wrench, verdict), off = published(used, *frames, wanted), error_bound(used, wanted, *frames)
    off = verdict.bound(off)
    replace_gains(used, wrench, truth.poc_mm, truth.force_n, truth.torque_nmm, torsion[:, 0])
    force_off, torque_off, torsion_off = np.split(np.nan_to_num(off), (3, 6), axis=1)
    if used.axes < _map.AXES_TORSION:
        torsion_off = np.zeros_like(torsion)
    if used.axes == 3:
        # Mx is derived from this force, with a lever of at most the core's radius
        torque_off = torque_bound_nmm(messages, truth, settings)
        torque_off[:, 0] += CORE_RADIUS_UM / UM_PER_MM * force_off[:, 1:].sum(axis=1)
    return 1e3 * force_off, torque_off, torsion_off, verdict


def not_asked(messages: StructArray, sent: NDArray[Any]) -> NDArray[np.bool_]:
    """Frames (n,) with a result ``sent`` (n, k) that nobody subscribed to: all of it is marked invalid."""
    asked_for_all = (messages["flags"] & wire.FrameFlags.NOT_ASKED) == 0
    return np.asarray(~asked_for_all & np.isnan(to_units(sent, 1)).all(axis=1))


def worst(error: NDArray[np.float64]) -> float:
    """The largest valid error, 0 if there is none."""
    return float(np.nanmax(error, initial=0.0)) if not np.isnan(error).all() else 0.0
