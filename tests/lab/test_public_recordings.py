"""tools/recordings without a network: the authors' formats are converted, and no other file is taken."""

import hashlib
import importlib.util
import io
import json
from datetime import datetime, timedelta
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    loader = SourceFileLoader("recordings_tool", str(ROOT / "tools/recordings"))
    spec = importlib.util.spec_from_loader(loader.name, loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module


def rows_of(values: np.ndarray) -> bytes:
    text = io.BytesIO()
    np.savetxt(text, values, fmt="%d " if values.dtype.kind == "u" else "%.6g ")
    return text.getvalue()


def log_of(t: np.ndarray, pdc: np.ndarray, e: np.ndarray, z: np.ndarray) -> bytes:
    begin, out = datetime(2019, 10, 16, 18, 16, 4), ["[xmlrpc][INFO] 2019-10-16 18:16:04,012: bound"]
    for row in zip(t.tolist(), pdc.tolist(), e.tolist(), z.tolist(), strict=True):
        at = (begin + timedelta(milliseconds=round(1e3 * row[0]))).strftime("%Y-%m-%d %H:%M:%S,%f")[:-3]
        normal = "\n ".join(f"[{part: .8f}]" for part in row[3])
        out.append(f"[rosout][INFO] {at}: \npdc: \n{row[1]}\nelectrode: \n{tuple(row[2])}\nz_dir: \n[{normal}]")
    return "\n".join([*out, "[rosout][INFO] 2019-10-16 18:17:24,000: over"]).encode()


@pytest.fixture(params=["drawn", "real"])
def plate(request: pytest.FixtureRequest) -> dict[str, Any]:
    if request.param == "real":
        folder: Path = request.getfixturevalue("shared_data")
        return dict(np.load(folder / "syntouchcontact/F1.npz"))
    rng = np.random.default_rng(1)
    counts = {name: rng.integers(0, 4096, (30, 19)).astype(np.uint16) for name in ("E", "E_base", "E_idle")}
    return counts | {"F": rng.normal(size=(30, 3)).astype(np.float32)}


def test_a_plates_rows_are_its_arrays(tool: ModuleType, plate: dict[str, Any]) -> None:
    got = tool.plate(*(rows_of(plate[name]) for name in ("E", "F", "E_base", "E_idle")))
    for name in ("E", "F", "E_base", "E_idle"):
        assert (got[name].dtype, got[name].shape) == (plate[name].dtype, plate[name].shape)
        np.testing.assert_allclose(got[name], plate[name], rtol=1e-5)


def test_a_listeners_log_is_its_arrays(tool: ModuleType, shared_data: Path) -> None:
    real = np.load(shared_data / "robotic_finger/trial_15330.npz")
    got = tool.listener(log_of(real["t"][:300], real["PDC"][:300], real["E"][:300], real["z_dir"][:300]))
    for name in ("t", "PDC", "E", "z_dir"):
        assert got[name].dtype == real[name].dtype
        np.testing.assert_allclose(got[name], real[name][:300], atol=1e-3 if name == "t" else 1e-7)


def test_another_file_is_refused_and_the_pinned_one_taken(
    tool: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    log = log_of(np.arange(5) / 100, np.full(5, 2412), np.full((5, 19), 3000), np.tile([0.0, 0.6, 0.8], (5, 1)))
    recording = tool.RECORDINGS["trial_15330"]
    at = tmp_path / recording.repository.replace("/", "+") / tool.LOG
    at.parent.mkdir(parents=True)
    at.write_bytes(log)
    words = [str(tmp_path / "out"), "trial_15330", "--from", str(tmp_path)]
    with pytest.raises(OSError, match=r"SHA-256 is [0-9a-f]{64}, expected [0-9a-f]{64}; it is another file"):
        tool.main(words)
    assert not list((tmp_path / "out").glob("*.npz"))
    pinned = recording._replace(files={tool.LOG: hashlib.sha256(log).hexdigest()})
    monkeypatch.setitem(tool.RECORDINGS, "trial_15330", pinned)
    assert tool.main(words) == 0 and "5 rows of Alexis-" in capsys.readouterr().out
    assert np.load(tmp_path / "out/trial_15330.npz")["E"].shape == (5, 19)


def test_the_default_map_names_the_same_commit(tool: ModuleType) -> None:
    document = json.loads((ROOT / "host/biotac/map/population.json").read_text(encoding="utf-8"))
    assert f"{tool.SYNTOUCHCONTACT[0]}, commit {tool.SYNTOUCHCONTACT[1]}" in document["provenance"]["source"]
