"""The words of the field: private ones do not come back into names, texts and file names."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import cosmic

SOURCES = Path(cosmic.__file__).parent
TESTS = Path(__file__).resolve().parents[1]
INSTEAD = {
    "told": "published, reported, or what it holds",
    "tell": "publish, report or record",
    "tells": "publishes or reports",
    "teller": "Publisher",
    "telling": "publishing",
    "elsewhere": "remote",
    "errand": "job or call",
    "errands": "jobs or calls",
    "judge": "check",
    "judged": "checked",
    "judgement": "verdict",
    "wish": "request",
    "pacer": "LoopTimer",
    "patience": "retry policy or timeout",
    "patient": "retrying",
    "hurried": "accelerated",
    "spilled": "dropped",
    "distrusted": "needs re-initialisation",
    "reins": "RunControl",
    "introduction": "discovery",
    "enquiry": "status poll",
    "wayfinder": "PathPlanner",
    "way": "path, travel, distance or heading",
    "ways": "paths, travels, headings or branches",
    "heed": "watch",
    "keeper": "recorder or watcher",
}
PHRASES = {
    "two hands": "two grippers",
    "where counting begins": "home position",
    "is told": "is reported",
    "are told": "are reported",
    "was told": "received",
    "not told": "unknown",
    "an errand": "a job",
    "gone on with": "resumed",
    "nobody answers": "no answer",
    "sign of life": "heartbeat",
    "signs of life": "heartbeats",
    "slower way": "slower connection",
    "way round": "detour",
    "in parts of": "in steps of",
    "the axes do not stand": "the axes are not",
}
KEPT = {
    "daqco/core/unclosed_file.py": {"tell"},  # the protocol of Python's files
    "autonomy/campaign/recipe.py": {"two hands"},  # a name that old recipes have
    # old names, which warn
    "frame/declaration.py": {"elsewhere"},
    "mico/api/mico.py": {"judge", "way"},
    "mico/api/poses.py": {"way"},
    "mico/api/ways.py": {"ways"},
    "autonomy/bending/span.py": {"way"},
    "autonomy/bending/result.py": {"ways"},
    # keys of configuration files and recipes, which stay
    "autonomy/bending/settings.py": {"way"},
    "autonomy/bending/inference.py": {"way"},
    "autonomy/bending/span_fit.py": {"way"},
    "twin/settings.py": {"way"},
    "mico/hw/sim_device.py": {"way"},
    "mico/hw/sim_scu3d_moves.py": {"way"},
    "mico/hw/sim_smaractctl_moves.py": {"way"},
    "testing/controllers.py": {"ways"},  # a suite of other packages sets it
}
PROSE = {"way", "ways"}
"""Right in a sentence, such as the name of a test; not as the name of a thing."""
_ANY = re.compile(
    f"(?i:{'|'.join([*(INSTEAD.keys() - PROSE), *PHRASES])})"
    "|(?<![a-z])ways?(?![a-z])|Ways?(?![a-z])|(?<![A-Z])WAYS?(?![A-Z])"
)
_SAID = re.compile(r'"""[\s\S]*?"""|#.*')
_PARTS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


def parts(name: str) -> set[str]:
    """Return the words of which an identifier is made, in small letters."""
    return {each.lower() for each in _PARTS.findall(name)}


def names_and_texts(source: str) -> Iterator[tuple[int, str, bool]]:
    """Yield line, word and whether it is a text, of all but docstrings and comments."""
    nodes = list(ast.walk(ast.parse(source)))
    prose = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            if id(node) not in prose:
                yield node.lineno, node.value, True
            continue
        for field in ("id", "attr", "arg", "name", "asname"):
            name = getattr(node, field, None)
            if isinstance(name, str):
                yield getattr(node, "lineno", 0), name, False


def private_words(source: str, kept: set[str]) -> Iterator[str]:
    """Yield a line for each private word in a file."""
    if not _ANY.search(_SAID.sub("", source)):
        return  # most files need not be parsed
    for line, word, is_text in names_and_texts(source):
        if is_text:
            found = {each: PHRASES[each] for each in PHRASES if each in word}
        else:
            found = {each: INSTEAD[each] for each in parts(word) & INSTEAD.keys()}
        yield from (
            f"{line}: {each!r} in {word!r}; say {instead}"
            for each, instead in found.items()
            if each not in kept
        )


def test_names_and_texts_use_the_words_of_the_field() -> None:
    found = []
    for path in sorted(SOURCES.rglob("*.py")):
        file = path.relative_to(SOURCES).as_posix()
        source = path.read_text(encoding="utf-8")
        found += [f"{file}:{each}" for each in private_words(source, KEPT.get(file, set()))]
    assert found == []


def test_files_and_tests_are_named_in_the_words_of_the_field() -> None:
    paths = [path for folder in (SOURCES, TESTS) for path in sorted(folder.rglob("*.py"))]
    names = [path.stem for path in paths]
    for path in sorted(TESTS.rglob("test_*.py")):
        names += re.findall(r"def (test_\w+)", path.read_text(encoding="utf-8"))
    refused = INSTEAD.keys() - PROSE
    assert [name for name in names if parts(name) & refused] == []


@pytest.mark.parametrize(
    "source",
    [
        "told = []",
        "go(way=1)",
        "def under_way(): ...",
        "AxisWay()",
        "MOST_WAYS = 3",
        "self._tell(1)",
        "from a import PathTeller",
        "def judge(x): ...",
        "f(told=1)",
    ],
)
def test_a_private_word_in_a_name_is_found(source: str) -> None:
    assert list(private_words(source, set()))


def test_plain_english_in_docstrings_stays_and_in_texts_does_not() -> None:
    assert list(private_words('"""The vendor tells; it is told."""', set())) == []
    assert list(private_words('text = f"it is told {x}"', set()))
