"""The limit, whether it is watched, and how far the force is from it, in one word."""

import pytest

from cosmic.daqco.core.settings import LimitSettings
from cosmic.daqco.gui.limit_indicator import reading
from gui.daqco.fake_port import Limited

ARMED = LimitSettings(channel="force", low=-150.0, high=150.0, armed=True)
ABOVE = LimitSettings(channel="force", high=140.0, armed=True)
BELOW = LimitSettings(channel="force", low=-140.0, armed=True)
DISARMED = ARMED.model_copy(update={"armed": False})


@pytest.mark.parametrize(
    ("limit", "value", "text", "tone"),
    [
        (Limited(ARMED), 42.0, "force limit ±150 µN: armed, 108 µN to go", "quiet"),
        (Limited(ARMED), -140.0, "force limit ±150 µN: armed, 10 µN to go", "quiet"),
        (Limited(ABOVE), 42.0, "force limit up to 140 µN: armed, 98 µN to go", "quiet"),
        (Limited(BELOW), 42.0, "force limit down to -140 µN: armed, 182 µN to go", "quiet"),
        (Limited(ARMED), None, "■ force limit ±150 µN: NO DATA", "alarm"),
        (Limited(DISARMED), 42.0, "▲ force limit ±150 µN: DISARMED", "warning"),
        (
            Limited(DISARMED, reason="not watched: nothing is acquired"),
            None,
            "▲ force limit ±150 µN: NOT WATCHED",
            "warning",
        ),
        (Limited(ARMED, crossed=True), 10.0, "■ force limit ±150 µN: CROSSED", "alarm"),
    ],
)
def test_a_limit_is_reported_with_its_state_and_the_distance_to_it(limit, value, text, tone):
    shown = reading(limit, "uN", value)
    assert (shown.text, shown.tone) == (text, tone)
