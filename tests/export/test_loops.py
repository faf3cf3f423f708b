"""Loops in the texts: the same solid as the flat text, by OpenSCAD itself, by a stand-in of build123d and by µcad's definitions."""

import math
import re
import shutil
import subprocess

import pytest
import trimesh
from manifold3d import CrossSection, Manifold
from tests.export.hole_solids import HOLES
from tests.export.test_parameters import FLANGE, MOUNT, ROW
from tests.export.test_ucad import read as read_ucad
from tests.planted import ALONG_X, box, common, cone, cut, cylinder, sphere, union
from tests.program.test_repeats import BOSS, around

from imdim.delivery.finish import FinishedProgram, finish
from imdim.export.openscad import to_openscad, to_openscad_loops
from imdim.export.openscad_reader import read_openscad
from imdim.export.script import to_script
from imdim.export.ucad import to_ucad
from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
from imdim.program.motions import mirror, move_program, turn
from imdim.program.repeats import expand, repeats
from imdim.program.tree import Program, leaves
from imdim.reconstruction.fitting import relations_of

SEGMENTS = 48
CORNERS = 1e-3  # circles that turn with a copy have their corners elsewhere
TILTED = turn((0.0, 0.0, 0.0), (0.6, 0.0, 0.8), 40.0)
PARTS: dict[str, Program] = {
    "mount": MOUNT,
    "row": ROW,
    "flange": FLANGE,
    "flange off centre": cut(
        box(120, 100, 8, (30, 20, 0)), *around(cylinder(3, 12, (62, 20, 0)), 8, point=(40.0, 20.0, 0.0)), cylinder(9, 20, (40, 20, 0))
    ),
    "arc": cut(cylinder(60, 8), *around(cylinder(3, 12, (40, 0, 0)), 5, 20.0)),
    "bosses": union(cylinder(60, 4), *around(BOSS, 5)),
    "bosses off centre": union(
        box(90, 110, 4, (10, 0, 0)), *around(move_program(BOSS, turn((0, 0, 0), (0, 0, 1), 10)), 6, point=(10.0, 0.0, 0.0))
    ),
    "mirror": union(box(40, 30, 10, (5, 0, 0)), BOSS, move_program(BOSS, mirror((5.0, 0.0, 0.0), (1.0, 0.0, 0.0)))),
    "holes and sinks": cut(
        box(90, 60, 8), *(p for x in (-30, 0, 30) for y in (-20, 20) for p in (cylinder(3, 12, (x, y, 0)), cone(3, 6, 3, (x, y, 2.5))))
    ),
    "across": union(box(10, 80, 10), *(sphere(6, (0.0, -30.0 + 15 * i, 5.0 + 4 * i)) for i in range(5))),
    "tilted flange": move_program(FLANGE, TILTED),
    "tilted teeth": move_program(union(cylinder(28, 6), *around(box(8, 4, 6, (30, 0, 0)), 7)), TILTED),
    "star": union(cylinder(5, 4), *around(box(40, 3, 4), 3, 60.0)),
    "corners": cut(
        box(100, 60, 6),
        *(cut(box(8, 8, 20, (50 * x, 30 * y, 0)), cylinder(4, 30, (46 * x, 26 * y, 0))) for x in (-1.0, 1.0) for y in (-1.0, 1.0)),
    ),
    "lens": common(*(cylinder(30, 90, (0.0, 12.0 * y, 14.0 * z), ALONG_X) for y in (-1, 1) for z in (-1, 1)), cylinder(30, 80)),
    "knob": cut(common(cylinder(20, 10), *around(cylinder(30, 20, (14, 0, 0)), 6)), cylinder(3, 20)),
    "copies alone": union(*around(BOSS, 3), *around(box(60, 4, 4), 3, 60.0)),
}


@pytest.fixture(scope="module")
def found() -> dict[str, FinishedProgram]:
    return {name: finish(*relations_of(program)) for name, program in PARTS.items()}


@pytest.mark.parametrize("name", PARTS)
def test_the_delivered_program_is_the_same_solid(name: str, found):
    result = found[name]
    assert result.folded is not None
    assert len(result.parameters.loops) == sum(1 for _ in repeats(result.folded))
    assert expand(result.folded) == result.program
    assert volume_iou(to_manifold(PARTS[name], SEGMENTS), to_manifold(result.program, SEGMENTS)) == pytest.approx(1, abs=1e-5)
    flat = read_openscad(to_openscad(result.program, SEGMENTS, result.parameters))
    assert [p.kind for p in leaves(flat)] == [p.kind for p in leaves(result.program)]
    assert volume_iou(to_manifold(flat, SEGMENTS), to_manifold(result.program, SEGMENTS)) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("name", PARTS)
