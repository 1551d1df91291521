"""Profiles of teleoperation that were changed outlast the program."""

import pytest

from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.mico.core.teleoperation.profile_book import ProfileBook
from cosmic.mico.core.teleoperation.settings import TeleoperationSettings

SETTINGS = TeleoperationSettings.model_validate(
    {
        "profile": [
            {
                "name": 'the "left" one',
                "axis": [
                    {"input": "x", "positioner": "left.x", "speed_um_s": 500.0},
                    {"input": "y", "positioner": "left.y", "mode": "position", "travel_um": 5.0},
                ],
            },
            {"name": "other", "axis": [{"input": "x", "positioner": "right.x"}]},
        ]
    }
)
LEFT = 'the "left" one'


def changed(path):
    book = ProfileBook(SETTINGS, path)
    profile = book.edited_axis(LEFT, 0, {"speed_um_s": 50.0, "direction": -1})
    book.put(profile)
    return profile


def test_a_changed_profile_is_there_again_at_the_next_start(tmp_path):
    profile = changed(tmp_path / "profiles.toml")
    book = ProfileBook(SETTINGS, tmp_path / "profiles.toml")
    assert book[LEFT] == profile
    assert book["other"] == SETTINGS.profile[1]
    assert [each.name for each in book.profiles] == [LEFT, "other"]


def test_a_profile_taken_back_leaves_the_file_without_it(tmp_path):
    changed(tmp_path / "profiles.toml")
    book = ProfileBook(SETTINGS, tmp_path / "profiles.toml")
    book.put(book.given(LEFT))
    assert "[[profile]]" not in (tmp_path / "profiles.toml").read_text(encoding="utf-8")
    assert ProfileBook(SETTINGS, tmp_path / "profiles.toml")[LEFT] == SETTINGS.profile[0]


def test_what_another_program_changed_meanwhile_stays(tmp_path):
    path = tmp_path / "profiles.toml"
    book = ProfileBook(SETTINGS, path)
    left = changed(path)
    other = book.edited("other", {"fine_share": 0.5})
    book.put(other)
    again = ProfileBook(SETTINGS, path)
    assert (again[LEFT], again["other"]) == (left, other)


def test_a_file_that_became_wrong_meanwhile_stays(tmp_path):
    path = tmp_path / "profiles.toml"
    book = ProfileBook(SETTINGS, path)
    path.write_text("[[profile", encoding="utf-8")
    book.put(book.edited("other", {"fine_share": 0.5}))
    assert path.read_text(encoding="utf-8") == "[[profile"
    assert book.path is None


def test_a_file_that_cannot_be_written_costs_nothing_but_the_file(tmp_path):
    book = ProfileBook(SETTINGS, tmp_path / "missing" / "profiles.toml")
    profile = book.edited(LEFT, {"fine_share": 0.5})
    book.put(profile)
    assert book[LEFT] == profile
    assert book.path is None


def test_a_broken_file_is_reported_with_the_key_that_is_wrong(tmp_path):
    path = tmp_path / "profiles.toml"
    path.write_text('[[profile]]\nname = "a"\naxis = [{input = "x", positioner = "p", scale = 0}]')
    with pytest.raises(ConfigError, match=r"profiles\.toml: profile\[0\]\.axis\[0\]\.scale"):
        ProfileBook(SETTINGS, path)


def test_what_is_not_there_cannot_be_taken_back(tmp_path):
    with pytest.raises(NotAvailable, match="no teleoperation profile 'x'"):
        ProfileBook(SETTINGS).given("x")
