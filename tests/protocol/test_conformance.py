"""protocol/conformance: ours in C and in Python and one in JavaScript pass it, and defective ones do not."""

import json
import os
import shutil
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
CONFORMING = Path(__file__).parent / "conforming"
LIBRARY = [sys.executable, str(CONFORMING / "library.py")]


def verdict(*command: str) -> subprocess.CompletedProcess[str]:
    if "node" in command and not shutil.which("node"):
        raise FileNotFoundError(2, "which the other process would meet", "node")  # see tests/conftest.py
    run = [sys.executable, str(ROOT / "protocol/conformance"), *command]
    return subprocess.run(run, capture_output=True, text=True, check=False)


def passes(*command: str) -> str:
    done = verdict(*command)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("options", "sources"),
    [
        ([f"-I{ROOT}/firmware/core"], sorted((ROOT / "firmware/core/wire").glob("*.c"))),
        (["-DCLIENT", f"-I{ROOT}/firmware/client"], [ROOT / "firmware/client/biotac_client.c"]),
    ],
    ids=["firmware", "client"],
)
def test_the_wire_in_c_conforms(tmp_path: Path, options: list[str], sources: list[Path]) -> None:
    program = tmp_path / "wire"
    build = ["cc", "-std=c11", "-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined", *options]
    subprocess.run([*build, CONFORMING / "core.c", *sources, "-o", program], check=True)
    report = passes(str(program))
    # It encodes in place and frames only: the requests for `frame` cover that.
    assert report.count("not offered") == 1 and "cobs     not offered" in report


def test_the_librarys_wire_conforms() -> None:
    assert passes(*LIBRARY).count("not offered") == 2  # COBS is inside of the framing, in C


def test_one_that_shares_no_code_conforms() -> None:
    assert "not offered" not in passes("node", str(CONFORMING / "other.mjs"))


@pytest.mark.parametrize(
    "right, wrong, kind",
    [
        ("if (last && !group.length) return;", "", "cobs"),
        ("encoded.length > MOST_BYTES", "encoded.length >= MOST_BYTES", "unframe"),
        ("code < 255 && next", "next", "uncobs"),
        ('type[0] === "i"', 'type === "i16"', "unpack"),
    ],
)
def test_a_mistake_is_found_and_named(tmp_path: Path, right: str, wrong: str, kind: str) -> None:
    text = (CONFORMING / "other.mjs").read_text()
    assert text.count(right) == 1
    text = text.replace(right, wrong).replace('new URL("../../../protocol/schema.json", import.meta.url)', "SCHEMA")
    defective = tmp_path / "defective.mjs"
    defective.write_text(text.replace("SCHEMA", json.dumps(str(ROOT / "protocol/schema.json"))))
    done = verdict("node", str(defective))
    assert done.returncode == 1 and "does not conform" in done.stdout
    blamed = [
        line.split()[0] for line in done.stdout.splitlines() if line[:1] != " " and " of " in line and not_all(line)
    ]
    assert kind in blamed


def not_all(line: str) -> bool:
    _, passed, _, asked = line.split()
    return passed != asked


def test_what_cannot_be_asked_is_said() -> None:
    for command in (["false"], ["/nowhere/to/be/found"]):
        done = verdict(*command)
        assert done.returncode == 2 and "cannot be checked against the vectors" in done.stderr
    assert verdict().returncode == 2
    assert "it offers nothing" in verdict("sed", "s/.*/no/").stdout


def test_the_schemas_hash_is_what_the_spec_says() -> None:
    """SPEC.md, Versions, followed from schema.json alone."""

    def without_doc(node: Any) -> Any:
        if isinstance(node, dict):
            return {key: without_doc(value) for key, value in node.items() if key not in ("doc", "force", "do")}
        return [without_doc(value) for value in node] if isinstance(node, list) else node

    schema = json.loads((ROOT / "protocol/schema.json").read_text())
    report = schema.pop("schema_hash")
    del schema["link"]["enum"]["board"]
    assert zlib.crc32(json.dumps(without_doc(schema), sort_keys=True, separators=(",", ":")).encode()) == report


@pytest.mark.parametrize("ci", ["", "1"])
def test_without_its_program_a_test_is_left_out_in_words_but_not_in_ci(ci: str) -> None:
    one = f"{__file__}::test_one_that_shares_no_code_conforms"
    run = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-rs", f"--rootdir={ROOT}", one]
    done = subprocess.run(run, capture_output=True, text=True, cwd=ROOT, env=os.environ | {"PATH": "", "BIOTAC_CI": ci})
    assert (done.returncode, "no node on the PATH" in done.stdout) == ((1, False) if ci else (0, True)), done.stdout
