"""A type checker's verdict on a user's program with the installed package."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import biotac

PROGRAM = Path(__file__).with_name("program.py")
WRONG = PROGRAM.read_text().replace("hand.tare(", "hand.tear(").replace("fresh=True", "fersh=True")
CHECKERS = {
    "mypy": [sys.executable, "-m", "mypy", "--strict", "--no-incremental"],
    "pyright": [sys.executable, "-m", "pyright", "--pythonpath", sys.executable],
}


@pytest.mark.nightly
@pytest.mark.parametrize("checker", ["mypy", "pyright"])
def test_a_users_program_is_typed_and_a_wrong_one_is_found(checker: str, tmp_path: Path) -> None:
    good, bad = tmp_path / "good.py", tmp_path / "bad.py"
    good.write_text(PROGRAM.read_text())
    bad.write_text(WRONG)
    # Both at once: most of the time goes to reading the packages that they import.
    done = subprocess.run([*CHECKERS[checker], "good.py", "bad.py"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1, done.stdout + done.stderr
    found = re.findall(r"(\w+\.py):\d+.*", done.stdout)
    assert set(found) == {"bad.py"}, done.stdout
    assert "tear" in done.stdout and "fersh" in done.stdout


def test_all_that_a_program_may_name_is_there_and_in_that_program() -> None:
    named = set(re.findall(r"biotac\.(\w+)", PROGRAM.read_text()))
    assert set(biotac.__all__) - named == set()
    assert all(hasattr(biotac, name) for name in biotac.__all__)
