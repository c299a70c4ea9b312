"""Imports and includes run one way: as the table of rooms in docs/develop/architecture.md allows, never in a circle.

A name that begins with an underscore belongs to its room: no other room of host/biotac uses it on an object.

Python's imports are read wherever they stand, inside functions too, and so are modules that are named in strings.
"""

import ast
import re
import subprocess
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from fnmatch import fnmatch
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "host/docs/develop/architecture.md"
PYTHON = "host/biotac"
# Folders that Python searches; a file belongs to the first that it lies in.
SEARCHED = ("host/biotac-lab/", "host/biotac-rig/", "host/ros2/biotac_ros2/", "host/", "tools/", "tests/support/", "")
C = ("firmware", "host/binding")
BY_NAME = re.compile(r"biotac(\.\w+)+(:\w+)?")
NOT_CODE = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\])*"', re.S)
ONE_AN_IMAGE = ("firmware/boards/", "firmware/sensor_board/", "firmware/port/")  # folders with siblings
FUNCTION = re.compile(r"^[A-Za-z_][\w *]*?\b(\w+)\([^;{]*\)\s*\{", re.M)


@dataclass(frozen=True)
class Arrow:
    """``source`` in ``line`` imports ``target``; files relative to the root."""

    source: str
    line: int
    target: str


@dataclass
class Table:
    """Rooms that a room may import, and files that may name others above them."""

    rooms: dict[str, set[str]] = field(default_factory=dict)
    hooks: set[tuple[str, str]] = field(default_factory=set)

    def room(self, file: str) -> str | None:
        """The nearest room around a file; a room is a folder or a single file, or with a * several of these."""
        around = [file, *map(str, Path(file).parents)]
        named = next((place for place in around if place in self.rooms), None)
        wild = next((name for place in around for name in self.rooms if is_one_of(place, name)), None)
        return max(filter(None, (named, wild)), key=lambda name: name.count("/"), default=None)


def is_one_of(place: str, name: str) -> bool:
    return fnmatch(place, name) and place.count("/") == name.count("/") and Path(place).suffix == Path(name).suffix


def read_table(page: str) -> Table:
    """Rows of a room, a sentence and the rooms it may import; rows of a file, a file and why under Hooks."""
    table = Table()
    rooms, _, hooks = page.partition("\n## Hooks")
    for row in re.findall(r"^\| `(.+?)` \|[^|]*\|([^|]*)\|$", rooms, re.M):
        table.rooms[row[0]] = set(re.findall(r"`(.+?)`", row[1]))
    for source, target in re.findall(r"^\| `(.+?)` \| `(.+?)` \|", hooks, re.M):
        table.hooks.add((source, target))
    return table


def tracked(root: Path) -> list[str]:
    """The project's files: git's, or all where there is no git."""
    if not (root / ".git").exists():
        return [str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()]
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True).stdout.splitlines()
    return [name for name in listed if (root / name).is_file()]


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def python_arrows(root: Path, files: tuple[str, ...]) -> list[Arrow]:
    """Imports of the project's modules by other modules of the project."""
    modules, arrows = {}, []
    for file in (file for file in files if file.endswith(".py")):
        below = file.removeprefix(next(folder for folder in SEARCHED if file.startswith(folder)))
        modules[below.removesuffix(".py").replace("/", ".").removesuffix(".__init__")] = file
    for module, file in modules.items():
        package = module if file.endswith("/__init__.py") else module.rpartition(".")[0]
        for node in ast.walk(parsed(root / file)):
            for name in imported(node, module, package):
                named = [name, name.rpartition(".")[0]] if not isinstance(node, ast.Constant) else [name]
                known = next((it for it in named if it in modules), module)
                if known != module:
                    arrows.append(Arrow(file, getattr(node, "lineno", 0), modules[known]))
    return arrows


