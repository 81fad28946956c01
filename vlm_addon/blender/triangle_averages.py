# SPDX-License-Identifier: GPL-3.0-or-later
"""Diffuse reflectance and radiant exitance of each triangle, averaged over its textures; for virtual lights only."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..core.brdf import diffuse_reflectance
from ..core.scene import DIFFUSE, NO_TEXTURE, Float32, Int32, Material, Texture

SAMPLES_PER_SIDE = 4
"""A triangle is averaged over the square of this many points, each standing for its share of the texels."""

CHUNK_TRIANGLES = 65536


def _stratified_barycentrics(side: int) -> Float32:
    """(side², 3): centroids of the side² equal triangles that parallels to the edges cut a triangle into."""
    points = []
    for i in range(side):
        for j in range(side - i):
            points.append((i + 1 / 3, j + 1 / 3))
            if i + j < side - 1:
                points.append((i + 2 / 3, j + 2 / 3))
    uv = np.array(points) / side
    return np.column_stack([1.0 - uv.sum(axis=1), uv]).astype(np.float32)


BARYCENTRICS = _stratified_barycentrics(SAMPLES_PER_SIDE)


class TextureAverager:
    """Averages textures over triangles; keeps the halved pictures of each texture that it has met."""

    def __init__(self, textures: Sequence[Texture]) -> None:
        self._textures = textures
        self._levels: dict[int, list[Float32]] = {}

    def sample(self, index: int, corner_uvs: Float32) -> Float32:
        """(t, s, 4) float32: texture `index` at the s points of each triangle with (t, 3, 2) coordinates.

        Each point reads the halved picture in which a texel is as large as the point's share of the triangle.
        """
        texture = self._textures[index]
        height, width = texture.pixels.shape[:2]
        a, b, c = np.moveaxis(corner_uvs.astype(np.float64), 1, 0)
        edge, other = b - a, c - a
        texels = 0.5 * np.abs(edge[:, 0] * other[:, 1] - edge[:, 1] * other[:, 0]) * width * height
        share = np.maximum(texels / len(BARYCENTRICS), 1.0)
        levels = np.floor(0.5 * np.log2(share)).astype(int)
        points = np.einsum("sk,tkc->tsc", BARYCENTRICS, corner_uvs)
        result = np.empty((len(corner_uvs), len(BARYCENTRICS), 4), np.float32)
        for level in np.unique(levels):
            chosen = levels == level
            result[chosen] = _bilinear(self._picture(index, int(level)), points[chosen], texture.repeat)
        return result

    def _picture(self, index: int, level: int) -> Float32:
        pictures = self._levels.setdefault(index, [self._textures[index].pixels])
        while len(pictures) <= level and max(pictures[-1].shape[:2]) > 1:
            pictures.append(_halved(pictures[-1]))
        return pictures[min(level, len(pictures) - 1)]


def _halved(picture: Float32) -> Float32:
    height, width = picture.shape[:2]
    padded = np.pad(picture, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    rows = 0.5 * (padded[0::2] + padded[1::2])
    return (0.5 * (rows[:, 0::2] + rows[:, 1::2])).astype(np.float32)


def _bilinear(picture: Float32, uv: Float32, repeat: bool) -> Float32:
    height, width = picture.shape[:2]
    result: Float32 = np.zeros((*uv.shape[:-1], 4), np.float32)
    # Floor and fraction in float64: large coordinates of tiled floors lose the fraction in float32.
    x, y = uv[..., 0].astype(np.float64) * width - 0.5, uv[..., 1].astype(np.float64) * height - 0.5
    left, low = np.floor(x), np.floor(y)
    for dx in (0, 1):
        for dy in (0, 1):
            weight = np.abs(1 - dx - (x - left)) * np.abs(1 - dy - (y - low))
            column, row = _wrapped(left + dx, width, repeat), _wrapped(low + dy, height, repeat)
            result += (weight[..., None] * picture[row, column]).astype(np.float32)
    return result


def _wrapped(index: np.ndarray, size: int, repeat: bool) -> np.ndarray:
    wrapped = np.mod(index, size) if repeat else np.clip(index, 0, size - 1)
    return np.nan_to_num(wrapped).astype(np.int64)


def triangle_averages(
    materials: Sequence[Material],
    averager: TextureAverager,
    material_indices: Int32,
    corner_uvs: Float32,
    corner_colors: Float32,
) -> tuple[Float32, Float32]:
    """Diffuse reflectance and radiant exitance (W/m², pi times radiance) of each triangle: two (t, 3) float32.

    Both are what the surface sends out where it is not transparent, times its alpha. The share that the specular
    layer takes is that of the mean roughness.
    """
    reflectance = np.zeros((len(material_indices), 3), np.float32)
    emission = np.zeros((len(material_indices), 3), np.float32)
    for index in np.unique(material_indices):
        triangles = np.flatnonzero(material_indices == index)
        for start in range(0, len(triangles), CHUNK_TRIANGLES):
            chosen = triangles[start : start + CHUNK_TRIANGLES]
            colors = corner_colors[chosen] if len(corner_colors) else corner_colors
            values = _averages(materials[index], averager, corner_uvs[chosen], colors)
            reflectance[chosen], emission[chosen] = values
    return reflectance, emission


def _averages(
    material: Material, averager: TextureAverager, corner_uvs: Float32, corner_colors: Float32
) -> tuple[Float32, Float32]:
    count = len(corner_uvs)

    def texels(texture: int) -> Float32:
        return averager.sample(texture, corner_uvs)

    def number(value: float, texture: int, channel: int) -> Float32:
        if texture == NO_TEXTURE:
            return np.full((1, 1), value, np.float32)
        return value * texels(texture)[..., channel]

    def color(value: tuple[float, float, float], texture: int) -> Float32:
        constant = np.array(value, np.float32)[None, None]
        return constant if texture == NO_TEXTURE else constant * texels(texture)[..., :3]

    base = color(material.base_color, material.base_color_texture)
    if material.base_color_from_corners and len(corner_colors):
        base = base * np.einsum("sk,tkc->tsc", BARYCENTRICS, corner_colors)
    alpha = number(material.alpha, material.alpha_texture, material.alpha_channel)
    metallic = number(material.metallic, material.metallic_texture, material.metallic_channel)
    roughness = number(material.roughness, material.roughness_texture, material.roughness_channel)
    # Base colour, alpha and metallic are averaged as their product; the specular layer needs one roughness.
    matt = (base * (alpha * (1.0 - np.clip(metallic, 0.0, 1.0)))[..., None]).mean(axis=1)
    if material.model == DIFFUSE:
        matt = (base * alpha[..., None]).mean(axis=1)
    reflectance = diffuse_reflectance(
        matt, 0.0, material.ior, material.specular_ior_level, roughness.mean(axis=1), material.model
    )
    radiance = (color(material.emission, material.emission_texture) * alpha[..., None]).mean(axis=1)
    shape = (count, 3)
    return np.broadcast_to(reflectance, shape), np.broadcast_to(np.pi * radiance, shape)
