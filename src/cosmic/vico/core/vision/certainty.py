"""How probable it is that what was found is one whole fibre, and how long it is.

The signs along a fibre and at its ends are weighed together: each lowers the probability, the more
the clearer it is. The weights are those of `benchmarks/certainty.py`, which draws single fibres and
pairs, finds them, and fits a logistic curve to what came out. Half of what it draws is no single
fibre; the probability told is for a sample in which one of sixty is not. The last sign is learned:
what the others find improbable it does not make certain.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import exp, log
from typing import Final

import numpy as np

from cosmic.frame.arrays import ByteMask, Floats
from cosmic.vico.core.vision import axial, beyond, learned_joint
from cosmic.vico.core.vision.axial import Joints
from cosmic.vico.core.vision.ends import EndKind
from cosmic.vico.core.vision.joining import ON_ANOTHER
from cosmic.vico.core.vision.profiles import Scene
from cosmic.vico.core.vision.refine import Course

CERTAIN: Final = 0.999
IMPROBABLE: Final = "weak signs together make it less than certain that it is one whole fibre"

NAMES: Final = (*axial.NAMES, "goes on", "soft", "compressed", "joint")
HAND_MADE: Final = len(NAMES) - 1
"""Signs before the learned one."""
HAND_WEIGHTS: Final = (
    0.49, 0.68, 1.48, 0.86, 0.10, 3.91, 1.37, 1.38, 0.10, 1.52, 1.80, 3.17, 3.22, 1.28,
)  # fmt: skip
WEIGHTS: Final = (
    0.10, 0.10, 0.31, 0.10, 0.10, 0.10, 0.91, 0.55, 0.22, 0.16, 0.10, 4.73, 3.16, 0.10, 7.58,
)  # fmt: skip
JPEG_WEIGHTS: Final = (
    0.10, 2.69, 2.04, 0.52, 0.10, 0.69, 0.65, 1.85, 0.10, 0.43, 0.10, 3.01, 2.75, 0.77, 6.63,
)  # fmt: skip
"""Without the learned sign, fitted to 4951 fibres and pairs; with it, to the 3395 of them on images
without the blocks of JPEG, and to 1281 on images with them. Right and wrong ones are alike in say,
and a tenth is a floor."""
HAND_LOGIT: Final = 5.58
FITTED_LOGIT: Final = 5.64
JPEG_LOGIT: Final = 8.51
"""Logit of the probability where there is no sign, on images of which a half is no single fibre."""
PRIOR_ODDS: Final = 60.0
"""Whole fibres for each that is two or a part, among what is found: a guess, on the safe side."""
MORE_ODDS: Final = 2.4
"""So much more probable than the hand-made signs alone say a fibre is at most, where a network
sees no joint: it may be blind to what it was not shown."""
HIDDEN_ODDS: Final = 10.0
"""So much less probable than fitted a fibre is where an image shows the blocks of JPEG. With less
than nine about one of a thousand pairs is certain and wrong there."""
DOUBT: Final = 6.0
"""What each reason to doubt takes off: a guess."""
NOISE: Final = 0.25
"""So clear is a sign in the clearest place of any fibre: only what is above it counts."""
NOISE_AS_JPEG: Final = 0.1
"""The same of the learned sign where compression hides joints: what is left of them is fainter."""
BLOCKY: Final = 0.5
"""Of borders of JPEG's blocks: from half as much again, about quality 80, more hides no more."""
MOST_BLOCKY: Final = 24.0
"""From there on no network looks: neighbours differ thirteen times as much across borders of blocks
as elsewhere (quality 25 to 50)."""
SEEN: Final = 0.5
"""So clearly a network sees a joint which no hand-made sign need show, on an image with blocks of
JPEG. Gloss along cords that are whole was no clearer than 0.35."""
MOST_ALONG: Final = 4.0
MOST: Final = 1.5
INTERVAL_STDS: Final = 2.0
"""Within so many standard deviations lie 95 of 100 lengths of drawn single fibres."""
CUT_OFF: Final = frozenset(
    {EndKind.BORDER.value, EndKind.BODY.value, EndKind.LOST.value, ON_ANOTHER}
)
"""What has one of these is not seen whole."""


