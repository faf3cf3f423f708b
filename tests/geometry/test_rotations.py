"""Products of vectors against numpy's, bit for bit."""

import numpy as np

from imdim.geometry.rotations import cross


def test_a_product_has_the_bits_of_numpys():
    rng = np.random.default_rng(0)
    for scale in (1e-9, 1.0, 1e9):
        for a, b in zip(scale * rng.normal(size=(200, 3)), rng.normal(size=(200, 3)), strict=True):
            assert cross(a, b).tobytes() == np.cross(a, b).tobytes()
