"""Hold a force on a fibre, change it, and look at how well the loop kept its time."""

import cosmic


def bring_near(rig: cosmic.Rig) -> None:
    """Bring the fibre in front of the probe, and the probe near to it."""
    rig.mico.move({"left.z": -800.0, "left.x": 3600.0})
    rig.mico["probe.y"].move_to(-4970.0)


def hold(rig: cosmic.Rig) -> None:
    """Push the fibre with 50 uN, then with 25 uN."""
    with rig.control.hold_force(
        "force",
        "probe.y",
        50.0,
        direction=-1,  # the force rises while the probe moves towards smaller y
        limit_un=90.0,
        travel_um=200.0,
    ) as loop:
        force_un = loop.wait_settled()
        print(f"held: {force_un:.1f} uN at {loop.reading.position:.1f} um")
        print(f"stiffness: {loop.stiffness_un_um:.1f} uN/um")
        loop.aim(25.0)
        print(f"held: {loop.wait_settled():.1f} uN")
        pace = loop.statistics.pace
        print(f"period: {1e3 * pace.period_p50_s:.2f} ms, missed {pace.missed} of {pace.cycles}")
    print(f"ended: {loop.ending}")


def be_ended(rig: cosmic.Rig) -> None:
    """Let a loop say that it may not go far enough; its axis stands then."""
    rig.mico["probe.y"].move_to(-4900.0)
    loop = rig.control.hold_force("force", "probe.y", 50.0, direction=-1, travel_um=20.0)
    try:
        loop.wait_settled()
    except cosmic.LimitError as limit:
        print(f"ended: {limit}")


def main() -> None:
    """Do all of it on the simulated platform, at twice its speed."""
    with cosmic.connect(applications=("mico", "daqco"), rate=2.0, world="plain") as rig:
        bring_near(rig)
        hold(rig)
        be_ended(rig)


if __name__ == "__main__":
    main()
