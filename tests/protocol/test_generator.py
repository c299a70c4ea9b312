"""The generators: committed output is current, drift is named, bad contracts are refused in words."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("protocol", "tools", "host/biotac", "host/biotac-rig", "host/docs/guides", *(
    f"firmware/{room}" for room in ("core", "emu", "sensor_board", "client")
))  # fmt: skip
GENERATED = (
    "firmware/client/biotac_client_gen.h",
    "firmware/core/wire/sensor_gen.h",
    "firmware/core/wire/sensor_gen.c",
    "firmware/core/wire/messages_gen.h",
    "firmware/core/wire/messages_gen.c",
    "host/biotac/wire/sensor_gen.py",
    "host/biotac/wire/messages_gen.py",
    "protocol/MESSAGES.md",
    "protocol/schema.json",
)
VECTORS = tuple(f"protocol/vectors/{name}.txt" for name in ("framing", "messages", "crc32", "cobs"))


def run(root: Path, tool: str, *options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, root / "tools" / tool, *options],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
    )


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The contract, the tools and everything made of it, to be altered at will."""
    for source in SOURCES:
        shutil.copytree(ROOT / source, tmp_path / source, ignore=shutil.ignore_patterns("__pycache__", "*.so"))
    return tmp_path


def replace(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


@pytest.mark.parametrize("tool", ["gen_protocol.py", "make/vectors.py"])
def test_what_is_committed_is_current(tool: str) -> None:
    result = run(ROOT, tool, "--check")
    assert (result.returncode, result.stderr) == (0, "")


@pytest.mark.parametrize(("tool", "names"), [("gen_protocol.py", GENERATED), ("make/vectors.py", VECTORS)])
def test_drifted_files_are_named_and_mended(copy: Path, tool: str, names: tuple[str, ...]) -> None:
    drifted = names[::2]
    (copy / drifted[0]).unlink()
    for name in drifted[1:]:
        with (copy / name).open("a", encoding="utf-8") as file:
            file.write("\n")
    result = run(copy, tool, "--check")
    assert result.returncode == 1
    assert tuple(name for name in names if name in result.stderr) == drifted
    assert run(copy, tool).returncode == 0
    assert all((copy / name).read_bytes() == (ROOT / name).read_bytes() for name in names)


def test_a_changed_contract_drifts_everything_made_of_it(copy: Path) -> None:
    replace(copy / "protocol/link.toml", '{ name = "boot_id", type = "u32"', '{ name = "boot_id", type = "u16"')
    result = run(copy, "gen_protocol.py", "--check")
    assert result.returncode == 1
    for room, suffix in (("firmware/core", "h"), ("firmware/core", "c"), ("host/biotac", "py")):
        assert f"{room}/wire/messages_gen.{suffix}" in result.stderr
    assert "sensor_gen" not in result.stderr
    vectors = run(copy, "make/vectors.py", "--check")
    assert vectors.returncode == 1
    assert "messages.txt" in vectors.stderr and "framing.txt" in vectors.stderr


REFUSED = [
    ("link.toml", "id = 0x02\n", "id = 0x01\n", "message id occurs twice"),
    ("link.toml", "[setting.force_gain_x_nn]\nid = 2", "[setting.force_gain_x_nn]\nid = 1", "setting id occurs twice"),
    ("link.toml", '"counts", type = "u16", count = 19', '"counts", type = "u32", count = 60', "FRAME is too long"),
    ("link.toml", "range = [50, 1_000_000]\ndefault = 1_000", "range = [50, 1_000_000]\ndefault = 49",
     "default of contact_energy_count2 is outside its range"),
    ("link.toml", "[setting.thermal_gain_milli]\nid = 10\nper_finger = true", "[setting.thermal_gain_milli]\nid = 10",
     "CALIBRATION has 8 values for 7 per-finger settings"),
    ("link.toml", 'reply = "HELLO"', 'reply = "HALLO"', "HELLO_REQUEST is answered by unknown message HALLO"),
    ("link.toml", '{ name = "seq", type = "u16", unit = "1", doc = "counts STATUS messages" },', "",
     "STATUS must start with seq, t_us if it has streams"),
    ("link.toml", 'streams = ["PAC"]\n', "", "PAC must start with seq, t_us if it has streams, and only then"),
    ("link.toml", 'streams = ["PAC"]', 'streams = ["PAK"]', "PAC is in a stream that"),
    ("link.toml", '"offset", type = "u16", unit = "byte", doc = "position of the first byte, below',
     '"req_id", type = "u16", unit = "byte", doc = "position of the first byte, below',
     "command READ_MAP must begin with req_id"),
    ("map.toml", "BULGE = { value = 3", "BULGE = { value = 9", r"values of \[kind\] must be 0, 1, 2"),
    ("map.toml", 'BULGE = { value = 3, columns = "electrodes"', 'BULGE = { value = 3, columns = "all"',
     "BULGE has unknown columns all"),
    ("map.toml", "serial_bytes = 16", "serial_bytes = 12", "serial_bytes is not the 16 of SENSOR_INFO"),
    ("sensor.toml", "command = 0x83", "command = 0x82", "command of PDC breaks the parity rule"),
    ("sensor.toml", 'name = "TAC"', 'name = "PDC"', "a channel name occurs twice"),
    ("sensor.toml", '"E1", "PAC", "E2",', '"E1", "PAC", "E99",', "slot E99 is not a channel"),
    ("sensor.toml", '["E7", 4_763, 0, -2_330,', '["E7", 4_763, 0, 0,', "electrode E7 must lie below the axis"),
    ("sensor.toml", "-5_080, 0, 0, -1_000]", "-5_080, 0, 0, -1_100]", "normal of E17 has length"),
]  # fmt: skip


@pytest.mark.parametrize(("file", "old", "new", "words"), REFUSED, ids=[case[3] for case in REFUSED])
def test_a_contract_that_breaks_a_rule_is_refused_in_words(
    tmp_path: Path, file: str, old: str, new: str, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    from protogen import schema

    contract = shutil.copytree(ROOT / "protocol", tmp_path / "protocol")
    replace(contract / file, old, new)
    with pytest.raises(ValueError, match=words) as refusal:
        schema.load(contract)
    assert file in str(refusal.value)


def test_words_do_not_change_the_schema_hash_and_facts_do(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    from protogen import schema

    before = schema.load(copy / "protocol").hash
    replace(copy / "protocol/link.toml", 'doc = "Why a command was refused."', 'doc = "The reason."')
    assert schema.load(copy / "protocol").hash == before
    replace(copy / "protocol/sensor.toml", "settle_us = 50 ", "settle_us = 51 ")
    assert schema.load(copy / "protocol").hash != before
