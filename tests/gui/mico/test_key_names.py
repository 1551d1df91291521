import pytest

from cosmic.mico.gui.key_names import key_text


@pytest.mark.parametrize(
    ("name", "shown"),
    [("Q", "Q"), ("Comma", ","), ("Left", "Left"), ("Shift+J", "Shift+J"), ("+", "+"), ("", "")],
)
def test_keys_are_written_as_on_the_keyboard(name: str, shown: str) -> None:
    assert key_text(name) == shown


@pytest.mark.parametrize("name", ["Nonsense", "A,B", "Shift+Nonsense"])
def test_what_is_no_key_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="is not the name of a key"):
        key_text(name)
