// SPDX-License-Identifier: GPL-3.0-or-later
// A material's channels and normal maps.
#ifndef LIB_SURFACE
#define LIB_SURFACE

bool has_bit(uint flags, uint bit) {
    return (flags & bit) != 0u;
}

// v as a unit vector, or `otherwise` where v has no direction: smooth normals of opposite corners cancel midway.
vec3 unit_or(vec3 v, vec3 otherwise) {
    float length_squared = dot(v, v);
    return length_squared > 1e-30 ? v * inversesqrt(length_squared) : otherwise;
}

// Unit normal of a tangent-space map. normal, tangent: interpolated, unit or not; tangent.w: sign of the bitangent;
// texel: rgb in [0, 1]; strength: 0 keeps the normal; otherwise: unit, where the normal has no direction.
vec3 mapped_normal(vec3 normal, vec4 tangent, vec3 texel, float strength, vec3 otherwise) {
    vec3 unit_normal = unit_or(normal, otherwise);
    vec3 direction = 2.0 * texel - 1.0;
    vec3 bitangent = sign(tangent.w) * cross(normal, tangent.xyz);
    vec3 mapped = direction.x * tangent.xyz + direction.y * bitangent + direction.z * normal;
    if (dot(tangent.xyz, tangent.xyz) == 0.0) {
        return unit_normal;
    }
    return unit_or(unit_normal + (unit_or(mapped, unit_normal) - unit_normal) * max(strength, 0.0), unit_normal);
}

// Where a ray meets a triangle, m. towards: per m of depth; interpolated: what the rasteriser makes of the corners,
// off by float32's share of the farthest one's distance `reach`. Where that is far beyond the point, the triangle's
// plane, `offset` along the normal from the origin, says better.
vec3 seen_point(vec3 interpolated, vec3 from, vec3 towards, vec3 normal, float offset, float reach) {
    float height = dot(normal, from);
    float slope = dot(normal, towards);
    bool plane_is_better = abs(offset) + abs(height) < reach * abs(slope);
    return plane_is_better ? from + towards * ((offset - height) / slope) : interpolated;
}
#endif
