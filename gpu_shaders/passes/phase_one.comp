// SPDX-License-Identifier: GPL-3.0-or-later
// Adds to each virtual light what falls on it from one sample of one lamp (seed 002, 3.2).
#include "gpu_layout/SourceSample"
#include "lib/lights.glsl"
#include "lib/shadow.glsl"

// Source samples have smooth normals, which lean away from their facets; radians.
#define NORMAL_TILT 0.2

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = LAMP_BINDING) readonly buffer Lamps { Lamp lamps[]; };
layout(std430, binding = SOURCE_SAMPLE_BINDING) readonly buffer SourceSamples { SourceSample source_samples[]; };
// Where the samples of each light begin and, at last, end.
layout(std430, binding = SOURCE_LIGHT_BINDING) readonly buffer SourceOffsets { int source_offsets[]; };
layout(std430, binding = RESULT_BINDING) buffer Irradiances { vec4 irradiances[]; }; // W/m², w unused
layout(binding = SHADOW_MAP_UNIT) uniform sampler2D shadow_map;

uniform float share;        // of the lamp that this sample stands for
uniform int light_count;
uniform int window;         // only of samples that this one shows; -1 for all

void main() {
    int index = int(gl_GlobalInvocationID.x);
    if (index >= light_count) {
        return;
    }
    Lamp lamp = lamps[0];
    vec3 irradiance = vec3(0.0);
    for (int i = source_offsets[index]; i < source_offsets[index + 1]; ++i) {
        SourceSample source = source_samples[i];
        if (window >= 0 && source.window != window) {
            continue;
        }
        vec3 unshadowed = lamp_irradiance(lamp, source.position, source.normal);
        if (max(max(unshadowed.r, unshadowed.g), unshadowed.b) > 0.0) {
            irradiance += source.weight * lit_share(shadow_map, lamp, source.position, source.normal, NORMAL_TILT) * unshadowed;
        }
    }
    irradiances[index].rgb += share * irradiance;
}
