"""Learns the network of `cosmic.vico.core.vision.learned_joint` from the strips of `joint_strips`.

`python -m benchmarks.joint_training FOLDER` reads the strips of a folder and writes the weights to
where the program reads them. It needs `jax`, which nothing else here does.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks import fibre_pairs
from benchmarks.joint_strips import Known, loaded
from cosmic.vico.core.vision import learned_joint

CHANNELS, FACTS, WHOLE, TAPS = 64, 5, 48, 5
COLUMNS = 8192
"""Columns of strips that are learnt from at once."""
LENGTHS = (128, 192, 256, 384, 512, 640)
STEPS, RATE, DECAY = 10_000, 3e-3, 1e-4
HELD_BACK = 11
"""One seed of so many is not learnt from, but only looked at."""
PLACE_SHARE, MORE = 0.3, 4.0
"""How much it counts where a joint is, beside whether there is one; and how much more a joint."""
GLOSS = 0.12
MOST_SLOPE = 2.0

Batch = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def first_weights(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return weights to begin with."""
    shapes = {
        "first": (TAPS + 1, learned_joint.ROWS + 2, CHANNELS),
        "second": (TAPS, CHANNELS, CHANNELS),
        "third": (TAPS, CHANNELS, CHANNELS),
        "fourth": (TAPS, CHANNELS, CHANNELS),
        "whole": (2 * CHANNELS + FACTS, WHOLE),
        "context": (WHOLE, 2 * CHANNELS),
        "last": (CHANNELS, 1),
    }
    weights = {}
    for name, shape in shapes.items():
        spread = np.sqrt(2.0 / np.prod(shape[:-1]))
        small = 0.1 if name in ("context", "last") else 1.0
        weights[name] = (small * spread * rng.normal(size=shape)).astype(np.float32)
        weights[f"{name}_bias"] = np.zeros(shape[-1], np.float32)
    weights["last_bias"] -= 5.0
    return weights


def batch_of(known: Sequence[Known], length: int, rng: np.random.Generator | None) -> Batch:
    """Return strips of one length, turned and lit at random if there is a generator."""
    answers = length // learned_joint.STRIDE
    levels = np.zeros((len(known), length, learned_joint.ROWS + 2), np.float32)
    where = np.zeros((len(known), answers), bool)
    ends = np.full((len(known), answers), -1, np.int8)
    for row, each in enumerate(known):
        first = 0
        if len(each.ends) > answers:
            first = (len(each.ends) - answers) // 2
            if rng is not None:
                first = int(rng.integers(0, len(each.ends) - answers + 1))
        part = slice(first, first + answers)
        values = each.strip.levels[learned_joint.STRIDE * first :][:length].astype(np.float32)
        seen, there = each.strip.where[part], each.ends[part]
        if rng is not None:
            values, seen, there = varied(values, seen, there, rng)
        levels[row, : len(values)] = values
        where[row, : len(seen)], ends[row, : len(there)] = seen, there
    return levels, where, np.array([each.strip.facts for each in known]), ends


