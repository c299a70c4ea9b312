#!/usr/bin/env bash
# io.BufferedRWPair, which socket.makefile("rwb") gives, returns more than size bytes from readline(size) when a line
# comes in pieces; io.BufferedReader ("rb") does not. "If size is specified, at most size bytes will be read", says
# IOBase.readline, whose code it is: it compares each piece with the whole size, not with what is left of it.
# Seen with CPython 3.11.7 and 3.13.0; fails where that has changed.
set -euo pipefail
python3 - <<'END'
import io
import sys


class Pieces(io.RawIOBase):
    def __init__(self):
        self.left = [b"a" * 10, b"b" * 10]

    def readable(self):
        return True

    def writable(self):
        return True

    def readinto(self, buffer):
        piece = self.left.pop(0) if self.left else b""
        buffer[: len(piece)] = piece
        return len(piece)


one = io.BufferedReader(Pieces()).readline(12)
both = io.BufferedRWPair(Pieces(), Pieces()).readline(12)
print(f"CPython {sys.version.split()[0]}: readline(12) of BufferedReader has {len(one)} bytes, of BufferedRWPair {len(both)}")
assert (len(one), len(both)) == (12, 20)
END
