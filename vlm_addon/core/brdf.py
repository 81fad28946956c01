# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflectance of the Diffuse and the Principled shader as Cycles 4.x and 5.x evaluates them; the shaders' oracle.

Principled here is a metal with Schlick's Fresnel mixed by `metallic` with a dielectric interface over a Lambertian
base. Both interfaces are GGX with height-correlated Smith shadowing (Heitz 2014) times the multiple-scattering gain
of Kulla and Conty 2017, because "Multiscatter GGX" is the distribution that Blender's node starts with. The base
receives what the interface does not reflect: 1 - albedo of the interface in the direction of the eye.

All cosines are against the shading normal, all angles of the light and the eye on its upper side; reflectances are
dimensionless, BRDFs in 1/sr.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from .errors import InvalidInput
from .scene import DIFFUSE, PRINCIPLED, Float32, Float64

ALBEDO_TABLE_SIZE = 16
_QUADRATURE_POINTS = 40
MAX_F0 = 0.99
"""Blender's own bound, so that the index of refraction stays finite."""


def f0_from_ior(ior: npt.ArrayLike) -> Float64:
    """Reflectance at normal incidence of a dielectric interface."""
    ior = np.asarray(ior, np.float64)
    root: Float64 = (ior - 1.0) / (ior + 1.0)
    return root * root


def ior_from_f0(f0: npt.ArrayLike) -> Float64:
    """Index of refraction (at least 1) whose reflectance at normal incidence is `f0`."""
    root = np.sqrt(np.clip(f0, 0.0, MAX_F0))
    return (1.0 + root) / (1.0 - root)


def specular_ior(ior: npt.ArrayLike, specular_ior_level: npt.ArrayLike) -> Float64:
    """Index of refraction that the specular layer uses: a level of 0.5 leaves `ior`, others scale its F0 by 2 level."""
    ior = np.maximum(np.asarray(ior, np.float64), 1e-5)
    level = np.maximum(np.asarray(specular_ior_level, np.float64), 0.0)
    scaled = ior_from_f0(f0_from_ior(ior) * 2.0 * level)
    return np.where(level == 0.5, ior, np.where(ior < 1.0, 1.0 / scaled, scaled))


def fresnel_dielectric(cos_incident: npt.ArrayLike, ior: npt.ArrayLike) -> Float64:
    """Unpolarised Fresnel reflectance of an interface of relative index `ior`, 1 under total internal reflection."""
    c, ior = np.broadcast_arrays(np.abs(np.asarray(cos_incident, np.float64)), np.asarray(ior, np.float64))
    g_squared = ior * ior - 1.0 + c * c
    g = np.sqrt(np.maximum(g_squared, 1e-30))
    a = (g - c) / (g + c)
    b = ((g + c) * c - 1.0) / ((g - c) * c + 1.0)
    return np.where(g_squared > 0.0, 0.5 * a * a * (1.0 + b * b), 1.0)


def fresnel_dielectric_average(ior: npt.ArrayLike) -> Float64:
    """Cosine-weighted hemispherical mean of `fresnel_dielectric`: fits of Kulla and Conty 2017."""
    ior = np.asarray(ior, np.float64)
    below = 0.997118 + ior * (0.1014 - ior * (0.965241 + ior * 0.130607))
    above = (ior - 1.0) / (4.08567 + 1.00071 * ior)
    return np.where(ior < 1.0, below, above)


def _smith_lambda(alpha: npt.ArrayLike, cosine: npt.ArrayLike) -> Float64:
    alpha, cosine = np.asarray(alpha, np.float64), np.asarray(cosine, np.float64)
    tan_squared = np.maximum(1.0 / np.maximum(cosine * cosine, 1e-30) - 1.0, 0.0)
    return 0.5 * (np.sqrt(1.0 + alpha * alpha * tan_squared) - 1.0)


