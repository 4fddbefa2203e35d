"""What is known of every episode: its notes, and what `inphase inspect --json` says of it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from inphase.errors import DataError
from inphase.io.notes import Note, notes_for
from inphase.studio.desk import Desk

COLUMNS = ("name", "seconds", "rate", "gap", "missing", "far", "said")


class Quality:
    """Of the chosen recordings: told by `inspect`, empty until then."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._told: Mapping[str, Any] = {}

    def read(self, output: str) -> None:
        """Take over what `inphase inspect --json` printed; what is no such thing says nothing."""
        try:
            self._told = json.loads(output)
        except ValueError:
            self._told = {}

    @property
    def episodes(self) -> dict[str, dict[str, Any]]:
        """What was told of each, by name."""
        return {episode["name"]: episode for episode in self._told.get("episodes", ())}

    @property
    def channels(self) -> list[dict[str, Any]]:
        """What was told of every channel."""
        return list(self._told.get("channels", ()))

    @property
    def summary(self) -> list[str]:
        """What is to be said of all of them, a line each."""
        if not self._told:
            return []
        told = self._told
        lines = [f"{finding['kind']}: {finding['message']}" for finding in told["findings"]]
        if told["threshold"] is None:
            return [*lines, f"none is held against the others: {told['why_not']}"]
        outliers = [episode["name"] for episode in told["episodes"] if episode["outlier"]]
        if not outliers:
            return [*lines, "none is unlike the others"]
        are = "is" if len(outliers) == 1 else "are"
        return [*lines, f"{len(outliers)} {are} unlike the others: further off than {told['threshold']:.3g}"]

    def notes(self) -> dict[str, Note]:
        """What was decided of each episode; nothing where the notes cannot be used."""
        episodes = self._desk.episodes
        try:
            return dict(zip(episodes, notes_for([self._desk.path(file) for file in episodes.values()]), strict=True))
        except DataError:  # `inspect` says so
            return dict.fromkeys(episodes, Note())

    def table(self) -> dict[str, list[Any]]:
        """A row an episode, by column; NaN where nothing is known."""
        told, notes = self.episodes, self.notes()
        rows: list[tuple[Any, ...]] = []
        for name in self._desk.episodes:
            known = told.get(name, {})
            missing = known.get("missing", {})
            rows.append(
                (
                    name,
                    known.get("duration", math.nan),
                    known.get("rate", math.nan),
                    known.get("longest_gap") or math.nan,
                    100 * max(missing.values(), default=0.0) or math.nan,
                    _number(known.get("score")),
                    "; ".join(part for part in (decided(notes[name]), known.get("verdict", "")) if part),
                )
            )
        return {title: [row[i] for row in rows] for i, title in enumerate(COLUMNS)}


def decided(note: Note) -> str:
    """A note in words; empty where nothing was decided."""
    if not note.use:
        return f"left out: {note.reason}" if note.reason else "left out"
    ends = [f"{word} {time:.4g} s" for word, time in (("from", note.start), ("until", note.end)) if time is not None]
    return " ".join(["used", *ends]) if ends else ""


def _number(value: float | None) -> float:
    return math.nan if value is None else value
