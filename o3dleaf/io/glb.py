"""glTF 2.0 in one binary file (.glb) for browsers and Blender: meters, y up, one primitive a label.

Numbers are float32 by the format's definition. The mesh stands around its own middle, which the node
holds in double precision, so that a leaf half a meter from the origin keeps its hairs.
"""

import json
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.atomic_files import claim
from o3dleaf.io.mesh_data import MeshData

MAGIC, VERSION, JSON_CHUNK, BIN_CHUNK = 0x46546C67, 2, 0x4E4F534A, 0x004E4942
FLOAT, UINT = 5126, 5125
VERTICES, INDICES = 34962, 34963
COLORS = ((0.22, 0.45, 0.16), (0.42, 0.58, 0.32), (0.55, 0.52, 0.28))
"""Base colors (linear RGB) of the labels, in turn."""
Z_TO_Y = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)
"""The rotation (quaternion x, y, z, w) that takes our z, up, to glTF's y."""


def write_glb(out: IO[bytes], mesh: MeshData, name: str) -> None:
    """Write one glTF scene of a mesh that is in meters and has normals."""
    middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    positions = (mesh.vertices - middle).astype("<f4")
    normals = np.zeros_like(positions) if mesh.normals is None else mesh.normals.astype("<f4")
    arrays: list[npt.NDArray[Any]] = [positions, normals]
    accessors: list[dict[str, Any]] = [
        {"bufferView": 0, "componentType": FLOAT, "count": len(positions), "type": "VEC3"}
        | {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()},
        {"bufferView": 1, "componentType": FLOAT, "count": len(normals), "type": "VEC3"},
    ]
    primitives, materials = [], []
    for number, (label, triangles) in enumerate(mesh.parts(name)):
        accessors.append({"bufferView": len(arrays), "componentType": UINT, "count": triangles.size, "type": "SCALAR"})
        arrays.append(triangles.astype("<u4"))
        attributes = {"POSITION": 0, "NORMAL": 1}
        primitives.append({"attributes": attributes, "indices": len(accessors) - 1, "material": number})
        materials.append(_material(label, COLORS[number % len(COLORS)]))
    node = {"mesh": 0, "name": name, "rotation": Z_TO_Y, "translation": [middle[0], middle[2], -middle[1]]}
    scene: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "o3dleaf"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [node],
        "meshes": [{"name": name, "primitives": primitives}],
        "materials": materials,
        "accessors": accessors,
        "bufferViews": _views(arrays),
        "buffers": [{"byteLength": sum(array.nbytes for array in arrays)}],
    }
    _write_chunks(out, scene, arrays)


def _material(label: str, color: tuple[float, float, float]) -> dict[str, Any]:
    """Return a matt material; open sheets are seen from both sides."""
    rough = {"baseColorFactor": [*color, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8}
    return {"name": label, "pbrMetallicRoughness": rough, "doubleSided": True}


def _views(arrays: list[npt.NDArray[Any]]) -> list[dict[str, int]]:
    """Return where each array lies in the buffer: all are of 4-byte numbers, so that none needs filling up."""
    views, offset = [], 0
    for array in arrays:
        target = INDICES if array.dtype.kind == "u" else VERTICES
        views.append({"buffer": 0, "byteOffset": offset, "byteLength": array.nbytes, "target": target})
        offset += array.nbytes
    return views


def _write_chunks(out: IO[bytes], scene: dict[str, Any], arrays: list[npt.NDArray[Any]]) -> None:
    """Write the header, the scene and the numbers."""
    text = json.dumps(scene, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    size = scene["buffers"][0]["byteLength"]
    claim(out, 28 + len(text) + size)
    out.write(np.array([MAGIC, VERSION, 28 + len(text) + size, len(text), JSON_CHUNK], dtype="<u4").tobytes())
    out.write(text)
    out.write(np.array([size, BIN_CHUNK], dtype="<u4").tobytes())
    for array in arrays:
        out.write(array.tobytes())
