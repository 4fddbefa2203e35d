"""What no `pip install` brings: without it a test is skipped with the reason, and fails where CI is set."""

from __future__ import annotations

import os

import pytest


def need(there: object, what: str) -> None:
    """Go on only where it is there; what: what is missing, and how to get it."""
    if not there:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(f"needs {what}")
