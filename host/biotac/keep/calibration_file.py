"""A calibration as JSON: for people to read, keep and send, with its provenance."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ..documents import Provenance, parse_document, read_document, sealed
from ..wire import messages_gen as wire
from .calibration import Calibration

FORMAT = "biotac-calibration/1"
_CURE = "expected a calibration, as `biotac calibrate get` writes it"


def to_dict(calibration: Calibration, provenance: Provenance | None = None) -> dict[str, Any]:
    """The content of a file, with the keys in order."""
    return {
        "format": FORMAT,
        "serial": calibration.serial,
        "made_s": calibration.made_s,
        "poc_weights": wire.PocWeights(calibration.poc_weights).name,
        "force_gain_nn": dict(zip("xyz", calibration.force_gain_nn, strict=True)),
        "torque_gain_nn": dict(zip("yz", calibration.torque_gain_nn, strict=True)),
        "thermal_gain_milli": calibration.thermal_gain_milli,
        "pressure_gain_nn": calibration.pressure_gain_nn,
        "provenance": provenance or {},
    }


KEYS = tuple(to_dict(Calibration()))


def from_dict(tree: Any) -> Calibration:
    """Inverse of to_dict, without the provenance. Raises ValueError that says which key is wrong, and why."""
    if not isinstance(tree, dict) or tree.get("format") != FORMAT:
        raise ValueError(f'it has no "format": "{FORMAT}"')
    for key in tree:
        if key not in KEYS:
            raise ValueError(f"key {key!r} is unknown; expected {', '.join(KEYS)}")
    for key in KEYS:
        if key not in tree and key != "provenance":
            raise ValueError(f"key {key!r} is missing")
    if not isinstance(tree.get("provenance", {}), dict):
        raise ValueError("provenance is not an object; give each fact its own key")
    weights = [w.name for w in wire.PocWeights]
    if tree["poc_weights"] not in weights:
        raise ValueError(f"poc_weights is {tree['poc_weights']!r}, expected one of {', '.join(weights)}")
    values = {key: value for key, value in tree.items() if key not in ("format", "provenance")}
    for key, axes in (("force_gain_nn", "xyz"), ("torque_gain_nn", "yz")):
        if not isinstance(tree[key], dict) or sorted(tree[key]) != list(axes):
            raise ValueError(f"{key} is {tree[key]!r}, expected an object with {', '.join(axes)}")
        values[key] = tuple(tree[key][axis] for axis in axes)
    return Calibration(**values | {"poc_weights": wire.PocWeights[tree["poc_weights"]]})


def dumps(calibration: Calibration, provenance: Provenance | None = None) -> str:
    return json.dumps(sealed(to_dict(calibration, provenance)), indent=2) + "\n"


def loads(text: str, where: str) -> Calibration:
    """The calibration in a file's text. Raises InputError that begins with ``where`` and names the fault."""
    return parse_document(text, where, FORMAT, from_dict, _CURE)


def load(path: Path) -> Calibration:
    """The calibration in a file. Raises InputError when it cannot be read or used."""
    return read_document(path, FORMAT, from_dict, _CURE)