def ggx_brdf(
    cos_half: npt.ArrayLike, cos_light: npt.ArrayLike, cos_view: npt.ArrayLike, roughness: npt.ArrayLike
) -> Float64:
    """Single-scatter GGX reflection without Fresnel, times nothing: D G / (4 cos_light cos_view), 1/sr."""
    alpha = np.asarray(roughness, np.float64) ** 2
    cos_half, cos_light, cos_view = (np.asarray(c, np.float64) for c in (cos_half, cos_light, cos_view))
    denominator = 1.0 - (1.0 - alpha * alpha) * cos_half * cos_half
    distribution = alpha * alpha / (np.pi * denominator * denominator)
    shadowing = 1.0 / (1.0 + _smith_lambda(alpha, cos_light) + _smith_lambda(alpha, cos_view))
    return distribution * shadowing / (4.0 * cos_light * cos_view)


def _visible_normal_quadrature(alpha: float, cos_view: float) -> tuple[Float64, Float64]:
    """Cosines view-to-half-vector and weights G2/G1 of reflections of one view, each weight divided by their number.

    Visible-normal sampling (Heitz 2018, JCGT 7:4) at Gauss-Legendre points of the disk; good to 1e-3.
    """
    nodes, node_weights = np.polynomial.legendre.leggauss(_QUADRATURE_POINTS)
    # Height w over the disk instead of the radius: r^2 = 1 - w^2 keeps the square root of the reprojection smooth.
    height = 0.5 * (nodes + 1.0)
    w_r = node_weights * height
    # The half disk phi in [0, pi] is a mirror image of the other for this view, once phi starts on the mirror plane.
    phi, w_phi = 0.5 * np.pi * nodes, 0.5 * node_weights
    r, angle = np.meshgrid(np.sqrt(1.0 - height * height), phi, indexing="ij")
    weight = np.outer(w_r, w_phi)
    sin_view = np.sqrt(max(0.0, 1.0 - cos_view * cos_view))
    stretched = np.array([alpha * sin_view, 0.0, cos_view])
    stretched /= np.linalg.norm(stretched)
    # Disk axes: t1 across the plane of view and normal, t2 within it; angle is measured from t1.
    t1, t2 = np.array([0.0, 1.0, 0.0]), np.array([-stretched[2], 0.0, stretched[0]])
    x, y = r * np.cos(angle), r * np.sin(angle)
    s = 0.5 * (1.0 + stretched[2])
    y = (1.0 - s) * np.sqrt(np.maximum(0.0, 1.0 - x * x)) + s * y
    z = np.sqrt(np.maximum(0.0, 1.0 - x * x - y * y))
    half = x[..., None] * t1 + y[..., None] * t2 + z[..., None] * stretched
    half[..., 0] *= alpha
    half[..., 1] *= alpha
    half[..., 2] = np.maximum(half[..., 2], 0.0)
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    view = np.array([sin_view, 0.0, cos_view])
    cos_vh = np.clip(half @ view, 0.0, 1.0)
    cos_light = 2.0 * cos_vh * half[..., 2] - cos_view
    lambda_view = _smith_lambda(alpha, cos_view)
    lambda_light = _smith_lambda(alpha, np.maximum(cos_light, 1e-9))
    ratio = (1.0 + lambda_view) / (1.0 + lambda_view + lambda_light)
    return cos_vh.ravel(), (weight * np.where(cos_light > 0.0, ratio, 0.0)).ravel()


