"""Says at a field why its entry is refused."""

from PySide6.QtWidgets import QLineEdit

from cosmic.frame.gui.build import restyle
from cosmic.frame.gui.reason_bubble import ReasonBubble
from cosmic.frame.gui.theme import State, state_look


def show_refusal(field: QLineEdit, reason: str) -> None:
    """Turn the border of a field and say below it why; an empty reason takes both away."""
    if reason:
        ReasonBubble.of(field).show_for(field, f"{state_look(State.REFUSED).glyph} {reason}")
    elif field.property("refused"):
        ReasonBubble.of(field).dismiss(field)
    if field.accessibleDescription() == reason:
        return
    field.setAccessibleDescription(reason)
    field.setProperty("refused", bool(reason))
    restyle(field)


def mark_refusal(field: QLineEdit, reason: str) -> None:
    """Show a refusal, or its end, once: a note that was clicked away does not come back."""
    if field.accessibleDescription() != reason:
        show_refusal(field, reason)
