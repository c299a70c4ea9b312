"""Every on-board result against the float64 reference, fed with the counts and the tare of its frame.

The bounds follow from rounding alone: the board's sums are exact, so a published value is off by at
most half a unit per axis, plus what its inner steps round (see each constant). A single altered digit
breaks them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from . import _wire as wire
from .core import Settings, reference_q4
from .frames import StructArray, to_units

# um per axis: 0.5 for the published um, 0.0005 for the nm before it, 0.0005 for the square root.
POC_BOUND_UM = 3**0.5 * (0.5 + 0.001)
# mN per axis: half of 0.1 mN, and half a uN before it.
FORCE_BOUND_MN = 0.05 + 0.0005 + 1e-9
# N*mm per axis: half a mN*mm; the um rounding of the torque sum at the largest gain (0.1 N/count,
# 0.5/16 count*um) adds 0.0031 mN*mm, the lever's inputs (1 nm, 1 uN) 0.11 mN*mm at 100 N.
TORQUE_BOUND_NMM = (0.5 + 0.12) / 1000


@dataclass
class CrossCheck:
    """Outcome over any number of frames. Maxima are over valid results; 0 while there are none."""

    frames: int = 0
    violations: int = 0
    poc_um_max: float = 0.0
    force_mn_max: float = 0.0
    torque_nmm_max: float = 0.0
    findings: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """For JSON: the maxima beside the bounds they are held to."""
        return {
            "frames": self.frames,
            "violations": self.violations,
            "poc_um_max": self.poc_um_max,
            "poc_um_bound": POC_BOUND_UM,
            "force_mn_max": self.force_mn_max,
            "force_mn_bound": FORCE_BOUND_MN,
            "torque_nmm_max": self.torque_nmm_max,
            "torque_nmm_bound": TORQUE_BOUND_NMM,
            "findings": self.findings[:20],
        }

    def add(self, messages: StructArray, settings: Settings) -> None:
        """Check FRAME messages (n,) as they came over the wire; live or from a file."""
        if not len(messages):
            return
        flags = messages["flags"]
        untared = (flags & wire.FrameFlags.UNTARED) != 0
        saturated = (flags & wire.FrameFlags.SATURATED) != 0
        truth = reference_q4(messages["counts"], messages["tare_q4"], settings)
        for name, got, want, scale, bound in (
            ("PoC", to_units(messages["poc_um"], 1), truth.poc_mm * 1e3, "um", POC_BOUND_UM),
            ("force", to_units(messages["force_100un"], 10), truth.force_n * 1e3, "mN", FORCE_BOUND_MN),
            ("torque", to_units(messages["torque_mnmm"], 1000), truth.torque_nmm, "N*mm", TORQUE_BOUND_NMM),
        ):
            want = np.where(untared[:, None], np.nan, want)
            error = np.abs(got - want)
            # The PoC is one point: its error is a distance. Force and torque count per axis.
            size = np.sqrt((error**2).sum(axis=1)) if name == "PoC" else largest(error)
            wrong = (size > bound) | np.any(np.isnan(got) != np.isnan(want), axis=1)
            wrong &= ~saturated if name != "PoC" else True
            self._note(name, messages, size, wrong, scale, bound)
            counted = size[~np.isnan(size) & ~saturated]
            maximum = float(counted.max()) if len(counted) else 0.0
            key = {"PoC": "poc_um_max", "force": "force_mn_max", "torque": "torque_nmm_max"}[name]
            setattr(self, key, max(getattr(self, key), maximum))
        self.frames += len(messages)

    def _note(self, name: str, messages: StructArray, size: Any, wrong: Any, unit: str, bound: float) -> None:
        for k in np.flatnonzero(wrong):
            self.violations += 1
            if len(self.findings) < 20:
                off = "valid on one side only" if np.isnan(size[k]) else f"off by {size[k]:.4g} {unit}"
                self.findings.append(
                    f"finger {messages['finger'][k]} frame {messages['seq'][k]} ({messages['t_us'][k] / 1e6:.3f} s): "
                    f"{name} {off}, bound {bound:.4g} {unit}"
                )


def largest(error: Any) -> Any:
    """Largest per row, NaN only where all are."""
    filled = np.where(np.isnan(error), -1.0, error).max(axis=1)
    return np.where(filled < 0, np.nan, filled)