def imported(node: ast.AST, module: str, package: str) -> Iterator[str]:
    """Absolute names that a node imports; for ``from a import b`` it is a.b, which may be a module or a name in one."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        base = absolute("." * node.level + (node.module or ""), package)
        yield from (f"{base}.{alias.name}" for alias in node.names)
    elif isinstance(node, ast.Constant) and isinstance(node.value, str) and BY_NAME.fullmatch(node.value):
        yield node.value.partition(":")[0]
    elif isinstance(node, ast.Call) and len(node.args) == 2 and ast.unparse(node.func).endswith("import_module"):
        name, anchor = (ast.unparse(argument) for argument in node.args)
        if name.startswith("'."):
            yield absolute(ast.literal_eval(name), module if anchor == "__name__" else package)


def absolute(name: str, package: str) -> str:
    """``..wire.frames`` as seen from ``package``."""
    dots = len(name) - len(name.lstrip("."))
    if dots == 0:
        return name
    return ".".join([*package.split(".")[: package.count(".") + 2 - dots], *filter(None, [name.lstrip(".")])])


def c_arrows(root: Path, files: Iterable[str]) -> Iterator[Arrow]:
    """Includes in quotes; one that no file of the project matches is an error too."""
    sources = [file for file in files if file.startswith(C) and file.endswith((".c", ".h"))]
    named = [file for file in files if file.endswith(".h") and not file.startswith("tests/")]
    for file in sources:
        for number, line in enumerate((root / file).read_text(encoding="utf-8").splitlines(), 1):
            include = re.match(r'\s*#\s*include\s*"(.+?)"', line)
            if not include:
                continue
            found = headers_of(file, include[1], named)
            one_an_image = all(header.startswith(ONE_AN_IMAGE) for header in found)
            assert found and (len(found) == 1 or one_an_image), f"{file}:{number}: {include[1]} is {found or 'nowhere'}"
            yield from (Arrow(file, number, header) for header in found)


def headers_of(file: str, name: str, headers: Iterable[str]) -> list[str]:
    """Files that an include may mean: the file beside, or in the same port; else all, of which an image has one."""
    near = [str(Path(file).parent / name), *(str(place / name) for place in Path(file).parents if is_port(place))]
    return [path for path in near if path in headers][:1] or [h for h in headers if h.endswith(f"/{name}")]


def is_port(folder: Path) -> bool:
    return str(folder.parent) == "firmware/port"


def c_calls(root: Path, files: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Pairs of C files, the first naming a function of the second: a header that several share does not tell.

    A function that several files define depends on the image, as port.h's do, and leads nowhere.
    """
    c = [file for file in files if file.startswith(C) and file.endswith((".c", ".h"))]
    code = {file: NOT_CODE.sub("", (root / file).read_text(encoding="utf-8")) for file in c}
    declared = {name for file in c if file.endswith(".h") for name in re.findall(r"(\w+)\(", code[file])}
    named = {file: set(re.findall(r"(?<![.>\w])\w+\b", text)) for file, text in code.items() if file.endswith(".c")}
    homes: dict[str, list[str]] = defaultdict(list)
    for file in named:
        for name in declared.intersection(FUNCTION.findall(code[file])):
            homes[name].append(file)
    for name, home in homes.items():
        if len(home) == 1:
            yield from ((file, home[0]) for file, names in named.items() if name in names)


def wrong(arrows: Iterable[Arrow], table: Table) -> list[str]:
    """The arrows that point the wrong way, each with file and line."""
    found = []
    for arrow in arrows:
        own, other = table.room(arrow.source), table.room(arrow.target)
        if None in (own, other):
            found.append(f"{arrow.source}:{arrow.line}: {arrow.source if own is None else arrow.target} has no room")
        elif own != other and other not in table.rooms[str(own)] and not hooked(arrow, table):
            found.append(f"{arrow.source}:{arrow.line}: {own} may not import {other} ({arrow.target})")
    return found


def hooked(arrow: Arrow, table: Table) -> bool:
    """Whether the page's second table allows the arrow."""
    return (arrow.source, arrow.target) in table.hooks


def circles(edges: Iterable[tuple[str, str]]) -> list[list[str]]:
    """Groups of nodes with a path from each back to itself (Tarjan)."""
    graph = defaultdict(set)
    for source, target in edges:
        graph[source].add(target)
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for target in sorted(graph.get(node, ())):
            if target not in index:
                visit(target)
                low[node] = min(low[node], low[target])
            elif target in stack:
                low[node] = min(low[node], index[target])
        if low[node] == index[node]:
            group = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(group) > 1:
                found.append(sorted(group))

    for node in sorted(graph):
        if node not in index:
            visit(node)
    return found


def stem(file: str) -> str:
    """A C module: header and source are one."""
    return file[:-2]