def test_microcad_repeats_by_arrays(name: str, found):
    result = found[name]
    text = to_ucad(result.program, result.parameters, result.folded)
    assert volume_iou(read_ucad(text), to_manifold(result.program, SEGMENTS)) == pytest.approx(1, abs=CORNERS)
    assert ("[1.." in text) == (name not in ("mirror", "across", "tilted flange", "tilted teeth", "corners", "lens", "knob"))


class Part:
    """build123d's algebra: placements times parts, lists of parts on the right of + and -."""

    def __init__(self, solid: Manifold | None = None) -> None:
        self.solid = Manifold() if solid is None else solid

    def __add__(self, other) -> "Part":
        return Part(self.solid + _one(other))

    def __and__(self, other) -> "Part":
        return Part(self.solid ^ other.solid)

    def __sub__(self, other) -> "Part":
        return Part(self.solid - _one(other))


def _one(parts) -> Manifold:
    out = Manifold()
    for part in parts if isinstance(parts, list) else [parts]:
        out = out + part.solid
    return out


class Place:
    def __init__(self, *motions) -> None:
        self.motions = motions

    def __mul__(self, other):
        if isinstance(other, Place):
            return Place(*self.motions, *other.motions)
        solid = other.solid
        for motion in reversed(self.motions):
            solid = motion(solid)
        return Part(solid)


def _mirrored(part: Part, about) -> Part:
    origin, normal = about
    to = [sum(o * n for o, n in zip(origin, normal, strict=True)) * 2 * n for n in normal]
    return Part(part.solid.mirror(normal).translate(to))


NAMES = {
    "Part": Part,
    "Box": lambda x, y, z: Part(Manifold.cube((x, y, z), True)),
    "Sphere": lambda r: Part(Manifold.sphere(r, SEGMENTS)),
    "Cylinder": lambda r, h: Part(Manifold.cylinder(h, r, r, SEGMENTS, True)),
    "Cone": lambda a, b, h: Part(Manifold.cylinder(h, a, b, SEGMENTS, True)),
    **{name: (lambda *numbers, cut=cut: Part(cut(SEGMENTS, *numbers))) for name, cut in HOLES.items()},
    "Torus": lambda a, b: Part(CrossSection.circle(b, SEGMENTS).translate((a, 0)).revolve(SEGMENTS)),
    "Pos": lambda *v: Place(lambda solid: solid.translate(v)),
    "Rot": lambda *v: Place(lambda solid: solid.rotate(v)),
    "Plane": lambda origin, z_dir: (origin, z_dir),
    "mirror": lambda part, about: _mirrored(part, about),
}


@pytest.mark.parametrize("name", PARTS)
def test_the_script_builds_the_same_solid(name: str, found):
    result = found[name]
    text = to_script(result.program, result.parameters, result.folded)
    code = re.sub(r"^from build123d import (.*)$", "", text, flags=re.MULTILINE)
    imported = re.search(r"^from build123d import (.*)$", text, flags=re.MULTILINE)[1].split(", ")
    scope = {"__name__": "program", **{n: NAMES.get(n) for n in imported}}
    exec(compile(code, "program.py", "exec"), scope)
    assert volume_iou(scope["part"].solid, to_manifold(result.program, SEGMENTS)) == pytest.approx(1, abs=CORNERS)
    assert " for i in range(" in text or name in ("mirror", "tilted flange", "tilted teeth", "corners")


def rendered(text: str, folder, *define: str) -> Manifold:
    tool = shutil.which("openscad")
    if tool is None:
        pytest.skip("openscad is not installed")
    (folder / "part.scad").write_text(text)
    command = [tool, "-o", folder / "part.stl", *(f"-D{d}" for d in define), folder / "part.scad"]
    said = subprocess.run(command, check=True, capture_output=True, timeout=120, text=True).stderr
    assert "WARNING" not in said
    return mesh_to_manifold(trimesh.load_mesh(folder / "part.stl"))


@pytest.mark.tool
@pytest.mark.parametrize("name", sorted(set(PARTS) - {"across"}))  # OpenSCAD places the corners of balls otherwise
def test_openscad_renders_the_same_solid(name: str, found, tmp_path):
    result = found[name]
    text = to_openscad_loops(result.folded, SEGMENTS, result.parameters)
    assert "module " in text
    assert ("intersection_for (" if name in ("lens", "knob") else "for (") in text
    assert volume_iou(rendered(text, tmp_path), to_manifold(result.program, SEGMENTS)) == pytest.approx(1, abs=CORNERS)


