"""The banner of a limit says what happened, and not what did not."""

from cosmic.daqco.core.settings import LimitSettings
from cosmic.daqco.gui.limit_banner import LimitBanner
from gui.daqco.fake_port import Limited

LIMIT = LimitSettings(channel="force", high=150.0, armed=True)
SILENT = "no data from force for 0.1 s while the limit of force is armed"


def shown(qtbot, limited):
    banner = LimitBanner()
    qtbot.addWidget(banner)
    banner.show_limits([limited], {"force": "uN"})
    return banner.text.text()


def test_a_force_that_crossed_its_limit_is_reported_with_limit_value_and_reaction(qtbot):
    text = shown(
        qtbot, Limited(LIMIT, crossed=True, value=151.2, reaction_ms=3.1, reason="reached")
    )
    assert text == "force crossed its limit (high 150 µN): 151.2 µN, stopped after 3.1 ms"


def test_missing_data_are_not_reported_as_a_limit_that_was_crossed(qtbot):
    text = shown(qtbot, Limited(LIMIT, crossed=True, value=None, reaction_ms=0.2, reason=SILENT))
    assert text == f"{SILENT}, stopped after 0.2 ms"
    assert "crossed" not in text
