// References of nodes: a node's number, the root's 0, or a leaf, which is negative.

#include "leaf.glsl"

CONSTANT(SPEC_STACK_ROOM, int, STACK_ROOM, 64);

#define ROOT 0
// No reference: packed leaves do not reach so far down. A walk that came to its end is at it: the loop's own condition
// proves nothing, since a compiler knows that it fails after the loop, even where the driver left the loop early.
#define NOTHING (-0x7fffffff - 1)

int leaf_first(int reference) { return (-1 - reference) >> int(LEAF_BITS); }

int leaf_last(int reference) { return leaf_first(reference) + ((-1 - reference) & int(LEAF_LIMIT - 1u)); }
