// SPDX-License-Identifier: GPL-3.0-or-later
// Which cells of each block its triangle meets, and how many in all: what the two passes share that go down a level.
#include "passes/voxelize_blocks.glsl"

layout(std430, binding = MEETING_BINDING) buffer Meetings { uint meetings[]; };
layout(std430, binding = TOTAL_BINDING) buffer Total { uint total; };

shared uint group_total;
