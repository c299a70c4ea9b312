"""Every file that a user can be handed, damaged or made to hurt: one BiotacError, in time and memory, or it is read.

The mutations are drawn with stated seeds; the library's contract, not the code, says how they may end.
"""

import gzip
import io
import json
import random
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from maps import make_map
from record_all import record_all

import biotac
from biotac import documents
from biotac.calibrate import population as population_map
from biotac.calibrate.reference.csv_file import read_csv
from biotac.calibrate.reference.mcap_file import read_mcap
from biotac.calibrate.reference.mounting import LIN, from_json, read_mounting
from biotac.cli.recordings.export import read_settings
from biotac.errors import BiotacError
from biotac.flash import read_backup
from biotac.flash.backup import FORMAT as BACKUP
from biotac.keep import calibration_file
from biotac.keep.calibration import Calibration
from biotac.map import columns
from biotac.map import file as map_file
from biotac.map.fitted import WrenchMap
from biotac.map.population import shipped
from biotac.sim import physics
from biotac.sim.loading import load_source
from biotac.wire import messages_gen as wire

MORE_BYTES = 500 << 20

CALIBRATION = calibration_file.to_dict(Calibration(wire.PocWeights.COMPRESS_N2, (1, 2, 3), (4, 5), 0, "BT1", 1_763_731))
MAP = map_file.to_dict(make_map(1))
COEFFICIENTS = np.full((columns.width(columns.blocks(with_pdc=False)) + 1, 3), 0.5)
FITTED = json.loads(
    map_file.dumps_fitted(WrenchMap("all", columns.AXES[:3], np.full(19, 2e3), 5, (1, 1, 1), COEFFICIENTS))
)
SETTINGS = {"settings": {"poc_weights": 2}}
KEPT = {
    "format": BACKUP, "settings": [{"id": 1, "value": 2}], "calibrations": {"0": CALIBRATION}, "maps": {"0": MAP},
}  # fmt: skip
EDITED = {documents.CRC32: documents.EDITED}  # so that more than the sum is asked
MOUNTING = {"rotation": [[0, 1, 0], [1, 0, 0], [0, 0, -1]], "offset_mm": [1.0, 0.0, 2.0], "reads": "force on finger"}

JSON: dict[str, tuple[Callable[[Path], Any], Any]] = {
    "calibration": (calibration_file.load, CALIBRATION | EDITED),
    "map": (map_file.load, MAP | EDITED),
    "fitted map": (map_file.load_fitted, FITTED | EDITED),
    "settings": (read_settings, SETTINGS),
    "backup": (read_backup, KEPT | EDITED),
    "mounting": (lambda path: from_json(path.read_text(errors="replace"), "here"), MOUNTING),
}
STRANGE: list[Any] = [
    None, True, -1, 0, 2**63, -(2**70), 10**400, 1.5, 1e300, "", "x" * 10_000, "\x1b[2J\n", "\ud800", [], [[]], {},
    {"a": {}}, [1e308, "1"], {"0": None}, "NaN", float("nan"), float("inf"),
]  # fmt: skip


def refused_or_read(read: Callable[[Path], Any], path: Path) -> bool:
    """Whether it was refused; any other error than a one-line BiotacError fails the test."""
    try:
        read(path)
    except BiotacError as error:
        text = str(error)
        assert "\n" not in text and text.isprintable() and len(text) < 2000, text
        return True
    return False


def changed(tree: Any, draw: random.Random) -> Any:
    """A copy with one value, at any depth, strange or gone."""
    if not isinstance(tree, dict | list) or not tree or draw.random() < 0.2:
        return draw.choice(STRANGE)
    copy = dict(tree) if isinstance(tree, dict) else list(tree)
    key = draw.choice(list(copy)) if isinstance(copy, dict) else draw.randrange(len(copy))
    if draw.random() < 0.15:
        del copy[key]
    else:
        copy[key] = changed(copy[key], draw)
    return copy


def damaged(data: bytes, draw: random.Random) -> bytes:
    """Cut, flipped, repeated or overwritten at a random place."""
    spoilt, at = bytearray(data), draw.randrange(len(data))
    kind = draw.randrange(5)
    if kind == 0:
        return data[:at]
    if kind == 1:
        for _ in range(draw.randint(1, 8)):
            spoilt[draw.randrange(len(spoilt))] ^= 1 << draw.randrange(8)
    elif kind == 2:
        spoilt[at:at] = spoilt[at : at + draw.randrange(1, 200)]
    elif kind == 3:
        spoilt[at : at + 8] = draw.randbytes(8)
    else:
        del spoilt[at : at + draw.randrange(1, 200)]
    return bytes(spoilt)


