"""Which cards stand together in the MiCo panel."""

from cosmic.mico.api.mico import Mico
from cosmic.mico.core.settings import GroupSettings


def arranged_groups(mico: Mico) -> list[GroupSettings]:
    """Return the groups of the configuration, and one a device for what they leave out."""
    groups = list(mico.settings.group)
    named = {name for group in groups for name in group.positioners}
    rest: dict[int, list[str]] = {}
    for name in mico.names:
        if name not in named:
            rest.setdefault(mico[name].details.address.device, []).append(name)
    groups += [
        GroupSettings(title=f"Device {index}", positioners=tuple(names))
        for index, names in sorted(rest.items())
    ]
    return groups
