// SPDX-License-Identifier: GPL-3.0-or-later
// The surface of a pixel, as the G-buffer pass packs it: this file and passes/gbuffer.frag know how.
#ifndef LIB_GBUFFER
#define LIB_GBUFFER

// Bit beside the model: the eye sees the triangle's clockwise side.
#define SEEN_FROM_BACK 256

struct Surface {
    vec3 position;          // m, from the local origin
    float depth;            // m along the direction of view
    vec3 shading_normal;    // unit, on the viewer's side
    vec3 geometric_normal;  // unit, on the viewer's side
    vec3 base_color;        // linear Rec.709
    vec3 emission;          // radiance, W/(m² sr)
    float roughness;
    float metallic;
    float specular_ior_level;
    float ior;
    int material;
    int tag_id;
    int face_id;
    int model;              // MODEL_DIFFUSE or MODEL_PRINCIPLED
};

// Whether a pixel shows geometry: cleared normals are zero. Elsewhere the ids are undefined.
bool shows_geometry(vec3 geometric_normal) {
    return dot(geometric_normal, geometric_normal) > 0.25;
}

// Depth in [0, 1] for a buffer of whole numbers: 0 at near, 1 at far, finest in proportion about the middle between
// both. Plain z / w spends nearly all of its steps on the first few near distances. inverse_distance: 1 / m.
float balanced_depth(float inverse_distance, float near, float far) {
    float middle = sqrt(near * far);
    return (1.0 - near * inverse_distance) / (1.0 + middle * inverse_distance) * ((far + middle) / (far - near));
}

// Whether the surface shows its clockwise side, which reflects for the camera as the other one does, but is the inside
// of a solid. ids: as packed.
bool seen_from_back(ivec4 ids) {
    return (ids.w & SEEN_FROM_BACK) != 0;
}

Surface unpack_surface(
    vec4 position, vec4 shading_normal, vec4 geometric_normal, vec4 base_color, vec4 emission, ivec4 ids
) {
    return Surface(
        position.xyz, position.w, shading_normal.xyz, geometric_normal.xyz, base_color.rgb, emission.rgb,
        shading_normal.w, geometric_normal.w, base_color.w, emission.w, ids.x, ids.y, ids.z, ids.w & ~SEEN_FROM_BACK
    );
}
#endif
