"""The book of named poses and its file."""

from pathlib import Path

import pytest

from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.mico.core.poses import Pose, PoseBook


def test_poses_are_kept_in_a_readable_file(tmp_path: Path) -> None:
    path = tmp_path / "poses.toml"
    book = PoseBook(path)
    assert not path.exists()
    book.put(Pose("home", {"left.x": 0.0, "table.rotation": -1.25}))
    book.put(Pose("over the fibre", {"left.z": 12.34567}))
    text = path.read_text(encoding="utf-8")
    assert '[home]\n"left.x" = 0.0\n"table.rotation" = -1.25\n' in text
    assert '["over the fibre"]\n"left.z" = 12.3457\n' in text
    again = PoseBook(path)
    assert again.poses == {
        "home": Pose("home", {"left.x": 0.0, "table.rotation": -1.25}),
        "over the fibre": Pose("over the fibre", {"left.z": 12.3457}),
    }


def test_what_the_user_wrote_into_the_file_stays(tmp_path: Path) -> None:
    path = tmp_path / "poses.toml"
    path.write_text(
        '# mine\n[a]\n# of a\n"left.x" = 1.0\n\n[b]\n"left.x" = 2.0 # of b\n', encoding="utf-8"
    )
    book = PoseBook(path)
    book.put(Pose("a", {"left.x": 5.0}))
    book.put(Pose("c", {"left.x": 3.0}))
    text = path.read_text(encoding="utf-8")
    assert text.startswith('# mine\n[a]\n# of a\n"left.x" = 5.0\n\n[b]\n"left.x" = 2.0 # of b\n')
    book.remove("a")
    assert "[a]" not in path.read_text(encoding="utf-8")
    assert list(PoseBook(path).poses) == ["b", "c"]


@pytest.mark.parametrize("name", ["a", "b", "c"])
@pytest.mark.parametrize(
    "text",
    [
        "b.q = 2.0\nb.x = 3.0\na = {x = 1.0, y = 2.0} # of a\n",
        "b.q = 2.0\nb.'left.x' = 3.0\na.x = 1.0\nb.x = 2.0\n[c]\nx = 1.0\n",
        "a.x = 1.0\nb.x = 1.0\na.y = 2.0\n# the last\n[c]\nx = 1.0\n",
    ],
)
def test_poses_that_the_user_wrote_with_dots_are_changed_as_others(
    text: str, name: str, tmp_path: Path
) -> None:
    path = tmp_path / "poses.toml"
    path.write_text(text, encoding="utf-8")
    book = PoseBook(path)
    others = {each: pose for each, pose in book.poses.items() if each != name}
    book.put(Pose(name, {"x": 5.0}))
    assert book.path == path
    assert PoseBook(path).poses == {**others, name: Pose(name, {"x": 5.0})}
    book.remove(name)
    assert PoseBook(path).poses == others


def test_what_is_said_above_a_pose_stays_there_when_the_one_before_changes(tmp_path: Path) -> None:
    path = tmp_path / "poses.toml"
    others = '# of b\n[b]\n"left.x" = 2.0\n\n# the end\n'
    path.write_text(f'[a]\n"left.x" = 1.0 # mine\n\n{others}', encoding="utf-8")
    book = PoseBook(path)
    book.put(Pose("a", {"left.x": 5.0, "left.z": 3.0}))
    text = path.read_text(encoding="utf-8")
    assert text == f'[a]\n"left.x" = 5.0 # mine\n"left.z" = 3.0\n\n{others}'
    book.remove("a")
    assert path.read_text(encoding="utf-8").lstrip() == others
    book.remove("b")
    assert path.read_text(encoding="utf-8").split("\n")[-2:] == ["# the end", ""]


@pytest.mark.parametrize(
    "text",
    [
        "[a]\n",
        "a = 1\n",
        "[a]\nx = 'far'\n",
        "[a]\nx = nan\n",
        f"[a]\nx = 1{'0' * 400}\n",
        "[a]\nx = true\n",
        "[a",
        '["#"]\nx=1\n',
    ],
)
def test_a_file_that_is_wrong_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "poses.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError):
        PoseBook(tmp_path / "poses.toml")


@pytest.mark.parametrize("name", ["", " a", "a\nb", "a#b", "x" * 81, "[a]"])
def test_a_name_that_is_none_is_refused(name: str) -> None:
    with pytest.raises(NotAvailable):
        PoseBook().put(Pose(name, {"x": 1.0}))


def test_a_pose_without_axes_and_one_that_is_not_there_are_refused() -> None:
    book = PoseBook()
    with pytest.raises(NotAvailable, match="no axis"):
        book.put(Pose("a", {}))
    with pytest.raises(NotAvailable, match="known poses: none"):
        book.remove("a")


def test_where_the_file_cannot_be_written_poses_stay_in_memory(tmp_path: Path) -> None:
    book = PoseBook(tmp_path / "gone" / "poses.toml")
    book.put(Pose("a", {"x": 1.0}))
    assert book.path is None
    assert book["a"].positions == {"x": 1.0}


def test_a_file_that_became_wrong_meanwhile_stays_and_poses_are_kept_in_memory(
    tmp_path: Path,
) -> None:
    path = tmp_path / "poses.toml"
    book = PoseBook(path)
    book.put(Pose("a", {"left.x": 1.0}))
    path.write_text("[a]\n'left.x' = = 1\n", encoding="utf-8")
    book.put(Pose("b", {"left.x": 2.0}))
    assert list(book.poses) == ["a", "b"] and book.path is None
    assert path.read_text(encoding="utf-8") == "[a]\n'left.x' = = 1\n"


def test_what_the_user_took_out_of_the_file_can_be_removed_and_taught_again(tmp_path: Path) -> None:
    path = tmp_path / "poses.toml"
    book = PoseBook(path)
    for name in "ab":
        book.put(Pose(name, {"left.x": 1.0}))
    path.write_text("b = 3\n", encoding="utf-8")
    book.remove("a")
    book.put(Pose("b", {"left.x": 2.0}))
    assert PoseBook(path).poses == book.poses == {"b": Pose("b", {"left.x": 2.0})}
