"""The sped-up emulated core gives the published core's results."""

import json
import subprocess
from pathlib import Path

import pytest


@pytest.mark.nightly
@pytest.mark.usefixtures("emulated_pico")
def test_every_opcode_does_what_it_does_as_published() -> None:
    run = subprocess.run(["node", Path(__file__).with_name("both_cores.mjs")], check=True, capture_output=True)
    answer = json.loads(run.stdout)
    assert answer["executed"] > 100_000
    assert answer["differences"] == []
