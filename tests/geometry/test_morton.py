import numpy as np

from imdim.geometry.triangles import morton


def test_bits_stand_by_turns():
    rng = np.random.default_rng(0)
    cells = rng.integers(0, 1 << 21, (200, 3))
    codes = morton((cells + 0.5) / (1 << 21) - 0.5)
    by_hand = [sum((int(c) >> bit & 1) << (3 * bit + axis) for bit in range(21) for axis, c in enumerate(cell)) for cell in cells]
    assert codes.tolist() == by_hand
