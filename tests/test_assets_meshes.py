"""Meshes from files: triangles in place, and what is refused."""

from __future__ import annotations

import copy
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from warp_caustics.assets import Assets, TriangleMesh, load_assets
from warp_caustics.errors import InputError
from warp_caustics.scene import Scene, load_scene

PLAIN: dict[str, Any] = {
    "name": "own",
    "water": {"level": 5.0, "waves": []},
    "sun": {"direction": [0, 0, -1]},
    "medium": {"ior": 1.333},
    "map": {"origin": [0, 0], "size": [1, 1], "resolution": [8, 8]},
}
# A square and a triangle that stands on it.
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1.0]])
OBJ_VERTICES = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
OBJ = OBJ_VERTICES + "f 1 2 3 4\nf 1 2 5\n"
PLY_HEADER = """ply
format {kind} 1.0
element vertex 5
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
"""
FACES = [(0, 1, 2, 3), (0, 1, 4)]


def assets_of(receiver: dict[str, Any]) -> Assets:
    """Load the files of a receiver."""
    return load_assets(Scene(**copy.deepcopy(PLAIN), receiver=receiver))


def mesh_of(path: Path) -> TriangleMesh:
    """Load a file as the receiver's mesh."""
    mesh = assets_of({"mesh": str(path)}).mesh
    assert mesh is not None
    return mesh


def refusal_of(path: Path) -> str:
    """Return the message with which a file is refused as the receiver's mesh."""
    with pytest.raises(InputError) as caught:
        mesh_of(path)
    message = str(caught.value)
    assert "\n" not in message
    return message.removeprefix("own: receiver.mesh: ")


def written(folder: Path, content: str | bytes, name: str = "rock.obj") -> Path:
    """Write a mesh file and return its path."""
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder / name


def ply(kind: str) -> bytes:
    """Return the mesh as PLY."""
    header = PLY_HEADER.format(kind=kind).encode()
    if kind == "ascii":
        lines = [" ".join(map(str, corner)) for corner in CORNERS.tolist()]
        lines += [" ".join(map(str, (len(face), *face))) for face in FACES]
        return header + "\n".join(lines).encode() + b"\n"
    order = ">" if "big" in kind else "<"
    body = CORNERS.astype(order + "f4").tobytes()
    return header + body + b"".join(struct.pack(f"{order}B{len(face)}i", len(face), *face) for face in FACES)


def areas(mesh: TriangleMesh) -> np.ndarray:
    """Return the area of each triangle."""
    a, b, c = mesh.vertices[mesh.triangles].transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def check_tent(mesh: TriangleMesh) -> None:
    """See that a mesh is the square, in two triangles, and the triangle on it."""
    assert mesh.vertices.dtype == np.float64
    assert mesh.triangles.dtype == np.int32
    assert mesh.triangles.shape == (3, 3)
    np.testing.assert_allclose(sorted(areas(mesh)), [0.5, 0.5, np.sqrt(1.25) / 2], rtol=1e-6)  # float32 in the file


def test_polygons_are_cut_into_triangles(tmp_path: Path) -> None:
    mesh = mesh_of(written(tmp_path, OBJ))
    check_tent(mesh)
    np.testing.assert_array_equal(mesh.vertices, CORNERS)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_in_each_of_its_kinds(tmp_path: Path, kind: str) -> None:
    check_tent(mesh_of(written(tmp_path, ply(kind), "rock.ply")))


@pytest.mark.parametrize("suffix", ["stl", "vtp", "ply"])
def test_what_pyvista_writes_is_read(tmp_path: Path, suffix: str) -> None:
    import pyvista

    pyvista.read(written(tmp_path, OBJ)).triangulate().save(tmp_path / f"rock.{suffix}")
    check_tent(mesh_of(tmp_path / f"rock.{suffix}"))


def test_lines_and_points_are_left_out(tmp_path: Path) -> None:
    check_tent(mesh_of(written(tmp_path, OBJ + "l 1 2\nl 2 3 4\np 5\n")))


def test_degenerate_triangles_stay(tmp_path: Path) -> None:
    mesh = mesh_of(written(tmp_path, OBJ_VERTICES + "f 1 1 2\nf 1 2 3\n"))
    assert mesh.triangles.tolist() == [[0, 0, 1], [0, 1, 2]]


