"""The laboratory stands on the gateway's public names alone, and the gateway never on the laboratory."""

import ast
import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LAB = sorted((ROOT / "host/biotac-lab/biotac_lab").rglob("*.py"))
GATEWAY = sorted((ROOT / "host/biotac").rglob("*.py"))
API = (ROOT / "host/docs/reference/api.md").read_text(encoding="utf-8")


def stable() -> tuple[set[str], set[str]]:
    """Packages with all of ``__all__`` public, and modules that are documented whole."""
    listed = set(re.findall(r"^\| `(biotac[\w.]*)` \|", API, re.M))
    return listed, set(re.findall(r"^\.\. automodule:: (biotac[\w.]+)$", API, re.M))


def foreign(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of each use of biotac that is not public."""
    packages, modules = stable()
    tree = ast.parse(source)
    aliases = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for name in node.names:
                if name.name.split(".")[0] == "biotac" and name.name != "biotac":
                    yield node.lineno, f"import {name.name}"
                aliases |= {"biotac": "biotac"} if name.name == "biotac" else {}
        elif isinstance(node, ast.ImportFrom) and not node.level and (node.module or "").split(".")[0] == "biotac":
            home = str(node.module)
            for name in node.names:
                whole = f"{home}.{name.name}"
                if whole in packages | modules:
                    aliases[name.asname or name.name] = whole
                elif not is_public(home, name.name, packages, modules):
                    yield node.lineno, f"from {home} import {name.name}"
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in aliases:
            home = aliases[node.value.id]
            if f"{home}.{node.attr}" not in packages | modules and not is_public(home, node.attr, packages, modules):
                yield node.lineno, f"{home}.{node.attr}"


def is_public(home: str, name: str, packages: set[str], modules: set[str]) -> bool:
    """Whether ``name`` of ``home`` is public: by ``__all__`` of a listed package, or in a documented module."""
    if home in packages:
        return name in importlib.import_module(home).__all__
    return home in modules and not name.startswith("_")


@pytest.mark.parametrize("path", LAB, ids=lambda path: path.stem)
def test_the_lab_uses_public_names_only(path: Path) -> None:
    assert [f"{path.name}:{line}: {name}" for line, name in foreign(path.read_text(encoding="utf-8"))] == []


def test_the_gateway_never_imports_the_lab() -> None:
    assert [
        path for path in GATEWAY if "biotac_lab" in re.sub(r"#.*|\"\"\".*?\"\"\"", "", path.read_text(), flags=re.S)
    ] == []


def test_every_listed_package_names_what_it_promises() -> None:
    packages, _ = stable()
    assert {"biotac", "biotac.sim"} <= packages
    for package in packages:
        module = importlib.import_module(package)
        assert all(hasattr(module, name) for name in module.__all__), package


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("from biotac.hand.streams import Streams", 1),
        ("from biotac.sim import _secret", 1),
        ("import biotac.core.finger", 1),
        ("import biotac\nbiotac._HOMES", 1),
        ("from biotac import sim\nsim.physics", 1),
        ("import biotac\nbiotac.open\nfrom biotac.sim import SimFinger\nfrom . import other", 0),
    ],
)
def test_it_can_fail(source: str, found: int) -> None:
    assert len(list(foreign(source))) == found
