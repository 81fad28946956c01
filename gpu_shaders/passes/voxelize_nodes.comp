// SPDX-License-Identifier: GPL-3.0-or-later
// The nodes of one level of the octree: each bit of the level's words becomes a word where its rank says.

layout(local_size_x = GROUP_SIZE) in;

layout(std430, binding = BIT_BINDING) readonly buffer Bits { uint bits[]; };
layout(std430, binding = RANK_BINDING) readonly buffer Ranks { uint ranks[]; };
layout(std430, binding = OCTREE_BINDING) writeonly buffer Octree { uint octree[]; };

uniform uint level_word; // first word of the level in `bits`
uniform uint child_word; // of the level below
uniform uint word_count; // of the level
uniform uint child_start; // bits before the first child that children count from: none for nodes, all nodes for bricks
uniform uint first_node; // first word of the nodes in the octree

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint index = group * GROUP_SIZE + gl_LocalInvocationID.x;
    if (index >= word_count) {
        return;
    }
    uint place = first_node + ranks[level_word + index];
    for (uint left = bits[level_word + index]; left != 0u; left &= left - 1u) {
        uint cell = 32u * index + uint(findLSB(left));
        uint word = child_word + cell / 4u;
        uint shift = 8u * (cell % 4u);
        uint octants = bits[word] >> shift & 255u;
        uint before = uint(bitCount(bits[word] & ((1u << shift) - 1u)));
        octree[place] = octants | (ranks[word] + before - child_start) << 8;
        ++place;
    }
}