def test_objects_are_scaled_then_moved_and_merged(tmp_path: Path) -> None:
    path = str(written(tmp_path, OBJ))
    objects = [{"mesh": path, "scale": 0.5, "translate": [10.0, 20.0, 1.0]}, {"mesh": path}]
    merged = assets_of({"plane": 0.0, "objects": objects}).objects
    assert merged is not None
    np.testing.assert_allclose(merged.vertices[:5], CORNERS * 0.5 + [10.0, 20.0, 1.0])
    np.testing.assert_array_equal(merged.vertices[5:], CORNERS)
    assert merged.triangles.dtype == np.int32
    np.testing.assert_array_equal(merged.triangles[3:], merged.triangles[:3] + 5)


def test_far_objects_keep_their_digits(tmp_path: Path) -> None:
    objects = [{"mesh": str(written(tmp_path, OBJ)), "translate": [1e7, 0.0, 0.0]}]
    merged = assets_of({"plane": 0.0, "objects": objects}).objects
    assert merged is not None
    np.testing.assert_array_equal(merged.vertices[:, 0] - 1e7, CORNERS[:, 0])


def test_the_rock_of_the_tank_stands_on_the_floor_under_water() -> None:
    tank = load_scene("tank")
    rock = load_assets(tank).objects
    assert rock is not None
    low, high = rock.vertices.min(axis=0), rock.vertices.max(axis=0)
    assert low[2] == tank.receiver.plane
    assert high[2] < tank.water.level - 0.2  # well under the waves
    assert np.all(low[:2] > 0.5)
    assert np.all(high[:2] < 1.5)
    edges = np.sort(rock.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert np.all(np.unique(edges, axis=0, return_counts=True)[1] == 2)  # closed
    a, b, c = rock.vertices[rock.triangles].transpose(1, 0, 2)
    assert np.sum(a * np.cross(b, c)) > 0.0  # its faces look outwards


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (OBJ_VERTICES, "expected a mesh with triangles, got none"),
        (OBJ_VERTICES + "l 1 2\n", "expected a mesh with triangles, got none"),
        ("", "expected a mesh with triangles, got none"),
        ("garbage\n", "expected a mesh with triangles, got none"),
        (OBJ.replace("v 1.0 1.0 0.0", "v 1.0 nan 0.0"), "expected finite vertices, got 1 that are not, the first is 2"),
        (OBJ + "f 1 2 9\n", "expected cells of its 5 vertices, got one that names another"),
        (OBJ_VERTICES + "f 1 2\n", "cannot be read as a mesh: "),
    ],
    ids=["no faces", "lines", "empty", "garbage", "nan", "index", "two corners"],
)
def test_an_obj_without_sound_triangles_is_refused(tmp_path: Path, content: str, message: str) -> None:
    assert message in refusal_of(written(tmp_path, content))


@pytest.mark.parametrize("suffix", ["ply", "stl", "vtp"])
@pytest.mark.parametrize("content", [b"", b"garbage\n"])
def test_a_file_of_another_kind_is_refused(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = written(tmp_path, content, f"rock.{suffix}")
    assert str(path) in refusal_of(path)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_a_ply_that_is_cut_short_anywhere_is_refused(tmp_path: Path, kind: str) -> None:
    whole = ply(kind)
    # VTK's reader kills the process on many of these. Cut to words, text ends where a number ends.
    ends = range(3, len(whole)) if kind != "ascii" else [i for i, c in enumerate(whole[:-1]) if c in b" \n"]
    for end in ends:
        message = refusal_of(written(tmp_path, whole[:end], "rock.ply"))
        assert "PLY" in message, end


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"vertex 5", b"vertex -5"),
        (b"vertex 5", b"vertex many"),
        (b"float x", b"quaternion x"),
        (b"element vertex 5\n", b""),
        (b"list uchar", b"list char"),
    ],
)
def test_a_ply_with_a_damaged_header_or_list_is_refused(tmp_path: Path, old: bytes, new: bytes) -> None:
    content = ply("ascii").replace(old, new).replace(b"\n3 0 1 4", b"\n-3 0 1 4")
    assert "damaged" in refusal_of(written(tmp_path, content, "rock.ply"))


def test_damaged_meshes_say_nothing_beside_their_error(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], recwarn: pytest.WarningsRecorder
) -> None:
    import pyvista

    pyvista.read(written(tmp_path, OBJ)).triangulate().save(tmp_path / "rock.stl")
    whole = (tmp_path / "rock.stl").read_bytes()
    refusal_of(written(tmp_path, whole[: len(whole) // 2], "rock.stl"))
    refusal_of(written(tmp_path, "<VTKFile", "rock.vtp"))
    captured = capfd.readouterr()
    assert (captured.out, captured.err) == ("", "")
    assert not recwarn.list
