"""glTF 2.0 and GLB -> SourceMesh: everything that the file's own scene shows, y up and in metres as its specification says."""

import logging
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.scan import gltf_file
from s2a.scan.gltf_file import GltfFile, GltfMaterials
from s2a.scan.source import SourceMesh, Stated, joined

_log = logging.getLogger(__name__)

NAME = "glTF"
ENDINGS = (".glb", ".gltf")
INSTANCES, VISIBILITY, DRACO = "EXT_mesh_gpu_instancing", "KHR_node_visibility", "KHR_draco_mesh_compression"
# Extensions that are read; of others a file may say that it needs them, and is refused then
READ = {"KHR_mesh_quantization", INSTANCES, VISIBILITY, "KHR_accessor_float64", *gltf_file.READ}
# Beginnings of the names of extensions that change neither geometry nor base colour, or move the whole
HARMLESS = tuple(
    "KHR_materials_ KHR_lights_ KHR_xmp KHR_animation_ KHR_node_ KHR_audio KHR_physics CESIUM_RTC EXT_mesh_features "
    "EXT_structural_metadata EXT_feature_metadata EXT_lights_ EXT_instance_features".split()
)
POINTS, TRIANGLES, STRIP, FAN = 0, 4, 5, 6
# What wrong values in the document raise
DAMAGE = (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError, MemoryError, RecursionError)


def recognise(path: Path) -> bool:
    """Return whether a file's name ends as glTF's do."""
    return path.suffix.lower() in ENDINGS


def read(path: Path) -> SourceMesh:
    """Read all triangles of the file's scene, in the order of its nodes; what is left out is a warning with its count.

    Raises:
        InputError: a truncated or damaged file, or one that needs an extension that is not read.
    """
    file = GltfFile(path)
    required = [str(name) for name in file.items("extensionsRequired")]
    file.refuse_compressed(required)
    if missing := [name for name in required if name not in READ and not name.startswith(HARMLESS)]:
        raise InputError(f"{path}: needs {', '.join(missing)}, which is not read; export it without")
    try:
        reader = _Reader(file)
        parts = list(reader.parts())
    except InputError:
        raise
    except DAMAGE as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:120]
        raise InputError(f"{path}: truncated or damaged ({reason}); export it again") from error
    reader.warn()
    if not parts:
        raise InputError(f"{path}: holds no faces; export a mesh, not a point cloud")
    return joined(parts, Stated("y", 1.0, NAME))


