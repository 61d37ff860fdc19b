"""Surfaces and matt materials in a GLB file."""

import numpy as np
import pygltflib as gltf  # type: ignore[import-untyped]

from mjxgait.animation.export.gltf import Buffer
from mjxgait.animation.export.surface import Surface, linear

ROUGHNESS = 0.75


def shaped(buffer: Buffer, surface: Surface, material: int) -> gltf.Primitive:
    """Store a surface. material: its number in the document."""
    points, normals, faces = surface
    indices = faces.astype(np.uint16 if len(points) < 0xFFFF else np.uint32)
    return gltf.Primitive(
        attributes=gltf.Attributes(
            POSITION=buffer.add(points.astype(np.float32), gltf.ARRAY_BUFFER, bounds=True),
            NORMAL=buffer.add(_unit(normals), gltf.ARRAY_BUFFER),
        ),
        indices=buffer.add(indices.reshape(-1), gltf.ELEMENT_ARRAY_BUFFER),
        material=material,
    )


def _unit(vectors: np.ndarray) -> np.ndarray:
    return (vectors / np.linalg.norm(vectors, axis=1, keepdims=True)).astype(np.float32)


def material_of(name: str, colour: np.ndarray) -> gltf.Material:
    """Return a matt material. colour: sRGB and opacity, [4]."""
    look = gltf.PbrMetallicRoughness(
        baseColorFactor=[*map(float, linear(colour[:3])), float(colour[3])],
        metallicFactor=0.0,
        roughnessFactor=ROUGHNESS,
    )
    return gltf.Material(
        name=name,
        pbrMetallicRoughness=look,
        alphaMode="BLEND" if colour[3] < 1 else "OPAQUE",
    )
