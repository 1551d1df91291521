"""Which bodies are watched against each other, which may touch, and why."""

from collections.abc import Iterable
from itertools import combinations
from pathlib import Path

from cosmic.mico.core.collision.model import (
    AllowedPair,
    BodyPair,
    Contact,
    Joint,
    JointKind,
    Shape,
    WatchedPair,
    pair_of,
)
from cosmic.mico.core.collision.scene_findings import Findings
from cosmic.mico.core.collision.scene_settings import SceneSettings
from cosmic.mico.core.collision.scene_xml import Disabled


class Pairing:
    """Sorts the pairs of bodies of a scene.

    Parameters
    ----------
    bodies, joints, pieces
        As in `SceneModel`.
    """

    def __init__(
        self,
        bodies: tuple[str, ...],
        joints: tuple[Joint, ...],
        pieces: Iterable[Shape],
        findings: Findings,
    ) -> None:
        self._bodies = bodies
        self._solid = {piece.body for piece in pieces}
        self._rigid = _rigid_groups(bodies, joints)
        self._findings = findings

    def allowed(self, disabled: Iterable[Disabled]) -> tuple[AllowedPair, ...]:
        """Return the pairs that the SRDF lets touch."""
        found: dict[BodyPair, AllowedPair] = {}
        for each in disabled:
            pair = self._known(each.links, each.where)
            if pair is None:
                continue
            if pair in found:
                self._findings.odd(each.where, f"{' and '.join(pair)} are listed twice")
            found.setdefault(pair, AllowedPair(pair, each.reason))
        return tuple(found.values())

    def watched(
        self, settings: SceneSettings, allowed: Iterable[AllowedPair], path: Path, srdf: Path
    ) -> tuple[WatchedPair, ...]:
        """Return all pairs that can move against each other and may not touch."""
        free = {each.bodies for each in allowed}
        able = [
            pair_of(one, other)
            for one, other in combinations(self._bodies, 2)
            if {one, other} <= self._solid and self._rigid[one] != self._rigid[other]
        ]
        pairs = [pair for pair in able if pair not in free]
        self._warn_of_unwatched(able, pairs, srdf)
        margins: dict[BodyPair, float] = {}
        for number, each in enumerate(settings.margin):
            where = f"{path}: margin[{number}]"
            pair = self._known(each.bodies, where)
            if pair is not None and pair in margins:
                self._findings.wrong(where, f"{' and '.join(pair)} have a margin already")
            elif pair is not None and pair not in pairs:
                self._findings.wrong(where, f"{' and '.join(pair)} are not watched")
            if pair is not None:
                margins[pair] = each.margin_um
        return tuple(WatchedPair(pair, margins.get(pair, settings.margin_um)) for pair in pairs)

    def contacts(
        self, settings: SceneSettings, watched: Iterable[WatchedPair], path: Path
    ) -> tuple[Contact, ...]:
        """Return the operations during which some pairs may touch."""
        known = {each.bodies for each in watched}
        found: dict[str, Contact] = {}
        for number, each in enumerate(settings.contact):
            where = f"{path}: contact[{number}] ({each.operation})"
            if each.operation in found:
                self._findings.wrong(where, "an operation of that name is listed already")
            pairs = [self._known(bodies, where) for bodies in each.pairs]
            for pair in pairs:
                if pair is not None and pair not in known:
                    self._findings.odd(where, f"{' and '.join(pair)} are not watched anyhow")
            whole = tuple(pair for pair in pairs if pair is not None)
            found.setdefault(each.operation, Contact(each.operation, whole, each.reason))
        return tuple(found.values())

    def _known(self, links: tuple[str, str], where: str) -> BodyPair | None:
        unknown = [name for name in links if name not in self._bodies]
        for name in unknown:
            self._findings.wrong(where, f"{name!r} is not a link of the URDF; is it misspelt?")
        if links[0] == links[1]:
            self._findings.wrong(where, f"{links[0]!r} with itself is not a pair")
            return None
        return None if unknown else pair_of(*links)

    def _warn_of_unwatched(self, able: list[BodyPair], pairs: list[BodyPair], srdf: Path) -> None:
        if able and not pairs:
            self._findings.odd(
                srdf, "every pair is allowed to touch: nothing at all is watched for collisions"
            )
            return
        watched = {name for pair in pairs for name in pair}
        for name in self._bodies:
            if name not in watched and any(name in pair for pair in able):
                self._findings.odd(srdf, f"{name!r} may touch everything it can meet")


def _rigid_groups(bodies: tuple[str, ...], joints: tuple[Joint, ...]) -> dict[str, str]:
    """Return for each body the first of those it is fixed to."""
    group = {bodies[0]: bodies[0]} if bodies else {}
    for joint in joints:
        fixed = joint.kind is JointKind.FIXED
        group[joint.child] = group[joint.parent] if fixed else joint.child
    return group
