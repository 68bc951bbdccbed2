"""The mesh of a scan while it is annotated: faces with neighbours, which can be split along a plane."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from s2a.scene.geometry.mesh_ops import GREY, TriangleSurface
from s2a.scene.scene import Mesh

ADDED = -1  # Source of a face that was not scanned
# [m] A vertex this near to a plane lies on it: what would be cut off is less than float32 and a scan resolve
ON_PLANE = 1e-4


@dataclass(frozen=True, eq=False)
class SplitSurface(TriangleSurface):
    """A scan's mesh; faces keep their numbers, later ones are appended."""

    colors: np.ndarray  # RGB, shape [vertex 3], 0 to 255, float64
    source: np.ndarray  # face of the scan that each face is a piece of, shape [face]; ADDED for what was not scanned

    @staticmethod
    def of(vertices: np.ndarray, faces: np.ndarray, colors: np.ndarray | None) -> SplitSurface:
        """Return the surface of a scan's mesh; grey without colours."""
        colors = np.full(vertices.shape, GREY) if colors is None else colors
        return SplitSurface(vertices.astype(float), faces.astype(np.int64), colors.astype(float), np.arange(len(faces)))

    @cached_property
    def face_colors(self) -> np.ndarray:
        """Mean RGB of each face, shape [face 3]."""
        return self.colors[self.faces].mean(axis=1)

    def adjacent(self, faces: np.ndarray) -> np.ndarray:
        """Return the pairs of some faces that share an edge, as places in their list [pair 2], across seams too."""
        used, index = np.unique(self.faces[faces], return_inverse=True)
        keys = np.ascontiguousarray(np.round(self.vertices[used] * 1e5).astype(np.int64))
        welded = np.unique(keys.view([("", np.int64)] * 3).ravel(), return_inverse=True)[1]
        corners = welded[index.reshape(-1, 3)]
        edges = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
        key = edges[:, 0] * (int(welded.max(initial=0)) + 1) + edges[:, 1]
        order = np.argsort(key, kind="stable")
        same = key[order][1:] == key[order][:-1]
        face = np.tile(np.arange(len(faces)), 3)[order]
        return np.stack([face[:-1][same], face[1:][same]], axis=1)

    def component(self, seeds: np.ndarray, allowed: np.ndarray) -> np.ndarray:
        """Return the faces that are connected to some faces through allowed ones (mask [face]), sorted."""
        some = np.flatnonzero(allowed)
        number = connected(self.adjacent(some), len(some))
        return np.asarray(some[np.isin(number, number[np.isin(some, seeds)])])

    def mesh(self, faces: np.ndarray | None = None) -> Mesh:
        """Return some faces, or all, as a mesh."""
        if faces is None:
            return Mesh(self.vertices, self.faces, np.rint(self.colors))
        used, index = np.unique(self.faces[faces], return_inverse=True)
        return Mesh(self.vertices[used], index.reshape(-1, 3), np.rint(self.colors[used]))

    def split(self, faces: np.ndarray, normal: np.ndarray, offset: float) -> tuple[SplitSurface, np.ndarray]:
        """Cut some faces along the plane normal.x = offset [m]; faces beside them are divided too, so that no crack opens.

        The largest piece of a face keeps its number, the others are appended.

        Returns:
            The surface, and for each appended face the face that it was cut from.
        """
        height = self.vertices @ normal - offset
        height[np.abs(height) < ON_PLANE] = 0.0
        ends = np.concatenate([self.faces[faces][:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
        edges = np.unique(np.sort(ends[height[ends].prod(axis=1) < 0.0], axis=1), axis=0)
        if not len(edges):
            return self, np.empty(0, int)
        a, b = edges.T
        t = (height[a] / (height[a] - height[b]))[:, None]
        vertices = np.concatenate([self.vertices, self.vertices[a] * (1 - t) + self.vertices[b] * t])
        colors = np.concatenate([self.colors, self.colors[a] * (1 - t) + self.colors[b] * t])
        changed, parent, pieces = _divide(self.faces, edges, len(self.vertices), vertices)
        new = self.faces.copy()
        new[parent] = changed
        owner = parent[pieces[0]]
        return (
            SplitSurface(
                vertices, np.concatenate([new, pieces[1]]), colors, np.concatenate([self.source, self.source[owner]])
            ),
            owner,
        )

    def with_mesh(self, mesh: Mesh) -> SplitSurface:
        """Return the surface with further faces that were not scanned."""
        colors = np.full(mesh.vertices.shape, GREY) if mesh.colors is None else mesh.colors
        return SplitSurface(
            np.concatenate([self.vertices, mesh.vertices.astype(float)]),
            np.concatenate([self.faces, mesh.faces + len(self.vertices)]),
            np.concatenate([self.colors, colors.astype(float)]),
            np.concatenate([self.source, np.full(len(mesh.faces), ADDED)]),
        )


def connected(pairs: np.ndarray, count: int) -> np.ndarray:
    """Return the number of the connected component of each of `count` nodes, joined by pairs [pair 2]."""
    graph = coo_matrix((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def _divide(
    faces: np.ndarray, edges: np.ndarray, first: int, vertices: np.ndarray
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Divide the faces at whose edges a new vertex lies.

    Args:
        faces: shape [face 3].
        edges: ends of the edges with a new vertex, sorted, shape [edge 2].
        first: number of the first new vertex.
        vertices: old and new ones [m].

    Returns:
        The piece that keeps the number of each divided face [divided 3], those faces' numbers [divided], and of the further
        pieces the index among the divided faces [piece] and the vertices [piece 3].
    """
    width = len(vertices)
    keys = edges[:, 0] * width + edges[:, 1]
    order = np.argsort(keys)
    marked = np.zeros(width, bool)
    marked[edges] = True
    some = np.flatnonzero(marked[faces].sum(axis=1) >= 2)
    ends = np.stack([faces[some], np.roll(faces[some], -1, axis=1)], axis=2)  # edge k leads from corner k to k + 1
    edge_keys = ends.min(axis=2) * width + ends.max(axis=2)
    place = np.clip(np.searchsorted(keys[order], edge_keys), 0, len(keys) - 1)
    cut = np.where(keys[order][place] == edge_keys, first + order[place], -1)
    cut, some = cut[(cut >= 0).any(axis=1)], some[(cut >= 0).any(axis=1)]
    main, owner, others = [], [], []
    for index, face in enumerate(some):
        pieces = sorted(_pieces(faces[face], cut[index]), key=lambda piece: -_area(vertices[list(piece)]))
        main.append(pieces[0])
        owner += [index] * (len(pieces) - 1)
        others += pieces[1:]
    return np.array(main), some, (np.array(owner, int), np.array(others, int).reshape(-1, 3))


def _pieces(face: np.ndarray, cut: np.ndarray) -> list[tuple[int, int, int]]:
    """Return the triangles of a face with a new vertex at one or two of its edges (-1: none), wound as it is."""
    count = int((cut >= 0).sum())
    # With one cut edge, turn it to the front; with two, the edge without a cut to the middle.
    shift = int(np.argmax(cut >= 0)) if count == 1 else (int(np.argmin(cut >= 0)) - 1) % 3
    a, b, c = (int(i) for i in np.roll(face, -shift))
    p, _, q = (int(i) for i in np.roll(cut, -shift))
    return [(a, p, c), (p, b, c)] if count == 1 else [(a, p, q), (p, b, c), (p, c, q)]


def _area(corners: np.ndarray) -> float:
    return float(np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])))
