"""csv: ports: named columns are rounds; a table without time or rest is refused in words."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import biotac
from biotac.errors import InputError
from biotac.sim.loading import load_source
from biotac.wire import messages_gen as wire
from biotac.wire import slots

HEAD = ["t", "label", *(f"E{k}" for k in range(1, 20)), "P", *(f"pac{k}" for k in range(1, 23))]
ONE = '[[finger]]\nelectrodes = "E{}"\npdc = "P"\npac = "pac{}"\nserial = "BT2P00000000000A"\n'
ROWS = load_source("press.toml", fingers=1, seconds=3.0).samples[:, 0].astype(int)


def write(folder: Path, columns: str, rows: np.ndarray = ROWS, t_s: np.ndarray | None = None) -> str:
    times = 100.0 + np.arange(len(rows)) * 0.01 if t_s is None else t_s
    order = [*slots.ELECTRODE_SLOT, slots.PDC_SLOT, *slots.PAC_SLOT]
    lines = [f'{t:.4f},"a",' + ",".join(str(row[k]) for k in order) for t, row in zip(times, rows, strict=True)]
    (folder / "a.csv").write_text("\n".join([",".join(HEAD), *lines]))
    (folder / "a.toml").write_text(columns)
    return f"csv:{folder / 'a.csv'}?columns={folder / 'a.toml'}"


def test_rows_are_rounds_with_their_times(tmp_path: Path) -> None:
    steps_s = np.random.default_rng(1).uniform(0.009, 0.011, len(ROWS))
    times_s = np.cumsum(steps_s)
    times_s[100] = np.nan
    with biotac.open(write(tmp_path, f'time = "t"\n{ONE}', t_s=times_s)) as hand:
        assert bytes(hand.sensor_info(0).serial) == b"BT2P00000000000A"
        batch = hand.read_batch(100.0)
        why = "a message was refused, after 0.98 s: line 102: its time is nan s"
        assert list(hand.link.notes) == [why, "a message was missing, after 0.99 s"]
    good = ~np.isnan(times_s)
    np.testing.assert_array_equal(batch.frames["counts"], ROWS[good][:, slots.ELECTRODE_SLOT])
    np.testing.assert_array_equal(batch.pac["pac"], ROWS[good][:, slots.PAC_SLOT])
    np.testing.assert_allclose(batch.frames["t_us"], 1e6 * (times_s[good] - times_s[0]), atol=101)


@pytest.mark.parametrize(("per_s", "words"), [(1e3, "like ms"), (1e6, "like us"), (1e9, "like ns"), (-1, "reverse")])
def test_times_in_another_unit_are_refused_by_its_name(tmp_path: Path, per_s: float, words: str) -> None:
    with pytest.raises(InputError, match=words):
        biotac.open(write(tmp_path, f'time = "t"\n{ONE}', t_s=per_s * (100.0 + np.arange(len(ROWS)) * 0.01)))


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (ONE, "a tare needs a row at rest"),
        ("rate_hz = 100", r"no \[\[finger\]\]"),
        ('rate_hz = 100\n[[finger]]\nelectrodes = "F{}"', "no column 'F1', expected one of t, label, E1"),
        ('rate_hz = 100\n[[finger]]\nelectrodes = "label"', "expected numbers"),
        ("rate_hz = [", "cannot be read"),
        (f'time = "E1"\n{ONE}', "goes on by"),
    ],
)
def test_a_table_that_says_too_little_is_refused(tmp_path: Path, columns: str, words: str) -> None:
    with pytest.raises(biotac.BiotacError, match=words):
        biotac.open(write(tmp_path, columns))


def test_one_row_a_grasp_has_no_rest(tmp_path: Path) -> None:
    rows = ROWS + np.random.default_rng(0).integers(-300, 300, ROWS.shape)
    with pytest.raises(InputError, match="finger 0 has no row at rest: of 300, no 30 one after the other are still"):
        biotac.open(write(tmp_path, f"rate_hz = 100\n{ONE}", rows))
    with pytest.raises(InputError, match=r"what are its columns\? expected csv:"):
        biotac.open(f"csv:{tmp_path / 'a.csv'}")


def changed(port: str, change: Callable[[list[str]], list[str]]) -> biotac.Hand:
    path = Path(port[4:].partition("?")[0])
    path.write_text("\n".join(change(path.read_text().split("\n"))))
    return biotac.open(port)


@pytest.mark.parametrize(
    "change",
    [
        lambda lines: [line.replace(",", ";") for line in lines],
        lambda lines: [line.replace(",", "\t") for line in lines],
        lambda lines: ["# of a press", "", *lines[:50], "# here it slipped", *lines[50:]],
        lambda lines: [lines[0].replace("E19", "E0"), *lines[1:]],
    ],
)
def test_a_table_of_another_form_says_the_same(tmp_path: Path, change: Callable[[list[str]], list[str]]) -> None:
    with changed(write(tmp_path, f'time = "t"\n{ONE}'), change) as hand:
        counts, notes = hand.read(100.0)["counts"], hand.link.notes
    order = [18, *range(18)] if (tmp_path / "a.csv").read_text().count("E0") else range(19)
    np.testing.assert_array_equal(counts, ROWS[:, slots.ELECTRODE_SLOT][:, order])
    assert list(notes) == []


def test_times_begin_anywhere_and_a_missing_word_is_only_that(tmp_path: Path) -> None:
    port = write(tmp_path, f'time = "t"\n{ONE}', t_s=np.arange(len(ROWS)) * 0.01 - 3.0)
    first = ROWS[100, slots.ELECTRODE_SLOT[0]]
    with changed(
        port, lambda lines: [*lines[:101], lines[101].replace(f",{first},", ",NaN,", 1), *lines[102:]]
    ) as hand:
        frames = hand.read(100.0)
    assert len(frames) == len(ROWS) and frames["t_us"][0] == 0
    assert np.argwhere(frames["counts"] == wire.INVALID_COUNT).tolist() == [[100, 0]]


@pytest.mark.parametrize(
    ("columns", "change", "words"),
    [
        (ONE, lambda lines: [lines[0].replace("E7,", "X,"), *lines[1:]], "no column E7, but E19; expected all"),
        (ONE.replace("pdc", "pcd"), list, "unknown key 'pcd'; expected electrodes, pdc"),
        (f"unit = 1\n{ONE}", list, "unknown key 'unit'; expected rate_hz, time, finger"),
        (ONE, lambda lines: lines[:1], "has no rows"),
        (ONE, lambda lines: ["", *lines[:9], lines[9].replace(",2", ",x", 1), *lines[10:]], "at line 11, column"),
        (ONE, lambda lines: ["", *lines[:9], lines[9][:60], *lines[10:]], "at line 11 with"),
    ],
)
def test_a_table_that_is_wrong_is_refused_by_name_or_line(
    tmp_path: Path, columns: str, change: Callable[[list[str]], list[str]], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        changed(write(tmp_path, f'time = "t"\n{columns}'), change)


@pytest.mark.parametrize("missing", ["", "NA", "null", '"NA"', '""', "NaN", "#N/A"])
def test_missing_words_are_missing_as_other_programs_write_them(tmp_path: Path, missing: str) -> None:
    def change(lines: list[str]) -> list[str]:
        cells = lines[150].split(",")
        quoted = [",".join(f'"{cell}"' for cell in line.split(",") if cell) for line in lines[151:]]
        return [*lines[:150], ",".join([*cells[:6], missing, *cells[7:]]), *quoted]

    with changed(write(tmp_path, f'time = "t"\n{ONE}'), change) as hand:
        counts = hand.read(100.0)["counts"]
    assert np.argwhere(counts == 65535).tolist() == [[149, 4]]
