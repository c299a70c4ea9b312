#!/usr/bin/env bash
# xarray reads a NetCDF 3 variable that is marked _Unsigned as unsigned, but drops the mark when the data set that was
# read is written again: numbers from 2^31 on come back negative, without a warning. Only with a _FillValue is it kept.
# Seen with xarray 2026.9.0 and SciPy 1.17.1 on Python 3.11; fails where that has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check xarray==2026.9.0 scipy==1.17.1 numpy==2.4.6
cd "$folder"
venv/bin/python -W error - <<'END'
import numpy as np
import xarray

values = np.array([7, 2**31 + 7], np.uint32)
made = xarray.Dataset({"bits": ("x", values, {"_Unsigned": "true"})})
made["bits"].encoding["dtype"] = "int32"
made.to_netcdf("first.nc", engine="scipy")
first = xarray.load_dataset("first.nc", engine="scipy")
first.to_netcdf("second.nc", engine="scipy")
second = xarray.load_dataset("second.nc", engine="scipy")
print(f"xarray {xarray.__version__}: read {first.bits.values} {first.bits.dtype}, with {first.bits.encoding}")
print(f"written again and read: {second.bits.values} {second.bits.dtype}")
assert first.bits.dtype == np.uint32 and (first.bits.values == values).all()
assert second.bits.dtype == np.int32 and second.bits.values[1] == 7 - 2**31
END
