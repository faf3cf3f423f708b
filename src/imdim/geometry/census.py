"""What a solid is by kind and by size: how many bodies, holes through them and voids inside, how large it is."""

from __future__ import annotations

from dataclasses import dataclass

from manifold3d import Manifold

CRUMB = 1e-7  # of the volume: a smaller piece is what booleans leave of faces that touch


@dataclass(frozen=True)
class SolidCensus:
    """`bodies` that hang together, holes that go `through` them (the sum of the genus of their surfaces), `voids` closed in by them; the
    `size` of the box along x, y, z, and the `volume`."""

    bodies: int
    through: int
    voids: int
    size: tuple[float, float, float]
    volume: float

    @property
    def kind(self) -> tuple[int, int, int]:
        """What stays the same while only sizes change."""
        return self.bodies, self.through, self.voids


def census_of(solid: Manifold) -> SolidCensus:
    """Count the closed surfaces of a solid; one that encloses a negative volume bounds a void."""
    volume, box = solid.volume(), solid.bounding_box()
    # each piece keeps a table of all that the solid was made of, unless it is an original
    pieces = [p for p in solid.as_original().decompose() if abs(p.volume()) > CRUMB * volume]
    voids = sum(p.volume() < 0 for p in pieces)
    size = (box[3] - box[0], box[4] - box[1], box[5] - box[2])
    return SolidCensus(len(pieces) - voids, sum(p.genus() for p in pieces), voids, size, volume)
