"""The title of a page and the smaller lines below it, broken where they are too long."""

import re
from collections.abc import Sequence
from textwrap import wrap
from typing import NamedTuple

from o3dleaf.output.view.panel import Page

LETTER = 0.47
"""Mean width of a letter of a caption, in heights of a line."""
UNIT = re.compile(r"(?<=\d) (?=%|[nµumck]?m\b)")
"""The space between a number and its unit, at which no line ends."""


class Heading(NamedTuple):
    """A title, perhaps empty, and the lines below it, in letters of `em` pixels."""

    title: str
    lines: list[str]
    em: float

    @classmethod
    def of(cls, text: str, size: tuple[int, int], em: float) -> "Heading":
        """Return the heading of a page of a size in pixels; what follows the first newline of a text is smaller."""
        title, *caption = text.split("\n")
        lines = lines_of(caption, max(1, int((size[0] / em - 2) / LETTER)))
        room = max(0, int((0.75 * size[1] / em - 2.8) / 1.4))  # the picture keeps a quarter of the page
        if len(lines) > room:
            lines = [*lines[: max(0, room - 1)], "…"][:room]
        return cls(title, lines, em)

    @property
    def height(self) -> int:
        """Pixels that it takes at the top of the page."""
        lines = 2.4 * bool(self.title) + 1.4 * len(self.lines) + 0.4 * bool(self.lines)
        return round(lines * self.em)

    def draw(self, page: Page) -> None:
        """Write it at the top of a page."""
        if self.title:
            page.write(self.em, 1.3 * self.em, self.title, scale=1.25)
        for number, line in enumerate(self.lines):
            page.write(self.em, (1.1 + 1.4 * number + 2.2 * bool(self.title)) * self.em, line, scale=0.85)


def lines_of(texts: Sequence[str], letters: int) -> list[str]:
    """Return texts as lines of at most so many letters, which do not end between a number and its unit."""
    return [line for text in texts for line in wrap(UNIT.sub("\u00a0", text), letters)]
