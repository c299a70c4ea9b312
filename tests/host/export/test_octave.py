"""Exports as Octave reads them: no text moves a number, hides one or makes it complex."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import biotac
from biotac.cli.main import main

SCRIPT = r"""
m = csvread("a.csv", 1, 0); f = fopen("a.csv"); head = strsplit(fgetl(f), ","); fclose(f);
h = load("a.h5").finger1; s = load("a.mat").finger1.frames;
column = @(name) m(m(:, 1) == 1, strcmp(head, name));
printf("%d %d\n", isreal(m), isfield(h, "bands") && isfield(h, "pac") && isfield(h.frames, "wrench_age_ms"));
printf("%.6f ", sum(column("applied_z_n")), sum(h.frames.applied_n(3, :)), sum(s.applied_n(:, 3)));
printf("%.6f ", column("counts_E7")(200) - column("tare_E7")(200), double(s.counts(200, 7)) - s.tare(200, 7));
printf("%.6f ", column("t_us")(200) / 1e6, double(s.t_us(200)) / 1e6);
disp(strtrim(h.frames.label(200, :)));
"""


@pytest.mark.nightly
@pytest.mark.skipif(
    not shutil.which("octave-cli") and "BIOTAC_CI" not in os.environ, reason="octave-cli is not installed"
)
def test_texts_leave_the_numbers_where_they_are(tmp_path: Path) -> None:
    with biotac.open("sim:press.toml?fingers=2&seconds=3") as hand, hand.record(tmp_path / "a.mcap", note="2026-11-28"):
        hand.read(5.0)
    biotac.Recording(tmp_path / "a.mcap").mark('glass, "3" mm; x, 7', 1.0, 2.5)
    for suffix in ("csv", "h5", "mat"):
        assert main(["export", str(tmp_path / "a.mcap"), str(tmp_path / f"a.{suffix}")]) == 0
    done = subprocess.run(["octave-cli", "--eval", SCRIPT], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.splitlines()
    recording = biotac.Recording(tmp_path / "a.mcap")
    rows = recording["middle"]
    applied_n = recording.applied_n[recording.frames["finger"] == 1][:, 2].sum()
    signal, t_s = rows["counts"][199, 6] - rows["tare"][199, 6], rows["t_us"][199] / 1e6
    *numbers, label = second.strip().split(maxsplit=7)
    assert first == "1 1" and label == '2026-11-28; glass, "3" mm; x, 7'
    assert np.allclose(np.array(numbers, float), [*[applied_n] * 3, signal, signal, t_s, t_s], atol=1e-3)
