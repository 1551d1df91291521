"""What may change under a guard: each row of the table in docs/explanation/safety.md."""

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from contract.daqco_rig import DaqcoRig, daqco_rig, settings
from contract.station_rig import wait_until
from cosmic.daqco.api.recording import open_recording
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import DaqcoSettings, LimitSettings, ScaleSettings
from cosmic.daqco.gui.draft import Draft
from cosmic.frame.errors import ConfigError, NotAvailable

# The probe's scale is 20 uN/V and the knob stands at 0.5 V: 10 uN.
ARMED = LimitSettings(channel="force", high=30.0, hysteresis=2.0, armed=True)


@dataclass
class Guarded:
    """DAQCo with an armed force limit, and what it stopped."""

    rig: DaqcoRig
    stops: list[str] = field(default_factory=list)

    @property
    def limit(self) -> LimitSettings:
        (limit,) = self.rig.daqco.limits
        return limit.settings

    def at_rest(self) -> bool:
        """Wait for the force that the knob makes at first."""
        buffer = self.rig.home.application.buffer
        return wait_until(lambda: 9.0 < buffer.get_latest_data().get("force", 0.0) < 11.0)

    def change(self, **fields: object) -> DaqcoSettings:
        """Return the settings in force with others for the channel "force"."""
        given = self.rig.daqco.settings
        changed = tuple(
            each.model_copy(update=fields) if each.name == "force" else each
            for each in given.channel
        )
        return DaqcoSettings.model_validate(
            given.model_copy(update={"channel": changed}).model_dump()
        )

    def with_scale(self, scale: ScaleSettings) -> DaqcoSettings:
        """Return the settings in force with another meaning of the scale of "force"."""
        return self.rig.daqco.settings.model_copy(update={"scale": (scale,)})

    def check_watched(self) -> None:
        """Fail unless the limit is armed as it was, and stops what crosses it."""
        assert self.limit == ARMED
        assert self.at_rest()
        assert not self.stops
        self.rig.home.knob.level_v = 2.0
        assert wait_until(lambda: bool(self.stops))
        assert "force reached" in self.stops[0]


@pytest.fixture(params=["home", "station"])
def guarded(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Guarded]:
    wanted = settings(tmp_path, channels=3)
    wanted = wanted.model_copy(update={"silence_s": 0.5, "chunk_s": 0.01})
    with daqco_rig(request.param, wanted) as rig:
        made = Guarded(rig)
        rig.home.application.guard.trip = made.stops.append
        rig.daqco.set_limit(ARMED)
        yield made


Act = Callable[[Guarded], object]
APPLIED: dict[str, Callable[[Guarded], DaqcoSettings]] = {
    "range": lambda each: each.change(low_v=-0.1, high_v=1.0),
    "input": lambda each: each.change(input="ai7"),
    "wiring": lambda each: each.change(mode="nrse"),
    "board": lambda each: each.change(board="Dev2"),
    "active flag": lambda each: each.change(active=False),
    "another scale": lambda each: each.change(scale="Volts"),
    "name": lambda each: each.change(name="push"),
    "name to that of another": lambda each: each.rig.daqco.settings.model_copy(
        update={
            "channel": tuple(
                one.model_copy(update={"name": name})
                for one, name in zip(
                    each.rig.daqco.settings.channel, ("channel1", "force", "channel2"), strict=True
                )
            )
        }
    ),
    "channel taken out": lambda each: each.rig.daqco.settings.model_copy(
        update={"channel": each.rig.daqco.settings.channel[1:]}
    ),
    "coefficients": lambda each: each.with_scale(
        ScaleSettings(name="Probe", unit="uN", coefficients=(0.0,))
    ),
    "unit": lambda each: each.with_scale(
        ScaleSettings(name="Probe", unit="mN", coefficients=(0.0, 0.02))
    ),
    "rate below 200 Hz": lambda each: each.rig.daqco.settings.model_copy(update={"rate_hz": 199.0}),
    "silence_s": lambda each: each.rig.daqco.settings.model_copy(update={"silence_s": 0.9}),
    "chunk_s": lambda each: each.rig.daqco.settings.model_copy(
        update={"chunk_s": 0.1, "silence_s": 0.15}
    ),
}


