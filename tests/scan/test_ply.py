"""Meshes of scans: every kind of PLY is read alike, a damaged one is refused."""

from __future__ import annotations

import numpy as np
import pytest
import tiny_scan
from tiny_scan import PLY, assert_refused, read

from s2a import scan
from s2a.core.errors import InputError
from s2a.scan import ply


def test_every_kind_of_ply_reads_the_same(tmp_path):
    plain = read(tmp_path / "plain").parts
    for i, kind in enumerate(({"double": True}, {"extras": True}, {"text": True}, {"text": True, "extras": True})):
        assert read(tmp_path / str(i), mesh=tiny_scan.ply(**kind)).parts == plain


def test_a_mesh_without_colors_is_read(tmp_path):
    assert all(part.mesh.colors is None for part in read(tmp_path, mesh=tiny_scan.ply(colors=None)).parts.values())


def test_texture_coordinates_do_not_reorder_the_vertices(tmp_path):
    mesh = tiny_scan.ply(faces=np.array([[11, 5, 3]]), extras=True)
    (tmp_path / "mesh.ply").write_bytes(mesh.replace(b"float nx", b"float s").replace(b"float ny", b"float t"))
    surface = ply.read(tmp_path / "mesh.ply")
    assert np.array_equal(surface.vertices, tiny_scan.VERTICES.astype(np.float32))
    assert surface.faces.tolist() == [[11, 5, 3]]


VERTICES = tiny_scan.VERTICES


def changed(array: np.ndarray, row: int, value: float) -> np.ndarray:
    """Return a copy of an array with the middle of a row replaced."""
    copy = array.copy()
    copy[row, 1] = value
    return copy


MESHES = {
    "truncated in its faces": (tiny_scan.ply()[:-5], ("truncated",)),
    "truncated in its vertices": (tiny_scan.ply()[:300], ("truncated",)),
    "truncated in its header": (tiny_scan.ply()[:60], ("truncated",)),
    "text truncated in its faces": (tiny_scan.ply(text=True)[:-9], ("truncated",)),
    "text truncated by whole faces": (b"\n".join(tiny_scan.ply(text=True).split(b"\n")[:-3]), ("truncated",)),
    "text truncated in its vertices": (b"\n".join(tiny_scan.ply(text=True).split(b"\n")[:16]), ("truncated",)),
    "empty": (b"", ("not a PLY",)),
    "something else": (b"solid cube\n", ("not a PLY",)),
    "longer than its header says": (tiny_scan.ply() + b"12345", ("truncated",)),
    "of quadrangles": (tiny_scan.ply(faces=np.array([[0, 1, 2, 3]])), ("triangles",)),
    "without faces": (tiny_scan.ply(faces=np.empty((0, 3), int)), ("triangles",)),
    "without vertices": (tiny_scan.ply(np.empty((0, 3)), colors=None), ("triangles",)),
    "with a coordinate that is not a number": (tiny_scan.ply(changed(VERTICES, 4, np.nan)), ("vertex 4", "nan")),
    "with an infinite coordinate": (tiny_scan.ply(changed(VERTICES, 4, np.inf)), ("vertex 4", "inf")),
    "with a coordinate out of this world": (tiny_scan.ply(changed(VERTICES, 4, 1e30)), ("1e+30 m", "metres")),
    "in millimetres": (tiny_scan.ply(1000 * VERTICES), ("5500 m", "millimetres", "metres")),
    "with a face out of range": (tiny_scan.ply(faces=changed(tiny_scan.FACES, 3, 12)), ("12", "vertices")),
    "with a negative face": (tiny_scan.ply(faces=changed(tiny_scan.FACES, 3, -1)), ("-1", "vertices")),
    "with colors of another kind": (tiny_scan.ply().replace(b"uchar red", b"char red"), ("colors", "uchar")),
}


@pytest.mark.parametrize("case", MESHES)
def test_a_damaged_mesh_is_refused(tmp_path, case):
    mesh, words = MESHES[case]
    assert_refused(tiny_scan.write(tmp_path / "scan", mesh=mesh), PLY, *words)


@pytest.mark.parametrize(("scale", "warned"), [(1, False), (10, False), (100, True), (180, True)])
def test_a_mesh_that_spans_more_than_a_room_is_warned_of(tmp_path, scale, warned, caplog):
    read(tmp_path, mesh=tiny_scan.ply(scale * VERTICES))
    assert [("centimetres" in text, f"{5.5 * scale:g} m" in text) for text in caplog.messages] == [
        (True, True)
    ] * warned


def test_a_mesh_with_other_polygons_among_the_triangles_is_refused(tmp_path):
    mesh = bytearray(tiny_scan.ply() + bytes(4))  # one more vertex of the last face
    mesh[-17] = 4
    assert_refused(tiny_scan.write(tmp_path / "scan", mesh=bytes(mesh)), PLY, "triangles")


def test_a_mesh_whose_last_face_is_longer_than_the_file_is_refused(tmp_path):
    mesh = bytearray(tiny_scan.ply())
    mesh[-13] = 4
    assert_refused(tiny_scan.write(tmp_path / "scan", mesh=bytes(mesh)), PLY, "truncated")


@pytest.mark.parametrize("text", [False, True])
@pytest.mark.parametrize(("kind", "top"), [("ushort", 65535), ("float", 1.0), ("double", 1.0)])
def test_colours_of_any_type_are_those_of_bytes(tmp_path, text, kind, top):
    size = {"ushort": "<u2", "float": "<f4", "double": "<f8"}[kind]
    rows = np.zeros(3, [("p", "<f4", 3), ("c", size, 3)])
    rows["p"] = np.eye(3)
    rows["c"] = np.array([[128, 51, 26], [0, 255, 1], [254, 3, 77]]) / 255 * top
    head = ["ply", f"format {'ascii' if text else 'binary_little_endian'} 1.0", "element vertex 3"]
    head += [f"property float {axis}" for axis in "xyz"] + [
        f"property {kind} {name}" for name in ("red", "green", "blue")
    ]
    head += ["element face 1", "property list uchar int vertex_indices", "end_header", ""]
    lines = ["".join(f"{x} " for x in (*row["p"], *row["c"])) for row in rows] + ["3 0 1 2", ""]
    body = "\n".join(lines).encode() if text else rows.tobytes() + b"\3" + np.arange(3, dtype="<i4").tobytes()
    (tmp_path / PLY).write_bytes("\n".join(head).encode() + body)
    assert ply.read(tmp_path / PLY).colors.tolist() == [[128, 51, 26], [0, 255, 1], [254, 3, 77]]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_header_may_end_its_lines_in_any_way_and_hold_any_comment(tmp_path, end):
    head, body = tiny_scan.ply().split(b"end_header\n")
    head = head.replace(b"ply\n", b"ply\ncomment caf\xe9 \x85 of mine\n") + b"end_header\n"
    (tmp_path / PLY).write_bytes(head.replace(b"\n", end.encode()) + body)
    assert np.array_equal(ply.read(tmp_path / PLY).faces, tiny_scan.FACES)


@pytest.mark.parametrize("seed", range(40))
def test_a_mesh_with_a_damaged_byte_is_read_or_refused_but_never_crashes(tmp_path, seed):
    rng = np.random.default_rng(seed)
    mesh = bytearray(tiny_scan.ply(text=bool(seed % 2)))
    mesh[rng.integers(len(mesh))] = rng.integers(256)
    try:
        scan.read(tiny_scan.write(tmp_path / "scan", mesh=bytes(mesh)))
    except InputError as error:
        assert PLY in str(error) and "\n" not in str(error)