SPOILT: dict[str, Callable[[Any, random.Random], bytes]] = {
    "one strange value": lambda good, draw: json.dumps(changed(good, draw)).encode(),
    "damaged": lambda good, draw: damaged(json.dumps(good).encode(), draw),
}


@pytest.mark.parametrize("spoilt", SPOILT)
@pytest.mark.parametrize("kind", JSON)
def test_spoilt_json_is_refused_in_a_line_or_read(tmp_path: Path, kind: str, spoilt: str) -> None:
    read, good = JSON[kind]
    path, draw, refused = tmp_path / "file.json", random.Random(1), 0
    path.write_text(json.dumps(good))
    assert not refused_or_read(read, path)
    for _ in range(300):
        path.write_bytes(SPOILT[spoilt](good, draw))
        refused += refused_or_read(read, path)
    assert refused > 30


SEALED: dict[str, tuple[Callable[[Path], Any], str]] = {
    "calibration": (calibration_file.load, json.dumps(documents.sealed(CALIBRATION), indent=2)),
    "map": (map_file.load, json.dumps(documents.sealed(MAP), indent=2)),
    "fitted map": (lambda path: repr(map_file.load_fitted(path)), json.dumps(FITTED)),
    "backup": (read_backup, json.dumps(documents.sealed(KEPT), indent=1)),
    "population map": (lambda path: repr(population_map.load(path)), shipped()),
}


