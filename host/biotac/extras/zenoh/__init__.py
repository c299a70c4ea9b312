"""Boards on a network, by Zenoh: ``biotac share PORT --zenoh left`` shares one, ``zenoh:left`` is then a PORT.

The wire is passed on as it comes: whole messages in numbered batches, so that a reader that is too slow loses whole
batches and knows how many. Commands are queries that the sharing computer answers (host/docs/guides/network.md). Needs
the extra ``zenoh``.
"""

from __future__ import annotations
