"""One picture of a result: the target, the result, the target coloured by its distance to the result, and by what became of it.

Meshes are drawn with a depth buffer, clouds as discs; no display and no GL are needed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import trimesh
from PIL import Image, ImageDraw, ImageFont
from scipy.spatial import KDTree

from imdim.export.surface_colours import COLOURS, COVERAGE_COLOURS, ColouredResult, ColouredTarget
from imdim.geometry.rows import dot_rows
from imdim.geometry.triangles import TriangleTree, distances, triangle_tree
from imdim.geometry.visible import faces_seen
from imdim.target.target import Target

PANEL = 480  # pixels, square
GAP, HEADER, FOOTER = 20, 46, 64
SUPERSAMPLE = 2
CREASE_COSINE = 0.94  # neighbouring pixels whose normals differ more (20 degrees) get a line
NEIGHBOURS = 12  # for the normals of a cloud that has none
SMALLEST_RANGE = 1e-3  # of the diagonal: a perfect result is not to look patchy

VIEW = np.array([0.55, -0.68, 0.48])  # towards the camera
LIGHT = np.array([0.25, -0.6, 0.85])
TARGET_COLOUR, RESULT_COLOUR = np.array([168, 178, 190.0]), np.array([112, 158, 204.0])
INK, FAINT = (40, 44, 52), (120, 126, 136)

# From explained to missed: light grey, sand, orange, red, dark red
_RAMP = np.array([[222, 226, 230], [250, 214, 140], [244, 142, 60], [204, 40, 40], [96, 0, 30]], float)


@dataclass(frozen=True)
class Camera:
    """An orthographic view: `axes` rows are right, up and towards the camera; `scale` is pixels per model unit."""

    axes: np.ndarray
    center: np.ndarray
    scale: float
    pixels: int

    def project(self, points: np.ndarray) -> np.ndarray:
        """Column, row (downward) and depth (towards the camera, model units) [n, 3] of `points` [n, 3]."""
        local = (np.asarray(points, np.float64) - self.center) @ self.axes.T
        half = self.pixels / 2
        return np.column_stack([half + local[:, 0] * self.scale, half - local[:, 1] * self.scale, local[:, 2]])


@dataclass(frozen=True)
class Shot:
    """What the camera sees: `seen` [h, w] bool, and for the seen pixels [k] how brightly they are lit, whether they are at a rim, which
    darkens, and their `owners`, the faces or the points of a cloud that are seen there. `place` gives the points [m, 3] of some of them."""

    seen: np.ndarray
    light: np.ndarray
    rim: np.ndarray
    owners: np.ndarray
    place: Callable[[np.ndarray], np.ndarray]


def preview(
    target: Target,
    result: trimesh.Trimesh,
    worst: float,
    verdict: ColouredTarget | None = None,
    coverage: ColouredResult | None = None,
    supersample: int = SUPERSAMPLE,
) -> Image.Image:
    """Three panels, 1500 x 590 pixels, or four, 2000 wide, with a `verdict`; `worst` is the largest distance from the target to the result,
    in model units. With a `coverage` the result has its colours. Each pixel is the mean of `supersample` squared finer ones."""
    bodies = [target.points if target.mesh is None else target.mesh.vertices, result.vertices]
    camera = _camera(np.concatenate([np.asarray(b, np.float64) for b in bodies]), PANEL * supersample)
    tree = triangle_tree(result)
    diagonal = float(np.linalg.norm(np.ptp(bodies[0], axis=0)))
    top = max(worst, SMALLEST_RANGE * diagonal)
    # faces and distances are looked for without the interpreter, which the other panel has meanwhile
    with ThreadPoolExecutor(1) as beside:
        second = beside.submit(_paint_result, result, camera, coverage)
        mesh = target.mesh if verdict is None or verdict.mesh is None else verdict.mesh
        shot = _shoot_points(target.points, target.normals, camera) if mesh is None else _shoot_mesh(mesh, camera)
        first, third = _paint(shot, TARGET_COLOUR), _paint(shot, _heat(shot, tree, top))
        panels = [first, second.result(), third]
        panels += [] if verdict is None else [_paint(shot, COLOURS[verdict.codes[shot.owners]])]
    sheet = _sheet(panels, target.name, top, worst, diagonal, verdict)
    if coverage is not None:
        _key(ImageDraw.Draw(sheet), GAP // 2 + PANEL + GAP, coverage.shares, COVERAGE_COLOURS)
    return sheet


def _paint_result(result: trimesh.Trimesh, camera: Camera, coverage: ColouredResult | None) -> Image.Image:
    if coverage is None:
        return _paint(_shoot_mesh(result, camera), RESULT_COLOUR)
    shot = _shoot_mesh(coverage.mesh, camera)
    return _paint(shot, COVERAGE_COLOURS[coverage.codes[shot.owners]])


def side_by_side(target: Target, result: trimesh.Trimesh, pixels: int) -> tuple[Image.Image, Image.Image]:
    """The target and the result alone, square, by one camera."""
    bodies = [target.points if target.mesh is None else target.mesh.vertices, result.vertices]
    camera = _camera(np.concatenate([np.asarray(b, np.float64) for b in bodies]), SUPERSAMPLE * pixels)
    shot = _shoot_points(target.points, target.normals, camera) if target.mesh is None else _shoot_mesh(target.mesh, camera)
    return _paint(shot, TARGET_COLOUR, pixels), _paint(_shoot_mesh(result, camera), RESULT_COLOUR, pixels)


def thumbnail(mesh: trimesh.Trimesh, pixels: int) -> Image.Image:
    """A small picture of a solid alone, square, from the same side."""
    return _paint(_shoot_mesh(mesh, _camera(np.asarray(mesh.vertices), SUPERSAMPLE * pixels)), RESULT_COLOUR, pixels)


def discs(points: np.ndarray, normals: np.ndarray, camera: Camera, colour: np.ndarray) -> Image.Image:
    """Points [n, 3] with their normals alone, in the camera's own pixels."""
    return _paint(_shoot_points(points, normals, camera), colour, camera.pixels)


