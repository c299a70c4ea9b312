"""One name, one class: no reader of ``Reader`` has to ask which."""

import ast
import importlib
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "host/biotac"
OLD_NAMES = [
    ("biotac.calibrate.press", "Fit", "PressureFit"),
    ("biotac.doctor", "judge", "diagnose"),
    ("biotac.grip", "State", "GripState"),
    ("biotac.sim", "Finger", "SimFinger"),
    ("biotac.sim", "Touch", "SimTouch"),
    ("biotac.wire.messages_gen", "Board", "BoardKind"),
    ("biotac.wire.messages_gen", "Calibration", "CalibrationMessage"),
    ("biotac.wire.messages_gen", "Frame", "FrameMessage"),
]


def shared(files: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """Names that several classes have, with the places of these."""
    places = defaultdict(list)
    for name, source in files:
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{name}:{node.lineno}")
    return {name: found for name, found in places.items() if len(found) > 1}


def test_no_two_classes_have_one_name() -> None:
    files = ((str(path), path.read_text(encoding="utf-8")) for path in sorted(PACKAGE.rglob("*.py")))
    assert shared(files) == {}


def test_a_shared_name_is_found() -> None:
    assert shared([("a.py", "class A: ...\n"), ("b.py", "class A: ...\nclass B: ...\n")]) == {"A": ["a.py:1", "b.py:1"]}


@pytest.mark.parametrize(("module", "old", "new"), OLD_NAMES)
def test_an_old_name_works_and_names_the_new_one(module: str, old: str, new: str) -> None:
    package = importlib.import_module(module)
    with pytest.warns(DeprecationWarning, match=rf"{module}\.{old} is now {module}\.{new}"):
        assert getattr(package, old) is getattr(package, new)
    with pytest.raises(AttributeError, match="no attribute 'Nothing'"):
        package.Nothing  # noqa: B018
