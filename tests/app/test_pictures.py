"""Pictures against what they must show: where the solid is, which side is lit, what hides what."""

import numpy as np
import torch

from imdim.app.pretrain import PIXELS, draw_cloud, pairs
from imdim.data.solids import from_sequences
from imdim.export.preview import TARGET_COLOUR
from imdim.program.state import ADD_SPHERE


def ball(r, sign=1.0):
    return from_sequences(torch.tensor([[int(ADD_SPHERE)]]), torch.tensor([[[0, 0, 0, r, 0, 0, 0, 0, 0, sign]]], dtype=torch.float32))


def test_a_ball_is_a_disc_of_its_size_and_nothing_stays_white():
    picture = pairs(ball(0.4), ball(0.4, -1.0))
    assert picture.shape == (PIXELS, 2 * PIXELS, 3)
    left, right = (p.min(-1) < 255 for p in np.split(picture, 2, axis=1))
    assert not right.any()
    rows, columns = np.nonzero(left)
    radius = 0.9 * 0.4 * PIXELS
    distance = np.hypot(rows - PIXELS / 2, columns - PIXELS / 2)
    assert radius < distance.max() < radius + 5
    assert left.sum() > 0.98 * np.pi * radius**2


def test_the_nearest_point_is_seen_and_what_faces_away_is_not():
    toward = np.array([0.55, -0.68, 0.48]) / np.linalg.norm([0.55, -0.68, 0.48])
    points = np.stack([0.2 * toward, -0.2 * toward])
    bright = draw_cloud(points, np.stack([toward, np.array([0.3, -0.3, 0.9])]), TARGET_COLOUR)
    alone = draw_cloud(points[:1], toward[None], TARGET_COLOUR)
    assert (bright == alone).all()
    assert (draw_cloud(points, -np.stack([toward, toward]), TARGET_COLOUR) == 255).all()
