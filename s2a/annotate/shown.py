"""The overlay of the annotation page: fronts, handles and axes, and the places of the scan that clicks hit."""

from dataclasses import dataclass

import numpy as np
import viser
import viser.transforms

from s2a.annotate.annotation import Draft, Item
from s2a.annotate.region import FrontRegion
from s2a.scene.articulation import transform
from s2a.scene.scene import Joint, Mesh
from s2a.view.page import glb
from s2a.view.page.layers import axis_arrow, lifted
from s2a.view.page.panel import first_face
from s2a.view.page.scene_nodes import ARROW_COLORS, HEAD, HEAD_LENGTH, SHAFT

# Linear RGB of fronts by their state, and of handles
SELECTED, DONE, PROPOSED, HANDLE = (1.0, 0.42, 0.0), (0.1, 0.6, 0.2), (0.95, 0.75, 0.05), (0.8, 0.05, 0.25)
OPACITY, DARK = 0.45, (0.03, 0.03, 0.03)
OUTLINE = {SELECTED: (255, 120, 0), DONE: (40, 160, 70), PROPOSED: (240, 200, 20)}
LINE = 0.004  # [m] Thickness of a front's outline
LIFT = 0.004  # [m] Overlays lie so far before the surface


class Shown:
    """The parts of an annotation in viser's scene."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._nodes: dict[int, tuple[Item, bool, list[viser.SceneNodeHandle]]] = {}
        self._open: list[viser.SceneNodeHandle] = []

    def update(self, annotation: Draft, selected: int | None) -> None:
        """Show an annotation; parts that have not changed stay as they are."""
        self.close()
        for index in [i for i in self._nodes if i >= len(annotation.items)]:
            self._forget(index)
        for index, item in enumerate(annotation.items):
            drawn = self._nodes.get(index)
            if drawn is None or drawn[0] is not item or drawn[1] != (index == selected):
                self._forget(index)
                self._nodes[index] = (item, index == selected, self._make(annotation, index, index == selected))

    def open(self, annotation: Draft, index: int, fraction: float) -> None:
        """Show a part open by a fraction of its range, 0 to 1, as a copy before a dark hole."""
        self.close()
        item = annotation.items[index]
        if item.joint is None or fraction <= 0.0:
            return
        for node in self._nodes[index][2]:
            node.visible = False
        mesh = annotation.surface.mesh(np.union1d(item.region.faces, item.handle))
        turned, position = _pose(item.joint, fraction)
        scene = self._scene
        self._open = [
            scene.add_glb("/open/hole", glb.encode(_hole(item), DARK)),
            scene.add_glb("/open/part", glb.encode(mesh, both_sides=True), wxyz=turned, position=position),
        ]

    def close(self) -> None:
        """Show every part at its scanned pose."""
        for node in self._open:
            node.remove()
        self._open = []
        for _, _, nodes in self._nodes.values():
            for node in nodes:
                node.visible = True

    def _forget(self, index: int) -> None:
        for node in self._nodes.pop(index, (None, None, []))[2]:
            node.remove()

    def _make(self, annotation: Draft, index: int, selected: bool) -> list[viser.SceneNodeHandle]:
        item, path = annotation.items[index], f"/part/{index}"
        color = SELECTED if selected else PROPOSED if item.proposed else DONE
        made: list[viser.SceneNodeHandle] = []
        if len(item.front):
            front = lifted(annotation.surface.mesh(item.front), LIFT)
            made.append(self._scene.add_glb(f"{path}/front", glb.encode(front, color, OPACITY, True)))
        if len(item.handle):
            mesh = annotation.surface.mesh(item.handle)
            shape = glb.encode(mesh if item.completed else lifted(mesh, LIFT), HANDLE, 1.0 if item.completed else 0.7)
            made.append(self._scene.add_glb(f"{path}/handle", shape))
        border = item.region.corners + 2 * LIFT * item.region.normal
        ends = np.stack([border, np.roll(border, -1, axis=0)], axis=1)
        made.append(self._scene.add_line_segments(f"{path}/outline", ends, OUTLINE[color], thickness=LINE))
        if item.joint is not None:
            made.append(self._arrow(f"{path}/axis", item.joint, item.region.corners))
        return made

    def _arrow(self, name: str, joint: Joint, corners: np.ndarray) -> viser.SceneNodeHandle:
        ends = axis_arrow(joint, corners)[None]
        return self._scene.add_arrows(
            name, ends, ARROW_COLORS[joint.kind], shaft_radius=SHAFT, head_radius=HEAD, head_length=HEAD_LENGTH
        )


def _hole(item: Item) -> Mesh:
    corners = item.region.corners + LIFT * item.region.normal
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def _pose(joint: Joint, fraction: float) -> tuple[np.ndarray, np.ndarray]:
    matrix = transform(joint, fraction * joint.limits[1])
    return viser.transforms.SO3.from_matrix(matrix[:3, :3]).wxyz, matrix[:3, 3]


FAR = 3.5  # [m] From farther away a wide front is not faced: rooms end
MIN_COSINE = 0.05  # Of a ray with a front's normal; at less, the front is seen from its edge
GRID = np.linspace(0.1, 0.9, 7)  # Fractions of a rectangle's sides at which is asked what it shows


@dataclass(frozen=True)
class CameraView:
    """A camera."""

    position: np.ndarray  # [m], shape [3]
    rotation: np.ndarray  # from its axes (right, down, forwards) to the scene's, shape [3 3]
    fov: float  # vertical field of view [rad]
    aspect: float  # width by height of the image

    def ray(self, x: float, y: float) -> np.ndarray:
        """Return the direction through a place of the image, from 0, 0 at the top left to 1, 1, shape [3]."""
        half = np.tan(self.fov / 2)
        local = np.array([(2 * x - 1) * half * self.aspect, (2 * y - 1) * half, 1.0])
        return np.asarray(self.rotation @ (local / np.linalg.norm(local)))


def place(mesh: Mesh, origin: np.ndarray, direction: np.ndarray) -> tuple[int, np.ndarray] | None:
    """Return the face that a ray meets first, from its front, and where [m], shape [3]; None where it meets none."""
    distance, face = first_face(mesh, origin, direction, both_sides=False)
    return None if face < 0 else (face, origin + distance * direction)


def corners(
    view: CameraView, low: tuple[float, float], high: tuple[float, float], region: FrontRegion
) -> np.ndarray | None:
    """Return where the corners of a rectangle of the image lie on a front's plane [m] [4 3]; None if it is seen from its edge.

    `low` and `high` are the rectangle's top left and bottom right corners in the image, 0 to 1.
    """
    corners = []
    for x, y in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])):
        ray = view.ray(x, y)
        against = float(ray @ region.normal)
        if abs(against) < MIN_COSINE:
            return None
        corners.append(view.position + ray * float((region.center - view.position) @ region.normal) / against)
    return np.array(corners)


def seen(view: CameraView, mesh: Mesh, low: tuple[float, float], high: tuple[float, float]) -> np.ndarray:
    """Return the faces that are seen on a grid of places within a rectangle of the image, that at its middle first."""
    grid = np.array([(x, y) for x in GRID for y in GRID])
    places = np.array(low) + grid[np.argsort(np.abs(grid - 0.5).max(axis=1), kind="stable")] * np.subtract(high, low)
    hits = [place(mesh, view.position, view.ray(x, y)) for x, y in places]
    return np.array([face for face, _ in filter(None, hits)], dtype=int)


def facing(region: FrontRegion, fov: float) -> tuple[np.ndarray, np.ndarray]:
    """Return where a camera stands that sees a front straight on with some room around it, and what it aims at [m], [3] each."""
    distance = 0.9 * float(region.size.max()) / np.tan(fov / 2) + 0.2
    return region.center + min(distance, FAR) * region.normal, region.center
