"""The 3D view of one client."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Collection, Mapping

import numpy as np
import viser

from imdim.app.lab.drawing import POINT_COLOUR, SELECTED, Colour, Drawing, Overlay, Piece
from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.points import Points

LAYERS: Mapping[str, bool] = {"Solid": True, "Cutters": True, "Points": True, "Distance map": False, "Relations": False}
SEEN_THROUGH = 0.3  # opacity of the solid where constraints or distances are shown, many of which lie inside it
TURN_DEG, TURN_S = 1.0, 0.05
MAP_SIZE, UNDER_MAP = (
    0.04,
    (222, 226, 230),
)  # of a point of the distance map; and of the solid below it, which shows between them: no distance
SKY, KEY, GROUND = 1.9, 1.6, (140, 144, 156)  # intensities, and what comes from below
AWAY = np.array([1.85, -2.45, 1.8])  # the camera, seen from the middle of the part, all of which it just sees


def light(scene: viser.SceneApi) -> None:
    """Two lights in place of the toolkit's picture of a room and its many, which a machine without a graphics card draws slowly."""
    scene.world_axes.visible = False
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_hemisphere("/lights/sky", ground_color=GROUND, intensity=SKY, position=(0.0, 0.0, 1.0))
    scene.add_light_directional("/lights/key", intensity=KEY, position=(1.5, -3.5, 4.0))


class SceneView:
    """Draws pieces, and tells which primitive was clicked."""

    def __init__(self, client: viser.ClientHandle, ear: InputQueue, clicked: Callable[[int], None]) -> None:
        self._scene, self._client, self._ear, self._clicked = client.scene, client, ear, clicked
        self._meshes: dict[str, tuple[Piece, viser.MeshHandle]] = {}
        self._others: dict[str, viser.SceneNodeHandle] = {}
        self._cloud = Points(client)
        self._turning = threading.Event()
        self._over: Overlay | None = None
        self._named: tuple[bytes, str] | None = None
        self._lit: frozenset[int] = frozenset()
        self.shown = dict(LAYERS)
        self._lock = threading.RLock()  # a person switches layers, a run draws, and distances come when they are measured
        client.camera.on_update(lambda _: self._cloud.stir())
        self.look()

    def look(self) -> None:
        """Put the camera where all of the part is seen."""
        camera = self._client.camera
        camera.position, camera.look_at, camera.up_direction = AWAY, np.zeros(3), np.array([0.0, 0.0, 1.0])

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
                    node.visible = visible
            if layer == "Points":
                self._cloud.show(visible)

    def draw(self, scene: Drawing | None, overlay: Overlay | None) -> None:
        """The solid, its cutters, and what the constraints relate."""
        pieces = {} if scene is None else {f"/solid/{p.leaf}": p for p in scene.pieces} | {f"/cutters/{p.leaf}": p for p in scene.ghosts}
        with self._lock, self._client.atomic():
            self._cloud.beside(bool(pieces))
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
        handle.on_click(self._ear.then(lambda leaf=piece.leaf: self._clicked(leaf)))
        self._meshes[name] = (piece, handle)

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
        self.turn(False)
        self._cloud.close()

    def turn(self, on: bool) -> None:
        """Let the part turn slowly, or hold it still."""
        self._turning.set()
        if on:
            self._turning = threading.Event()
            threading.Thread(target=self._turn, args=(self._turning,), name="turn", daemon=True).start()

    def _turn(self, ended: threading.Event) -> None:
        c, s = math.cos(math.radians(TURN_DEG)), math.sin(math.radians(TURN_DEG))
        while not ended.wait(TURN_S):
            with self._client.atomic():
                x, y, z = self._client.camera.position
                self._client.camera.position = np.array([c * x - s * y, s * x + c * y, z])
                self._client.camera.look_at = np.zeros(3)

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

    def draw_cloud(self, points: np.ndarray) -> None:
        """The target's points [n, 3]."""
        self._cloud.draw(points)

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
}
