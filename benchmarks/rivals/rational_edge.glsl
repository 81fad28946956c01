// SPDX-License-Identifier: GPL-3.0-or-later
// The rational fit of an edge's integral used with linearly transformed cosines.
// Heitz, Dupuy, Hill and Neubelt 2016, "Real-time polygonal-light shading with linearly transformed cosines", for the
// method; Hill and Heitz 2016, "Real-time area lighting: a journey from research to production" (SIGGRAPH course
// "Advances in real-time rendering"), for the fit.
#ifndef RIVALS_RATIONAL_EDGE
#define RIVALS_RATIONAL_EDGE

// Unit vectors a and b to the ends of an edge: their cross product times theta / (2 pi sin theta), theta between them.
vec3 rational_edge(vec3 a, vec3 b) {
    float cos_theta = dot(a, b);
    float x = abs(cos_theta);
    float ratio = ((0.0145206 * x + 0.4965155) * x + 0.8543985) / ((x + 4.1616724) * x + 3.4175940);
    float obtuse = 0.5 * inversesqrt(max(1.0 - cos_theta * cos_theta, 1e-7)) - ratio;
    return cross(a, b) * (cos_theta > 0.0 ? ratio : obtuse);
}
#endif
