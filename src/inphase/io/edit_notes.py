"""Deciding of recordings: leave one out, cut one, or take one as it was recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from inphase.errors import OptionError
from inphase.io.files import SUFFIXES, Source, episode_names, find_episodes, is_episode
from inphase.io.load import read_episode
from inphase.io.notes import Note, as_noted, names_in_folder, read_notes, unknown, write_notes


def edit_notes(
    source: Source,
    *,
    drop: Mapping[str, str] | None = None,
    cut: Mapping[str, tuple[float | None, float | None]] | None = None,
    keep: Sequence[str] = (),
    time: str = "time",
    delimiter: str = ",",
) -> list[Path]:
    """Note what is decided of the episodes in `source` in the file beside them; returns the files that were written.

    drop: names of episodes to leave out, and why. cut: names of episodes, and from when until when [s] they are used,
    None for as far as they go. keep: names of episodes to take as they were recorded; that is done first. Names are
    those of the demonstrations that `load` makes. Raises OptionError for an unknown name, DataError for times outside
    of the episode or notes that cannot be used; then nothing is written.
    """
    paths = find_episodes(source)
    by_name = dict(zip(episode_names(paths), paths, strict=True))
    drop, cut = drop or {}, cut or {}
    for name in (*keep, *drop, *cut):
        if name not in by_name:
            raise OptionError(unknown(name, list(by_name)))
        if not is_episode(by_name[name]):
            raise OptionError(f"{by_name[name]}: expected a visible file that ends in {' or '.join(SUFFIXES)}")
    folders = {by_name[name].parent for name in (*keep, *drop, *cut)}
    notes = {folder: read_notes(folder) for folder in folders}
    noted = {folder: names_in_folder(folder) for folder in folders}  # by file

    for name in (*keep, *drop, *cut):
        path = by_name[name]
        episode = noted[path.parent][path.name]
        note = Note() if name in keep else notes[path.parent].get(episode, Note())
        if name in drop:
            note = replace(note, use=False, reason=drop[name])
        if name in cut:
            note = replace(note, start=cut[name][0], end=cut[name][1])
            as_noted(read_episode(path, time=time, delimiter=delimiter), note)
        notes[path.parent][episode] = note
    return [write_notes(folder, notes[folder]) for folder in sorted(folders)]
