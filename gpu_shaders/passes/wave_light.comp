// SPDX-License-Identifier: GPL-3.0-or-later
// Adds to every point what it receives from a run of a wave's lights, without shadows (seed 000, eq. 4.5): points are
// the corners of triangles, or pixels.
#include "gpu_layout/Material"
#include "lib/surface.glsl"
#include "lib/wave.glsl"
#include "passes/gbuffer_samplers.glsl"
#include "passes/reflectance.glsl"

#if AT_CORNERS
layout(local_size_x = GROUP_SIZE) in;
layout(std430, binding = MATERIAL_BINDING) readonly buffer Materials { Material materials[]; };
// Position and material, normal; in m from the local origin and unit.
layout(std430, binding = POINT_BINDING) readonly buffer Points { vec4 points[]; };
// Irradiance on the normal's side and on the other one, W/m², and radiance of the specular layer on the viewer's side.
layout(std430, binding = RESULT_BINDING) buffer Sums { vec4 sums[]; };
#else
layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;
layout(rgba32f, binding = 0) uniform image2D irradiance_sum;    // W/m²
#if HAS_SPECULAR
layout(rgba32f, binding = 1) uniform image2D specular_sum;      // W/(m² sr)
#endif
#endif

// Three a light: position and red, normal and green, irradiance and blue; the colours in w are what the specular layer
// receives. m from the local origin, unit, W/m².
layout(std430, binding = LIGHT_BINDING) readonly buffer Lights { vec4 lights[]; };

uniform int first_light, end_light;
uniform vec3 camera_position;   // m, from the local origin
uniform vec3 camera_backward;   // unit
uniform bool is_orthographic;
uniform float solid_angle;      // sr, that a ray of the wave stands for

#if AT_CORNERS
uniform int point_count;

// The surface at a corner, as its material has it without images.
Surface corner_surface(Material material, vec3 position, vec3 normal) {
    int model = has_bit(material.flags, MATERIAL_PRINCIPLED) ? MODEL_PRINCIPLED : MODEL_DIFFUSE;
    return Surface(
        position, 0.0, normal, normal, material.base_color, vec3(0.0), clamp(material.roughness, 0.0, 1.0),
        clamp(material.metallic, 0.0, 1.0), material.specular_ior_level, material.ior, 0, 0, 0, model
    );
}
#endif

void main() {
#if AT_CORNERS
    int index = int(gl_GlobalInvocationID.x);
    if (index >= point_count) {
        return;
    }
    vec3 p = points[2 * index].xyz, n = points[2 * index + 1].xyz;
#else
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(irradiance_sum))) || !pixel_shows_geometry(pixel)) {
        return;
    }
    vec3 p = texelFetch(gbuffer_position, pixel, 0).xyz, n = texelFetch(gbuffer_shading_normal, pixel, 0).xyz;
#endif
#if HAS_SPECULAR
    vec3 to_camera = is_orthographic ? camera_backward : normalize(camera_position - p);
#if AT_CORNERS
    vec3 seen_normal = dot(n, to_camera) < 0.0 ? -n : n;
    Surface surface = corner_surface(materials[int(points[2 * index].w)], p, seen_normal);
#else
    vec3 seen_normal = n;
    Surface surface = fetch_surface(pixel);
#endif
    Reflector reflector = make_reflector(surface, to_camera, albedo_table);
    reflector.alpha = widened_alpha(reflector.alpha, solid_angle);
    vec3 specular = vec3(0.0);
#endif
    vec3 front = vec3(0.0), back = vec3(0.0);
    for (int i = first_light; i < end_light; ++i) {
        vec4 place = lights[3 * i], facing = lights[3 * i + 1], sent = lights[3 * i + 2];
        vec3 direction = towards_light(p, place.xyz);
        float received = dot(n, direction);
        vec3 arriving = emission_share(-dot(facing.xyz, direction)) * sent.rgb;
        front += max(received, 0.0) * arriving;
#if AT_CORNERS
        back += max(-received, 0.0) * arriving;
#endif
#if HAS_SPECULAR
        specular += specular_reflection(reflector, seen_normal, direction, to_camera) * vec3(place.w, facing.w, sent.w);
#endif
    }
#if AT_CORNERS
    sums[3 * index] += vec4(front, 0.0);
    sums[3 * index + 1] += vec4(back, 0.0);
#if HAS_SPECULAR
    sums[3 * index + 2] += vec4(specular, 0.0);
#endif
#else
    imageStore(irradiance_sum, pixel, imageLoad(irradiance_sum, pixel) + vec4(front, 0.0));
#if HAS_SPECULAR
    imageStore(specular_sum, pixel, imageLoad(specular_sum, pixel) + vec4(specular, 0.0));
#endif
#endif
}
