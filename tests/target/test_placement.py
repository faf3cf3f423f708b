"""Units and origin: lengths become millimetres, the part moves as it is told to, and both are said."""

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from imdim.reconstruction.config import ConfigError, from_arguments
from imdim.target.placement import place
from imdim.target.target import InputError, frame_meta, in_unit_frame, load_target, target_from


def block(size=(4.0, 2.0, 1.0), at=(10.0, 20.0, 30.0)):
    return target_from(trimesh.creation.box(size, trimesh.transformations.translation_matrix(at)), "block")


@pytest.mark.parametrize(("units", "millimetres"), [("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("inch", 25.4)])
def test_lengths_become_millimetres(units, millimetres):
    given = block()
    placed = place(given, units)
    assert placed.mesh is not None
    assert placed.mesh.volume == pytest.approx(8 * millimetres**3)
    assert placed.points == pytest.approx(given.points * millimetres)
    assert frame_meta(placed).units == "millimeter"
    assert frame_meta(placed).scale == pytest.approx(1 / (math.sqrt(21) * millimetres))
    assert [f"each becomes {millimetres:g} millimetres" in note for note in placed.notes] == [True] * (millimetres != 1)


def test_what_nobody_says_stays_as_it_is():
    given = block()
    assert place(given).points is given.points
    assert frame_meta(place(given)).units == "unspecified"


@pytest.mark.parametrize(
    ("origin", "low"), [("keep", (8.0, 19.0, 29.5)), ("center", (-2.0, -1.0, -0.5)), ("base", (-2.0, -1.0, 0.0))], ids=lambda v: str(v)
)
def test_the_box_moves_to_the_origin(origin, low):
    placed = place(block(), "cm", origin)
    assert placed.mesh is not None
    assert placed.mesh.bounds[0] == pytest.approx(10 * np.array(low))
    assert any("origin=" in note for note in placed.notes) == (origin != "keep")
    assert placed.points.min(axis=0) == pytest.approx(10 * np.array(low), abs=1.0)


def test_clouds_are_placed_too():
    points = np.random.default_rng(0).random((200, 3))
    placed = place(replace(target_from(points, "cloud"), scanners=points[:2]), "inch", "base")
    assert placed.scanners == pytest.approx(placed.points[:2])
    assert in_unit_frame(placed)[0].scanners == pytest.approx(in_unit_frame(placed)[0].points[:2])
    assert np.ptp(placed.points, axis=0) == pytest.approx(25.4 * np.ptp(points, axis=0))
    assert placed.points[:, 2].min() == pytest.approx(0.0, abs=1e-12)


def test_a_size_that_is_too_large_is_doubted():
    (hint,) = place(block((52000.0, 30000.0, 8000.0))).notes
    much = "The longest side measures {} mm, which is much for a part: "
    assert hint == much.format(52000) + "if it is in micrometres, it is 52 mm long and has to be scaled."
    *_, hint = place(block((80.0, 40.0, 20.0)), "m").notes
    assert hint == much.format(80000) + "units=mm makes it 80, units=cm makes it 800, units=inch makes it 2032 mm."
    assert place(block((900.0, 40.0, 20.0))).notes == ()


def test_a_size_that_is_hardly_millimetres_is_doubted():
    (hint,) = place(block((0.0048, 0.0048, 0.002))).notes
    assert hint == "The longest side measures 0.0048, which is little for millimetres: units=m makes it 4.8 mm."
    assert "units=cm makes it 5, units=m makes it 500, units=inch makes it 12.7 mm" in place(block((0.5, 0.2, 0.2))).notes[0]
    assert not place(block((0.5, 0.2, 0.2)), "mm").notes, "a person has said so"
    assert not place(block()).notes


def test_a_file_that_says_its_unit_is_believed(tmp_path):
    from imdim.export.meshes import threemf_bytes

    path = tmp_path / "block.3mf"
    path.write_bytes(threemf_bytes([trimesh.creation.box((2.0, 1.0, 1.0))], "block", "inch"))
    given = load_target(path)
    assert given.units == "millimeter"
    placed = place(given, "inch")
    assert placed.mesh is not None
    assert placed.mesh.extents == pytest.approx((50.8, 25.4, 25.4))
    assert "units=inch was not needed" in placed.notes[-1]


def test_what_cannot_be_is_refused():
    with pytest.raises(InputError, match="block: in millimetres a coordinate is beyond 1e"):
        place(block((9e28, 9e28, 9e28), (0.0, 0.0, 0.0)), "m")
    with pytest.raises(ConfigError, match="unknown units 'feet'; known are auto, mm, cm, m, inch"):
        from_arguments(["units=feet"])
    with pytest.raises(ConfigError, match="unknown origin 'top'; known are keep, base, center"):
        from_arguments(["origin=top"])
