"""The 3D view of one client."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import viser

from imdim.app.lab.camera import PageCamera
from imdim.app.lab.drawing import CAP_OF, EDGE, LIFT, POINT_COLOUR, SELECTED, SPAN, Colour, Drawing, Overlay, Piece
from imdim.app.lab.ground import Ground
from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.points import Points
from imdim.target.target import Frame

LAYERS: Mapping[str, bool] = {
    "Solid": True,
    "Cutters": True,
    "Original": False,
    "Points": True,
    "Distance map": False,
    "Relations": False,
    "Grid and axes": True,
}
SEEN_THROUGH = 0.3  # opacity of the solid where constraints or distances are shown, many of which lie inside it
MAP_SIZE, UNDER_MAP = (
    0.04,
    (222, 226, 230),
)  # of a point of the distance map; and of the solid below it, which shows between them: no distance
EDGE_WIDTH = 1.2
PICKED, PICKED_LINE = (151, 117, 250), (95, 61, 196)
ADDING = ("cmd/ctrl", "shift")  # keys with which a click adds a face
GHOST = 0.35  # opacity of the original beside the solid


class Click(NamedTuple):
    """A click on what belongs to thing number `leaf`, along the ray from `origin` [3] in `direction` [3] of the view; one that `adds` keeps
    what was clicked before."""

    leaf: int
    origin: np.ndarray
    direction: np.ndarray
    adds: bool


class SceneView:
    """Draws pieces, and tells what was clicked."""

    def __init__(self, client: viser.ClientHandle, queue: InputQueue, clicked: Callable[[Click], None]) -> None:
        self._scene, self._client, self._queue, self._clicked = client.scene, client, queue, clicked
        self._meshes: dict[str, tuple[Piece, viser.MeshHandle]] = {}
        self._others: dict[str, viser.SceneNodeHandle] = {}
        self._cloud = Points(client)
        self._over: Overlay | None = None
        self._is_alone = True  # the target, before there is a solid
        self._named: tuple[bytes, str] | None = None
        self._lit: frozenset[int] = frozenset()
        self.shown = dict(LAYERS)
        self._lock = threading.RLock()  # a person switches layers, a run draws, and distances come when they are measured
        client.camera.on_update(lambda _: self._cloud.stir())
        self.camera = PageCamera(client.camera, client.atomic, queue.soon)

    def show(self, layer: str, visible: bool) -> None:
        """One of LAYERS on or off."""
        with self._lock:
            self.shown[layer] = visible
            if layer in ("Relations", "Distance map"):
                for name, (piece, node) in self._meshes.items():
                    node.opacity, node.color = self._opacity(name, piece), self._colour(name, piece)
                self._overlay()
            for name, node in (*((n, h) for n, (_, h) in self._meshes.items()), *self._others.items()):
                if _LAYER_OF[name.split("/")[1]] == layer:
                    node.visible = self._is_seen(name)
            if layer == "Points":
                self._cloud.show(visible)

    def draw(self, scene: Drawing | None, overlay: Overlay | None) -> None:
        """The solid, its cutters, and what the constraints relate."""
        pieces = {} if scene is None else {f"/solid/{p.leaf}": p for p in scene.pieces} | {f"/cutters/{p.leaf}": p for p in scene.ghosts}
        with self._lock, self._client.atomic():
            self._beside(bool(pieces))
            self._draw_edges("/outlines/solid", np.zeros((0, 2, 3)) if scene is None else scene.edges)
            self._cloud.stir()
            for name in self._meshes.keys() - pieces.keys():
                self._meshes.pop(name)[1].remove()
            for name, piece in pieces.items():
                self._mesh(name, piece)
            self._over = overlay
            self._overlay()

    def _mesh(self, name: str, piece: Piece) -> None:
        before = self._meshes.get(name)
        if before is not None and _same(before[0], piece):
            return
        handle = self._scene.add_mesh_simple(
            name,
            piece.vertices,
            piece.faces.astype(np.uint32),
            color=self._colour(name, piece),
            opacity=self._opacity(name, piece),
            flat_shading=True,
            side="front",
            visible=self.shown[_LAYER_OF[name.split("/")[1]]],
        )
        for key in () if piece.leaf == CAP_OF else (None, *ADDING):
            handle.on_click(modifier=key)(self._queue.pass_event(lambda event, leaf=piece.leaf: self._click(leaf, event)))
        self._meshes[name] = (piece, handle)

    def _click(self, leaf: int, event: viser.SceneNodePointerEvent[viser.MeshHandle]) -> None:
        self._clicked(Click(leaf, np.array(event.ray_origin), np.array(event.ray_direction), event.modifier is not None))

    def draw_picks(self, faces: Sequence[np.ndarray], ends: np.ndarray | None, label: str) -> None:
        """Clicked faces, each of triangles [m, 3, 3]; a line between `ends` [2, 3] of the unit frame, and what is written on it."""
        with self._lock, self._client.atomic():
            self._remove(*(name for name in self._others if name.startswith("/picks/")))
            for i, corners in enumerate(faces):
                self._others[f"/picks/{i}"] = self._scene.add_mesh_simple(
                    f"/picks/{i}",
                    _raise(corners).reshape(-1, 3),
                    np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3),
                    color=PICKED,
                    flat_shading=True,
                    side="double",
                )
            if ends is not None:
                at = (ends * SPAN).astype(np.float32)
                self._draw_edges("/picks/line", at[None], PICKED_LINE, 3.0)
                self._others["/picks/label"] = self._scene.add_label(
                    "/picks/label", label, position=at.mean(axis=0), anchor="bottom-center", font_screen_scale=1.3
                )

    def light_up(self, leaves: Collection[int]) -> None:
        """Show what belongs to these primitives and edge features in the colour of what is selected, and nothing else so."""
        with self._lock:
            changed = self._lit ^ frozenset(leaves)
            self._lit = frozenset(leaves)
            with self._client.atomic():
                for name, (piece, node) in self._meshes.items():
                    if piece.leaf in changed:
                        node.color = self._colour(name, piece)

    def _opacity(self, name: str, piece: Piece) -> float | None:
        through = self.shown["Relations"] or self.shown["Distance map"]
        return SEEN_THROUGH if through and name.startswith("/solid/") else piece.opacity

    def _colour(self, name: str, piece: Piece) -> Colour:
        if piece.leaf in self._lit:
            return SELECTED
        return UNDER_MAP if self.shown["Distance map"] and name.startswith("/solid/") else piece.colour

    def close(self) -> None:
        """The client has gone."""
        self.camera.close()
        self._cloud.close()

    def _overlay(self) -> None:
        """Only where it is seen: what is new in the view costs the browser more than all that moves in it."""
        self._remove("/points/controls", "/constraints/links")
        overlay = self._over
        if overlay is None or not self.shown["Relations"]:
            return
        self._others["/points/controls"] = self._points("/points/controls", overlay.points, POINT_COLOUR, 0.045)
        if len(overlay.segments):
            self._others["/constraints/links"] = self._scene.add_line_segments(
                "/constraints/links", overlay.segments, overlay.colours, thickness=2.0, thickness_units="screen"
            )

    def draw_ground(self, ground: Ground, frame: Frame) -> None:
        """What the part stands on."""
        with self._lock, self._client.atomic():
            self._others |= ground.draw(self._scene, frame, self.shown["Grid and axes"])

    def draw_cloud(self, points: np.ndarray) -> None:
        """The target's points [n, 3]."""
        self._cloud.draw(points)

    def draw_original(self, pieces: Sequence[Piece], edges: np.ndarray) -> None:
        """The target's surface, and its sharp edges [m, 2, 3]."""
        with self._lock, self._client.atomic():
            self._remove(*(name for name in self._others if name.startswith("/original/surface")))
            for i, piece in enumerate(pieces):
                name = f"/original/surface{i}"
                self._others[name] = self._scene.add_mesh_simple(
                    name,
                    piece.vertices,
                    piece.faces.astype(np.uint32),
                    color=piece.colour,
                    opacity=None if self._is_alone else GHOST,
                    flat_shading=True,
                    side="double",
                    visible=self._is_seen(name),
                )
            self._draw_edges("/original/edges", edges)

    def _beside(self, solid: bool) -> None:
        """Whether there is a solid, beside which the target is not seen, or stands back."""
        self._cloud.beside(solid)
        self._is_alone = not solid
        for name, node in self._others.items():
            if name.startswith("/original/"):
                node.visible = self._is_seen(name)
                if isinstance(node, viser.MeshHandle):
                    node.opacity = None if self._is_alone else GHOST

    def _is_seen(self, name: str) -> bool:
        layer = _LAYER_OF[name.split("/")[1]]
        return self.shown[layer] or (layer == "Original" and self._is_alone)

    def _draw_edges(self, name: str, edges: np.ndarray, colour: Colour = EDGE, width: float = EDGE_WIDTH) -> None:
        """Lines [m, 2, 3] in place of those before."""
        before = self._others.get(name)
        if isinstance(before, viser.LineSegmentsHandle) and np.array_equal(before.points, edges):
            return
        self._remove(name)
        if len(edges):
            self._others[name] = self._scene.add_line_segments(
                name, edges, colour, thickness=width, thickness_units="screen", visible=self._is_seen(name)
            )

    def draw_map(self, points: np.ndarray, colours: np.ndarray) -> None:
        """The distances at the target's points."""
        with self._lock:
            self._others["/map/points"] = self._points("/map/points", points, colours, MAP_SIZE)

    def name(self, at: np.ndarray | None, text: str) -> None:
        """What the selected primitive is called, where it is."""
        named = None if at is None else (at.tobytes(), text)
        with self._lock:
            if named == self._named:
                return
            self._named = named
            self._remove("/label/selected")
            if at is not None:
                self._others["/label/selected"] = self._scene.add_label("/label/selected", text, position=at, anchor="bottom-center")

    def _points(self, name: str, points: np.ndarray, colours: object, size: float) -> viser.PointCloudHandle:
        return self._scene.add_point_cloud(
            name,
            points,
            np.asarray(colours, np.uint8),
            point_size=size,
            point_shape="circle",
            precision="float32",
            point_shading="flat",
            visible=self.shown[_LAYER_OF[name.split("/")[1]]],
        )

    def _remove(self, *names: str) -> None:
        for name in names:
            if name in self._others:
                self._others.pop(name).remove()

    def forget(self) -> None:
        """Another target: nothing of the old one stays."""
        with self._lock, self._client.atomic():
            self._named, self._lit = None, frozenset()
            self._cloud.forget()
            self.draw(None, None)
            self._remove(*self._others)


def _raise(corners: np.ndarray) -> np.ndarray:
    """Triangles [m, 3, 3] above the surface that they are of."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    return (corners + 2 * LIFT * normals[:, None]).astype(np.float32)


def _same(a: Piece, b: Piece) -> bool:
    return (
        (a.colour, a.opacity, a.leaf) == (b.colour, b.opacity, b.leaf)
        and np.array_equal(a.faces, b.faces)
        and np.array_equal(a.vertices, b.vertices)
    )


_LAYER_OF: Mapping[str, str] = {
    "solid": "Solid",
    "cutters": "Cutters",
    "map": "Distance map",
    "points": "Relations",
    "constraints": "Relations",
    "label": "Solid",
    "picks": "Solid",
    "outlines": "Solid",
    "original": "Original",
    "ground": "Grid and axes",
}
