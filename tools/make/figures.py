#!/usr/bin/env python3
"""Measure the pages' figures and the pictures' data again: write them, or compare them with what is committed.

tools/make/figures.py [NAME...]            write those with NAME in their file or command; default all
tools/make/figures.py --changed [NAME...]  only those with inputs changed since
tools/make/figures.py --check [NAME...]    exit 1, naming them, where one is further off than it states

A page's figures stand between two comments, the second of which is <!-- end of figures -->:
<!-- figures: COMMAND ## SECTION | INPUT INPUT | within 1 % | made of HASH, HASH -->
COMMAND prints them, or writes them as Markdown into the folder {out}, in the section of that heading. The
source of a program or a picture is a .json, with the same facts in "figures" and COMMAND's output in "data";
{picture} is where it draws. The hashes are those of the inputs (files and folders) and of the figures, with the
picture, as written.
tools/nightly measures them all.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(
    r"<!-- figures: (?P<command>.*?)(?: ## (?P<section>.*?))? \| (?P<inputs>.*?) \| "
    r"within (?P<within>[\d.]+) % \| made of (?P<hashes>[^>]*?) -->\n(?P<text>.*?)\n<!-- end of figures -->", re.S
)  # fmt: skip
NUMBER = re.compile(r"-?(?:\d{1,3}(?:,\d{3})+|\d*\.?\d+(?:e[-+]?\d+)?)")


@dataclass(frozen=True)
class Figures:
    """One block of a page, or one picture's data."""

    file: Path
    command: str
    section: str
    inputs: str
    within: float
    hashes: str
    text: str

    @property
    def name(self) -> str:
        """Page or picture, and the source of the figures."""
        return f"{self.file.relative_to(ROOT)}: {self.command}" + (f" ## {self.section}" if self.section else "")

    def hashes_of(self, text: str) -> str:
        """The hashes of the inputs as they are and of ``text``, with the picture."""
        drawn = self.file.with_suffix(".png").read_bytes() if "{picture}" in self.command else b""
        return f"{inputs_hash(self.inputs)}, {_hash(text.encode(), drawn)}"

    def measured(self, draw: bool = False) -> str:
        """The command's output now. With ``draw``, the picture is drawn, too."""
        picture = str(self.file.with_suffix(".png")) if draw else os.devnull
        text = output(self.command.replace("{picture}", picture))
        if self.section:
            parts = re.split(r"^#+ (.*)\n", text, flags=re.M)
            named = dict(zip(parts[1::2], parts[2::2], strict=True))
            if self.section not in named:
                raise SystemExit(f"{self.name}: no such section; the command has {', '.join(named)}")
            text = named[self.section]
        return text.strip()

    def differences(self, now: str) -> list[str]:
        """The figures that are further off than stated, or the words that are others."""
        if NUMBER.sub("#", self.text) != NUMBER.sub("#", now):
            return ["other words or rows"]
        seen, wanted = ([n.replace(",", "") for n in NUMBER.findall(text)] for text in (self.text, now))
        limit = self.within / 100
        return [
            f"{a} is {b} now, more than {self.within:g} % off"
            for a, b in zip(seen, wanted, strict=True)
            if abs(float(a) - float(b)) > limit * abs(float(b)) + 1e-9
        ]

    def write(self, now: str) -> None:
        """Replace the file's figures and hashes by those of ``now``."""
        whole = self.file.read_text(encoding="utf-8")
        if self.file.suffix == ".json":
            document = {"figures": json.loads(whole)["figures"], "data": json.loads(now)}
            document["figures"]["made of"] = self.hashes_of(json.dumps(document["data"]))
            whole = json.dumps(document, indent=1) + "\n"
        else:
            old = next(m for m in BLOCK.finditer(whole) if m["text"] == self.text and m["hashes"] == self.hashes)
            hashes, text = old.span("hashes"), old.span("text")
            between = whole[hashes[1] : text[0]]
            whole = whole[: hashes[0]] + self.hashes_of(now) + between + now + whole[text[1] :]
        self.file.write_text(whole, encoding="utf-8")


def found(names: list[str] | None = None) -> list[Figures]:
    """All figures of the repository that have one of ``names`` in their own."""
    out = []
    files = subprocess.run(["git", "ls-files", "*.md", "*.json"], cwd=ROOT, capture_output=True, text=True, check=True)
    for file in (ROOT / line for line in files.stdout.splitlines()):
        whole = file.read_text(encoding="utf-8")
        if file.suffix == ".json" and whole.startswith('{\n "figures":'):
            document = json.loads(whole)
            about = document["figures"]
            out.append(Figures(file, about["command"], "", about["inputs"], about["within %"],
                               about["made of"], json.dumps(document["data"])))  # fmt: skip
        for m in BLOCK.finditer(whole) if file.suffix == ".md" else ():
            out.append(Figures(file, m["command"], m["section"] or "", m["inputs"],
                               float(m["within"]), m["hashes"], m["text"]))  # fmt: skip
    return [figure for figure in out if not names or any(name in figure.name for name in names)]


@cache
def inputs_hash(inputs: str) -> str:
    """Of all files under these paths that git knows, by content; measured files (figures.json) are no input."""
    files = [*inputs.split(), ":!*/figures.json"]
    listed = subprocess.run(["git", "ls-files", *files], cwd=ROOT, capture_output=True, text=True, check=True)
    return _hash(*(part for name in listed.stdout.splitlines() for part in (name.encode(), (ROOT / name).read_bytes())))


@cache
def output(command: str) -> str:
    """The output of ``command``, and the Markdown that it writes into {out}."""
    with tempfile.TemporaryDirectory() as out:
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        words = command.format(out=out).split()
        ran = subprocess.run(words, cwd=ROOT, env={**os.environ, "PATH": path}, text=True, stdout=subprocess.PIPE)
        if ran.returncode:
            raise SystemExit(f"{command}: exit code {ran.returncode}")
        return ran.stdout if "{out}" not in command else "".join(p.read_text("utf-8") for p in Path(out).glob("*.md"))


def _hash(*parts: bytes) -> str:
    whole = hashlib.sha256()
    for part in parts:
        whole.update(len(part).to_bytes(8, "little") + part)
    return whole.hexdigest()[:12]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="only compare")
    parser.add_argument("--changed", action="store_true", help="only those made of other inputs than there are now")
    parser.add_argument("names", metavar="NAME", nargs="*", help="those with NAME in their file or command")
    args = parser.parse_args()
    off = 0
    for figure in found(args.names):
        if args.changed and figure.hashes.split(", ")[0] == inputs_hash(figure.inputs):
            continue
        now = figure.measured(draw=not args.check)
        if not args.check:
            figure.write(now)
        for line in figure.differences(now) if args.check else ():
            print(f"{figure.name}: {line}", file=sys.stderr)
            off = 1
    return off


if __name__ == "__main__":
    sys.exit(main())
