"""STEP with analytic faces through OpenCASCADE, the optional extra `step`.

Planes, cylinders, cones, spheres and tori stay what they are, the walls of outlines among them; only an ellipsoid becomes a NURBS surface.
Edge features are blends of OpenCASCADE: fillets are cylinders and tori, chamfers planes and cones. Lengths are written as mm.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from imdim.export.part_names import PartNames
from imdim.export.placed_edges import PlacedEdges
from imdim.export.step_booleans import CLOSE, StepError, boolean, build, drop_needles, fits, is_valid, ocp, shape_volume, solids_in
from imdim.export.step_names import write_named
from imdim.geometry.solid import exact_rotation
from imdim.install import install_command
from imdim.program.edges import Blending, EdgeFeature
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Curve, Loop, arc_center, arc_radius, circle_of, regions, ring_curves
from imdim.program.tree import FULL_TURN, Primitive, Program, Vec3, leaves, longest

# OpenCASCADE takes points closer than 1e-7 for one, so a part needs to be a good deal larger
SMALLEST_SIZE = 1e-4

# share of the largest size, by which a face may be narrow that goes where its shape is not valid once it is read back
NEEDLE = 3e-7

INTEGRATION_ERROR = 1e-6  # relative; without it, a NURBS face is off by 4e-4

_STAMP = re.compile(r"FILE_NAME\('.*?\);", re.DOTALL)


def write_step(program: Program, path: Path, edges: Sequence[EdgeFeature] = (), names: PartNames | None = None) -> Blending:
    """Write `program` with its edge features as a STEP AP214 file in mm, the same bytes for the same program; which edges stayed sharp.
    Features are called by `names`, or by their roles.

    Raises StepError, and leaves no file, when OpenCASCADE is not installed or cannot build a valid solid, or where what it reads back is
    none; OSError when the file cannot be written. An edge that it cannot blend is no error.
    """
    placed = PlacedEdges.of(program, edges) if edges else PlacedEdges()
    return list(write_stages(program, path, placed, names))[-1].blending


class Stage(NamedTuple):
    """A file as it stands: the volume of its solid, re-read, in cubed model units, and which edges are sharp in it."""

    volume: float
    blending: Blending


def write_stages(program: Program, path: Path, edges: PlacedEdges, names: PartNames | None = None) -> Iterator[Stage]:
    """Write a file as `write_step` does, first with all edges sharp, then in its place those of fewer solids and the one with its edges,
    where there are any; what each is. A later one that is worse takes no place: whoever stops between two has the earlier one whole."""
    names, beside = names or PartNames.of(program), path_beside(path)
    path.unlink(missing_ok=True)  # an earlier one does not stand for what fails
    sharp = read = None  # the latest shape that is kept, and what is read back of the one that was written last

    def survives(shape: Any) -> bool:
        nonlocal read
        read = _write(shape, beside, program, names)
        return read is not None

    unblended = _no_blends(edges)
    try:
        for sharp in to_shapes(program, survives):  # noqa: B007 - the last one is blended
            beside.replace(path)
            yield Stage(shape_volume(read, INTEGRATION_ERROR), unblended)
        if not edges.edges:
            return
        from imdim.export.step_blends import blend_shape

        blended, blending = blend_shape(sharp, program, edges, to_shape)
        # tolerances do not survive the file, and those of blends can be large
        if len(blending.sharp) < len(blending.edges) and survives(blended):
            beside.replace(path)
            yield Stage(shape_volume(read, INTEGRATION_ERROR), blending)
    finally:
        beside.unlink(missing_ok=True)


def _no_blends(edges: PlacedEdges) -> Blending:
    if not edges.edges:
        return Blending()
    from imdim.export.step_blends import no_blends

    return no_blends(edges.edges)


def path_beside(path: Path) -> Path:
    """Where `write_stages` writes what then takes the place of `path`."""
    return path.with_name(f"{path.name}.blended")


def _write(shape: Any, path: Path, program: Program, names: PartNames) -> Any:
    """Write a shape, without its needles where it is not valid with them; what is read back, None where that is not valid either, or is
    another solid."""
    read = _write_once(shape, path, program, names)
    if is_valid(read):
        return read
    # whether it is valid before it is written tells nothing, either way
    without = _write_once(drop_needles(read, NEEDLE * longest(leaves(program))), path, program, names)
    is_same = fits(without, shape_volume(shape, INTEGRATION_ERROR), CLOSE) and solids_in(without) == solids_in(shape)
    return without if is_same else None


def _write_once(shape: Any, path: Path, program: Program, names: PartNames) -> Any:
    """Write a shape; what is read back."""
    if not write_named(shape, path, program, names):
        raise OSError(f"cannot write {path}")
    name = names.part.replace("'", "''")
    head = f"FILE_NAME('{name}','1970-01-01T00:00:00',(''),(''),'OpenCASCADE','IMDIM','');"
    path.write_text(_STAMP.sub(lambda _: head, path.read_text(encoding="utf-8"), count=1), encoding="utf-8")
    return read_step(path)


def read_step(path: Path) -> Any:
    """The TopoDS_Shape in a STEP file; raises StepError when there is none."""
    _check_installed()
    reader = ocp("STEPControl").STEPControl_Reader()
    if not reader.ReadFile(str(path)).name.endswith("RetDone") or not reader.TransferRoots():
        raise StepError(f"{path} holds no STEP shape")
    return reader.OneShape()


def step_volume(path: Path) -> float:
    """Volume in cubed model units of the solids in a STEP file, re-read from disk; raises StepError when there are none."""
    return shape_volume(read_step(path), INTEGRATION_ERROR)


def to_shapes(program: Program, survives: Callable[[Any], bool] = lambda _: True) -> Iterator[Any]:
    """The sharp program as a valid TopoDS_Shape that `survives`, and then perhaps better ones (`step_booleans.build`).

    Raises StepError when OpenCASCADE is not installed or builds none.
    """
    _check_installed()
    largest = longest(leaves(program))
    if largest < SMALLEST_SIZE:
        raise StepError(f"STEP needs a part larger than {SMALLEST_SIZE:g}, its largest size is {largest:g}")
    yield from build(program, _place, survives)


def to_shape(program: Program, edges: Sequence[EdgeFeature] = (), survives: Callable[[Any], bool] = lambda _: True) -> Any:
    """The program as a valid TopoDS_Shape that, still sharp, `survives`, with those of its edge features that OpenCASCADE can build; raises
    as `to_shapes` does."""
    *_, shape = to_shapes(program, survives)
    if not edges:
        return shape
    from imdim.export.step_blends import blend_shape

    placed = PlacedEdges.of(program, edges)
    return blend_shape(shape, program, placed, to_shape)[0] if placed.edges else shape


def _check_installed() -> None:
    try:
        message = ocp("Message")
    except ImportError as error:
        raise StepError(f"no STEP without OpenCASCADE: {install_command('step')} ({error})") from error
    for printer in message.Message.DefaultMessenger_s().Printers():
        printer.SetTraceLevel(message.Message_Gravity.Message_Fail)


def _place(leaf: Primitive) -> Any:
    placement = ocp("gp").gp_Trsf()
    matrix = np.column_stack([exact_rotation(leaf), leaf.center])
    placement.SetValues(*(float(v) for v in matrix.ravel()))
    return ocp("BRepBuilderAPI").BRepBuilderAPI_Transform(_unplaced(leaf), placement, True).Shape()


def _unplaced(leaf: Primitive) -> Any:
    if leaf.outline is None:
        return _local(leaf.kind, leaf.size)
    swept = [_SWEEPS[leaf.kind](region, *leaf.size) for region in regions(leaf.outline)]
    return boolean("Fuse", swept[:1], swept[1:]) if len(swept) > 1 else swept[0]


def _extruded(region: tuple[Loop, ...], height: float) -> Any:
    face = _face(region, lambda x, y: (x, y, -height / 2), (0.0, 0.0, 1.0))
    return ocp("BRepPrimAPI").BRepPrimAPI_MakePrism(face, ocp("gp").gp_Vec(0.0, 0.0, height)).Shape()


def _drafted(region: tuple[Loop, ...], height: float, draft: float) -> Any:
    """An extrusion whose walls are then leaned inward about the foot: planes stay planes, cylinders become cones."""
    prism, gp = _extruded(region, height), ocp("gp")
    draw = ocp("BRepOffsetAPI").BRepOffsetAPI_DraftAngle(prism)
    up = gp.gp_Dir(0.0, 0.0, 1.0)
    foot = gp.gp_Pln(gp.gp_Pnt(0.0, 0.0, -height / 2), up)
    for face in _walls_of(prism):
        draw.Add(face, up, math.radians(draft), foot, True)
        if not draw.AddDone():
            raise StepError("OpenCASCADE leans no wall of a drafted outline")
    draw.Build()
    if not draw.IsDone():
        raise StepError("OpenCASCADE builds no drafted outline")
    return draw.Shape()


def _walls_of(prism: Any) -> Iterator[Any]:
    """The faces of an upright prism that are not its ends."""
    explorer = ocp("TopExp").TopExp_Explorer(prism, ocp("TopAbs").TopAbs_ShapeEnum.TopAbs_FACE)
    while explorer.More():
        face = ocp("TopoDS").TopoDS.Face(explorer.Current())
        surface = ocp("BRepAdaptor").BRepAdaptor_Surface(face)
        kind = surface.GetType().name
        if not kind.endswith("Plane") or abs(surface.Plane().Axis().Direction().Z()) < 0.5:
            yield face
        explorer.Next()


def _turned(region: tuple[Loop, ...], angle: float) -> Any:
    make, gp = ocp("BRepPrimAPI").BRepPrimAPI_MakeRevol, ocp("gp")
    face = _face(region, lambda x, z: (x, 0.0, z), (0.0, -1.0, 0.0))
    axis = gp.gp_Ax1(gp.gp_Pnt(0.0, 0.0, 0.0), gp.gp_Dir(0.0, 0.0, 1.0))
    return (make(face, axis) if angle == FULL_TURN else make(face, axis, math.radians(angle))).Shape()


_SWEEPS: Mapping[str, Callable[..., Any]] = {"extrude": _extruded, "revolve": _turned, "drafted": _drafted}


def _face(region: tuple[Loop, ...], place: Callable[[float, float], Vec3], normal: Vec3) -> Any:
    """The plane face in an outer loop, without its holes; `place` puts a point of the outline into the plane across `normal`."""
    api, gp = ocp("BRepBuilderAPI"), ocp("gp")
    plane = gp.gp_Pln(gp.gp_Pnt(*place(0.0, 0.0)), gp.gp_Dir(*normal))
    # an ellipse runs no way of its own, a hole runs clockwise
    back = (-normal[0], -normal[1], -normal[2])
    wires = [_wire(loop, place, back if k and isinstance(loop, Ellipse) else normal) for k, loop in enumerate(region)]
    made = api.BRepBuilderAPI_MakeFace(plane, wires[0], True)
    for hole in wires[1:]:
        made.Add(hole)
    return made.Face()


def _wire(loop: Loop, place: Callable[[float, float], Vec3], normal: Vec3) -> Any:
    api, gp = ocp("BRepBuilderAPI"), ocp("gp")
    if isinstance(loop, Ellipse):
        return api.BRepBuilderAPI_MakeWire(api.BRepBuilderAPI_MakeEdge(_oval(loop, place, normal)).Edge()).Wire()
    round_one = circle_of(loop)
    if round_one is not None:
        x, y, radius = round_one
        turn = 1.0 if loop[0][2] > 0 else -1.0
        circle = gp.gp_Circ(gp.gp_Ax2(gp.gp_Pnt(*place(x, y)), gp.gp_Dir(*(turn * n for n in normal))), radius)
        return api.BRepBuilderAPI_MakeWire(api.BRepBuilderAPI_MakeEdge(circle).Edge()).Wire()
    corners = [api.BRepBuilderAPI_MakeVertex(gp.gp_Pnt(*place(x, y))).Vertex() for x, y, _ in loop]
    wire = api.BRepBuilderAPI_MakeWire()
    for curve, start, end in zip(ring_curves(loop), corners, [*corners[1:], corners[0]], strict=True):
        wire.Add(api.BRepBuilderAPI_MakeEdge(_carrier(curve, place, normal), start, end).Edge())
    return wire.Wire()


def _oval(loop: Ellipse, place: Callable[[float, float], Vec3], normal: Vec3) -> Any:
    """An ellipse about its longer semi-axis, as OpenCASCADE wants it."""
    gp = ocp("gp")
    longer = loop if loop.rx >= loop.ry else Ellipse(loop.ry, loop.rx, loop.x, loop.y, loop.angle + 90)
    c, s = longer.along
    along = np.array(place(loop.x + c, loop.y + s)) - place(loop.x, loop.y)
    frame = gp.gp_Ax2(gp.gp_Pnt(*place(loop.x, loop.y)), gp.gp_Dir(*normal), gp.gp_Dir(*map(float, along)))
    return gp.gp_Elips(frame, longer.rx, longer.ry)


def _carrier(curve: Curve, place: Callable[[float, float], Vec3], normal: Vec3) -> Any:
    """The line or circle that a curve is a piece of, which runs as the curve does."""
    gp = ocp("gp")
    x, y, u, v, bulge = curve
    start, end = np.array(place(x, y)), np.array(place(u, v))
    if not bulge:
        return gp.gp_Lin(gp.gp_Pnt(*map(float, start)), gp.gp_Dir(*map(float, end - start)))
    turn = 1.0 if bulge > 0 else -1.0
    frame = gp.gp_Ax2(gp.gp_Pnt(*place(*arc_center(curve))), gp.gp_Dir(*(turn * n for n in normal)))
    return gp.gp_Circ(frame, arc_radius(curve))


def _local(kind: str, size: tuple[float, ...]) -> Any:
    make, gp = ocp("BRepPrimAPI"), ocp("gp")

    def upright(height: float) -> Any:
        return gp.gp_Ax2(gp.gp_Pnt(0.0, 0.0, -height / 2), gp.gp_Dir(0.0, 0.0, 1.0))

    if kind == "box":
        return make.BRepPrimAPI_MakeBox(gp.gp_Pnt(*(-s / 2 for s in size)), *size).Shape()
    if kind == "sphere":
        return make.BRepPrimAPI_MakeSphere(size[0]).Shape()
    if kind == "torus":
        return make.BRepPrimAPI_MakeTorus(*size).Shape()
    if kind == "ellipsoid":
        return _ellipsoid(size)
    if kind == "cylinder" or size[0] == size[1]:
        return make.BRepPrimAPI_MakeCylinder(upright(size[-1]), size[0], size[-1]).Shape()
    return make.BRepPrimAPI_MakeCone(upright(size[2]), *size).Shape()


def _ellipsoid(semi_axes: tuple[float, ...]) -> Any:
    stretch = ocp("gp").gp_GTrsf()
    for axis, length in enumerate(semi_axes, start=1):
        stretch.SetValue(axis, axis, length)
    ball = ocp("BRepPrimAPI").BRepPrimAPI_MakeSphere(1.0).Shape()
    return ocp("BRepBuilderAPI").BRepBuilderAPI_GTransform(ball, stretch, True).Shape()
