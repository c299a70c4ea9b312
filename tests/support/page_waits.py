"""Waits for what the live page shows; each fails by Playwright's own time-out."""

from __future__ import annotations

from typing import Any


def until(page: Any, condition: str, argument: Any = None) -> None:
    page.wait_for_function(condition, arg=argument)


def link_is(page: Any, link: str) -> None:
    page.wait_for_selector(f'#link[data-link="{link}"]')


def await_text(page: Any, words: str) -> None:
    until(page, "w => told.textContent.includes(w)", words)
