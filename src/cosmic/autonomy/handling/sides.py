"""The settings of one of two hands: each keeps to its own side of the platform."""

from cosmic.autonomy.handling.settings import HandlingSettings


def of_hand(settings: HandlingSettings, gripper: str) -> HandlingSettings:
    """Return the settings of one of two hands.

    Each stays on its own side, so that neither is ever in the other's way. Fibres are let go
    from where the hands travel: the table, with all that stands up from it, turns below.
    """
    pair, places, grasp = settings.pair, settings.places, settings.grasp
    own = {
        "hold_x_um": min(places.hold_x_um, -pair.apart_um),
        "bin_um": max(places.bin_um, places.travel_um),
    }
    # Of two fibres, one before the probe and one drawn back, neither reaches the other.
    longest_um = pair.apart_um + pair.behind_um / 2.0 + grasp.inside_um
    sides = {
        "reach_x_um": min(grasp.reach_x_um, -pair.apart_um),
        "longest_um": min(grasp.longest_um, longest_um),
    }
    return settings.model_copy(
        update={
            "gripper": gripper,
            "other": "right" if gripper == "left" else "left",
            "places": places.model_copy(update=own),
            "grasp": grasp.model_copy(update=sides),
        }
    )
