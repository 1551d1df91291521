"""Which cards stand together in the MiCo panel."""

from cosmic.mico.core.ports import ManagerPort
from cosmic.mico.core.settings import GroupSettings


def arranged_groups(manager: ManagerPort) -> list[GroupSettings]:
    """Return the groups of the configuration, and one a device for what they leave out."""
    groups = list(manager.settings.group)
    named = {name for group in groups for name in group.positioners}
    rest: dict[int, list[str]] = {}
    for name in manager.names():
        if name not in named:
            rest.setdefault(manager.address(name).device, []).append(name)
    groups += [
        GroupSettings(title=f"Device {index}", positioners=tuple(names))
        for index, names in sorted(rest.items())
    ]
    return groups