@lru_cache(maxsize=1)
def albedo_table() -> Float32:
    """Directional albedo of GGX interfaces: (16, 16, 16, 4) float32 indexed [fresnel, cosine, roughness, channel].

    Coordinates run over [0, 1] with the first and last entry on the ends: sqrt(sqrt(F0)) of the interface, square
    root of the cosine of the view, roughness. Channels: 0, s, with which F0 + (1 - F0) s is the Fresnel reflectance
    averaged over the visible normals; 1, albedo E of the interface with a Fresnel reflectance of 1; 2, its
    cosine-weighted mean over views (Kulla and Conty 2017); 3, cosine-weighted mean over views of the albedo of the
    interface with multiple scattering, as `interface_albedo` gives it.
    """
    coordinate = np.linspace(0.0, 1.0, ALBEDO_TABLE_SIZE)
    f0 = coordinate**4
    ior = np.where(f0 < 1.0, (1.0 + coordinate**2) / np.maximum(1.0 - coordinate**2, 1e-6), 1e6)
    table = np.zeros((ALBEDO_TABLE_SIZE,) * 3 + (4,))
    for r, roughness in enumerate(coordinate):
        # A mirror is the limit of small roughness; at exactly 0 the formulas divide 0 by 0.
        alpha = max(roughness, 1e-3) ** 2
        for m, root_cosine in enumerate(coordinate):
            cos_vh, weight = _visible_normal_quadrature(alpha, max(root_cosine, 1e-3) ** 2)
            total = weight.sum()
            reflected = fresnel_dielectric(cos_vh[None], ior[:, None]) @ weight / total
            with np.errstate(invalid="ignore", divide="ignore"):
                s = (reflected - f0) / (1.0 - f0)
            s[-1] = s[-2]
            s[0] = s[1]
            table[:, m, r, 0] = np.clip(s, 0.0, 1.0)
            table[:, m, r, 1] = total
    # Mean over the hemisphere: integral of 2 mu dmu with mu = u^2, so 4 u^3 du, u being the table's coordinate.
    hemisphere = _interpolation_weights(coordinate)
    table[..., 2] = np.einsum("m,fmr->fr", hemisphere, table[..., 1])[:, None, :]
    gain = _scattering_gain(table[..., 1], table[..., 2], fresnel_dielectric_average(ior)[:, None, None])
    albedo = (f0[:, None, None] + (1.0 - f0[:, None, None]) * table[..., 0]) * table[..., 1] * gain
    table[..., 3] = np.einsum("m,fmr->fr", hemisphere, albedo)[:, None, :]
    return np.ascontiguousarray(table, np.float32)


def _interpolation_weights(coordinate: Float64) -> Float64:
    """Weights by which values at `coordinate`, interpolated linearly in u, integrate against 4 u^3 du over [0, 1]."""
    step = coordinate[1] - coordinate[0]
    nodes, node_weights = np.polynomial.legendre.leggauss(4)
    weights = np.zeros_like(coordinate)
    for i, start in enumerate(coordinate[:-1]):
        fraction = 0.5 * (nodes + 1.0)
        density = 0.5 * step * node_weights * 4.0 * (start + fraction * step) ** 3
        weights[i] += (density * (1.0 - fraction)).sum()
        weights[i + 1] += (density * fraction).sum()
    return weights


def _scattering_gain(albedo: npt.ArrayLike, mean_albedo: npt.ArrayLike, mean_fresnel: npt.ArrayLike) -> Float64:
    """Factor on a single-scatter lobe that makes up for light scattered more than once (Kulla and Conty 2017)."""
    albedo, mean_albedo, mean_fresnel = (np.asarray(a, np.float64) for a in (albedo, mean_albedo, mean_fresnel))
    multiple = mean_fresnel * mean_albedo / (1.0 - mean_fresnel * (1.0 - mean_albedo))
    return 1.0 + multiple * (1.0 - albedo) / albedo


def lookup_albedo(ior: npt.ArrayLike, cos_view: npt.ArrayLike, roughness: npt.ArrayLike) -> Float64:
    """The four channels of `albedo_table` interpolated linearly: (..., 4) for inputs broadcast to (...)."""
    fresnel = np.sqrt(np.sqrt(f0_from_ior(ior)))
    coordinates = np.broadcast_arrays(fresnel, np.sqrt(np.clip(cos_view, 0.0, 1.0)), np.asarray(roughness, np.float64))
    table = albedo_table().astype(np.float64)
    result: Float64 = np.zeros((*coordinates[0].shape, 4))
    scaled = [np.clip(c, 0.0, 1.0) * (ALBEDO_TABLE_SIZE - 1) for c in coordinates]
    lower = [np.minimum(np.floor(c).astype(int), ALBEDO_TABLE_SIZE - 2) for c in scaled]
    fraction = [c - i for c, i in zip(scaled, lower, strict=True)]
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod([f if bit else 1.0 - f for f, bit in zip(fraction, corner, strict=True)], axis=0)
        index = tuple(i + bit for i, bit in zip(lower, corner, strict=True))
        result += weight[..., None] * table[index]
    return result


