"""Visit a grid of positions with the probe and print where it really stood, as CSV."""

from itertools import product

import cosmic

COLUMNS_UM = (0.0, 100.0, 200.0, 300.0)
ROWS_UM = (-50.0, 0.0, 50.0)


def main() -> None:
    """Ask the gate about every position first, so that nothing starts that cannot end."""
    positions = [{"probe.x": x, "probe.y": y} for y, x in product(ROWS_UM, COLUMNS_UM)]
    with cosmic.connect(rate=20, world="plain") as rig:
        for position in positions:
            verdict = rig.mico.check(position)
            if not verdict.allowed:
                raise SystemExit(f"{position} cannot be visited: {verdict}")
        print("x_um,y_um,x_reached_um,y_reached_um")
        for position in positions:
            reached = rig.mico.move(position)
            print(*position.values(), reached["probe.x"], reached["probe.y"], sep=",")


if __name__ == "__main__":
    main()
