"""The settings of a CSG-Stump Net, in a file of their own because they are read before any network is built."""

from __future__ import annotations

from dataclasses import dataclass

ENCODERS = ("dgcnn", "pointnet")


@dataclass
class StumpConfig:
    """`primitives` is K, a quarter each of KINDS, and `intersections` C; the paper has 256 of both. `eta` is the steepness of
    occupancy in a frame where the shape's box has diagonal 1.

    `cloud` points are encoded, each joined to its `neighbours` nearest (encoder dgcnn), to `width` numbers. A sample has `points` test
    points: a share `near` beside the surface, `spread` (standard deviation) off it, the others even in the shape's box grown by `margin`.
    """

    encoder: str = "dgcnn"
    primitives: int = 64
    intersections: int = 32
    width: int = 256
    neighbours: int = 16
    cloud: int = 384
    eta: float = 50.0
    primitive_weight: float = 0.001
    points: int = 512
    near: float = 0.25
    spread: float = 0.03
    margin: float = 0.05


def check(config: StumpConfig) -> StumpConfig:
    """The same, or ValueError for what no net can have."""
    if config.encoder not in ENCODERS:
        raise ValueError(f"unknown encoder {config.encoder!r}; known are {', '.join(ENCODERS)}")
    if config.primitives < 8 or config.primitives % 8:
        raise ValueError(f"stump.primitives must be a multiple of 8, got {config.primitives}")
    if not 0 < config.neighbours <= config.cloud:
        raise ValueError(f"stump.neighbours must lie in 1..cloud = {config.cloud}, got {config.neighbours}")
    if min(config.intersections, config.points, config.width) < 1 or not 0 <= config.near <= 1:
        raise ValueError(f"stump needs intersections, points, width of at least 1 and near in 0..1, got {config}")
    return config
