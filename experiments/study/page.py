"""What a study tells: paragraphs, tables, pictures and films, on the terminal and as Markdown."""

from __future__ import annotations

import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from experiments.study.table import Table
from inphase.errors import DataError, OptionError
from inphase.io.atomic import whole_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Page:
    """Collects what a study tells. Pictures are written at once, beside the text; `write` writes that.

    heads: of all parts that the study has, in their order.
    """

    def __init__(self, name: str, folder: Path, heads: Sequence[str] = ()) -> None:
        self.name, self.folder, self.heads = name, folder, heads
        self.blocks: list[str] = []
        self.pictures: list[str] = []
        folder.mkdir(parents=True, exist_ok=True)

    def head(self, what: str, command: str, minutes: float) -> None:
        """A heading, with the command that makes what stands below it, and how long it takes one processor."""
        took = f"{minutes:.0f} min" if minutes >= 2 else f"{60 * minutes:.0f} s"
        self.blocks += [f"### {what}", f"`{command}`, {took} of one processor."]

    def say(self, text: str) -> None:
        """A paragraph of Markdown."""
        self.blocks.append(text.strip())

    def table(self, table: Table) -> None:
        """A table, as Markdown."""
        self.blocks.append(table.markdown())

    def picture(self, figure: Figure, what: str, alt: str) -> None:
        """A figure of matplotlib, as NAME-what.png."""
        with whole_file(self._target(what, ".png", alt)) as temporary:
            figure.savefig(temporary, dpi=110)

    def film(self, frames: Sequence[np.ndarray], what: str, alt: str, fps: float) -> None:
        """Frames (H, W, 3) of bytes, as NAME-what.gif, which runs for ever."""
        from PIL import Image

        # One palette for all, of the middle: it flickers otherwise.
        palette = Image.fromarray(frames[len(frames) // 2]).quantize(128)
        shown = [Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
        with whole_file(self._target(what, ".gif", alt)) as temporary:
            shown[0].save(
                temporary, save_all=True, append_images=shown[1:], duration=round(1000 / fps), loop=0, optimize=True
            )

    def _target(self, what: str, suffix: str, alt: str) -> Path:
        name = f"{self.name}-{what}{suffix}"
        self.pictures.append(name)
        self.blocks.append(f"![{alt}](studies/{name})")
        return self.folder / name

    def text(self) -> str:
        """All of it."""
        return "\n\n".join(self.blocks)

    def write(self, title: str) -> None:
        """Into the study's folder, as NAME.md, where its pictures are, too."""
        text = f"# {title}\n\n{self.text()}\n".replace("](studies/", "](")
        with whole_file(self.folder / f"{self.name}.md") as temporary:
            temporary.write_text(text, encoding="utf-8")

    def into(self, page: Path) -> None:
        """Take the place of this study's section in a larger page, and put the pictures into its folder `studies`.

        Parts that are not told here stay as they are there. Raises DataError where it has no such place.
        """
        text, begin, end = place(page, self.name)
        before, there = text.split(begin, 1)
        there, after = there.split(end, 1)
        told = _by_head(there) | _by_head(self.text())
        section = "\n\n".join(told[head] for head in ("", *self.heads) if head in told)
        folder = page.parent / "studies"
        folder.mkdir(exist_ok=True)
        for name in self.pictures:
            shutil.copyfile(self.folder / name, folder / name)
        with whole_file(page) as temporary:
            temporary.write_text(f"{before}{begin}\n{section}\n{end}{after}", encoding="utf-8")


def place(page: Path, name: str) -> tuple[str, str, str]:
    """The text of a page, and the lines between which that study has its place there.

    Raises OptionError where there is no such page, DataError where the study has no place in it.
    """
    begin, end = (f"<!-- {word} {name} -->" for word in ("begin", "end"))
    if not page.is_file():
        raise OptionError(f"expected a page of Markdown, got {page}, which does not exist")
    text = page.read_text(encoding="utf-8")
    if not 0 <= text.find(begin) < text.find(end):
        raise DataError(f"{page}: expected the lines {begin!r} and {end!r}, got none")
    return text, begin, end


def _by_head(text: str) -> dict[str, str]:
    """The parts of a section with their headings, by these; what stands before the first one by ""."""
    first, *others = re.split(r"^(?=### )", text, flags=re.MULTILINE)
    return {"": first.strip()} | {part.splitlines()[0].removeprefix("### "): part.strip() for part in others}
