"""Taking movements back, per assembly, through the gate."""

import pytest

import cosmic
from cosmic.frame.errors import DeviceFault
from cosmic.mico.hw.interface import Channel
from unit.mico.rigs import mico, wait_until

GROUPS = {
    "group": [
        {"title": "Left", "positioners": ["d0.c0", "d0.c1", "d0.c2"]},
        {"title": "Right", "positioners": ["d1.c0"]},
    ]
}
TWO = ("LLN", "LL")


def where(rig, *names):
    return [rig[name].details.position for name in names]


def test_a_movement_of_any_kind_is_taken_back_by_assembly():
    with mico(TWO, **GROUPS) as (rig, _):
        rig["d0.c0"].move_to(100.0)
        rig.move({"d0.c0": 200.0, "d0.c1": 50.0})
        rig["d1.c0"].move_to(7.0)
        wait_until(lambda: len(rig.undo_entries) == 3)
        assert [entry.group for entry in rig.undo_entries] == ["Right", "Left", "Left"]
        assert rig.undo("Left") == {"d0.c0": 100.0, "d0.c1": 0.0}
        assert rig.undo() == {"d1.c0": 0.0}
        assert rig.undo() == {"d0.c0": 0.0}
        with pytest.raises(cosmic.NotAvailable, match="nothing to undo"):
            rig.undo()
        with pytest.raises(cosmic.NotAvailable, match="nothing to undo of Left"):
            rig.undo("Left")
        with pytest.raises(
            cosmic.NotAvailable, match=r"no group 'Middle'; there are Left, Right, d1"
        ):
            rig.undo("Middle")


def test_ten_movements_of_an_assembly_are_kept():
    with mico(TWO, **GROUPS) as (rig, _):
        for number in range(1, 13):
            rig["d0.c0"].move_to(10.0 * number)
            wait_until(lambda n=number: len(rig.undo_entries) == min(n, 10))
        for _ in range(10):
            rig.undo()
        assert where(rig, "d0.c0") == [20.0]
        with pytest.raises(cosmic.NotAvailable):
            rig.undo()


def test_a_movement_that_was_stopped_on_its_way_is_taken_back_too():
    with mico(TWO, instant=False, **GROUPS) as (rig, controller):
        movement = rig["d0.c0"].move_to(100.0, wait=False)
        wait_until(lambda: controller.of("move_to"))
        controller.position[Channel(0, 0)] = 40.0
        rig["d0.c0"].halt()
        movement.exception(3)
        wait_until(lambda: len(rig.undo_entries) == 1)
        back = rig.undo(wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 2)
        controller.end(Channel(0, 0), 0.0)
        assert back.wait(3) == {"d0.c0": 0.0}
        wait_until(lambda: not rig.undo_entries)


def test_a_refused_undo_says_why_and_keeps_its_entry():
    with mico(TWO, **GROUPS) as (rig, _):
        rig["d0.c0"].move_to(100.0)
        wait_until(lambda: len(rig.undo_entries) == 1)
        rig.application.manager.stop("test")
        with pytest.raises(cosmic.StoppedError, match="reset the stop first"):
            rig.undo()
        rig.application.manager.reset_stop()
        assert rig.undo() == {"d0.c0": 0.0}


def test_an_undo_that_fails_can_be_tried_again():
    with mico(TWO, instant=False, **GROUPS) as (rig, controller):
        movement = rig["d0.c0"].move_to(100.0, wait=False)
        wait_until(lambda: controller.of("move_to"))
        controller.end(Channel(0, 0), 100.0)
        movement.wait(3)
        wait_until(lambda: len(rig.undo_entries) == 1)
        back = rig.undo(wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 2)
        with pytest.raises(cosmic.NotAvailable, match=r"d0\.c0 is moving"):
            rig.undo()
        controller.fail(Channel(0, 0), DeviceFault.OVERHEATED)
        with pytest.raises(cosmic.DeviceError):
            back.wait(3)
        assert len(rig.undo_entries) == 1


def test_there_is_no_undo_to_before_an_axis_was_initialised():
    with mico(TWO, **GROUPS) as (rig, _):
        rig["d0.c0"].move_to(100.0)
        wait_until(lambda: len(rig.undo_entries) == 1)
        rig.initialise()
        assert not rig.undo_entries


def test_a_movement_from_an_unknown_position_leaves_nothing_to_undo():
    def power_up(controller):
        controller.known = False

    with mico(TWO, prepare=power_up, **GROUPS) as (rig, _):
        rig["d0.c0"].move_to(100.0, consent=True)
        assert not rig.undo_entries


def test_a_linked_axis_comes_back_with_the_one_that_moved_it():
    with mico(TWO, **GROUPS) as (rig, _):
        rig.link("d0.c0", "d1.c0", -1.0)
        rig["d0.c0"].move_to(30.0)
        wait_until(lambda: len(rig.undo_entries) == 2)
        rig.undo("Left")
        assert where(rig, "d0.c0", "d1.c0") == [0.0, 0.0]
        with pytest.raises(cosmic.NotAvailable):
            rig.undo()


def test_what_moved_is_still_known_after_a_rescan():
    with mico(TWO, **GROUPS) as (rig, _):
        rig["d0.c0"].move_to(100.0)
        wait_until(lambda: len(rig.undo_entries) == 1)
        rig.rescan()
        rig["d0.c0"].move_to(150.0)
        wait_until(lambda: len(rig.undo_entries) == 2)
        rig.undo()
        assert rig.undo() == {"d0.c0": 0.0}


