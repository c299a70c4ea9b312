#!/usr/bin/env python3
"""Write everything that is derived from protocol/*.toml, and the population map.

tools/gen_protocol.py           write the generated files
tools/gen_protocol.py --check   exit 1, naming the files, when any of them has drifted
"""

from __future__ import annotations

import sys
from pathlib import Path

from make.committed import ROOT, write_or_check
from protogen import (
    c_client,
    c_crc,
    c_estimates,
    c_map,
    c_population,
    c_rsqrt,
    c_sensor,
    c_sums,
    c_wire,
    docs,
    emu,
    python_code,
    schema,
    touch,
)


def outputs(root: Path) -> dict[Path, str]:
    """Every generated path, with the text it must have."""
    contract = schema.load(root / "protocol")
    sensors = emu.load(root / "protocol", contract)
    verdicts = touch.load(root)
    return {
        root / "firmware/core/wire/sensor_gen.h": c_sensor.header(contract),
        root / "firmware/core/wire/sensor_gen.c": c_sensor.source(contract),
        root / "firmware/core/wire/crc32_gen.c": c_crc.source(),
        root / "firmware/core/signal/sums_gen.h": c_sums.header(contract),
        root / "firmware/core/signal/sums_gen.c": c_sums.source(contract),
        root / "firmware/core/solve/rsqrt_gen.h": c_rsqrt.header(contract),
        root / "firmware/core/solve/rsqrt_gen.c": c_rsqrt.source(contract),
        root / "firmware/core/map/map_gen.h": c_map.header(contract),
        root / "firmware/core/map/population_gen.h": c_population.header(root),
        root / "firmware/core/map/estimates_gen.h": c_estimates.header(root),
        root / "firmware/client/biotac_client_gen.h": c_client.header(contract),
        root / "firmware/core/wire/messages_gen.h": c_wire.header(contract),
        root / "firmware/core/wire/touch_gen.h": touch.header(verdicts),
        root / "protocol/SPEC.md": touch.spec(root, verdicts),
        root / "firmware/core/wire/messages_gen.c": c_wire.source(contract),
        root / "host/biotac/wire/sensor_gen.py": python_code.sensor(contract),
        root / "host/biotac/wire/messages_gen.py": python_code.wire(contract),
        root / "host/biotac/wire/dtypes_gen.py": python_code.dtypes(contract),
        root / "host/biotac/wire/map_gen.py": python_code.wrench_map(contract),
        root / "firmware/emu/fault_gen.h": emu.faults_header(root / "protocol"),
        root / "host/biotac/sim/fault_gen.py": emu.faults_python(root / "protocol"),
        root / "firmware/sensor_board/emu_gen.h": emu.header(sensors),
        root / "firmware/sensor_board/emu_gen.c": emu.source(sensors),
        root / "host/biotac-rig/biotac_rig/emu_gen.py": emu.python(sensors),
        root / "protocol/MESSAGES.md": docs.messages(contract),
        root / docs.CONTROLLER: docs.controller(root, contract),
        root / "protocol/schema.json": schema.canonical(contract, with_docs=True),
    }


if __name__ == "__main__":
    sys.exit(write_or_check(outputs(ROOT), "protocol/*.toml"))