def view_axes() -> np.ndarray:
    """Rows: right, up, towards the camera."""
    toward = VIEW / np.linalg.norm(VIEW)
    right = np.cross([0.0, 0.0, 1.0], toward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(toward, right), toward])


def _camera(points: np.ndarray, pixels: int) -> Camera:
    axes = view_axes()
    flat = points @ axes.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    return Camera(axes, (low + high) / 2 @ axes, 0.92 * pixels / max(float((high - low)[:2].max()), 1e-300), pixels)


def _shoot_mesh(mesh: trimesh.Trimesh, camera: Camera) -> Shot:
    half = camera.pixels / 2
    local = trimesh.Trimesh((mesh.vertices - camera.center) @ camera.axes.T * camera.scale, mesh.faces, process=False)
    placed = np.asarray(local.vertices) * [1.0, -1.0, 1.0] + [half, half, 0.0]
    owner = faces_seen(placed[local.faces], camera.pixels, camera.pixels)
    seen = owner >= 0
    face, (rows, columns) = owner[seen], np.nonzero(seen)
    x, y = columns + (0.5 - half), (half - 0.5) - rows
    depth = _drop_rays(x, y, local, face)
    normals = np.asarray(local.face_normals)

    def place(some: np.ndarray) -> np.ndarray:
        return np.column_stack([x[some], y[some], depth[some]]) / camera.scale @ camera.axes + camera.center

    return Shot(seen, _lit(_facing(normals) @ camera.axes)[face], _creases(owner, normals, depth), face, place)


def _drop_rays(x: np.ndarray, y: np.ndarray, local: trimesh.Trimesh, face: np.ndarray) -> np.ndarray:
    """The heights [k] of the faces right below `x`, `y` [k]; within the face's range of z where it stands almost upright."""
    corners, facing = np.asarray(local.vertices)[local.faces], np.asarray(local.face_normals)
    first, heights = corners[:, 0], corners[:, :, 2]
    slope = -facing[:, :2] / np.where(np.abs(facing[:, 2]) < 1e-6, 1e-6, facing[:, 2])[:, None]
    base = first[:, 2] - (first[:, :2] * slope).sum(axis=1)
    z = base[face] + x * slope[face, 0] + y * slope[face, 1]
    return np.clip(z, heights.min(axis=1)[face], heights.max(axis=1)[face])


