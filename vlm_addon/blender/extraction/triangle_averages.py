# SPDX-License-Identifier: GPL-3.0-or-later
"""Diffuse reflectance and radiant exitance of each triangle, averaged over its textures; for virtual lights only."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...core.brdf import diffuse_reflectance
from ...core.scene import DIFFUSE, NO_TEXTURE, Float32, Float64, Int32, Material, Texture

POINTS_PER_SIDE = ((0.0, 2), (256.0, 4), (16384.0, 16))
"""A triangle of at least so many texels is averaged over the square of so many points, each standing for its share."""

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


BARYCENTRICS = {side: _stratified_barycentrics(side) for _, side in POINTS_PER_SIDE}


class TextureAverager:
    """Averages textures over triangles; keeps the halved pictures of each texture that it has met."""

    def __init__(self, textures: Sequence[Texture]) -> None:
        self._textures = textures
        self._levels: dict[int, list[Float32]] = {}

    def texels(self, index: int, corner_uvs: Float32) -> Float64:
        """(t,) how many texels of texture `index` each triangle with (t, 3, 2) coordinates covers."""
        height, width = self._textures[index].pixels.shape[:2]
        a, b, c = np.moveaxis(corner_uvs.astype(np.float64), 1, 0)
        edge, other = b - a, c - a
        return 0.5 * np.abs(edge[:, 0] * other[:, 1] - edge[:, 1] * other[:, 0]) * width * height

    def sample(self, index: int, corner_uvs: Float32, barycentrics: Float32) -> Float32:
        """(t, s, 4) float32: texture `index` at s points of each triangle with (t, 3, 2) coordinates.

        Each point reads the halved picture in which a texel is as large as the point's share of the triangle.
        """
        share = np.maximum(self.texels(index, corner_uvs) / len(barycentrics), 1.0)
        levels = np.floor(0.5 * np.log2(share)).astype(int)
        points = np.matmul(barycentrics, np.nan_to_num(corner_uvs))
        result = np.empty((len(corner_uvs), len(barycentrics), 4), np.float32)
        for level in np.unique(levels):
            chosen = levels == level
            result[chosen] = _bilinear(self._picture(index, int(level)), points[chosen], self._textures[index].repeat)
        return result

    def halve_all(self) -> None:
        """Make all halved pictures before they are needed; may be called in a thread."""
        for index in range(len(self._textures)):
            if index not in self._levels:
                pictures = [self._textures[index].pixels]
                while max(pictures[-1].shape[:2]) > 1:
                    pictures.append(_halved(pictures[-1]))
                self._levels.setdefault(index, pictures)

    def _picture(self, index: int, level: int) -> Float32:
        pictures = self._levels.setdefault(index, [self._textures[index].pixels])
        while len(pictures) <= level and max(pictures[-1].shape[:2]) > 1:
            pictures.append(_halved(pictures[-1]))
        return pictures[min(level, len(pictures) - 1)]


def _halved(picture: Float32) -> Float32:
    height, width = picture.shape[:2]
    odd = height % 2 or width % 2
    padded = np.pad(picture, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge") if odd else picture
    rows = 0.5 * (padded[0::2] + padded[1::2])
    return (0.5 * (rows[:, 0::2] + rows[:, 1::2])).astype(np.float32)


def _bilinear(picture: Float32, uv: Float32, repeat: bool) -> Float32:
    height, width = picture.shape[:2]
    columns, across = _neighbours(uv[..., 0], width, repeat)
    rows, up = _neighbours(uv[..., 1], height, repeat)
    texels = picture.reshape(-1, 4)
    low, high = (
        (1.0 - across) * texels[row * width + columns[0]] + across * texels[row * width + columns[1]] for row in rows
    )
    return np.asarray((1.0 - up) * low + up * high, np.float32)


def _neighbours(coordinate: Float32, size: int, repeat: bool) -> tuple[list[Int32], Float32]:
    """Both texels beside a coordinate, and (..., 1) how far it is from the first towards the second."""
    # In float64: large coordinates of tiled floors lose the fraction in float32.
    scaled = coordinate.astype(np.float64) * size - 0.5
    first = np.floor(scaled)
    fraction = (scaled - first).astype(np.float32)[..., None]
    both = (first, first + 1.0)
    wrapped = [np.mod(index, size) if repeat else np.clip(index, 0, size - 1) for index in both]
    return [index.astype(np.int32) for index in wrapped], fraction


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
    """`triangle_averages` of triangles of one material: more points where a triangle covers more texels."""
    textures = [index for index in _textures(material) if index != NO_TEXTURE]
    texels = np.max([averager.texels(index, corner_uvs) for index in textures] or [np.zeros(len(corner_uvs))], axis=0)
    reflectance, emission = np.empty((2, len(corner_uvs), 3), np.float32)
    classes = np.searchsorted([least for least, _ in POINTS_PER_SIDE], texels, side="right") - 1
    for number in np.unique(classes):
        chosen = classes == number
        colors = corner_colors[chosen] if len(corner_colors) else corner_colors
        barycentrics = BARYCENTRICS[POINTS_PER_SIDE[number][1]]
        found = _averages_over(material, averager, corner_uvs[chosen], colors, barycentrics)
        reflectance[chosen], emission[chosen] = found
    return reflectance, emission


def _textures(material: Material) -> tuple[int, ...]:
    """The textures that decide what a material reflects and emits."""
    return (
        material.base_color_texture,
        material.alpha_texture,
        material.metallic_texture,
        material.roughness_texture,
        material.emission_texture,
    )


def _averages_over(
    material: Material, averager: TextureAverager, corner_uvs: Float32, corner_colors: Float32, barycentrics: Float32
) -> tuple[Float32, Float32]:
    sampled: dict[int, Float32] = {}

    def texels(texture: int) -> Float32:
        if texture not in sampled:
            sampled[texture] = averager.sample(texture, corner_uvs, barycentrics)
        return sampled[texture]

    def number(value: float, texture: int, channel: int) -> Float32:
        if texture == NO_TEXTURE:
            return np.full((1, 1), value, np.float32)
        return value * texels(texture)[..., channel]

    def color(value: tuple[float, float, float], texture: int) -> Float32:
        constant = np.array(value, np.float32)[None, None]
        return constant if texture == NO_TEXTURE else constant * texels(texture)[..., :3]

    base = color(material.base_color, material.base_color_texture)
    if material.base_color_from_corners and len(corner_colors):
        base = base * np.matmul(barycentrics, corner_colors)
    alpha = number(material.alpha, material.alpha_texture, material.alpha_channel)
    metallic = number(material.metallic, material.metallic_texture, material.metallic_channel)
    roughness = number(material.roughness, material.roughness_texture, material.roughness_channel)
    # Base colour, alpha and metallic are averaged as their product; the specular layer needs one roughness.
    share = alpha if material.model == DIFFUSE else alpha * (1.0 - np.clip(metallic, 0.0, 1.0))
    matt = (base * share[..., None]).mean(axis=1)
    reflectance = diffuse_reflectance(
        matt, 0.0, material.ior, material.specular_ior_level, roughness.mean(axis=1), material.model
    )
    radiance = (color(material.emission, material.emission_texture) * alpha[..., None]).mean(axis=1)
    shape = (len(corner_uvs), 3)
    return np.broadcast_to(reflectance, shape), np.broadcast_to(np.pi * radiance, shape)
