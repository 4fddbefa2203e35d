"""A real browser for pages: Debian's chromium, driven by playwright. What it complains of fails the test."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from system_packages import need

ARGUMENTS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
WIDE, NARROW = {"width": 1280, "height": 900}, {"width": 400, "height": 800}


@contextmanager
def browser() -> Iterator[Any]:
    """A browser that is ended with the block."""
    program = shutil.which("chromium")
    need(program, "chromium: apt-get install chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=program, args=ARGUMENTS)
        try:
            yield started
        finally:
            started.close()


@dataclass
class Watched:
    """A page, and all that went wrong in it. home: what its requests may begin with."""

    page: Any
    home: tuple[str, ...]
    troubles: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.page.on("console", self._said)
        self.page.on("pageerror", lambda error: self.troubles.append(f"error: {error}"))
        self.page.on("request", self._asked)

    def _said(self, message: Any) -> None:
        if message.type in ("error", "warning"):
            self.troubles.append(f"{message.type}: {message.text}")

    def _asked(self, request: Any) -> None:
        if not request.url.startswith((*self.home, "data:", "blob:", "about:")):
            self.troubles.append(f"a request left the page: {request.url}")


@contextmanager
def watched(started: Any, home: tuple[str, ...] = ("file://",), **context: Any) -> Iterator[Watched]:
    """A page of the browser; at the end of the block nothing may have gone wrong in it."""
    opened = started.new_context(**{"viewport": WIDE, "reduced_motion": "reduce", **context})
    try:
        seen = Watched(opened.new_page(), home)
        yield seen
        assert seen.troubles == [], seen.troubles
    finally:
        opened.close()
