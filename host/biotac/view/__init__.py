"""The live page: one thread reads a board or a recording, HTTP threads on 127.0.0.1 show it to browsers.

No framework and no external files: Python's own HTTP server, server-sent events, plain modules in static/.
"""

from __future__ import annotations

#: The page's TCP port, if it is free.
DEFAULT_PORT = 8719