def judge(root: Path, table: Table) -> list[str]:
    """All that is wrong with the project at ``root``."""
    files = tracked(root)
    python, c = python_arrows(root, tuple(files)), list(c_arrows(root, files))
    found = wrong([*(a for a in python if a.source.startswith(f"{PYTHON}/")), *c], table)
    for circle in circles((a.source, a.target) for a in python if not hooked(a, table)):
        found.append(f"{circle[0]}: in a circle with {', '.join(circle[1:])}")
    ties = [*((a.source, a.target) for a in c), *c_calls(root, files)]
    for circle in circles((stem(source), stem(target)) for source, target in ties if stem(source) != stem(target)):
        found.append(f"{circle[0]}.c: in a circle with {', '.join(circle[1:])}")
    return found


def test_every_arrow_points_the_way_the_page_says() -> None:
    assert judge(ROOT, read_table(PAGE.read_text(encoding="utf-8"))) == []


def test_the_page_is_about_what_there_is_and_runs_one_way() -> None:
    table = read_table(PAGE.read_text(encoding="utf-8"))
    places = [*table.rooms, *(end for hook in table.hooks for end in hook)]
    assert [place for place in places if not any(ROOT.glob(place))] == []
    assert [name for may in table.rooms.values() for name in may if name not in table.rooms] == []
    assert circles((room, other) for room, may in table.rooms.items() for other in may) == []
    used = {(a.source, a.target) for a in python_arrows(ROOT, tuple(tracked(ROOT)))}
    assert table.hooks - used == set(), "a hook that nothing needs"


def crowded(files: Iterable[str]) -> list[str]:
    """Folders of code that are too full to find a file in."""
    lie_in = Counter(
        str(Path(file).parent) for file in files if file.startswith(("firmware/", "host/", "tests/", "tools/"))
    )
    return [f"{folder}: {count} files" for folder, count in lie_in.items() if count > 25 and folder != "host/docs"]


def test_no_folder_holds_more_than_one_can_overlook() -> None:
    assert crowded(tracked(ROOT)) == []
    assert crowded(f"tools/{k}.py" for k in range(26)) == ["tools: 26 files"]


def privates(tree: ast.AST) -> Iterator[ast.Attribute]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.endswith("__"):
            yield node


def own(node: ast.Attribute) -> bool:
    return isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")


def reached_into(root: Path, table: Table) -> list[str]:
    """Each ``x._name`` that no class of that room has, or with x named after another room: ``hand._name``."""
    rooms, found = dict[str, set[str]](), []
    folders = {name.removeprefix(f"{PYTHON}/") for name in table.rooms if name.startswith(PYTHON)}
    own_files = [file for file in tracked(root) if file.startswith(f"{PYTHON}/") and file.endswith(".py")]
    files = [(f, str(table.room(f)), parsed(root / f)) for f in own_files]
    for _, room, tree in files:
        defined = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
        rooms.setdefault(room, set()).update(defined, (node.attr for node in privates(tree) if own(node)))
    for file, room, tree in files:
        modules = {name.name for node in ast.walk(tree) if isinstance(node, ast.Import) for name in node.names}
        for node in privates(tree):
            x = ast.unparse(node.value)
            named = x.rpartition(".")[2].strip("_")
            other = named in folders and room != f"{PYTHON}/{named}"
            if not own(node) and x not in modules and (other or node.attr not in rooms[room]):
                found.append(f"{file}:{node.lineno}: {x}.{node.attr}")
    return found


def test_no_room_reaches_into_another_rooms_objects() -> None:
    assert reached_into(ROOT, read_table(PAGE.read_text(encoding="utf-8"))) == []


def written(root: Path, room: str) -> list[str]:
    """Attributes that a file of ``room`` sets on objects of another file; a batch is a value that it makes."""
    found = []
    for file in (file for file in tracked(root) if file.startswith(f"{room}/")):
        tree = parsed(root / file)
        stores = [n for n in ast.walk(tree) if isinstance(n, ast.Attribute) and not isinstance(n.ctx, ast.Load)]
        ours = {node.attr for node in stores if own(node)} | {"__cause__"}
        others = [n for n in stores if not own(n) and n.attr not in ours and ast.unparse(n.value) != "batch"]
        found += [f"{file}:{node.lineno}: {ast.unparse(node)}" for node in others]
    return found


@pytest.mark.parametrize("room", ["host/biotac/board", "host/biotac/hand"])
def test_the_state_of_a_connection_is_changed_by_its_owner_alone(room: str) -> None:
    assert written(ROOT, room) == []


