// What this dispatch did, summed in the workgroup and added to one of COUNTER_SLOTS slots, for the
// host to compare with what it asked for.

STORAGE_BLOCK(BINDING_COUNTERS) buffer CounterBlock { Counters counters[]; };

shared uint group_primary_asked;
shared uint group_primary_finished;
shared uint group_ambient_asked;
shared uint group_ambient_finished;
shared uint group_overflowed;

// Every invocation of the workgroup calls this once, in uniform control flow.
void report(Counters mine) {
    if (gl_LocalInvocationIndex == 0u) {
        group_primary_asked = 0u;
        group_primary_finished = 0u;
        group_ambient_asked = 0u;
        group_ambient_finished = 0u;
        group_overflowed = 0u;
    }
    barrier();
    if (mine.primary_asked > 0u) atomicAdd(group_primary_asked, mine.primary_asked);
    if (mine.primary_finished > 0u) atomicAdd(group_primary_finished, mine.primary_finished);
    if (mine.ambient_asked > 0u) atomicAdd(group_ambient_asked, mine.ambient_asked);
    if (mine.ambient_finished > 0u) atomicAdd(group_ambient_finished, mine.ambient_finished);
    if (mine.overflowed > 0u) atomicAdd(group_overflowed, mine.overflowed);
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        uint slot = gl_WorkGroupID.x % COUNTER_SLOTS;
        atomicAdd(counters[slot].primary_asked, group_primary_asked);
        atomicAdd(counters[slot].primary_finished, group_primary_finished);
        atomicAdd(counters[slot].ambient_asked, group_ambient_asked);
        atomicAdd(counters[slot].ambient_finished, group_ambient_finished);
        if (group_overflowed > 0u) atomicAdd(counters[slot].overflowed, group_overflowed);
    }
}
