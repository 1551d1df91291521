"""The same seed and the same commands give the same fate of fibres, however fast the clock runs."""

from typing import Any

import pytest

import cosmic
from cosmic.app.configuration.platform_file import load_platform
from cosmic.frame.clock import RatedClock
from cosmic.frame.errors import ConfigError
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.mico import Mico
from cosmic.mico.hw.scu3d import Scu3dController
from cosmic.mico.hw.sim_scu3d import load_simulated_library
from cosmic.twin.force_settings import FibreSettings
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings
from cosmic.twin.truth import read_truth
from unit.twin.force_bench import Heard

FIBRE = FibreSettings(
    length_um=1600.0, width_um=32.0, thickness_um=8.0, ei_n_m2=5e-11, ea_n=7.7, curl_deg=15.0
)
STEPS_HZ = 2000.0
"""The twin looks at jaws each millisecond: at 10 kHz they go 10 um between two looks, and where
they wipe a fibre off themselves is not known better."""
RATES = {"missed_grasp": 0.3, "slip_in_lift": 0.3, "jaw_adhesion": 0.3, "tool_offset_um": 1.0}


def handled(rate: float, *, watched: bool) -> list[tuple[str, dict[str, Any]]]:
    """Take, lift, let go and shake five times; return what happened."""
    shipped = shipped_settings()
    handling = shipped.handling.model_copy(
        update={"default_faults": True, "fall_um": 2.0, "fall_part": 0.01, "fall_deg": 1.0} | RATES
    )
    stages = dict(shipped.stages)
    stages["left.gripper"] = stages["left.gripper"].model_copy(update={"start": 400.0})
    twin = shipped.model_copy(update={"fibres": (FIBRE,), "handling": handling, "stages": stages})
    heard = Heard()
    scene = Scene.from_settings(twin, RatedClock(rate), 17, truth=heard)
    application = MicoApplication(
        Scu3dController(load_simulated_library(scene=scene), simulated=True),
        load_platform(None)[0].mico,
        clock=scene.clock,
        policy=FailurePolicy(),
    )
    application.initialize()
    try:
        _work(Mico(application), scene, watched=watched)
    finally:
        application.shut_down()
        scene.close()
    return heard.events


def _work(mico: Mico, scene: Scene, *, watched: bool) -> None:
    gripper, z = mico["left.gripper"], mico["left.z"]
    mico["left.x"].move_to(3500.0)
    for _ in range(5):
        z.move_to(-1500.0)
        gripper.steps(-405, frequency_hz=STEPS_HZ)
        z.move_to(-1200.0)
        gripper.steps(385, frequency_hz=STEPS_HZ)
        for way in (6.0, -6.0, 6.0, -6.0):
            z.move_by(way)
        if watched:
            assert scene.force_side is not None
            assert scene.force_side.timeline.moment(scene.clock.now_s())


def test_the_fate_of_fibres_is_the_same_at_rate_1_and_at_rate_20() -> None:
    slow, fast = handled(1.0, watched=False), handled(20.0, watched=True)
    outcomes = [(name, facts.get("how")) for name, facts in slow]
    assert outcomes == [(name, facts.get("how")) for name, facts in fast]
    assert {"grasped", "released"} <= {name for name, _ in outcomes}
    assert {"missed", "slipped", "came off"} <= {name for name, _ in outcomes}
    for (name, one), (_, two) in zip(slow, fast, strict=True):
        for key in ("at_um", "x_um", "y_um") if name != "sample" else ():
            if key in one:
                assert one[key] == pytest.approx(two[key], abs=4.0), (name, key)


def test_a_rig_writes_the_truth_and_takes_faults_of_every_part(tmp_path: Any) -> None:
    file = tmp_path / "truth.jsonl"
    with cosmic.connect(
        applications=("mico", "daqco"), rate=20.0, sample="three-dry", truth=file, seed=5
    ) as rig:
        rig.faults.inject("missed_grasp")
        rig.faults.inject("board stalled")
        for unknown in ("foo", 5, "board foo"):
            with pytest.raises(cosmic.CosmicError, match=r"no fault .* known: scene missed_grasp"):
                rig.faults.inject(unknown)
        assert len(rig.faults.active) == 2
        rig.faults.clear()
        rig.mico["left.x"].move_to(2000.0)
    truth = read_truth(file)
    assert truth.complete and (truth.sample, truth.seed) == ("three-dry", 5)
    assert sum(each.role == "single" for each in truth.fibres) == 3


def test_an_unknown_sample_and_a_truth_that_cannot_be_written_are_refused(tmp_path: Any) -> None:
    with pytest.raises(ConfigError, match=r"no sample 'forty' .*three-dry") as refused:
        cosmic.connect(sample="forty")
    assert "\n" not in str(refused.value)
    with pytest.raises(ConfigError, match="cannot be written"):
        cosmic.connect(truth=tmp_path / "nowhere" / "truth.jsonl")