def _facing(normals: np.ndarray) -> np.ndarray:
    # open or inverted targets show their backs as well
    return np.where(normals[:, 2:] < 0, -normals, normals)


def _creases(owner: np.ndarray, normals: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Seen pixels [k] at silhouettes, depth jumps and creases, of faces [h, w] with `normals` [f, 3]; -1 is no face."""
    seen, normals = owner >= 0, np.append(normals, np.zeros((1, 3)), axis=0)  # the last is that of no face
    full_depth = np.full(seen.shape, -1e9)
    full_depth[seen] = depth
    rim = np.zeros(seen.shape, bool)
    # what is next to the frame is no face
    for here, before in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
        one, two = owner[here], owner[before]
        edge = np.abs(full_depth[here] - full_depth[before]) > 12.0
        apart = one != two  # within a face nothing bends
        edge[apart] |= dot_rows(normals[one[apart]], normals[two[apart]]) < CREASE_COSINE
        rim[here] |= edge
    return rim[seen]


def _shoot_points(points: np.ndarray, normals: np.ndarray | None, camera: Camera) -> Shot:
    """Discs as wide as the spacing of the points, nearest on top."""
    projected = camera.project(points)
    order = np.argsort(projected[:, 2], kind="stable")
    radius = int(np.clip(0.5 * camera.pixels / np.sqrt(len(order)), 2, 8))
    owner = np.full((camera.pixels, camera.pixels), -1)
    columns, rows = projected[order, 0].astype(np.int64), projected[order, 1].astype(np.int64)
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            if dx * dx + dy * dy <= radius * radius:
                _stamp(owner, rows + dy, columns + dx, order, projected[:, 2])
    seen = owner >= 0
    index = owner[seen]
    light = _lit(_cloud_normals(points, normals, camera, index))
    return Shot(seen, light, np.zeros(len(index), bool), index, lambda some: points[index[some]])


def _stamp(owner: np.ndarray, rows: np.ndarray, columns: np.ndarray, order: np.ndarray, depth: np.ndarray) -> None:
    """Give each pixel to its nearest point so far; `order` goes from far to near, and the last of equal indices wins."""
    inside = (rows >= 0) & (rows < owner.shape[0]) & (columns >= 0) & (columns < owner.shape[1])
    rows, columns, order = rows[inside], columns[inside], order[inside]
    fresh = np.full_like(owner, -1)
    fresh[rows, columns] = order
    nearer = (fresh >= 0) & ((owner < 0) | (depth[fresh] > depth[owner]))
    owner[nearer] = fresh[nearer]


def _cloud_normals(points: np.ndarray, normals: np.ndarray | None, camera: Camera, index: np.ndarray) -> np.ndarray:
    """Normals [k, 3] that face the camera, those given or else of the plane through the nearest points."""
    shown, which = np.unique(index, return_inverse=True)
    chosen = _plane_normals(points, shown) if normals is None else normals[shown]
    return (_facing(chosen @ camera.axes.T) @ camera.axes)[which]


def _plane_normals(points: np.ndarray, index: np.ndarray) -> np.ndarray:
    near = points[KDTree(points).query(points[index], k=min(NEIGHBOURS, len(points)))[1]]
    offsets = near - near.mean(axis=1, keepdims=True)
    return np.linalg.eigh(offsets.transpose(0, 2, 1) @ offsets)[1][:, :, 0]


def _lit(normals: np.ndarray) -> np.ndarray:
    """How brightly surfaces with unit normals [k, 3] are lit."""
    return 0.55 + 0.45 * np.clip(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0.0, 1.0)


def _paint(shot: Shot, colours: np.ndarray, side: int = PANEL) -> Image.Image:
    """The panel at final size: `colours` [k, 3] or [3] lit, on white."""
    shade = np.where(shot.rim, 0.45 * shot.light, shot.light)
    pixels = np.full((*shot.seen.shape, 3), 255, np.uint8)
    pixels[shot.seen] = np.clip(1.06 * shade[:, None] * colours, 0, 255).astype(np.uint8)
    image = Image.fromarray(pixels)
    return image.resize((side, side), Image.Resampling.BOX)


def _heat(shot: Shot, tree: TriangleTree, top: float) -> np.ndarray:
    """Colours [k, 3] of the seen pixels. Distances change slowly: the finer pixels that make one of the picture share one."""
    side, finer = PANEL, shot.seen.shape[0] // PANEL
    number = np.full(shot.seen.shape, len(shot.owners))
    number[shot.seen] = np.arange(len(shot.owners))
    first = number.reshape(side, finer, side, finer).min(axis=(1, 3))
    shown = first < len(shot.owners)
    colours = np.zeros((side, side, 3))
    colours[shown] = ramp(distances(tree, shot.place(first[shown])) / top)
    return colours.repeat(finer, 0).repeat(finer, 1)[shot.seen]


def ramp(fraction: np.ndarray) -> np.ndarray:
    """Colours [k, 3] of fractions 0 to 1; larger ones take the last colour."""
    knots = np.linspace(0.0, 1.0, len(_RAMP))
    return np.column_stack([np.interp(fraction, knots, _RAMP[:, channel]) for channel in range(3)])


def _sheet(panels: list[Image.Image], name: str, top: float, worst: float, diagonal: float, verdict: ColouredTarget | None) -> Image.Image:
    width = len(panels) * (PANEL + GAP)
    sheet = Image.new("RGB", (width, HEADER + PANEL + FOOTER), "white")
    draw = ImageDraw.Draw(sheet)
    titles = (f"target: {name}", "result", "target, coloured by distance to the result", "target, by what became of it")
    for number, (panel, title) in enumerate(zip(panels, titles, strict=False)):
        left = GAP // 2 + number * (PANEL + GAP)
        sheet.paste(panel, (left, HEADER))
        draw.text((left + 8, 14), _shorten_text(draw, title, PANEL - 16), font=ImageFont.load_default(19), fill=INK)
    _bar(sheet, draw, GAP // 2 + 2 * (PANEL + GAP), top)
    text = f"worst distance {worst:.4g} ({worst / diagonal:.2%} of the diagonal {diagonal:.4g}), in model units"
    draw.text((GAP // 2 + 8, HEADER + PANEL + 22), text, font=ImageFont.load_default(16), fill=FAINT)
    if verdict is not None:
        _key(draw, GAP // 2 + 3 * (PANEL + GAP), verdict.shares, COLOURS)
    return sheet


def _key(draw: ImageDraw.ImageDraw, left: int, shares: Mapping[str, str], colours: np.ndarray) -> None:
    """The colours [k, 3] with their shares of the surface, in words."""
    x, y, font = left + 8, HEADER + PANEL + 22, ImageFont.load_default(16)
    for (name, share), colour in zip(shares.items(), colours, strict=True):
        text = f"{name} {share}"
        draw.rectangle([x, y + 3, x + 14, y + 17], fill=tuple(colour.astype(int)), outline=FAINT)
        draw.text((x + 20, y), text, font=font, fill=INK)
        x += 20 + int(draw.textlength(text, font=font)) + 18


def _bar(sheet: Image.Image, draw: ImageDraw.ImageDraw, left: int, top: float) -> None:
    width, height, y = PANEL - 60, 14, HEADER + PANEL + 10
    colours = np.broadcast_to(ramp(np.linspace(0.0, 1.0, width)), (height, width, 3))
    sheet.paste(Image.fromarray(colours.astype(np.uint8)), (left + 30, y))
    for part in range(5):
        x = left + 30 + part * (width - 1) / 4
        draw.line([(x, y + height), (x, y + height + 5)], fill=FAINT)
        draw.text((x, y + height + 7), f"{top * part / 4:.3g}", font=ImageFont.load_default(14), fill=INK, anchor="ma")


def _shorten_text(draw: ImageDraw.ImageDraw, text: str, width: int) -> str:
    while draw.textlength(text, font=ImageFont.load_default(19)) > width:
        text = text[:-2].rstrip("…") + "…"
    return text
