"""How figures, pictures and tables stand in a report."""

import base64
from collections.abc import Callable, Iterable, Sequence
from html import escape

ShowSvg = Callable[[str, int], str]
"""Returns the element that shows an SVG, so many pixels wide."""

ShowPng = Callable[[bytes, int, str], str]
"""Returns the element that shows a PNG, so many pixels wide, with words for who cannot see it."""


def inline_svg(svg: str, _width_px: int) -> str:
    """Show an SVG as a part of the page."""
    return f'<div class="figure">{svg}</div>'


def inline_png(data: bytes, width_px: int, words: str) -> str:
    """Show a PNG as a part of the page."""
    content = base64.b64encode(data).decode()
    return (
        f'<img width="{width_px}" alt="{escape(words, quote=True)}" '
        f'src="data:image/png;base64,{content}">'
    )


def table(head: Sequence[str], rows: Iterable[Sequence[str]], *, words: int = 1) -> str:
    """Return a table; all columns after the first `words` hold numbers."""

    def line(cells: Sequence[str], tag: str) -> str:
        told = "".join(
            f'<{tag} align="{"left" if place < words else "right"}">{escape(each)}</{tag}>'
            for place, each in enumerate(cells)
        )
        return f"<tr>{told}</tr>"

    lines = "".join(line(each, "td") for each in rows)
    return f'<table cellpadding="4" cellspacing="0">{line(head, "th")}{lines}</table>'
