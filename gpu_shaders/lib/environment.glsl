// SPDX-License-Identifier: GPL-3.0-or-later
// Places in an equirectangular map; float32 form of vlm_addon/core/environment.py.
#ifndef LIB_ENVIRONMENT
#define LIB_ENVIRONMENT

#define ENVIRONMENT_PI 3.14159265358979

// u, v in [0, 1]² of a direction in the map's frame; need not be unit.
vec2 environment_place(vec3 direction) {
    float level = length(direction.xy);
    float azimuth = level > 0.0 ? atan(direction.y, direction.x) : 0.0;
    return vec2(0.5 - azimuth / (2.0 * ENVIRONMENT_PI), 0.5 + atan(direction.z, level) / ENVIRONMENT_PI);
}
#endif
