"""C source as the compiler sees it: preprocessed by the system's compiler, parsed by pycparser."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from pycparser import c_ast, c_parser

ROOT = Path(__file__).resolve().parents[2]
CORE = ROOT / "firmware" / "core"

# Only what the core's arithmetic includes. The widths are those of every target we build for. A core that needed more
# of libc would fail to parse, on purpose.
HEADERS = {
    "stdint.h": """
typedef signed char int8_t; typedef unsigned char uint8_t;
typedef short int16_t; typedef unsigned short uint16_t;
typedef int int32_t; typedef unsigned int uint32_t;
typedef long long int64_t; typedef unsigned long long uint64_t;
#define INT8_MAX 127
#define INT16_MAX 32767
#define INT16_MIN (-32767 - 1)
#define UINT16_MAX 65535
#define INT32_MAX 2147483647
#define INT32_MIN (-2147483647 - 1)
#define UINT32_MAX 4294967295u
#define INT64_MAX 9223372036854775807ll
#define INT64_MIN (-9223372036854775807ll - 1)
#define UINT64_MAX 18446744073709551615ull
""",
    "stdbool.h": "#define bool _Bool\n#define true 1\n#define false 0\n",
    "stddef.h": "typedef unsigned int size_t;\n#define NULL 0\n",
    "string.h": "",
}


def preprocess(text: str, folders: Sequence[Path] = (CORE,)) -> str:
    """``text`` after preprocessing: no #include and no macro is left."""
    with tempfile.TemporaryDirectory() as folder:
        for name, content in HEADERS.items():
            Path(folder, name).write_text(content, encoding="utf-8")
        includes = [f"-I{path}" for path in (folder, *folders)]
        command = [os.environ.get("CC", "cc"), "-E", "-P", "-nostdinc", *includes, "-D__attribute__(x)=", "-xc", "-"]
        done = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ValueError(f"the compiler refuses the source:\n{done.stderr}")
    return done.stdout


@cache
def parse(text: str, folders: tuple[Path, ...] = (CORE,)) -> c_ast.FileAST:
    """The syntax tree, the same object for the same text: to change it, change a copy."""
    return c_parser.CParser().parse(preprocess(text, folders))


@cache
def text_of(path: Path) -> str:
    """A C file's text, which tests change before parsing, to see a proof fail."""
    return path.read_text(encoding="utf-8")


def changed(text: str, old: str, new: str) -> str:
    """``text`` with one place made wrong on purpose. The place must occur exactly once."""
    if text.count(old) != 1:
        raise ValueError(f"{old!r} occurs {text.count(old)} times: expected once")
    return text.replace(old, new)


# The warnings are those of every other build: a proof of C that does not compile cleanly proves nothing.
FLAGS = ("-std=c11", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion", "-Werror")


def run_c(text: str, folders: Sequence[Path], *arguments: str, sources: Sequence[Path] = ()) -> str:
    """Compile a program, run it and return its output. Raises ValueError with the output if it fails."""
    with tempfile.TemporaryDirectory() as folder:
        main, program = Path(folder, "main.c"), Path(folder, "program")
        main.write_text(text, encoding="utf-8")
        includes = [f"-I{path}" for path in (*folders, CORE)]
        compiler = os.environ.get("CC", "cc")
        subprocess.run([compiler, *FLAGS, *includes, main, *sources, "-lm", "-o", program], check=True)
        done = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        raise ValueError(done.stdout + done.stderr)
    return done.stdout
