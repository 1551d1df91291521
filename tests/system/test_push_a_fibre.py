"""A script drives the probe into the held fibre, past the collision gate, and feels it."""

import numpy as np
import pytest

from cosmic.twin.scene import Scene
from system.simulated_platform import platform


def volts(scene: Scene) -> float:
    """Return the mean of the last 20 ms at the force sensor, as a board would see it."""
    assert scene.force_side is not None
    now_s = scene.clock.now_s()
    return float(
        scene.force_side.sensors["force"].volts(now_s - np.arange(300)[::-1] / 15e3).mean()
    )


def test_the_force_rises_while_the_probe_is_driven_into_the_fibre():
    with platform() as (mico, _, scene):
        assert scene.force_side is not None
        for target in ({"left.x": 3600.0}, {"left.z": -810.0}, {"probe.y": -4950.0}):
            assert mico.check(target).allowed
            mico.move(target)
        zero = volts(scene)
        seen = []
        for place in (-5000.0, -5010.0, -5020.0):
            assert mico.check({"probe.y": place}).allowed
            mico["probe.y"].move_to(place)
            scene.clock.sleep(0.1)
            truth = scene.force_side.timeline.moment(scene.clock.now_s())
            seen.append(volts(scene) - zero)
            assert seen[-1] == pytest.approx(0.01 * truth.force_un, rel=0.05)
        assert np.diff(seen) == pytest.approx([0.2, 0.2], rel=0.2), "2 uN/um at 10 mV/uN"
        (push,) = truth.pushes
        assert (push.fibre, push.abscissa_um) == (0, pytest.approx(400.0, abs=2.0))
        mico["probe.y"].move_to(-4900.0)
        assert scene.force_side.timeline.moment(scene.clock.now_s()).force_un == 0.0


def test_initialising_keeps_the_fibre_in_the_jaws():
    with platform() as (mico, _, scene):
        mico.initialise()
        assert scene.force_side is not None
        assert scene.force_side.timeline.moment(scene.clock.now_s()).fibres[0].held_by == ("left",)
