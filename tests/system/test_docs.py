"""The documentation is true: its code runs, its links lead somewhere, its lists are complete."""

import functools
import os
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtWidgets import QApplication

import cosmic
from cosmic.app import connect as connect_module
from system.docs_blocks import (
    LINKED,
    PAGES,
    ROOT,
    anchors,
    blocks,
    is_in,
    links_to_headings,
    relative_links,
)

FASTEST = 20.0


def ids(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def with_python(page: Path) -> bool:
    """Tell whether a page has Python that runs by itself; stations are started in their test."""
    if "<!-- with stations -->" in page.read_text(encoding="utf-8"):
        return False
    return any(block.language == "python" for block in blocks(page))


@pytest.mark.parametrize("page", list(filter(with_python, PAGES)), ids=ids)
def test_the_python_of_a_page_runs_from_top_to_bottom(
    page: Path, qapp: QApplication, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A page marked `<!-- with rig -->` speaks of the console, where `rig` is there already."""
    real = connect_module.connect
    opened: list[cosmic.Rig] = []

    @functools.wraps(real)
    def fast(*args: Any, **kwargs: Any) -> cosmic.Rig:
        opened.append(real(*args, **{"rate": FASTEST, **kwargs}))
        return opened[-1]

    monkeypatch.setattr(connect_module, "connect", fast)
    monkeypatch.chdir(tmp_path)
    text = page.read_text(encoding="utf-8")
    namespace: dict[str, Any] = {"__name__": "page"}
    try:
        if "<!-- with rig -->" in text:
            namespace |= {"cosmic": cosmic, "rig": cosmic.connect()}
        for block in blocks(page):
            if block.language == "python":
                # Line numbers of the page, so that a traceback points into it.
                code = compile("\n" * (block.line - 1) + block.text, str(page), "exec")
                exec(code, namespace)
    finally:
        for rig in opened:
            rig.close()


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_a_block_that_names_its_file_is_found_in_it(page: Path) -> None:
    for block in blocks(page):
        if block.source:
            file = ROOT / block.source
            assert file.is_file(), f"{page}:{block.line}: there is no {block.source}"
            assert is_in(block, file.read_text(encoding="utf-8")), (
                f"{page}:{block.line}: differs from {block.source}"
            )


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_toml_in_a_page_is_toml(page: Path) -> None:
    for block in blocks(page):
        if block.language == "toml":
            tomllib.loads(block.text)


@pytest.mark.parametrize("page", LINKED, ids=ids)
def test_links_of_a_page_lead_to_files_and_headings(page: Path) -> None:
    for link in relative_links(page):
        assert (page.parent / link).exists(), f"{page}: {link} leads nowhere"
    for target, anchor in links_to_headings(page):
        assert anchor in anchors(target), f"{page}: {target.name} has no heading #{anchor}"


def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", tmp_path],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        check=True,
    )
    first = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "reference/api.html" in first
    assert (tmp_path / "examples" / "first_session.py").is_file()


def test_the_version_is_the_same_everywhere() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {cosmic.__version__}\n" in citation
    assert f"## [{cosmic.__version__}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_every_page_is_listed_in_the_index() -> None:
    index = ROOT / "docs" / "README.md"
    listed = {(index.parent / link).resolve() for link in relative_links(index)}
    pages = {page for page in PAGES if page.is_relative_to(ROOT / "docs") and page != index}
    unlisted = [ids(page) for page in sorted(pages - listed) if "decisions" not in page.parts]
    assert not unlisted


def test_every_decision_is_listed_in_the_index_of_decisions() -> None:
    folder = ROOT / "docs" / "explanation" / "decisions"
    listed = set(relative_links(folder / "README.md"))
    assert {page.name for page in folder.glob("[0-9]*.md")} <= listed
