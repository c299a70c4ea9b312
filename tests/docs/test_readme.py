"""What README.md tells a newcomer to type works."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^    biotac (\S.*?)(?:\s+#.*)?$", README, flags=re.MULTILINE)


def test_the_python_example_runs(capsys) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    exec(compile(code, "README.md", "exec"), {})
    assert re.match(r"\[.*\]\n", capsys.readouterr().out)


def test_the_commands_run(tmp_path: Path) -> None:
    endless = ("stream", "view")
    assert {c.split()[0] for c in COMMANDS} >= {"record", "check", *endless}
    for command in COMMANDS:
        words = shlex.split(command)
        if words[0] in endless:
            continue  # they run until Ctrl-C; tests/host/cli and tests/host/view run them with an end
        done = subprocess.run([sys.executable, "-m", "biotac", *words], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, (command, done.stderr)


@pytest.mark.parametrize("link", re.findall(r"\]\(([^)#:]+)\)", README))
def test_links_lead_somewhere(link: str) -> None:
    assert (Path(__file__).parents[2] / link).exists()
