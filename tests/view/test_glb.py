"""Meshes as binary glTF, decoded here by its specification."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
import usd_room

from s2a.scene.scene import Mesh
from s2a.view.page import glb

TYPES = {5123: np.uint16, 5125: np.uint32}


def decode(data: bytes) -> tuple[dict, list[np.ndarray]]:
    """Return the document of a .glb file, and the array of each accessor."""
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    document = json.loads(data[20 : 20 + size])
    payload = data[28 + size :]
    assert kind == b"JSON" and struct.unpack_from("<I4s", data, 20 + size) == (len(payload), b"BIN\0")
    assert size % 4 == 0 and len(payload) % 4 == 0
    arrays = []
    for accessor in document["accessors"]:
        view, dtype = document["bufferViews"][accessor["bufferView"]], TYPES[accessor["componentType"]]
        width = 3 if accessor["type"] == "VEC3" else 1
        stride = view.get("byteStride", width * dtype().itemsize)
        assert view["byteOffset"] % 4 == 0 and (width == 1 or stride % 4 == 0)
        raw = payload[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        table = np.frombuffer(raw, dtype).reshape(accessor["count"], stride // dtype().itemsize)
        arrays.append(table[:, :width])
    return document, arrays


def positions(document: dict, table: np.ndarray) -> np.ndarray:
    node = document["nodes"][0]
    return table / 65535.0 * node["scale"] + node["translation"]


def test_positions_come_back_within_a_step_of_the_box() -> None:
    mesh = Mesh(np.random.default_rng(0).uniform(-5.0, 5.0, (300, 3)), np.arange(300).reshape(100, 3))
    document, (indices, table) = decode(glb.encode(mesh))
    step = np.ptp(mesh.bounds, axis=0) / 65535.0
    assert (np.abs(positions(document, table) - mesh.vertices) <= 0.51 * step + 1e-6).all()
    assert indices.reshape(-1, 3).tolist() == mesh.faces.tolist()


def test_colours_become_linear_light() -> None:
    base = usd_room.box((0, 0, 0), (1, 1, 1))
    grey = Mesh(base.vertices, base.faces, np.full((8, 3), 188))  # half of the light: ((188 / 255 + 0.055) / 1.055)^2.4
    document, (_, _, colors) = decode(glb.encode(grey))
    np.testing.assert_allclose(colors / 65535.0, 0.503, atol=1e-3)
    assert document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] == [1.0, 1.0, 1.0, 1.0]


def test_one_colour_and_opacity_are_the_materials() -> None:
    document, arrays = decode(glb.encode(usd_room.box((0, 0, 0), (1, 1, 1), seed=3), (1.0, 0.5, 0.0), 0.25))
    assert len(arrays) == 2 and "COLOR_0" not in document["meshes"][0]["primitives"][0]["attributes"]
    material = document["materials"][0]
    assert material["alphaMode"] == "BLEND"
    assert material["pbrMetallicRoughness"]["baseColorFactor"] == [1.0, 0.5, 0.0, 0.25]


def test_baked_light_is_that_of_the_page_and_pixels_are_not_shaded() -> None:
    """Half of the light on a floor: 2.2 from everywhere, and of the lights 1.3 and 0.6 the cosines of their heights."""
    floor = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]), np.full((3, 3), 188))
    document, (_, _, colors) = decode(glb.encode(floor, baked=True))
    material = document["materials"][0]
    assert "KHR_materials_unlit" in material["extensions"] and "KHR_materials_unlit" in document["extensionsUsed"]
    shown = colors / 65535.0 * material["pbrMetallicRoughness"]["baseColorFactor"][:3]
    expected = 0.503 * (2.2 + 1.3 * 4 / np.sqrt(21) + 0.6 / np.sqrt(11)) / np.pi
    np.testing.assert_allclose(shown, expected, rtol=0.01)
    ceiling = Mesh(floor.vertices, floor.faces[:, ::-1], floor.colors)
    _, (_, _, darker) = decode(glb.encode(ceiling, baked=True))
    np.testing.assert_allclose(darker / colors, 2.2 / (np.pi * expected / 0.503), rtol=0.02)


@pytest.mark.parametrize("count", [65535, 65538])
def test_many_vertices_take_wider_indices(count: int) -> None:
    mesh = Mesh(np.random.default_rng(1).uniform(0.0, 1.0, (count, 3)), np.arange(count).reshape(-1, 3))
    _, (indices, _) = decode(glb.encode(mesh))
    assert indices.dtype == (np.uint16 if count <= 65535 else np.uint32)
    assert indices.ravel().tolist() == list(range(count))


def test_a_flat_mesh_has_a_scale_that_can_be_inverted() -> None:
    flat = Mesh(np.array([[0.0, 0, 1], [1, 0, 1], [0, 1, 1]]), np.array([[0, 1, 2]]))
    document, (_, table) = decode(glb.encode(flat))
    assert min(document["nodes"][0]["scale"]) > 0.0
    np.testing.assert_allclose(positions(document, table), flat.vertices, atol=1e-6)
