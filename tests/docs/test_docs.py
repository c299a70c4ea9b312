"""The pages: every command that they show works, and generated text is up to date.

By night tools/docs also builds them, with warnings as errors.
"""

import html
import json
import re
import shlex
import subprocess
import sys
import textwrap
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import biotac
from biotac.cli.main import parser
from biotac.core import geometry
from biotac.demo.answers import own_map
from biotac.sim.scenario import FingerSpec

ROOT = Path(__file__).parents[2]
PAGES = [page for folder in ("docs", "biotac-lab/docs") for page in sorted((ROOT / "host" / folder).rglob("*.md"))]
NOTEBOOK = ROOT / "host/docs/guides/examples/press.ipynb"
BLOCKS = {
    page.name: re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL) for page in PAGES
}
COMMANDS = [
    (page.name, command)
    for page in PAGES
    for command in re.findall(
        r"^    (?:sudo )?biotac (\S.*?)(?:\s+#.*)?$", page.read_text(encoding="utf-8"), flags=re.M
    )
]


def anchors(page: Path) -> set[str]:
    """Anchors of the headings, as the site and GitHub make them."""
    whole = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    heads = re.findall(r"^#+ (.*)$", whole, flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).strip().replace(" ", "-") for head in heads}


def test_links_between_pages_lead_somewhere() -> None:
    listed = subprocess.run(["git", "ls-files", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    broken = []
    for page in (ROOT / name for name in listed.splitlines()):
        for place, anchor in re.findall(r"\]\(([^)#:\s]*)(?:#([^)\s]+))?\)", page.read_text(encoding="utf-8")):
            target = page.parent / place if place else page
            if not target.exists() or (anchor and target.suffix == ".md" and anchor not in anchors(target)):
                broken.append(f"{page.relative_to(ROOT)}: {place}#{anchor}")
    assert broken == []


PROGRAMS = "live_reading.md"  # their blocks are programs, each run by tests/host/hand/test_aio.py


@pytest.mark.parametrize("page", [page for page, blocks in BLOCKS.items() if blocks and page != PROGRAMS])
def test_a_pages_python_runs(page: str, tmp_path: Path, monkeypatch, capsys) -> None:
    """Block after block, as a reader would type them."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "__main__"}
    for code in BLOCKS[page]:
        exec(compile(code, page, "exec"), names)
        printed = capsys.readouterr().out
        assert "print(" not in code or printed
        assert shown_under(page, code) in ("", printed)


def shown_under(page: str, code: str) -> str:
    """The output that a page shows for a block."""
    (path,) = (path for path in PAGES if path.name == page)
    after = path.read_text(encoding="utf-8").partition(f"```python\n{code}```\n\n")[2]
    return textwrap.dedent(re.match(r"(?:    .*\n)*", after)[0])  # type: ignore[index]


def test_the_controller_that_is_taught_has_at_most_forty_lines() -> None:
    (law,) = (code for code in BLOCKS["controller.md"] if "class SimpleGrip" in code)
    assert len(law.splitlines()) <= 40


def test_the_controller_that_is_taught_stops_where_the_thing_is_gone() -> None:
    names: dict[str, Any] = {}
    (law,) = (code for code in BLOCKS["controller.md"] if "class SimpleGrip" in code)
    exec(compile(law, "controller.md", "exec"), names)
    grip, gone = (
        names["SimpleGrip"](),
        SimpleNamespace(trust=biotac.Trust.ACT, flags=biotac.FrameFlags.CONTACT, force_n=np.zeros(3)),
    )
    speeds_mm_s = [grip.step([gone, None], slipped=False) for _ in range(1000)]
    assert 11 < sum(speeds_mm_s) * 0.01 < 13 and speeds_mm_s[-1] == 0.0


@pytest.mark.nightly
def test_the_notebook_runs_and_begins_as_the_page_does(tmp_path: Path, monkeypatch, capsys) -> None:
    """Ten lines from open to a plotted DataFrame, then a day's work; cell after cell in one place, as in Jupyter."""
    plt = pytest.importorskip("matplotlib.pyplot", reason="pip install 'biotac-gateway[plot,export]'")
    monkeypatch.chdir(tmp_path)
    plt.switch_backend("agg")
    cells = ["".join(cell["source"]) for cell in json.loads(NOTEBOOK.read_text())["cells"]]
    assert "\n\n".join(cells[:3]) in (ROOT / "host/docs/start/quickstart.md").read_text()
    names: dict[str, Any] = {}
    for cell in cells[:2]:
        exec(compile(cell, NOTEBOOK.name, "exec"), names)
    axes = eval(compile(cells[2], NOTEBOOK.name, "eval"), names)
    frames = biotac.load("trial.mcap")
    for line, force_n in zip(axes.lines, frames["force_n"].T, strict=True):
        np.testing.assert_array_equal(line.get_ydata(), force_n)
    for cell in cells[3:]:
        exec(compile(cell, NOTEBOOK.name, "exec"), names)
    assert abs(names["lag"].offset_s - 2.5) < 4 * names["lag"].sigma_s < 0.02 and names["share_right"] > 0.8
    assert {label.text for label in biotac.Recording("day.mcap").labels} == {"glass plate", "presses", "hardest press"}
    assert len(names["skin"].collections) == 1 and len(names["force"].lines) == 2
    plt.close("all")


def test_everyday_tasks_take_at_most_five_lines() -> None:
    assert [code for code in BLOCKS["everyday.md"] if len(list(filter(None, code.splitlines()))) > 5] == []


def test_there_is_python_to_run_and_commands_to_parse() -> None:
    assert sum(map(len, BLOCKS.values())) >= 8
    assert {page for page, _ in COMMANDS} >= {"quickstart.md", "recording.md", "live_view.md", "robots.md", "cli.md"}


@pytest.mark.parametrize(("page", "command"), COMMANDS)
def test_a_pages_command_is_one(page: str, command: str) -> None:
    parser().parse_args(shlex.split(command))  # leaves with SystemExit when it is none


def test_the_command_lines_page_is_up_to_date() -> None:
    done = subprocess.run([sys.executable, ROOT / "tools/make/cli_page.py", "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_the_reference_has_every_public_name() -> None:
    reference = (ROOT / "host/docs/reference/api.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"(?:^\| `|:: )biotac\.(\w+)", reference, flags=re.M))
    missing = set(biotac.__all__) - listed
    assert not missing


SCENARIO = """
name = "press"
seed = 1
[[step]]
do = "rest"
seconds = 2.0
[[step]]
do = "press"
seconds = 0.5
at = "{at}"
force_n = 5.0
[[step]]
do = "hold"
seconds = 1.0
"""


def test_a_word_lives_where_the_dictionary_says() -> None:
    words = (ROOT / "host/docs/reference/glossary.md").read_text(encoding="utf-8").partition("## Words")[0]
    homes = [line.split(" | ")[-1] for line in words.splitlines() if line.startswith("| ")][1:]
    assert 40 <= len(homes) <= 50
    places = [place for home in homes for place in re.findall(r"`([a-z]+/[\w/.]+)`", home)]
    assert [place for place in places if not (ROOT / place).exists()] == []


def test_the_controllers_page_has_every_flag() -> None:
    table = (ROOT / "host/docs/guides/controller.md").read_text(encoding="utf-8")
    assert [flag.name for flag in biotac.FrameFlags if f"`{flag.name}`" not in table] == []


@pytest.mark.nightly
def test_the_drawings_signs_are_what_a_calibrated_board_measures(tmp_path: Path) -> None:
    drawing = html.unescape((ROOT / "host/docs/reference/frames.svg").read_text(encoding="utf-8"))
    pressed = re.findall(r">pressed at (E\d+): ([^<]*(?:[<>] 0,? ?[^<]*)*)</text>", drawing)
    wrench_map, _ = own_map(FingerSpec(1, "new", "BTSIM00000000001"))
    checked = 0
    for name, readings in pressed:
        (tmp_path / "press.toml").write_text(SCENARIO.format(at=name))
        with biotac.open(f"sim:{tmp_path / 'press.toml'}") as hand:
            hand.board.set_map(0, wrench_map)
            frames = hand.read(10.0)
        held = frames[-50:]
        # 5 N into the surface, by hand; at the tip the line passes through the origin, so that torque has no sign
        at_mm = geometry.ELECTRODE_MM[int(name[1:]) - 1]
        force_n = -5.0 * geometry.normals_at(at_mm[None])[0]
        applied = {"F": force_n, "M": np.cross(at_mm, force_n)}
        measured = {"F": held["force_n"].mean(axis=0), "M": held["torque_nmm"].mean(axis=0)}
        for letter, axis, sign in re.findall(r"([FM])([xyz]) ([<>]) 0", readings):
            for value in (applied[letter]["xyz".index(axis)], measured[letter]["xyz".index(axis)]):
                assert abs(value) > 0.1 and np.sign(value) == (1 if sign == ">" else -1), (name, letter, axis, value)
            checked += 1
    assert len(pressed) == 3 and checked >= 8