def varied(
    values: np.ndarray, seen: np.ndarray, there: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a strip seen from another end or side, and with gloss along it."""
    if rng.integers(0, 2):
        values, seen, there = values[::-1].copy(), seen[::-1], there[::-1]
    rows = slice(0, learned_joint.ROWS)
    if rng.integers(0, 2):
        values[:, rows] = values[:, learned_joint.ROWS - 1 :: -1].copy()
        values *= learned_joint.MIRRORED
    if rng.integers(0, 3) == 0:
        wave = learned_joint.PER_WIDTH * float(rng.uniform(2.0, 8.0))
        gloss = fibre_pairs.wandering(rng, len(values), float(rng.uniform(0.0, GLOSS)), wave)
        values[:, rows] *= gloss[:, None]
    values[:, rows] *= float(rng.uniform(0.95, 1.05))
    return values, seen, there


def convolved(
    weights: Mapping[str, jax.Array], name: str, values: jax.Array, stride: int = 1, apart: int = 1
) -> jax.Array:
    """Return values (strips, n, channels) convolved with a kernel (taps, channels, channels)."""
    kernel = weights[name]
    before = apart * ((len(kernel) - 1) // 2)
    padded = jnp.pad(values, ((0, 0), (before, apart * (len(kernel) - 1) - before), (0, 0)))
    taps = [padded[:, apart * tap :][:, : values.shape[1] : stride] for tap in range(len(kernel))]
    stacked = jnp.concatenate(taps, axis=2)
    return stacked @ kernel.reshape(-1, kernel.shape[2]) + weights[f"{name}_bias"]


def answers(
    weights: Mapping[str, jax.Array], levels: jax.Array, where: jax.Array, facts: jax.Array
) -> jax.Array:
    """Return what `learned_joint.logits` does of many strips, each seen from one end and side."""
    on = (levels[:, :: learned_joint.STRIDE] != 0).any(axis=2, keepdims=True).astype(jnp.float32)
    # Beyond its end a strip that stands alone has nothing, and no bias either.
    on = jnp.flip(jax.lax.cummax(jnp.flip(on, 1), axis=1), 1)
    near = jax.nn.relu(convolved(weights, "first", levels, learned_joint.STRIDE)) * on
    near = (near + jax.nn.relu(convolved(weights, "second", near))) * on
    share = where[:, :, None] / jnp.maximum(where.sum(axis=1), 1)[:, None, None]
    mean = (near * share).sum(axis=1)
    variance = (((near - mean[:, None]) ** 2) * share).sum(axis=1)
    whole = jnp.concatenate(
        [mean, jnp.sqrt(variance + learned_joint.LEAST_VARIANCE), facts], axis=1
    )
    whole = jax.nn.relu(whole @ weights["whole"] + weights["whole_bias"])
    context = whole @ weights["context"] + weights["context_bias"]
    scale, shift = jnp.split(context[:, None], 2, axis=2)
    far = jax.nn.relu(near * (1.0 + scale) + shift) * on
    far = (far + jax.nn.relu(convolved(weights, "third", far, apart=2))) * on
    far = (far + jax.nn.relu(convolved(weights, "fourth", far, apart=4))) * on
    return (far @ weights["last"] + weights["last_bias"])[:, :, 0]


def loss(
    weights: Mapping[str, jax.Array],
    levels: jax.Array,
    where: jax.Array,
    facts: jax.Array,
    ends: jax.Array,
) -> jax.Array:
    """Return how far off it is whether a strip has a joint, and, with less say, where."""
    logit = answers(weights, levels, where, facts)
    whole = jax.nn.logsumexp(jnp.where(where, logit, -30.0), axis=1)
    joined = ((ends == 1) & where).any(axis=1)
    whole_loss = jax.nn.softplus(jnp.where(joined, -whole, whole))
    counted = jnp.where(where & (ends >= 0), jnp.where(ends == 1, MORE, 1.0), 0.0)
    places = jax.nn.softplus(jnp.where(ends == 1, -logit, logit)) * counted
    place_loss = places.sum(axis=1) / jnp.maximum(where.sum(axis=1), 1)
    used = where.any(axis=1)
    both = jnp.where(used, whole_loss + PLACE_SHARE * place_loss, 0.0)
    return both.sum() / jnp.maximum(used.sum(), 1)


@partial(jax.jit, static_argnames="steps")
def step(
    state: tuple[dict, dict, dict], number: float, batch: Batch, steps: int
) -> tuple[tuple[dict, dict, dict], jax.Array]:
    """Return the weights after one more step (Adam, at a rate that falls as a cosine)."""
    weights, mean, square = state
    value, slope = jax.value_and_grad(loss)(weights, *batch)
    norm = jnp.sqrt(sum((each**2).sum() for each in jax.tree.leaves(slope)))
    slope = jax.tree.map(lambda each: each * jnp.minimum(1.0, MOST_SLOPE / (norm + 1e-9)), slope)
    mean = jax.tree.map(lambda old, new: 0.9 * old + 0.1 * new, mean, slope)
    square = jax.tree.map(lambda old, new: 0.99 * old + 0.01 * new**2, square, slope)
    rate = RATE * jnp.minimum(1.0, number / 200.0)
    rate *= 0.5 * (1.0 + jnp.cos(jnp.pi * number / steps)) + 1e-3
    first, second = 1.0 - 0.9 ** (number + 1.0), 1.0 - 0.99 ** (number + 1.0)

    def moved(weight: jax.Array, slope: jax.Array, power: jax.Array) -> jax.Array:
        change = slope / first / (jnp.sqrt(power / second) + 1e-7)
        return weight - rate * (change + DECAY * weight)

    return (jax.tree.map(moved, weights, mean, square), mean, square), value


def train(known: Sequence[Known], into: Path, steps: int = STEPS) -> None:
    """Learn from strips, and write the weights."""
    held = [each for each in known if each.seed % HELD_BACK == 3]
    used = [each for each in known if each.seed % HELD_BACK != 3]
    rng = np.random.default_rng(1)
    weights = first_weights(rng)
    state = (weights, *(jax.tree.map(np.zeros_like, weights) for _ in range(2)))
    size = np.array([
        min((n for n in LENGTHS if n >= len(each.strip.levels)), default=LENGTHS[-1])
        for each in used
    ])  # fmt: skip
    rows = [np.flatnonzero(size == n) for n in LENGTHS]
    share = np.array([n * len(each) for n, each in zip(LENGTHS, rows, strict=True)], float)
    values: list[float] = []
    for number in range(steps):
        index = int(rng.choice(len(LENGTHS), p=share / share.sum()))
        chosen = rng.choice(rows[index], COLUMNS // LENGTHS[index])
        batch = batch_of([used[row] for row in chosen], LENGTHS[index], rng)
        state, value = step(state, float(number), batch, steps)
        values.append(float(value))
        if number % 1000 == 999 or number == steps - 1:
            kept = {name: np.asarray(each, np.float16) for name, each in state[0].items()}
            np.savez(into, **kept)
            mean = np.mean(values[-200:])
            sys.stdout.write(f"{number + 1}: {mean:.4f}, {held_back(held, kept)}\n")
            sys.stdout.flush()


def held_back(held: Sequence[Known], weights: dict[str, np.ndarray]) -> str:
    """Return how well joints are told from fibres that were not learnt from."""
    clear, joined = [], []
    weights = {name: each.astype(np.float32) for name, each in weights.items()}
    for each in held:
        strip = replace(each.strip, levels=each.strip.levels.astype(np.float32))
        clear.append(float(learned_joint.logits(strip, weights)[strip.where].max()))
        joined.append(bool((each.ends == 1).any()))
    with_one, without = (np.array(clear)[np.array(joined) == flag] for flag in (True, False))
    if not (len(with_one) and len(without)):
        return "none held back"
    missed = [
        f"{100.0 * (with_one < np.quantile(without, part)).mean():.1f}" for part in (0.8, 0.9, 0.95)
    ]
    return (
        f"of {len(with_one)} joints and {len(without)} fibres, missed at 20, 10 and 5 % of fibres "
        f"taken for joints: {', '.join(missed)} %"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--into", type=Path, default=learned_joint.WEIGHTS_FILE)
    asked = parser.parse_args()
    train(loaded(asked.folder), asked.into, asked.steps)
