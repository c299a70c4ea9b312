"""Access to a shared board: nobody from elsewhere gets through, unless Zenoh is configured to ask for proof."""

import json
import os
import subprocess
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from served_board import free_port

from biotac.errors import InputError, PortError
from biotac.extras.zenoh import network

pytest.importorskip("zenoh")


def test_nothing_leaves_this_computer_without_a_configuration(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.delenv("ZENOH_CONFIG", raising=False)
    for endpoint in ("tcp/0.0.0.0:7447", "tcp/192.0.2.1:7447", "tls/[::]:7447", "udp/example.org:7447", "nonsense"):
        for kind in ("connect", "listen"):
            with pytest.raises(InputError, match="leaves this computer"):
                network.open_session("left", **{kind: endpoint})
    with closing(network.open_session("left")) as session:
        assert session.zid()
        assert {address for address in listening_at() if address != LOOPBACK_HEX} == set()


LOOPBACK_HEX = "0100007F"


def listening_at() -> set[str]:
    """IPv4 and IPv6 addresses on which this process listens for TCP, as the kernel writes them."""
    inodes = {os.readlink(fd) for fd in Path("/proc/self/fd").iterdir() if fd.exists()}
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/self/net/{table}").read_text().splitlines()[1:]:
            _, local, _, state, *_, inode = line.split()[:10]
            if state == "0A" and f"socket:[{inode}]" in inodes:
                found.add(local.partition(":")[0])
    return found


def reached(folder: Path, endpoint: str, of_server: Any, of_clients: list[Any]) -> list[bool]:
    """The callers that get through to a board's program, each with a Zenoh configuration or, for None, without."""

    def file(name: str, transport: Any) -> Path | None:
        if transport is None:
            return None
        path = folder / f"{name}.json5"
        path.write_text(json.dumps({"transport": transport}))
        return path

    seen = []
    with closing(network.open_session("left", listen=endpoint, config=file("server", of_server))) as server:
        here = server.declare_queryable(network.key("left", "info"), lambda query: query.reply(query.key_expr, b"{}"))
        for k, transport in enumerate(of_clients):
            try:
                with closing(network.open_session("t", connect=endpoint, config=file(f"{k}", transport))) as session:
                    seen.append(any(reply.ok for reply in session.get(network.key("left", "info"), timeout=60.0)))
            except PortError as error:
                assert "password or a certificate" in str(error)
                seen.append(False)
        here.undeclare()
    return seen


def test_a_password_keeps_others_out(tmp_path: Path) -> None:
    (tmp_path / "users").write_text("lab:good\n")
    good, bad = ({"auth": {"usrpwd": {"user": "lab", "password": word}}} for word in ("good", "bad"))
    server = {"auth": {"usrpwd": {"user": "lab", "password": "good", "dictionary_file": str(tmp_path / "users")}}}
    assert reached(tmp_path, f"tcp/127.0.0.1:{free_port()}", server, [good, bad, None]) == [True, False, False]


@pytest.mark.nightly
def test_tls_keeps_others_out(tmp_path: Path) -> None:
    """Certificates by openssl, as host/docs/guides/network.md says."""
    for name in ("board", "other"):
        options = ["-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost"]
        options += ["-addext", "subjectAltName=DNS:localhost", "-addext", "basicConstraints=critical,CA:FALSE"]
        files = ["-keyout", str(tmp_path / f"{name}.key"), "-out", str(tmp_path / f"{name}.pem")]
        subprocess.run(["openssl", "req", *options, *files], check=True, capture_output=True)
    board, other = ({"link": {"tls": {"root_ca_certificate": str(tmp_path / f"{n}.pem")}}} for n in ("board", "other"))
    keys = {"listen_private_key": str(tmp_path / "board.key"), "listen_certificate": str(tmp_path / "board.pem")}
    server = {"link": {"tls": keys}}
    assert reached(tmp_path, f"tls/localhost:{free_port()}", server, [board, other, None]) == [True, False, False]
