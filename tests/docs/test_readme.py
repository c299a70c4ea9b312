"""The commands that README.md gives a newcomer work."""

import re
import shlex
import subprocess
import sys
import textwrap
from pathlib import Path

from biotac.calibrate import population

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_python_example_runs(capsys) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    exec(compile(code, "README.md", "exec"), {})
    printed = re.match(r"\[(.*)\]\n", capsys.readouterr().out)
    said = re.search(r"# (\S+), (\S+), (\S+) N: ", code)
    assert printed and said and [f"{float(n):.1f}" for n in printed[1].split()] == list(said.groups())


def test_a_newcomer_reads_it_in_three_minutes() -> None:
    assert len(README.replace("|", " ").split()) <= 600


def test_the_command_prints_what_the_page_shows(tmp_path: Path) -> None:
    ((command, shown),) = re.findall(r"^    biotac (\S.*?) +#.*\n\n((?:    .*\n)+)", README, flags=re.MULTILINE)
    words = [sys.executable, "-m", "biotac", *shlex.split(command)]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, textwrap.dedent(shown)), done.stderr


def test_the_losses_that_the_controllers_page_states_are_the_tables() -> None:
    experiments = (ROOT / "host/biotac-lab/docs/experiments.md").read_text(encoding="utf-8")
    page = (ROOT / "host/docs/guides/controller.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\w+) \| ([a-zN0-9 ]+) \| (\d+) \|(?:[^|]*\|){2} ([\d.]+) ", experiments, re.M)
    lost = {(plant, told): f"{percent} % of {n}" for plant, told, n, percent in rows}
    said = [
        f"| {plant} | {lost[plant, 'true force']} | {lost[plant, 'own map']} |"
        for plant in ("numpy", "lagging", "mujoco")
    ]
    said.append(f"constant 3 N loses {lost['numpy', 'constant 3 N'].partition(' of')[0]}")
    assert [row for row in said if row not in page] == []


def test_the_force_error_to_state_is_the_default_maps() -> None:
    page = (ROOT / "host/docs/reference/accuracy.md").read_text(encoding="utf-8")
    row = re.search(r"(?s)finger \| (0\.\d+) N RMS.* sideways \| (0\.\d+) N RMS.* pad \| (0\.\d+) N RMS", README)
    match = re.search(r"(0\.\d+) N towards the tip, (0\.\d+) N sideways and (0\.\d+) N normal", page.replace("\n", " "))
    for figures in (row, match):
        assert figures and list(map(float, figures.groups())) == population.load(None).sigma_n.round(2).tolist()


def test_the_errors_that_the_controllers_page_states_are_the_budgets() -> None:
    budget, page = (
        (ROOT / f"host/docs/{name}.md").read_text(encoding="utf-8")
        for name in ("reference/wrong_by", "guides/controller")
    )
    worst_n = dict(re.findall(r"^\| (.*?) \| ([\d.]+) \|", budget, re.M))
    causes = "the finger warms by up to 6 C in a hold", "all electrodes drift by 12 to 30 counts/s"
    assert [cause for cause in causes if f"{worst_n[cause]} N" not in page] == []
