// SPDX-License-Identifier: GPL-3.0-or-later
// A material's channels and normal maps.
#ifndef LIB_SURFACE
#define LIB_SURFACE

bool has_bit(uint flags, uint bit) {
    return (flags & bit) != 0u;
}

// Unit normal of a tangent-space map. normal, tangent: interpolated, unit or not; tangent.w: sign of the bitangent;
// texel: rgb in [0, 1]; strength: 0 keeps the normal.
vec3 mapped_normal(vec3 normal, vec4 tangent, vec3 texel, float strength) {
    vec3 unit_normal = normalize(normal);
    if (dot(tangent.xyz, tangent.xyz) == 0.0) {
        return unit_normal;
    }
    vec3 direction = 2.0 * texel - 1.0;
    vec3 bitangent = sign(tangent.w) * cross(normal, tangent.xyz);
    vec3 mapped = normalize(direction.x * tangent.xyz + direction.y * bitangent + direction.z * normal);
    vec3 blended = unit_normal + (mapped - unit_normal) * max(strength, 0.0);
    float blended_length = length(blended);
    return blended_length > 0.0 ? blended / blended_length : unit_normal;
}
#endif
