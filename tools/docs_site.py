"""Hooks of mkdocs: the site's contents are the lists of docs/README.md.

What pages link to outside of docs, such as examples, becomes part of the site.
"""

import re
from pathlib import Path
from typing import Final

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT: Final = Path(__file__).resolve().parents[1]
OUTSIDE: Final = ("CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "LICENSE")
_SECTION: Final = re.compile(r"^## ([^:\n]+)")
_ENTRY: Final = re.compile(r"^- \[([^\]]+)\]\(([^)#\s]+)\)")
_LINK: Final = re.compile(r"\]\(((?:\.\./)*)([^):\s#]+)((?:#[^)\s]*)?)\)")


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Take the navigation from the lists of the first page."""
    nav: list[dict[str, object]] = [{"Home": "README.md"}]
    entries: list[dict[str, str]] = []
    for line in (ROOT / "docs" / "README.md").read_text(encoding="utf-8").splitlines():
        if section := _SECTION.match(line):
            entries = []
            nav.append({section[1]: entries})
        elif entry := _ENTRY.match(line):
            entries.append({entry[1]: entry[2].removeprefix("../")})
    decisions = sorted((ROOT / "docs" / "explanation" / "decisions").glob("[0-9]*.md"))
    nav.append({"Decisions": [f"explanation/decisions/{page.name}" for page in decisions]})
    config.nav = nav
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add what lies outside of docs and is linked to."""
    examples = [f"examples/{path.name}" for path in sorted((ROOT / "examples").glob("*.py"))]
    for name in (*OUTSIDE, *examples):
        files.append(File(name, str(ROOT), config.site_dir, config.use_directory_urls))
    return files


def on_page_markdown(markdown: str, page: Page, **_others: object) -> str:
    """Turn links that leave docs into links on the site."""
    folder = (ROOT / "docs" / page.file.src_uri).parent
    if page.file.src_uri in OUTSIDE:
        return markdown.replace("](docs/", "](")

    def moved(match: re.Match[str]) -> str:
        target = (folder / match[1] / match[2]).resolve()
        if target.is_relative_to(ROOT / "docs") or not target.is_relative_to(ROOT):
            return match[0]
        return f"]({match[1].removeprefix('../')}{match[2]}{match[3]})"

    return _LINK.sub(moved, markdown)