@pytest.mark.tool
def test_openscad_changes_counts_pitch_and_radius(found, tmp_path):
    row = found["row"]
    text = to_openscad_loops(row.folded, SEGMENTS, row.parameters)
    meant = cut(box(90, 20, 8), *(cylinder(2.5, 20, (-24 + 16.0 * i, 3.0, 0.0)) for i in range(5)))
    solid = rendered(text, tmp_path, "hole_count=5", "hole_spacing=16", "hole_diameter=5.0")
    assert volume_iou(solid, to_manifold(meant, SEGMENTS)) == pytest.approx(1, abs=2e-5)
    flange = found["flange"]
    text = to_openscad_loops(flange.folded, SEGMENTS, flange.parameters)
    meant = cut(
        cylinder(40, 8), *(cylinder(3, 20, (33 * math.cos(a), 33 * math.sin(a), 0.0)) for a in [i * math.tau / 8 for i in range(8)])
    )
    solid = rendered(text, tmp_path, "hole_count=8", "bolt_circle=66")
    assert volume_iou(solid, to_manifold(meant, SEGMENTS)) == pytest.approx(1, abs=CORNERS)
    flat = to_openscad(expand(flange.folded), SEGMENTS, flange.parameters)
    assert "*cos(" in flat
    meant = cut(
        cylinder(40, 8), *(cylinder(3, 20, (33 * math.cos(a), 33 * math.sin(a), 0.0)) for a in [i * math.tau / 6 for i in range(6)])
    )
    assert volume_iou(rendered(flat, tmp_path, "bolt_circle=66"), to_manifold(meant, SEGMENTS)) == pytest.approx(1, abs=CORNERS)


def test_names_are_shared_by_what_repeats_alike(found):
    assert found["mount"].parameters.counts == {"hole_count_x": 2, "hole_count_y": 2}
    assert found["flange"].parameters.counts == {"hole_count": 6}
    assert found["flange"].parameters.values["bolt_circle"] == pytest.approx(60)
    assert found["row"].parameters.values["hole_spacing"] == pytest.approx(20)
    both = found["holes and sinks"]
    assert both.parameters.counts == {"hole_count_x": 3, "hole_count_y": 2}
    assert both.parameters.values["hole_spacing_x"] == pytest.approx(30)
    assert both.parameters.values["hole_spacing_y"] == pytest.approx(40)


@pytest.mark.tool
def test_a_mirror_in_the_middle_of_a_body_goes_with_it(tmp_path):
    """A plate that begins at the origin: its length has a name, which takes the plane between two posts along."""

    def posts(length: float, apart: float = 54.0) -> Program:
        plate, pair = box(length, 30, 6, (length / 2, 15, 3)), (length / 2 - apart / 2, length / 2 + apart / 2)
        return union(plate, *(p for x in pair for p in (cylinder(5, 14, (x, 12, 13)), box(6, 20, 9, (x, 15, 10.5)))))

    found = finish(*relations_of(posts(70.0)))
    assert found.folded is not None
    assert [repeat.kind for _, repeat in repeats(found.folded)] == ["mirror"]
    assert found.parameters.values["plate_length"] == pytest.approx(70)
    flat = to_openscad(found.program, SEGMENTS, found.parameters)
    loops = to_openscad_loops(found.folded, SEGMENTS, found.parameters)
    for text in (flat, loops):
        solid = rendered(text, tmp_path, "plate_length=90", "boss_spacing=60")
        assert volume_iou(solid, to_manifold(posts(90.0, 60.0), SEGMENTS)) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("holes", [[], [cylinder(3, 20, (35, 15, 3))]], ids=["alone", "beside a hole"])
def test_mirrored_posts_that_nothing_is_midway_of_have_a_place(holes):
    """The plate's middle lies elsewhere, and a hole between the posts is no datum: it is where they are, if anything."""
    plate = box(90, 30, 6, (45, 15, 3))
    posts = [p for x in (15.0, 55.0) for p in (cylinder(5, 14, (x, 12, 13)), box(6, 20, 9, (x, 15, 10.5)))]
    found = finish(*relations_of(cut(union(plate, *posts), *holes)))
    assert found.folded is not None
    assert [repeat.kind for _, repeat in repeats(found.folded)] == ["mirror"]
    assert len(found.parameters.loops) == 1
    used = [{term.name for term in row[0].terms} for row in found.parameters.centers]
    assert used[1] == used[2] == {"boss_x"}
    assert used[3] == used[4] == {"boss_x", "boss_spacing"}
