"""A disk that fills up in the middle of an export: one line, nothing left behind, whichever library writes."""

import subprocess
import sys
from pathlib import Path

import pytest
from record_all import record_all

import biotac
from biotac.export import FORMATS, export

LIMITS = [0, 700, 5_000, 20_000]  # bytes; the smallest of these exports has 40 000


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    import matplotlib.font_manager  # noqa: F401 - writes the font cache now, not on the full disk

    return record_all("sim:press.toml?seconds=3", tmp_path_factory.mktemp("recorded") / "rec.mcap")


BY_DAY = (".csv", ".parquet", ".ros2")  # ours, a library's, and a folder


@pytest.mark.parametrize("suffix", [pytest.param(s, marks=() if s in BY_DAY else pytest.mark.nightly) for s in FORMATS])
def test_a_full_disk_ends_an_export_in_a_line_and_leaves_nothing(tmp_path: Path, recorded: Path, suffix: str) -> None:
    words = [Path(__file__).with_name("export_to_full_disk.py"), recorded, tmp_path, suffix, *map(str, LIMITS)]
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert len(lines) == 2 * len(LIMITS)
    for limit, message, left in zip(LIMITS, lines[::2], lines[1::2], strict=True):
        assert (
            message.startswith(f"{limit} InputError")
            and "cannot be written (" in message
            and "File too large" in message
        )
        assert left == f"{limit} left []"


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_an_export_of_two_files_writes_both_or_none(tmp_path: Path, recorded: Path, suffix: str) -> None:
    recording, second = biotac.Recording(recorded), tmp_path / f"out.pac{suffix}"
    second.write_text("precious")
    with pytest.raises(biotac.InputError, match=r"out\.pac.* exists"):
        export(recording, tmp_path / f"out{suffix}")
    assert [path.name for path in tmp_path.iterdir()] == [second.name] and second.read_text() == "precious"
