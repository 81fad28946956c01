// SPDX-License-Identifier: GPL-3.0-or-later
// What later passes know of the nearest surface in a pixel.
#include "gpu_layout/Material"
#include "lib/gbuffer.glsl"
#include "lib/hash.glsl"
#include "lib/surface.glsl"

layout(std430, binding = MATERIAL_BINDING) readonly buffer Materials { Material materials[]; };

layout(binding = BASE_COLOR_UNIT) uniform sampler2D base_color_map;
layout(binding = ALPHA_UNIT) uniform sampler2D alpha_map;
layout(binding = ROUGHNESS_UNIT) uniform sampler2D roughness_map;
layout(binding = METALLIC_UNIT) uniform sampler2D metallic_map;
layout(binding = EMISSION_UNIT) uniform sampler2D emission_map;
layout(binding = NORMAL_UNIT) uniform sampler2D normal_map;

uniform vec3 camera_position;   // m, from the local origin
uniform vec3 camera_backward;   // unit
uniform bool is_orthographic;
uniform vec2 clip_distances;    // m, near and far
uniform vec3 ray;               // per m of depth, through the window's corner; 0 for an orthographic camera
uniform vec3 ray_right, ray_up; // what each pixel to the right and up adds to it
uniform uint sample_index;

in vec3 position;
in vec3 corner_normal;
in vec2 uv;
in vec3 corner_color;
in vec4 corner_tangent;
flat in vec3 triangle_normal;
flat in ivec3 triangle_ids;
flat in vec2 triangle_plane;

layout(location = 0) out vec4 out_position;
layout(location = 1) out vec4 out_shading_normal;
layout(location = 2) out vec4 out_geometric_normal;
layout(location = 3) out vec4 out_base_color;
layout(location = 4) out vec4 out_emission;
layout(location = 5) out ivec4 out_ids;

void main() {
    Material material = materials[triangle_ids.x];
    float alpha = material.alpha;
    if (has_bit(material.flags, 1u << ALPHA_UNIT)) {
        alpha *= texture(alpha_map, uv)[material.alpha_channel];
    }
    if (alpha < 1.0 && spread_random(uvec2(gl_FragCoord.xy), uint(triangle_ids.z), sample_index) >= alpha) {
        discard;
    }

    vec3 base_color = material.base_color;
    vec3 emission = material.emission;
    float roughness = material.roughness;
    float metallic = material.metallic;
    vec3 normal = unit_or(corner_normal, triangle_normal);
    if (has_bit(material.flags, 1u << BASE_COLOR_UNIT)) {
        base_color *= texture(base_color_map, uv).rgb;
    }
    if (has_bit(material.flags, MATERIAL_CORNER_COLOR)) {
        base_color *= corner_color;
    }
    if (has_bit(material.flags, 1u << ROUGHNESS_UNIT)) {
        roughness *= texture(roughness_map, uv)[material.roughness_channel];
    }
    if (has_bit(material.flags, 1u << METALLIC_UNIT)) {
        metallic *= texture(metallic_map, uv)[material.metallic_channel];
    }
    if (has_bit(material.flags, 1u << EMISSION_UNIT)) {
        emission *= texture(emission_map, uv).rgb;
    }
    if (has_bit(material.flags, 1u << NORMAL_UNIT)) {
        vec3 texel = texture(normal_map, uv).rgb;
        normal = mapped_normal(corner_normal, corner_tangent, texel, material.normal_strength, triangle_normal);
    }

    vec3 towards = ray + gl_FragCoord.x * ray_right + gl_FragCoord.y * ray_up;
    vec3 place = seen_point(position, camera_position, towards, triangle_normal, triangle_plane.x, triangle_plane.y);

    // Both normals turn to the viewer's side, as Cycles turns them on back faces.
    vec3 to_camera = is_orthographic ? camera_backward : camera_position - place;
    float side = dot(triangle_normal, to_camera) < 0.0 ? -1.0 : 1.0;
    int model = has_bit(material.flags, MATERIAL_PRINCIPLED) ? MODEL_PRINCIPLED : MODEL_DIFFUSE;
    float depth = dot(camera_position - place, camera_backward);

    gl_FragDepth =
        is_orthographic ? gl_FragCoord.z : balanced_depth(gl_FragCoord.w, clip_distances.x, clip_distances.y);
    out_position = vec4(place, depth);
    out_shading_normal = vec4(side * normal, clamp(roughness, 0.0, 1.0));
    out_geometric_normal = vec4(side * triangle_normal, clamp(metallic, 0.0, 1.0));
    out_base_color = vec4(max(base_color, 0.0), material.specular_ior_level);
    out_emission = vec4(max(emission, 0.0), material.ior);
    out_ids = ivec4(triangle_ids, side < 0.0 ? model | SEEN_FROM_BACK : model);
}
