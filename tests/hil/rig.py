"""A rig: a board with surroundings, and the faults a test may play: rigs/*.toml and firmware/boards/*/rig.toml."""

import fcntl
import os
import shutil
import subprocess
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from served_board import ServedBoard

import biotac
from bench import BenchPty, open_bench
from biotac.documents import tomllib
from biotac.hand.opening import shake_hands
from biotac.sim.loading import load_source
from biotac.sim.ports import SIM, parse_sim, start_board
from biotac.sim.source import Source
from biotac_rig.two_picos import TwoPicos

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
NO_MAPS = "a {} keeps no wrench maps (HELLO)"  # of board_name()


@dataclass
class Rig:
    """One of rigs/*.toml, with the hands opened on it during a test."""

    name: str
    facts: dict[str, Any]
    port: str | None
    sensor_port: str | None
    opened: list[Any] = field(default_factory=list)

    @property
    def image(self) -> Path:
        """The UF2 of the image that an emulated board runs."""
        board = self.facts["board"]
        return ROOT / f"build/{board}/biotac-{board}.uf2"

    def need(self, ability: str) -> None:
        """Skip the test when this rig has not got the ability."""
        why = self.facts.get("cannot", {}).get(ability)
        if why is not None:
            pytest.skip(f"{self.name}: {why}")

    def can(self, ability: str) -> bool:
        """Whether the rig has the ability: for a mere part of a test."""
        return ability not in self.facts.get("cannot", {})

    def open(self, source: str = "press.toml", *, reconnect: bool = False) -> biotac.Hand:
        """Open the board; a rig that plays scenarios plays ``source``, which may carry ?options."""
        path, _, options = source.partition("?")
        if self.sensors_are_a_board or self.facts.get("board") == "two_picos":
            sim = parse_sim(f"sim:{source}", pace=0.0)
            played = load_source(sim.source, fingers=sim.fingers, seconds=sim.seconds)
            return self.open_with(played, pace=sim.pace, reconnect=reconnect)
        port = self.facts["port"].format(source=path, options=options, port=self.port)
        hand = biotac.open(port, reconnect=reconnect)
        self.opened.append(hand)
        return hand

    def open_with(self, source: Source, *, pace: float = 0.0, reconnect: bool = False) -> biotac.Hand:
        """Open the board with words that no file holds."""
        self.need("scenarios")
        if self.sensors_are_a_board:
            hand = open_bench(self.port, self.sensor_port, source)
        else:
            link = start(self.facts["board"], source, pace=pace).link(self.name)
            hand = shake_hands(link, reconnect=reconnect)
        self.opened.append(hand)
        return hand

    @property
    def sensors_are_a_board(self) -> bool:
        """A real one, beside the real gateway."""
        return "{sensor_port}" in self.facts["port"]

    def play(self, source: str) -> biotac.Hand:
        """Open the board with ``source``, or skip when it cannot be played."""
        self.need("scenarios")
        return self.open(source)

    def on_a_pty(self, source: str, *, pace: float) -> Any:
        """The board as ``biotac sim`` starts it; board time runs from the start."""
        self.need("scenarios")
        if self.sensors_are_a_board:
            board = BenchPty(self.port, self.sensor_port, load_source(source, seconds=600))
        elif self.facts["board"] == SIM:
            board = ServedBoard(load_source(source, seconds=600), pace=pace)
        else:
            board = start(self.facts["board"], load_source(source, seconds=600), pace=pace)
        board.release()
        self.opened.append(board)
        return board

    def close(self) -> None:
        for board in reversed(self.opened):
            board.close()
        self.opened.clear()


def start(board: str, source: Source, *, pace: float) -> Any:
    return TwoPicos(source, pace=pace, hold=True) if board == "two_picos" else start_board(board, source, pace=pace)


def all_rigs() -> dict[str, dict[str, Any]]:
    """Those of rigs/*.toml by name, a board's own by the folder's; each with the facts of the rig it is ``like``."""
    rigs = {path.stem: tomllib.loads(path.read_text()) for path in sorted((HERE / "rigs").glob("*.toml"))}
    for path in sorted((ROOT / "firmware/boards").glob("*/rig.toml")):
        rigs[path.parent.name] = tomllib.loads(path.read_text())

    def whole(facts: dict[str, Any]) -> dict[str, Any]:
        like = whole(rigs[facts["like"]]) if "like" in facts else {}
        return like | facts | {"cannot": like.get("cannot", {}) | facts.get("cannot", {})}

    return {name: whole(facts) for name, facts in rigs.items()}


def prepare(facts: dict[str, Any]) -> str | None:
    """Build the programs that the rig needs; returns why it cannot be used, or None."""
    missing = [tool for tool in facts.get("tools", []) if shutil.which(tool) is None]
    if missing:
        return f"{', '.join(missing)} missing; tools/test installs what this rig needs"
    (ROOT / "build").mkdir(exist_ok=True)
    with open(ROOT / "build/rigs.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # of several test processes one builds, the others find it built
        for command in facts.get("prepare", []):
            done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
            if done.returncode:
                raise RuntimeError(f"{' '.join(command)} failed: {(done.stderr or done.stdout).strip()}")
    return None


def require(facts: dict[str, Any]) -> None:
    """Build the programs that the rig needs; a rig that cannot be used skips the test, and fails it in CI."""
    if why := prepare(facts):
        pytest.fail(why) if in_ci() else pytest.skip(why)


def in_ci() -> bool:
    return bool(os.environ.get("BIOTAC_CI"))