class _Reader:
    def __init__(self, file: GltfFile) -> None:
        self._file, self._lost = file, Counter[str]()
        self._looks = GltfMaterials(file)
        self._world = dict(self._placed())

    def parts(self) -> Iterator[SourceMesh]:
        """Yield the primitives of triangles of all nodes of the scene, placed."""
        for index, world in self._world.items():
            node = self._file.items("nodes")[index]
            if "mesh" not in node:
                continue
            mesh = self._file.items("meshes")[node["mesh"]]
            weights = node.get("weights", mesh.get("weights", []))
            places = list(self._instances(node, world))
            for primitive in mesh["primitives"]:
                faces = self._faces(primitive)
                if faces is None:
                    continue
                points = self._points(primitive, weights)
                if "skin" in node and "JOINTS_0" in primitive["attributes"]:
                    points, places = self._skinned(points, primitive, node["skin"]), [np.eye(4)]
                uv, colors, material = self._looks.of(primitive, faces, len(points))
                for place in places:
                    yield _part(points, faces, place, uv, colors, material)

    def warn(self) -> None:
        """Log what is left out."""
        for what, count in [*self._lost.items(), *self._looks.lost.items()]:
            _log.warning("%s: %d %s", self._file.path, count, what)

    def _placed(self) -> Iterator[tuple[int, np.ndarray]]:
        """Yield the nodes of the default scene with their matrices [4 4], parents first."""
        scenes, nodes = self._file.items("scenes"), self._file.items("nodes")
        children = {child for node in nodes for child in node.get("children", [])}
        roots = [i for i in range(len(nodes)) if i not in children]
        if scenes:
            shown = int(self._file.document.get("scene", 0))
            roots = scenes[shown].get("nodes", [])
            meshes = [self._meshes(scene.get("nodes", [])) for i, scene in enumerate(scenes) if i != shown]
            if lost := len(set().union(*meshes) - self._meshes(roots)):
                self._lost[f"meshes of {len(scenes) - 1} other scenes are left out; the file shows scene {shown}"] = (
                    lost
                )
        done: set[int] = set()
        waiting = [(root, np.eye(4)) for root in reversed(roots)]
        while waiting:
            index, above = waiting.pop()
            if index in done:
                raise ValueError(f"node {index} has two parents")
            done.add(index)
            node = nodes[index]
            if not node.get("extensions", {}).get(VISIBILITY, {}).get("visible", True):
                self._lost["nodes are invisible, and are left out"] += 1
                continue
            if "matrix" in node:
                own = np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
            else:
                own = _composed(node.get("translation"), node.get("rotation"), node.get("scale"))
            world = above @ own
            yield index, world
            waiting += [(child, world) for child in reversed(node.get("children", []))]

    def _meshes(self, roots: list[int]) -> set[int]:
        nodes, below, waiting = self._file.items("nodes"), set[int](), list(roots)
        while waiting:
            index = waiting.pop()
            if index not in below:
                below.add(index)
                waiting += nodes[index].get("children", [])
        return {index for index in below if "mesh" in nodes[index]}

    def _instances(self, node: dict[str, Any], world: np.ndarray) -> Iterator[np.ndarray]:
        """Yield the matrices [4 4] at which a node's mesh stands."""
        given = node.get("extensions", {}).get(INSTANCES, {}).get("attributes", {})
        names = ("TRANSLATION", "ROTATION", "SCALE")
        arrays = [self._file.array(given[name]) if name in given else None for name in names]
        lengths = [len(array) for array in arrays if array is not None]
        if not lengths:
            yield world
        for row in range(min(lengths, default=0)):
            yield world @ _composed(*(None if array is None else array[row] for array in arrays))

    def _faces(self, primitive: dict[str, Any]) -> np.ndarray | None:
        """Return a primitive's triangles, shape [face 3], int64; None for points and lines, which are counted."""
        mode = primitive.get("mode", TRIANGLES)
        if "POSITION" not in primitive["attributes"]:
            self._lost["primitives without positions are left out"] += 1
            return None
        if mode not in (TRIANGLES, STRIP, FAN):
            self._lost[f"primitives of {'points' if mode == POINTS else 'lines'} are left out"] += 1
            return None
        accessor = self._file.items("accessors")[primitive["attributes"]["POSITION"]]
        if DRACO in primitive.get("extensions", {}) and "bufferView" not in accessor:
            self._file.refuse_compressed([DRACO])
        order = np.arange(accessor["count"])
        if "indices" in primitive:
            order = self._file.array(primitive["indices"])[:, 0].astype(np.int64)
        if len(order) < 3:
            return None
        if mode == TRIANGLES:
            if len(order) % 3:
                self._lost["corners at the end of a primitive make no triangle"] += len(order) % 3
            return order[: len(order) // 3 * 3].reshape(-1, 3)
        step = np.arange(len(order) - 2)
        if mode == FAN:
            return np.stack([np.full(len(step), order[0]), order[step + 1], order[step + 2]], axis=1)
        odd = step % 2
        strip = np.stack([order[step], order[step + 1 + odd], order[step + 2 - odd]], axis=1)
        # Strips are joined by triangles without area, which the format means to be nothing.
        return strip[(strip[:, 0] != strip[:, 1]) & (strip[:, 1] != strip[:, 2]) & (strip[:, 2] != strip[:, 0])]

    def _points(self, primitive: dict[str, Any], weights: list[float]) -> np.ndarray:
        """Return positions with morph targets applied, shape [vertex 3], float64."""
        points = self._file.array(primitive["attributes"]["POSITION"]).astype(np.float64)
        if points.shape[1] != 3:
            raise ValueError(f"positions of {points.shape[1]} numbers")
        for weight, target in zip(weights, primitive.get("targets", []), strict=False):
            if weight and "POSITION" in target:
                points = points + float(weight) * self._file.array(target["POSITION"])
        return points

    def _skinned(self, points: np.ndarray, primitive: dict[str, Any], skin: int) -> np.ndarray:
        """Return positions in the scene, where the joints of a skin stand; those of its own node do not count."""
        record, attributes = self._file.items("skins")[skin], primitive["attributes"]
        bind = np.tile(np.eye(4), (len(record["joints"]), 1, 1))
        if "inverseBindMatrices" in record:
            bind = self._file.array(record["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
        moves = np.stack([self._world.get(joint, np.eye(4)) @ bind[i] for i, joint in enumerate(record["joints"])])
        total, whole = np.zeros_like(points), np.concatenate([points, np.ones((len(points), 1))], axis=1)
        sums = np.zeros(len(points))
        for number in range(sum(name.startswith("JOINTS_") for name in attributes)):
            joints = self._file.array(attributes[f"JOINTS_{number}"]).astype(np.int64)
            shares = self._file.array(attributes[f"WEIGHTS_{number}"])
            for joint, share in zip(joints.T, shares.T, strict=True):
                total += share[:, None] * np.einsum("nij,nj->ni", moves[joint], whole)[:, :3]
                sums += share
        return np.where(sums[:, None] > 0, total / np.where(sums > 0, sums, 1.0)[:, None], points)


def _part(
    points: np.ndarray, faces: np.ndarray, matrix: np.ndarray, uv: np.ndarray, colors: np.ndarray, material: Any
) -> SourceMesh:
    vertices = points @ matrix[:3, :3].T + matrix[:3, 3]
    if np.linalg.det(matrix[:3, :3]) < 0:  # a mirror turns faces inside out
        faces, uv, colors = faces[:, ::-1], uv[:, ::-1], colors[:, ::-1]
    number = np.full(len(faces), -1 if material is None else 0)
    return SourceMesh(vertices, faces, uv, colors, number, () if material is None else (material,), Stated())


def _composed(translation: Any, rotation: Any, scale: Any) -> np.ndarray:
    """Return the matrix [4 4] of a translation, a quaternion xyzw and a scale; None is none."""
    matrix = np.eye(4)
    if rotation is not None and np.any(rotation):
        matrix[:3, :3] = Rotation.from_quat(rotation).as_matrix()
    if scale is not None:
        matrix[:3, :3] *= np.asarray(scale, dtype=np.float64)
    if translation is not None:
        matrix[:3, 3] = translation
    return matrix
