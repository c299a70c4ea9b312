"""Boards on a network, by Zenoh: ``biotac serve PORT --name left`` shares one, ``zenoh:left`` is a PORT like any other.

The wire goes over as it comes: whole messages, in batches that are numbered, so that whoever is too slow loses whole
ones and knows how many. Commands are queries that the sharing computer answers. host/docs/network.md describes it.
Needs the extra ``zenoh``.
"""

from __future__ import annotations
