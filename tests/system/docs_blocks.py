"""Reads the pages of the documentation: their code blocks, links and words."""

import re
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[2]
PAGES: Final = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
LINKED: Final = (
    *PAGES,
    *(ROOT / f"{name}.md" for name in ("CHANGELOG", "CONTRIBUTING", "SECURITY")),
)
"""Pages whose links are looked at: those of the project as well."""

_FENCE: Final = re.compile(r"^```(\w*)\s*$")
_SOURCE: Final = re.compile(r"^<!-- (example|excerpt): (\S+) -->$")
_HEADING: Final = re.compile(r"^#+ (.+?)#*$", re.MULTILINE)
_ELSEWHERE: Final = re.compile(r"\w+://|mailto:")
_LINK: Final = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")


@dataclass(frozen=True)
class Block:
    """One fenced block of a page.

    Attributes
    ----------
    line : int
        Line of its first line in the page, from 1.
    source : str
        The file it was taken from, when the line above the fence says so.
    whole : bool
        It must be the whole file, not a part of it.
    """

    language: str
    text: str
    line: int
    source: str = ""
    whole: bool = False


def blocks(page: Path) -> list[Block]:
    """Return the fenced blocks of `page`."""
    found: list[Block] = []
    lines = page.read_text(encoding="utf-8").splitlines()
    start: int | None = None
    language, source = "", ("", "")
    for number, line in enumerate(lines):
        fence = _FENCE.match(line)
        if start is None and fence:
            start, language = number + 1, fence[1]
            marked = _SOURCE.match(lines[number - 1]) if number else None
            source = (marked[1], marked[2]) if marked else ("", "")
        elif start is not None and line == "```":
            text = "\n".join(lines[start:number]) + "\n"
            found.append(Block(language, text, start + 1, source[1], source[0] == "example"))
            start = None
    assert start is None, f"{page}: a code block is not closed"
    return found


def is_in(block: Block, file_text: str) -> bool:
    """Return whether `block` stands in `file_text`, at any indentation."""
    if block.whole:
        return block.text == file_text
    deeper = (textwrap.indent(block.text, " " * depth) for depth in (0, 4, 8, 12))
    return any(text in file_text for text in deeper)


def relative_links(page: Path) -> list[str]:
    """Return the links of `page` that name a file, without their fragments."""
    return [name for name, _ in _links(page) if name]


def links_to_headings(page: Path) -> list[tuple[Path, str]]:
    """Return the links of `page` to a heading: its page, and the heading's anchor."""
    return [
        ((page.parent / name).resolve() if name else page, anchor)
        for name, anchor in _links(page)
        if anchor and not name.endswith(".py")
    ]


def anchors(page: Path) -> set[str]:
    """Return the anchors of the headings of `page`, as the forges and the site make them."""
    found: set[str] = set()
    for heading in _HEADING.findall(_prose(page)):
        words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
        slug = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
        number = 0
        while (name := f"{slug}-{number}" if number else slug) in found:
            number += 1
        found.add(name)
    return found


def _links(page: Path) -> list[tuple[str, str]]:
    links = [link for link in _LINK.findall(_prose(page)) if not _ELSEWHERE.match(link)]
    return [(name, anchor) for name, _, anchor in (link.partition("#") for link in links)]


def _prose(page: Path) -> str:
    return re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)


def table_rows(page: Path) -> list[list[str]]:
    """Return the cells of every table row of `page`."""
    lines = page.read_text(encoding="utf-8").splitlines()
    rows = [line.strip().strip("|") for line in lines if line.startswith("|")]
    split = [[cell.strip().replace("\\|", "|") for cell in _cells(row)] for row in rows]
    return [row for row in split if not all(set(cell) <= {"-", ":"} for cell in row)]


def _cells(row: str) -> list[str]:
    return re.split(r"(?<!\\)\|", row)