# ---- each check can fail -------------------------------------------------------------------------

MADE_UP = """
| room | what is in it | may import |
|---|---|---|
| `host/biotac/low` | ground | |
| `host/biotac/high` | above it | `host/biotac/low` |
| `firmware/low` | ground | |
| `firmware/high` | above it | `firmware/low` |

## Hooks

| file | names | why |
|---|---|---|
| `host/biotac/low/hook.py` | `host/biotac/high/top.py` | on purpose |
"""


@pytest.mark.parametrize(
    ("files", "complaint"),
    [
        ({"host/biotac/low/a.py": "from ..high import top\n"}, "host/biotac/low/a.py:1: host/biotac/low may not"),
        ({"host/biotac/low/a.py": "from biotac.high.top import x\n"}, "host/biotac/low/a.py:1: "),
        ({"host/biotac/low/a.py": "import biotac.high.top\n"}, "host/biotac/low/a.py:1: "),
        ({"host/biotac/low/a.py": "def f():\n    from ..high.top import x\n"}, "host/biotac/low/a.py:2: "),
        ({"host/biotac/low/a.py": "x = {'k': 'biotac.high.top:open'}\n"}, "host/biotac/low/a.py:1: "),
        ({"host/biotac/low/a.py": "\nimport_module('..high.top', __package__)\n"}, "host/biotac/low/a.py:2: "),
        ({"host/biotac/low/a.py": "import_module('...high.top', __name__)\n"}, "host/biotac/low/a.py:1: "),
        ({"host/biotac/low/a.py": "from . import b\n", "host/biotac/low/b.py": "from .a import x\n"}, "circle"),
        ({"tools/make/a.py": "from make import b\n", "tools/make/b.py": "from .a import x\n"}, "tools/make/a.py: in a"),
        ({"host/biotac/elsewhere.py": "from .low import hook\n"}, "host/biotac/elsewhere.py has no room"),
        ({"firmware/low/a.c": '#include "a.h"\n#include "high/b.h"\n', "firmware/low/a.h": ""}, "firmware/low/a.c:2: "),
        (
            {
                "firmware/high/c.h": "",
                "firmware/high/c.c": '#include "high/c.h"\n#include "high/d.h"\n',
                "firmware/high/d.h": "",
                "firmware/high/d.c": '#include "high/d.h"\n#include "high/c.h"\n',
            },
            "firmware/high/c.c: in a circle with firmware/high/d",
        ),
        (
            {
                "firmware/high/all.h": "void one(void);\nvoid other(void);\n",
                "firmware/high/e.c": '#include "high/all.h"\nvoid one(void)\n{\n    other();\n}\n',
                "firmware/high/f.c": '#include "high/all.h"\nvoid other(void)\n{\n    start(&one);\n}\n',
            },
            "firmware/high/e.c: in a circle with firmware/high/f",
        ),
    ],
)
def test_a_wrong_arrow_is_named(tmp_path: Path, files: dict[str, str], complaint: str) -> None:
    right = {
        "host/biotac/low/__init__.py": "",
        "host/biotac/low/hook.py": "y = 'biotac.high.top:open'\n",
        "host/biotac/high/top.py": "from ..low import hook\n",
        "firmware/low/ground.h": "#include <stdint.h>\n",
        "firmware/high/b.h": '#include "low/ground.h"\n',
    }
    for name, text in (right | files).items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    found = judge(tmp_path, read_table(MADE_UP))
    assert len(found) == 1 and complaint in found[0]


def test_what_reaches_into_another_room_is_named(tmp_path: Path) -> None:
    page = "| `host/biotac/hand` | x | |\n| `host/biotac/high` | x | |\n"
    files = {
        "hand/hand.py": "import os\nclass Hand:\n    def _start(self): self._board = os._exit\n",
        "hand/aio.py": "def f(hand): hand._board\n",
        "high/a.py": "class A:\n    def f(self, hand, x):\n        self._board = hand._board\n        x._start\n",
    }
    for name, text in files.items():
        (tmp_path / PYTHON / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / PYTHON / name).write_text(text, encoding="utf-8")
    named = ["high/a.py:3: hand._board", "high/a.py:4: x._start"]
    assert reached_into(tmp_path, read_table(page)) == [f"{PYTHON}/{one}" for one in named]