def interface_albedo(ior: npt.ArrayLike, cos_view: npt.ArrayLike, roughness: npt.ArrayLike) -> Float64:
    """Share of the light from direction `cos_view` that the dielectric layer reflects, multiple scattering included."""
    s, albedo, mean_albedo, _ = np.moveaxis(lookup_albedo(ior, cos_view, roughness), -1, 0)
    f0 = f0_from_ior(ior)
    return (f0 + (1.0 - f0) * s) * albedo * _scattering_gain(albedo, mean_albedo, fresnel_dielectric_average(ior))


def diffuse_reflectance(
    base_color: npt.ArrayLike,
    metallic: npt.ArrayLike,
    ior: npt.ArrayLike,
    specular_ior_level: npt.ArrayLike,
    roughness: npt.ArrayLike,
    model: str,
) -> Float32:
    """Share of the irradiance that leaves a surface diffusely, averaged over views: (..., 3) float32.

    base_color: (..., 3) linear Rec.709; the other values broadcast against its leading shape. DIFFUSE reflects its
    base colour; PRINCIPLED base_color (1 - metallic) (1 - mean albedo of the specular layer). Raises InvalidInput for
    another model. This is what the colour of a virtual light is made of.
    """
    color = np.asarray(base_color, np.float64)
    if model == DIFFUSE:
        return color.astype(np.float32)
    if model != PRINCIPLED:
        raise InvalidInput("material", f"{model!r} is not a shading model", f"use {DIFFUSE} or {PRINCIPLED}")
    mean_albedo = lookup_albedo(specular_ior(ior, specular_ior_level), 1.0, np.clip(roughness, 0.0, 1.0))[..., 3]
    share = (1.0 - np.clip(metallic, 0.0, 1.0)) * (1.0 - mean_albedo)
    return (color * share[..., None]).astype(np.float32)


def principled_brdf(
    normal: npt.ArrayLike,
    to_light: npt.ArrayLike,
    to_view: npt.ArrayLike,
    base_color: npt.ArrayLike,
    metallic: npt.ArrayLike,
    roughness: npt.ArrayLike,
    ior: npt.ArrayLike,
    specular_ior_level: npt.ArrayLike,
) -> Float64:
    """BRDF of the Principled shader in 1/sr, (..., 3); 0 where the light or the eye is below the surface.

    normal, to_light, to_view: (..., 3) unit vectors.
    """
    n, light, v = (np.asarray(a, np.float64) for a in (normal, to_light, to_view))
    color, metallic, roughness = (np.asarray(a, np.float64) for a in (base_color, metallic, roughness))
    half = light + v
    half = half / np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-30)
    cos_light, cos_view = (n * light).sum(-1), (n * v).sum(-1)
    above = (cos_light > 0.0) & (cos_view > 0.0)
    cos_light, cos_view = np.where(above, cos_light, 1.0), np.where(above, cos_view, 1.0)
    cos_vh = np.clip((v * half).sum(-1), 0.0, 1.0)
    lobe = ggx_brdf(np.clip((n * half).sum(-1), 0.0, 1.0), cos_light, cos_view, roughness)
    eta = specular_ior(ior, specular_ior_level)
    _, albedo, mean_albedo, _ = np.moveaxis(lookup_albedo(eta, cos_view, roughness), -1, 0)
    dielectric = lobe * fresnel_dielectric(cos_vh, eta)
    dielectric = dielectric * _scattering_gain(albedo, mean_albedo, fresnel_dielectric_average(eta))
    base = (1.0 - interface_albedo(eta, cos_view, roughness))[..., None] * color / np.pi
    metal_fresnel = color + (1.0 - color) * ((1.0 - cos_vh) ** 5)[..., None]
    metal_gain = _scattering_gain(albedo[..., None], mean_albedo[..., None], color + (1.0 - color) / 21.0)
    metal = lobe[..., None] * metal_fresnel * metal_gain
    mixed = metallic[..., None] * metal + (1.0 - metallic[..., None]) * (dielectric[..., None] + base)
    return np.where(above[..., None], mixed, 0.0)
