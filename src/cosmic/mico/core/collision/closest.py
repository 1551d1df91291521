"""The point of a simplex nearest to the origin, in plain numbers: faster than arrays of three."""

from typing import Final

Point = tuple[float, float, float]
Shares = list[tuple[int, float]]
"""Which corners carry the nearest point, and with what weights; they add up to 1."""

_FACES: Final = ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3))


def nearest_of(corners: list[Point]) -> Shares:
    """Return the point nearest to the origin on one to four corners, as shares of them."""
    numbers = tuple(range(len(corners)))
    if len(numbers) == 4:
        return _of_tetrahedron(corners)
    if len(numbers) == 3:
        return _of_triangle(corners, numbers)
    return _of_segment(corners, numbers) if len(numbers) == 2 else [(0, 1.0)]


def mix(corners: list[Point], shares: Shares) -> Point:
    """Return the point that `shares` of `corners` make."""
    x = y = z = 0.0
    for number, share in shares:
        corner = corners[number]
        x, y, z = x + share * corner[0], y + share * corner[1], z + share * corner[2]
    return x, y, z


def dot(one: Point, other: Point) -> float:
    """Return the inner product."""
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


def _minus(one: Point, other: Point) -> Point:
    return one[0] - other[0], one[1] - other[1], one[2] - other[2]


def _cross(one: Point, other: Point) -> Point:
    return (
        one[1] * other[2] - one[2] * other[1],
        one[2] * other[0] - one[0] * other[2],
        one[0] * other[1] - one[1] * other[0],
    )


def _of_segment(corners: list[Point], numbers: tuple[int, ...]) -> Shares:
    first, second = numbers
    one, edge = corners[first], _minus(corners[second], corners[first])
    length = dot(edge, edge)
    share = -dot(one, edge) / length if length > 0.0 else 0.0
    if not share > 0.0:
        return [(first, 1.0)]
    if share >= 1.0:
        return [(second, 1.0)]
    return [(first, 1.0 - share), (second, share)]


def _of_triangle(corners: list[Point], numbers: tuple[int, ...]) -> Shares:
    one, two, three = (corners[number] for number in numbers)
    normal = _cross(_minus(two, one), _minus(three, one))
    size = dot(normal, normal)
    if size > 0.0:
        # Areas of the triangles that the foot of the origin makes with the sides.
        shares = [
            dot(_cross(two, three), normal) / size,
            dot(_cross(three, one), normal) / size,
            dot(_cross(one, two), normal) / size,
        ]
        if min(shares) >= 0.0:
            total = sum(shares)
            return [(n, share / total) for n, share in zip(numbers, shares, strict=True)]
    first, second, third = numbers
    sides = ((first, second), (first, third), (second, third))
    return _least(corners, [_of_segment(corners, side) for side in sides])


def _of_tetrahedron(corners: list[Point]) -> Shares:
    base = corners[0]
    volume = dot(
        _cross(_minus(corners[1], base), _minus(corners[2], base)), _minus(corners[3], base)
    )
    if volume != 0.0:
        one, two, three, four = corners
        shares = [
            dot(_cross(two, three), four) / volume,
            -dot(_cross(one, three), four) / volume,
            dot(_cross(one, two), four) / volume,
            -dot(_cross(one, two), three) / volume,
        ]
        if min(shares) >= 0.0:
            total = sum(shares)
            return [(number, share / total) for number, share in enumerate(shares)]
    return _least(corners, [_of_triangle(corners, face) for face in _FACES])


def _least(corners: list[Point], choices: list[Shares]) -> Shares:
    def size(shares: Shares) -> float:
        point = mix(corners, shares)
        return dot(point, point)

    return min(choices, key=size)
