"""Write a procedure: touch a fibre at several positions, push it there, and note the stiffness."""

from dataclasses import dataclass, field

from typing_extensions import override

import cosmic
from cosmic.autonomy.procedures.parts import (
    SAFE_POINT,
    Guard,
    NodeEvent,
    OperationFailed,
    Procedure,
    Repeat,
    Retry,
    Sequence,
    Steps,
    UnitOperation,
)


@dataclass
class Work:
    """What the operations share: the rig, what is left to do, and what was found."""

    rig: cosmic.Rig
    positions_um: list[float]
    stiffness_un_um: dict[float, float] = field(default_factory=dict)

    @property
    def force_un(self) -> float:
        """The force now."""
        return self.rig.daqco.latest()["force"]


class BringNear(UnitOperation[Work]):
    """Bring the next position of the fibre in front of the probe."""

    name = "bring near"

    @override
    def run(self, work: Work) -> Steps:
        yield work.rig.mico["probe.y"].move_to(-4940.0, wait=False)
        yield work.rig.mico.move({"left.z": -800.0, "left.x": work.positions_um[0]}, wait=False)
        yield SAFE_POINT


class Touch(UnitOperation[Work]):
    """Go on in small steps until the force says that something is touched."""

    name = "touch"

    @override
    def precondition(self, work: Work) -> None:
        if abs(work.force_un) > 2.0:
            raise OperationFailed("not free", f"the force is {work.force_un:.1f} uN; draw back")

    @override
    def run(self, work: Work) -> Steps:
        for _ in range(50):
            yield work.rig.mico["probe.y"].move_by(-2.0, wait=False)
            yield 0.02
            if work.force_un > 3.0:
                return
        raise OperationFailed("no contact", "nothing was touched within 100 um; look where it is")

    @override
    def verify(self, work: Work) -> Steps:
        yield 0.1
        if not work.force_un > 2.0:
            raise OperationFailed("lost contact", f"only {work.force_un:.1f} uN are left")

    @override
    def undo(self, work: Work) -> Steps:
        yield work.rig.mico["probe.y"].move_to(-4940.0, wait=False)


class Push(UnitOperation[Work]):
    """Push by 10 um and note how much the force rises."""

    name = "push"

    @override
    def run(self, work: Work) -> Steps:
        before_un = work.force_un
        yield work.rig.mico["probe.y"].move_by(-10.0, wait=False)
        yield 0.1
        place_um = work.positions_um.pop(0)
        work.stiffness_un_um[place_um] = (work.force_un - before_un) / 10.0


class DrawBack(UnitOperation[Work]):
    """Leave the fibre."""

    name = "draw back"

    @override
    def run(self, work: Work) -> Steps:
        yield work.rig.mico["probe.y"].move_to(-4900.0, wait=False)
        yield 0.1


def draw_back(work: Work) -> Steps:
    """Make things safe, whatever happened."""
    yield from DrawBack().run(work)


def scan() -> Procedure[Work]:
    """Put the operations together."""
    one_position = Sequence(
        "one position",
        BringNear(),
        Retry(Touch(), times=3, only={"no contact", "lost contact"}),
        Guard(Push(), lambda work: work.force_un < 90.0, cause="force too high"),
        DrawBack(),
    )
    all_positions = Repeat(
        one_position, until=lambda work: not work.positions_um, name="each position"
    )
    return Procedure("stiffness along a fibre", all_positions, make_safe=draw_back)


def show(event: NodeEvent) -> None:
    """Print what each operation came to."""
    if event.kind == "operation" and event.ended_s is not None:
        print(f"{event.name}: {event.cause or event.state}")


def main() -> None:
    """Run it on the simulated platform, ten times as fast as in life."""
    with cosmic.connect(applications=("mico", "daqco"), rate=10.0, world="plain") as rig:
        work = Work(rig, positions_um=[3600.0, 3500.0, 3400.0])
        run = rig.procedure(scan(), work)
        run.subscribe(show)
        run.run_here()
        for place_um, stiffness_un_um in work.stiffness_un_um.items():
            print(f"at {place_um:.0f} um: {stiffness_un_um:.2f} uN/um")
        for each in run.times.summary():
            print(f"{each.name}: {each.count} times, median {each.median_s:.2f} s")


if __name__ == "__main__":
    main()
