"""Frames as a pandas DataFrame or an xarray Dataset; either library is imported only when needed."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ..errors import InputError
from ..wire.fields import FRAME_FIELDS
from ..wire.frames import StructArray


def to_pandas(frames: StructArray, stamp_ns: Any) -> Any:
    """A DataFrame with the flat names of host/docs/reference/rows.md, one row per frame, indexed by ``stamp`` (UTC).

    Integer fields that can be missing are nullable (UInt16); all others have NumPy types.
    """
    pandas = _imported("pandas")
    columns: dict[str, Any] = {}
    for field in FRAME_FIELDS:
        values = frames[field.name].reshape(len(frames), -1)
        for k, name in enumerate(field.flat_names()):
            column = values[:, k].copy()
            if field.invalid is not None:
                column = pandas.arrays.IntegerArray(column, column == field.invalid)
            columns[name] = column
    index = pandas.DatetimeIndex(pandas.to_datetime(stamp_ns, unit="ns", utc=True), name="stamp")
    return pandas.DataFrame(columns, index=index)


def to_xarray(frames: StructArray, stamp_ns: Any) -> Any:
    """A Dataset with dimensions ``row``, ``axis`` and ``electrode``, and units as attributes.

    Missing counts are NaN (float32 holds 0 to 4095 exactly).
    """
    xarray = _imported("xarray")
    data: dict[str, Any] = {}
    labels: dict[str, Any] = {"stamp": ("row", stamp_ns.astype("datetime64[ns]"))}
    for field in FRAME_FIELDS:
        values = frames[field.name]
        if field.invalid is not None:
            values = values.astype("float32")
            values[frames[field.name] == field.invalid] = float("nan")
        inner = () if not field.parts else ("axis",) if len(field.parts) == 3 else ("electrode",)
        labels |= {name: list(field.parts) for name in inner}
        data[field.name] = (("row", *inner), values, {"units": field.unit, "long_name": field.what})
    return xarray.Dataset(data, labels)


def _imported(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        raise InputError(f"{name} is not installed; pip install 'biotac-gateway[export]'") from error