# What was felt, and how fast it goes back


def test_an_undo_moves_at_the_speed_of_the_configuration():
    with mico(TWO, **GROUPS, undo={"speed_um_s": 30.0}) as (rig, controller):
        rig["d0.c0"].move_to(100.0)
        wait_until(lambda: rig.undo_entries)
        rig.undo()
        begun = controller.calls.index(controller.of("move_to")[-1])
        limits = [call for call in controller.calls[:begun] if call[0] == "frequency"]
        assert limits[-1][1:] == (Channel(0, 0), 20)  # 30 um/s at 1.5 um a step


def test_undo_is_refused_where_a_force_was_felt_since_until_it_is_confirmed():
    felt = ["force feels 40.0 uN"]
    with mico(TWO, **GROUPS) as (rig, _):
        rig.application.cautions.add(lambda: felt[0])
        rig["d0.c0"].move_to(100.0)
        wait_until(lambda: rig.undo_entries)
        felt[0] = ""
        rig["d0.c0"].move_to(80.0)
        wait_until(lambda: len(rig.undo_entries) == 2)
        assert rig.undo() == {"d0.c0": 100.0}  # nothing was felt after that
        with pytest.raises(cosmic.NotAvailable, match=r"100\.0 µm to 0\.0 µm.*feels 40\.0 uN"):
            rig.undo()
        assert where(rig, "d0.c0") == [100.0]
        assert rig.undo(confirm=True) == {"d0.c0": 0.0}


def test_a_touch_that_is_over_when_the_movement_ends_is_remembered_by_undo():
    with mico(TWO, instant=False, **GROUPS) as (rig, controller):
        movement = rig["d0.c0"].move_to(100.0, wait=False)
        wait_until(lambda: controller.of("move_to"))
        rig.application.cautions.touched("force felt more than 15 uN")
        controller.end(Channel(0, 0), 100.0)
        movement.wait(3)
        wait_until(lambda: len(rig.undo_entries) == 1)
        with pytest.raises(cosmic.NotAvailable, match="force felt more than 15 uN"):
            rig.undo()
        assert len(controller.of("move_to")) == 1
        back = rig.undo(wait=False, confirm=True)
        wait_until(lambda: len(controller.of("move_to")) == 2)
        controller.end(Channel(0, 0), 0.0)
        back.wait(3)


def test_a_touch_between_two_movements_counts_for_all_that_lead_back_over_it():
    with mico(TWO, **GROUPS) as (rig, _):
        rig["d1.c0"].move_to(7.0)
        rig["d0.c0"].move_to(100.0)
        wait_until(lambda: len(rig.undo_entries) == 2)
        rig.application.cautions.touched("force felt more than 15 uN")
        rig["d0.c0"].move_to(80.0)
        wait_until(lambda: len(rig.undo_entries) == 3)
        assert rig.undo() == {"d0.c0": 100.0}  # nothing was touched after that
        wait_until(lambda: len(rig.undo_entries) == 2)
        for group in (None, "Right"):
            with pytest.raises(cosmic.NotAvailable, match="force felt more than 15 uN"):
                rig.undo(group)
        assert where(rig, "d0.c0", "d1.c0") == [100.0, 7.0]


def test_a_touch_during_undo_is_remembered_with_what_was_before():
    with mico(TWO, instant=False, **GROUPS) as (rig, controller):
        for number, target in enumerate((100.0, 200.0), start=1):
            movement = rig["d0.c0"].move_to(target, wait=False)
            wait_until(lambda n=number: len(controller.of("move_to")) == n)
            controller.end(Channel(0, 0), target)
            movement.wait(3)
            wait_until(lambda n=number: len(rig.undo_entries) == n)
        back = rig.undo(wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 3)
        rig.application.cautions.touched("force felt more than 15 uN")
        controller.end(Channel(0, 0), 100.0)
        back.wait(3)
        wait_until(lambda: len(rig.undo_entries) == 1)
        with pytest.raises(cosmic.NotAvailable, match="force felt more than 15 uN"):
            rig.undo()


def test_a_movement_that_came_back_by_itself_leaves_its_touch_to_the_one_before():
    with mico(TWO, instant=False, **GROUPS) as (rig, controller):
        for number, target in enumerate((100.0, 130.0), start=1):
            movement = rig["d0.c0"].move_to(target, wait=False)
            wait_until(lambda n=number: len(controller.of("move_to")) == n)
            if number == 2:
                rig.application.cautions.touched("force felt more than 15 uN")
            controller.end(Channel(0, 0), 100.0)
            movement.exception(3)
        with pytest.raises(cosmic.NotAvailable, match="force felt more than 15 uN"):
            rig.undo()


def test_initialising_is_refused_where_something_may_be_held_until_it_is_said():
    with mico(TWO, **GROUPS) as (rig, controller):
        rig.application.cautions.add(lambda: "left.gripper was closed and may hold something")
        with pytest.raises(cosmic.NotAvailable, match=r"was closed .*may_hold=True"):
            rig.initialise()
        assert not controller.of("reference")
        rig.initialise(may_hold=True)
        assert controller.of("reference")
