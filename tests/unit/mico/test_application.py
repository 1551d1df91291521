import pytest

import cosmic
from cosmic.mico.api import initialisation
from unit.mico.rigs import mico, wait_until


@pytest.mark.defects
def test_a_defect_in_a_long_operation_ends_it_and_stops_everything(monkeypatch):
    def broken(settings, states, **how):
        raise RuntimeError("defect")

    monkeypatch.setattr(initialisation, "plan_sequence", broken)
    with mico() as (rig, _):
        with pytest.raises(RuntimeError, match="defect"):
            rig.initialise()
        wait_until(lambda: rig.application.manager.latch.state.latched)
        wait_until(lambda: not rig.application.isRunning())
        with pytest.raises(cosmic.NotAvailable, match="closed"):
            rig.initialise()


def test_closing_ends_a_long_operation():
    with mico(instant=False) as (rig, controller):
        task = rig.initialise(wait=False)
        wait_until(lambda: bool(controller.of("reference")))
        rig.application.shut_down()
        with pytest.raises(cosmic.CosmicError):
            task.wait(2)


@pytest.mark.defects
def test_a_defect_in_a_device_thread_stops_everything_and_leaves_no_movement_waiting():
    with mico(instant=False) as (rig, controller):
        movement = rig["d0.c0"].move_to(5.0, wait=False)
        wait_until(lambda: bool(controller.of("move_to")))

        def explode(channel):
            raise RuntimeError("defect in a driver")

        controller.ask_activity = explode
        assert isinstance(movement.exception(3), cosmic.CosmicError)
        wait_until(lambda: rig.application.manager.latch.state.latched)
        with pytest.raises(cosmic.MoveRefused):
            rig["d0.c1"].move_to(1.0)
