"""Keys as the configuration names them, and as they are written on the keyboard."""

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence


def key_text(name: str) -> str:
    """Return the key `name` as Qt and the buttons write it; empty for an empty name.

    A sign may be named by a word, as TOML is easier to read so: "Comma" is ",".

    Raises
    ------
    ValueError
        There is no such key, or it is more than one.
    """
    if not name:
        return ""
    *modifiers, last = name.split("+") if len(name) > 1 else [name]
    by_word = getattr(Qt.Key, f"Key_{last}", None) if len(last) > 1 else None
    if by_word is not None:
        last = QKeySequence(by_word).toString()
    text = "+".join([*modifiers, last])
    sequence = QKeySequence(text)
    shown = sequence.toString()
    if sequence.count() != 1 or not shown.isprintable() or not shown:
        raise ValueError(f"{name!r} is not the name of a key, such as Q, Left or Shift+J")
    return shown
