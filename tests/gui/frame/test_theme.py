import itertools

import pytest
from PySide6.QtWidgets import QApplication

from cosmic.frame.gui.palette import DARK, INK, LIGHT, OKABE_ITO, Palette, contrast_ratio
from cosmic.frame.gui.theme import (
    State,
    apply_theme,
    current_palette,
    number_font,
    state_look,
    ui_font,
)

THEMES = pytest.mark.parametrize("palette", [DARK, LIGHT], ids=["dark", "light"])


def test_contrast_of_black_on_white_is_21() -> None:
    assert contrast_ratio("#000000", "#FFFFFF") == pytest.approx(21.0)
    assert contrast_ratio("#FFFFFF", "#FFFFFF") == pytest.approx(1.0)


@THEMES
@pytest.mark.parametrize("ground", ["window", "panel", "raised", "hover", "field"])
@pytest.mark.parametrize("ink", ["text", "dim"])
def test_text_can_be_read_on_every_ground(palette: Palette, ground: str, ink: str) -> None:
    assert contrast_ratio(getattr(palette, ink), getattr(palette, ground)) >= 4.5


@THEMES
@pytest.mark.parametrize(
    ("ink", "ground"),
    [
        ("on_accent", "accent"),
        ("accent", "window"),
        ("on_stop", "stop"),
        ("on_stop", "stop_hover"),
        ("on_stop", "latched"),
        ("refused", "field"),
    ],
)
def test_words_on_coloured_grounds_can_be_read(palette: Palette, ink: str, ground: str) -> None:
    assert contrast_ratio(getattr(palette, ink), getattr(palette, ground)) >= 4.5


@THEMES
@pytest.mark.parametrize("state", State)
def test_the_word_of_a_state_can_be_read(palette: Palette, state: State) -> None:
    look = state_look(state, palette)
    assert contrast_ratio(look.text, look.fill) >= 4.5


@pytest.mark.parametrize("colour", OKABE_ITO.values())
def test_ink_can_be_read_on_the_loud_state_and_warning_colours(colour: str) -> None:
    if colour != OKABE_ITO["blue"]:  # no state has it
        assert contrast_ratio(INK, colour) >= 4.5


def test_states_differ_in_colour_and_shape_and_word() -> None:
    for first, second in itertools.combinations((state_look(state) for state in State), 2):
        assert first.colour != second.colour
        assert first.glyph != second.glyph
        assert first.word != second.word


def test_the_theme_in_force_is_known_to_widgets(qapp: QApplication) -> None:
    apply_theme(qapp, "light")
    assert current_palette() is LIGHT
    apply_theme(qapp, "dark")
    assert current_palette() is DARK


def test_another_theme_makes_no_other_style(qapp: QApplication) -> None:
    apply_theme(qapp, "light")
    style = qapp.style()
    apply_theme(qapp, "dark")
    assert qapp.style() is style
    qapp.setStyleSheet("")
    assert qapp.style().name() == "fusion"


def test_an_unknown_theme_is_refused(qapp: QApplication) -> None:
    with pytest.raises(ValueError, match="there is no theme 'pink'"):
        apply_theme(qapp, "pink")  # type: ignore[arg-type]


def test_all_figures_have_one_width(qapp: QApplication) -> None:
    from PySide6.QtGui import QFontMetricsF

    metrics = QFontMetricsF(number_font())
    assert len({round(metrics.horizontalAdvance(figure), 3) for figure in "0123456789"}) == 1
    assert ui_font().families() == number_font().families()
