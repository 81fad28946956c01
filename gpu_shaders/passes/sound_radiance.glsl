// SPDX-License-Identifier: GPL-3.0-or-later
// Light without what is none. Compilers may assume that comparisons see no NaN, so bits are looked at.
#ifndef PASSES_SOUND_RADIANCE
#define PASSES_SOUND_RADIANCE

// W/(m² sr): what is brighter is an overflow.
#define MOST_RADIANCE 1e30

// Whether each is a number, neither below 0 nor too large.
bvec4 are_sound(vec4 values) {
    return lessThan(floatBitsToUint(values), uvec4(floatBitsToUint(MOST_RADIANCE)));
}

// 0 for channels that are not sound.
vec3 sound_radiance(vec3 radiance) {
    return mix(vec3(0.0), radiance, are_sound(vec4(radiance, 0.0)).xyz);
}
#endif