@pytest.mark.parametrize("name", APPLIED)
def test_what_an_armed_limit_rests_on_does_not_change(guarded: Guarded, name: str) -> None:
    wanted = APPLIED[name](guarded)
    assert wanted != guarded.rig.daqco.settings
    before = guarded.rig.daqco.settings
    with pytest.raises(NotAvailable, match="isarm the limit first"):
        guarded.rig.daqco.apply(wanted)
    assert guarded.rig.daqco.settings == before
    guarded.check_watched()


SCALES = {
    "one that makes everything nothing": Scale("nothing", "uN", (0.0,)),
    "another unit": Scale("other", "mN", (0.0, 0.02)),
    "another gain": Scale("weak", "uN", (0.0, 2.0)),
}


@pytest.mark.parametrize("name", SCALES)
def test_an_armed_limit_keeps_its_scale(guarded: Guarded, name: str) -> None:
    with pytest.raises(NotAvailable, match="isarm the limit first"):
        guarded.rig.daqco.set_scale("force", SCALES[name])
    guarded.check_watched()


def test_the_configure_dialog_is_refused_as_scripts_are(guarded: Guarded) -> None:
    daqco = guarded.rig.daqco
    draft = Draft(daqco.settings)
    draft.replace(0, draft.channels[0].model_copy(update={"name": "push"}))
    with pytest.raises(NotAvailable, match="isarm the limit first"):
        daqco.apply(draft.settings())
    guarded.check_watched()


LEFT_ARMED: dict[str, Act] = {
    "rate": lambda each: each.rig.daqco.configure(rate_hz=2000.0),
    "colour": lambda each: each.rig.daqco.apply(each.change(colour="#000000")),
    "name of its scale": lambda each: each.rig.daqco.set_scale(
        "force", Scale("same", "uN", (0.0, 20.0))
    ),
    "scale of another channel": lambda each: each.rig.daqco.set_scale(
        "channel1", Scale("nothing", "uN", (0.0,))
    ),
    "another channel": lambda each: each.rig.daqco.apply(
        each.rig.daqco.settings.model_copy(update={"channel": each.rig.daqco.settings.channel[:2]})
    ),
    "acquisition stopped and started": lambda each: (each.rig.daqco.stop(), each.rig.daqco.start()),
}


@pytest.mark.parametrize("name", LEFT_ARMED)
def test_a_limit_is_watched_through_changes_that_do_not_touch_it(
    guarded: Guarded, name: str
) -> None:
    LEFT_ARMED[name](guarded)
    wait_until(lambda: guarded.rig.daqco.running and guarded.limit.armed)
    guarded.check_watched()


def test_acquisition_that_is_stopped_says_that_the_limit_is_not_watched(
    guarded: Guarded, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        guarded.rig.daqco.stop()
    assert "force: its limit is no longer watched: nothing is acquired" in caplog.text
    (limit,) = guarded.rig.daqco.limits
    assert not limit.settings.armed
    assert "armed again when it starts" in limit.reason
    with pytest.raises(NotAvailable, match="isarm the limit first"):
        guarded.rig.daqco.apply(guarded.change(name="push"))


def test_disarming_is_logged_and_stands_in_the_recording(
    guarded: Guarded, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    daqco = guarded.rig.daqco
    file = daqco.directory / "disarmed.h5"
    with caplog.at_level(logging.WARNING), daqco.record(file):
        daqco.disarm_limit("force")
    assert "force: its limit was disarmed" in caplog.text
    with open_recording(file) as recording:
        assert "force: its limit was disarmed" in [each.text for each in recording.events]
    assert not guarded.limit.armed


def test_a_limit_that_is_not_armed_follows_its_channel_and_goes_with_its_unit(
    guarded: Guarded,
) -> None:
    daqco = guarded.rig.daqco
    daqco.disarm_limit("force")
    daqco.apply(guarded.change(name="push"))
    assert guarded.limit.channel == "push"
    assert guarded.limit.high == ARMED.high
    daqco.set_scale("push", Scale("other", "mN", (0.0, 0.02)))
    assert daqco.limits == (), "30 uN are not 30 mN"


@pytest.mark.parametrize(
    ("limit", "why"),
    [
        (ARMED.model_copy(update={"high": 300.0}), "never be crossed"),
        (ARMED.model_copy(update={"channel": "nothing"}), "no active channel"),
    ],
)
def test_a_limit_that_can_never_be_crossed_is_not_armed(
    guarded: Guarded, limit: LimitSettings, why: str
) -> None:
    with pytest.raises(ConfigError, match=why):
        guarded.rig.daqco.set_limit(limit)
    guarded.check_watched()
