#!/usr/bin/env python3
"""Check that every link in a folder of HTML pages leads somewhere: to a file, and to an anchor in it.

tools/check_links.py build/docs   exit 1, a line on each link that leads nowhere
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """The links of a page, and the anchors in it."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = {""}
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name == "id" or (tag == "a" and name == "name"):
                self.anchors.add(value or "")
            elif name in ("href", "src") and value is not None:
                self.links.append(value)


def broken(folder: Path) -> Iterator[str]:
    """One line for each link that leads nowhere, or leaves this computer without https."""
    pages = {path.resolve(): Page(path) for path in sorted(folder.rglob("*.html"))}
    for path, page in pages.items():
        for link in page.links:
            url = urlsplit(link)
            name = path.relative_to(folder.resolve())
            if url.scheme or url.netloc:
                if url.scheme != "https":
                    yield f"{name}: {link} is neither one of these pages nor https"
                continue
            target = (path.parent / unquote(url.path)).resolve() if url.path else path
            if not target.is_file():
                yield f"{name}: {link} leads to no file"
            elif target in pages and unquote(url.fragment) not in pages[target].anchors:
                yield f"{name}: {link} leads to no anchor"


def main() -> int:
    """The command line."""
    if len(sys.argv) != 2 or not list(Path(sys.argv[1]).rglob("*.html")):
        print((__doc__ or "").strip(), file=sys.stderr)
        return 2
    lines = list(broken(Path(sys.argv[1])))
    print("\n".join(lines), file=sys.stderr, end="\n" if lines else "")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