@pytest.mark.parametrize("flips", [150, pytest.param(10_000, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("kind", SEALED)
def test_a_flipped_bit_is_never_read_as_another_value(tmp_path: Path, kind: str, flips: int) -> None:
    read, text = SEALED[kind]
    path, draw, data = tmp_path / "file.json", random.Random(4), text.encode()
    path.write_bytes(data)
    good, refused = read(path), 0
    for _ in range(flips):
        spoilt = bytearray(data)
        spoilt[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
        path.write_bytes(spoilt)
        try:
            assert read(path) == good  # white space, or 1e5 for 1E5
        except BiotacError:
            refused += 1
    assert refused > 0.5 * flips


@pytest.mark.parametrize("text", ["[" * 200_000, '{"a":' * 200_000, "1e999", "9" * 100_000, "", "\0", "\ufeff"])
@pytest.mark.parametrize("kind", JSON)
def test_json_made_to_hurt_is_refused(tmp_path: Path, kind: str, text: str) -> None:
    path = tmp_path / "file.json"
    path.write_text(text, encoding="utf-8")
    assert refused_or_read(JSON[kind][0], path)


def npz(**fields: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez(file, **fields)
    return file.getvalue()


def test_a_flipped_bit_in_an_npz_drops_no_channel(tmp_path: Path) -> None:
    """Every bit of the archive's structure: a field with a changed name would just be missing."""
    path = tmp_path / "finger.npz"
    draw = np.random.default_rng(5)
    data = npz(E=draw.integers(2000, 3000, (20, 19)), PDC=draw.integers(2000, 3000, 20), TDC=np.arange(900, 920))
    path.write_bytes(data)
    good = load_source(path).samples
    reported = 0
    for bit in range(8 * data.index(b"PK\x01\x02"), 8 * len(data)):  # the directory, at the end
        spoilt = bytearray(data)
        spoilt[bit // 8] ^= 1 << bit % 8
        path.write_bytes(spoilt)
        try:
            np.testing.assert_array_equal(load_source(path).samples, good)
        except BiotacError:
            reported += 1
    assert reported


def binaries() -> Iterator[tuple[str, str, Callable[[Path], Any], bytes]]:
    """Name, suffix, reader and a good file."""
    rows = "\n".join(f"{k / 100},{k % 7},0.5,1,0,0,0" for k in range(300))
    yield (
        "reference",
        ".csv",
        lambda path: read_csv(path, LIN),
        f"t_s,Fx_N,Fy_N,Fz_N,Mx_Nmm,My_Nmm,Mz_Nmm\n{rows}\n".encode(),
    )
    yield "finger", ".npz", load_source, npz(E=np.full((50, 19), 2000), PDC=np.full(50, 1000))
    scenario = b'name = "a"\n[[step]]\ndo = "press"\nseconds = 1.0\nat = "E17"\nforce_n = 3.0\n'
    yield "scenario", ".toml", load_source, scenario
    mounting = b'rotation = [[0, 1, 0], [1, 0, 0], [0, 0, -1]]\noffset_mm = [1, 0, 2]\nreads = "force on finger"\n'
    yield "mounting", ".toml", lambda path: read_mounting(str(path)), mounting


@pytest.mark.filterwarnings("ignore:.*have the time of the one before:biotac.RecordingWarning")
@pytest.mark.parametrize(("suffix", "read", "good"), [pytest.param(*parts, id=name) for name, *parts in binaries()])
def test_a_damaged_file_is_refused_in_a_line_or_read(
    tmp_path: Path, suffix: str, read: Callable[[Path], Any], good: bytes
) -> None:
    path, draw = tmp_path / f"file{suffix}", random.Random(3)
    path.write_bytes(good)
    assert not refused_or_read(read, path)
    refused = 0
    for _ in range(200):
        path.write_bytes(damaged(good, draw))
        refused += refused_or_read(read, path)
    assert refused > 20


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return record_all("sim:press.toml?seconds=1", tmp_path_factory.mktemp("recorded") / "rec.mcap").read_bytes()


@pytest.mark.filterwarnings("ignore::biotac.RecordingWarning")
@pytest.mark.parametrize("read", [biotac.load, biotac.Recording, lambda path: read_mcap(path, LIN)])
def test_a_damaged_recording_is_refused_in_a_line_or_read(
    tmp_path: Path, recorded: bytes, read: Callable[[Path], Any]
) -> None:
    path, draw = tmp_path / "rec.mcap", random.Random(4)
    for _ in range(60):
        path.write_bytes(damaged(recorded, draw))
        refused_or_read(read, path)


CPU_S = 30.0  # for work that takes 10 s on a desktop's processor, on whatever runs this


PROGRAM = """
import os, resource, sys
from pathlib import Path
from biotac.calibrate.reference.csv_file import read_csv
from biotac.calibrate.reference.mounting import LIN
from biotac.errors import BiotacError
from biotac.keep import calibration_file
from biotac.sim.loading import load_source
from biotac_rig.tape import write_tape
for call in sys.stdin:
    if (child := os.fork()) == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (60, 60))
        resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
        outcome = "read"
        try:
            eval(call)
        except BiotacError as error:
            outcome = str(error)
        used = resource.getrusage(resource.RUSAGE_SELF)
        most = next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM"))
        print(used.ru_utime + used.ru_stime, int(most) * 1024, outcome, flush=True)
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
"""
UsedBy = Callable[[str], str]


@pytest.fixture(scope="module")
def used_by_another() -> Iterator[UsedBy]:
    """``read``, or the error; judged in another process, by processor time, not by the wall's."""
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as another:
        assert another.stdin is not None and another.stdout is not None

        def used(call: str) -> str:
            another.stdin.write(call + "\n")
            another.stdin.flush()
            seconds, size, reported = another.stdout.readline().split(maxsplit=2)
            assert float(seconds) < CPU_S and int(size) < MORE_BYTES
            return reported.strip()

        yield used
        another.stdin.close()
    assert another.returncode == 0


QUOTED = '"b".' * 100_000 + "b = 1"


TOML_BOMBS = [
    "a." * 400_000 + "a = 1",
    "x = " + "[" * 400_000,
    "x = {" + "a." * 100_000 + "b = 1}",
    QUOTED,
    r'"\"".' + QUOTED,
    f'x = {{a = """ " """, {QUOTED}}}',
    f"# '''\n{QUOTED}\n# '''",
    "\n".join(f"[k{k}" + ".b" * 30 + "]" for k in range(14_000)),
    'x = "' + r"\"" * 400_000,
    ("#" + ("a" * 63 + ".") * 31 + "\n") * 500,
]
BY_DAY = (0, 3, 7)  # a long key, a quoted one, many tables


@pytest.mark.parametrize(
    "line",
    [pytest.param(bomb, marks=() if k in BY_DAY else pytest.mark.nightly) for k, bomb in enumerate(TOML_BOMBS)],
    ids=range(10),
)
def test_toml_made_to_hurt_is_refused_in_little_time_and_memory(
    tmp_path: Path, used_by_another: UsedBy, line: str
) -> None:
    path = tmp_path / "bomb.toml"
    path.write_text(line)
    assert path.stat().st_size < 1 << 20
    reported = used_by_another(f"load_source({str(path)!r})")
    assert reported.isprintable() and reported != "read"
    assert refused_or_read(lambda file: read_mounting(str(file)), path)


def test_what_is_dotted_but_no_key_is_read() -> None:
    text = """a.b.c = [1.5, 2.5] # 1.2.3.4.5.6
    "a.b.c.d.e.f" = '1.2.3.4.5.6'
    x = '''\n"b"."b".b.b.b\n'''
    y = \"""\\\"""b.b.b.b.b.b\"""
    """
    assert documents.parse_toml(text)["y"] == '"""b.b.b.b.b.b'


def packed(**fields: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **fields)
    return file.getvalue()


LINES = gzip.compress(b"0 0 0 33 9 0\n" * (1 << 20))
#: The reader, a file's name, and the bytes: small, or within the limits of the kind.
BOMBS: dict[str, tuple[str, str, Callable[[], bytes]]] = {
    "lists": ("calibration_file.load", "a.json", lambda: b"[" + b"[]," * (20 << 20) + b"1]"),
    "fewer lists": ("calibration_file.load", "a.json", lambda: b"[" + b"[]," * (documents.JSON_BYTES // 3 - 1) + b"1]"),
    "empty lines": ("read_csv", "a.csv", lambda: b"\n" * (2 << 20)),
    "a unit": ("read_csv", "a.csv", lambda: b"t_s,Fx [" + b" " * 10_000 + b"x,Fy_N,Fz_N\n0,0,0,0\n"),
    "lines": ("load_source", "a.btd.gz", lambda: gzip.compress(b"Begin File\n") + LINES * 40),
    "rows": ("load_source", "a.npz", lambda: packed(E=np.zeros((3_000_000, 19), np.uint8))),
}


@pytest.mark.parametrize("kind", BOMBS)
def test_a_file_made_to_hurt_is_refused_in_little_time_and_memory(
    tmp_path: Path, used_by_another: UsedBy, kind: str
) -> None:
    reader, name, data = BOMBS[kind]
    path = tmp_path / name
    path.write_bytes(data())
    more = ", LIN" if reader == "read_csv" else ""
    assert used_by_another(f"{reader}(Path({str(path)!r}){more})") != "read"


NAME = 'name = "x"\n'
REST = '[[step]]\ndo = "rest"\nseconds = {}\n'
PRESS = '[[step]]\ndo = "press"\nforce_n = 3.0\nat = "E17"\nseconds = {}\n'
SLIP = '[[step]]\ndo = "slip"\nmm_s = 5.0\nseconds = {}\n'
WORN = '[[finger]]\nprofile = "worn"\n'
LONGEST = WORN + REST.format(1) + PRESS.format(159) + SLIP.format(740)
FAULT = '[[fault]]\nat_s = 0\nseconds = {}\nfinger = 0\nkind = "stuck_low"\n'


def played(by: UsedBy, text: str, folder: Path, **options: float) -> str:
    """Output of another process that loads ``text`` as a scenario and writes the tape."""
    path = folder / "long.toml"
    path.write_text(text)
    assert len(text) < 1 << 20
    return by(f"write_tape({str(folder / 'tape')!r}, load_source({str(path)!r}, **{options!r}))")


@pytest.mark.parametrize(
    "text",
    [
        NAME + REST.format(3600) + FAULT.format(3600) * 2000,
        pytest.param(NAME + LONGEST + FAULT.format(900) * 11, marks=pytest.mark.nightly),
        pytest.param(NAME + REST.format(20) + FAULT.format(0.01) * 3_000, marks=pytest.mark.nightly),
        NAME + REST.format(600) + FAULT.format(0.01) * 13_000,
        pytest.param("\n".join(f"k{k}" + ".b" * 3 + " = 1" for k in range(60_000)), marks=pytest.mark.nightly),
    ],
)
def test_a_scenario_made_to_take_long_does_not(tmp_path: Path, used_by_another: UsedBy, text: str) -> None:
    assert played(used_by_another, text, tmp_path).isprintable()


def test_the_most_that_a_scenario_computes_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in rows, not seconds: states of a timeline, and the states among them with a load of their own."""
    states, loads = [0], [0]

    def deform(moved: physics.States) -> tuple[np.ndarray, np.ndarray]:
        states[0] += len(moved)
        loads[0] += len(np.unique(moved.force_n))
        return np.zeros((len(moved), 19)), np.zeros((len(moved), 19))

    monkeypatch.setattr(physics, "deform", deform)  # work is counted, because time would be that of the computer
    path = tmp_path / "long.toml"
    for text in (LONGEST, WORN * 5 + REST.format(1) + PRESS.format(31) + SLIP.format(148)):
        states[0] = loads[0] = 0
        path.write_text(NAME + text)
        load_source(path)
        assert states[0] <= 90_500 + 45_100 and loads[0] <= 16_100 + 8_100, text
    for seconds in (SLIP.format(741), PRESS.format(2)):  # a second more is refused
        path.write_text(NAME + WORN + REST.format(1) + PRESS.format(159) + seconds)
        assert refused_or_read(load_source, path)


@pytest.mark.nightly
@pytest.mark.parametrize("text", [REST.format(1), LONGEST], ids=["rest", "longest"])
def test_an_hour_of_five_fingers_is_played_within_500_mb(tmp_path: Path, used_by_another: UsedBy, text: str) -> None:
    assert played(used_by_another, NAME + text, tmp_path, seconds=3600, fingers=5) == "read"