@dataclass(frozen=True, slots=True)
class Signs:
    """Signs that a fibre is not one, or not whole; each counts by itself from 1 on.

    What is compressed, or what a network takes for a joint, counts with the others only. None: no
    network has looked.
    """

    joints: Joints = field(default_factory=Joints)
    goes_on: float = 0.0
    soft: float = 0.0
    compressed: float = 0.0
    joint: float | None = None

    @property
    def coded(self) -> bool:
        """Whether the image shows the blocks of JPEG."""
        return self.compressed > NOISE

    @property
    def doubts(self) -> list[str]:
        """Reasons that count by themselves."""
        found = self.joints.doubts
        if self.goes_on > 1.0:
            found.append(beyond.GOES_ON)
        if self.soft > 1.0:
            found.append(beyond.SOFT)
        return found

    @property
    def values(self) -> tuple[float, ...]:
        """Each sign in the order of `NAMES`, from nothing to `MOST`, where they weigh most."""
        return tuple(self._at(WEIGHTS).tolist())

    def weighed_by(self, weights: Sequence[float]) -> Floats:
        """Return what is above noise of each sign that has a weight, in the order of `NAMES`.

        Those along the fibre are of the one place where together they weigh most: a joint is in
        one place, the unevenness of one fibre is scattered.
        """
        noise = np.full(len(NAMES), NOISE)
        noise[-1] = NOISE_AS_JPEG if self.coded else NOISE
        return np.asarray(np.maximum(self._at(weights) - noise[: len(weights)], 0.0))

    def taken_by(self, weights: Sequence[float]) -> float:
        """Return what signs take off the logit."""
        return float(self.weighed_by(weights) @ np.asarray(weights))

    def _at(self, weights: Sequence[float]) -> Floats:
        along = np.minimum(self.joints.along, MOST_ALONG)
        above = np.maximum(along - NOISE, 0.0)
        place = int(np.argmax(np.asarray(weights[: len(along)]) @ above))
        whole = np.clip([self.goes_on, self.soft, self.compressed], 0.0, MOST)
        learned = np.clip([self.joint or 0.0], 0.0, MOST_ALONG)
        return np.concatenate([along[:, place], whole, learned])[: len(weights)]


def signs_of(scene: Scene, course: Course, explained: ByteMask) -> Signs:
    """Return the signs of a course; `explained` says where fibres lie on the reduced image."""
    compressed = scene.blockiness / BLOCKY
    # What more compression takes away a network cannot see.
    return Signs(
        axial.joints(scene, course),
        beyond.goes_on(scene, course, explained),
        beyond.soft(course),
        compressed,
        learned_joint.clearest(scene, course) if compressed < MOST_BLOCKY else None,
    )


def probability(signs: Signs, doubts: Sequence[str]) -> float:
    """Return how probable it is that something is one whole fibre."""
    if not CUT_OFF.isdisjoint(doubts):
        return 0.0
    logit = HAND_LOGIT - signs.taken_by(HAND_WEIGHTS)
    if signs.joint is not None and signs.coded:
        # Where it has looked, what compression hides counts once. What gloss and blocks look like
        # to a network takes nothing from what is certain without it, but a clear joint does.
        both = JPEG_LOGIT - signs.taken_by(JPEG_WEIGHTS) - log(HIDDEN_ODDS)
        plain = HAND_LOGIT - replace(signs, compressed=0.0).taken_by(HAND_WEIGHTS)
        looked = min(both, plain + log(MORE_ODDS))
        logit = looked if signs.joint > SEEN else max(logit, looked)
    elif signs.joint is not None:
        both = FITTED_LOGIT - signs.taken_by(WEIGHTS)
        logit = min(both, logit + log(MORE_ODDS))
    logit += log(PRIOR_ODDS)
    return 1.0 / (1.0 + exp(DOUBT * len({*doubts, *signs.doubts}) - logit))


def interval(length: float, std: float) -> tuple[float, float]:
    """Return what holds the length in 95 of 100 cases."""
    return max(0.0, length - INTERVAL_STDS * std), length + INTERVAL_STDS * std
