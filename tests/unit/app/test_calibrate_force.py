"""``cosmic calibrate-force`` leads a person through known loads, and says what to write where."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cosmic.app.commands import calibrate_force
from cosmic.autonomy.calibrating.force_scale import ForceCalibration, weight
from cosmic.daqco.core.scale import Scale

GAIN = 1.04


class Person:
    """Puts there what is asked for; forgets the first weight once."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, ends_at: int = 99) -> None:
        self.asked: list[str] = []
        self.ends_at = ends_at
        monkeypatch.setattr(calibrate_force, "read", lambda daqco, watch: self.read())

    def ask(self, text: str) -> bool:
        self.asked.append(text)
        return len(self.asked) < self.ends_at

    def read(self) -> tuple[float, float]:
        text = self.asked[-1]
        forgets = "2 mg" in text and "is not to be seen" not in text and len(self.asked) == 2
        load = 0.0 if forgets else sum(9.80665 * n for n in (2, 5) if f"of {n} mg (" in text)
        return 1.5 + GAIN * load, 0.01


@pytest.fixture
def daqco() -> Any:
    return SimpleNamespace(channels=["force"], subscribe=lambda take: lambda: None)


def test_a_person_is_led_through_and_what_was_forgotten_is_asked_for_again(
    daqco: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    person = Person(monkeypatch)
    loads = [weight(2.0, 1.0), weight(5.0, 1.0)]
    found = calibrate_force.lead(ForceCalibration(loads, 1), daqco, "force", person.ask)
    assert found is not None
    assert found.gain == pytest.approx(GAIN)
    assert len(person.asked) == 7
    assert "is not to be seen" in person.asked[2]
    assert person.asked[0].startswith("1 of 6: Take everything off")
    before = Scale("sensor", "uN", (0.0, 18.0))
    said = "\n".join(calibrate_force.lines_of(found, before))
    assert "coefficients = [0, 17.3077]" in said
    assert f"gain_std_part = {found.gain_std_part:.4f}" in said
    calibrate_force.write_certificate(tmp_path / "force.json", found, "force", before)
    page = json.loads((tmp_path / "force.json").read_text(encoding="utf-8"))
    assert page["scale"]["coefficients"][1] == pytest.approx(18.0 / GAIN)
    assert len(page["result"]["readings"]) == 6


def test_who_ends_it_changes_nothing(daqco: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    person = Person(monkeypatch, ends_at=3)
    calibration = ForceCalibration([weight(5.0, 1.0)])
    assert calibrate_force.lead(calibration, daqco, "force", person.ask) is None
