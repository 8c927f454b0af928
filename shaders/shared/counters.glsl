// What this dispatch did, summed in the workgroup and added to one of COUNTER_SLOTS slots, for the
// host to compare with what it asked for.

// The slots' words, in the order of `Counters`.
STORAGE_BLOCK(BINDING_COUNTERS) buffer CounterBlock { uint counter_words[]; };

// The words that are summed. An invocation takes care of a word of all: a CPU device goes through its lanes at each access to memory,
// whoever takes part.
shared uint group_counts[COUNTED_WORDS];

// Where there is nothing to report but this, which is rare.
void report_overflows(uint count) {
    uint slot = gl_WorkGroupID.x % COUNTER_SLOTS;
    if (count > 0u) atomicAdd(counter_words[slot * COUNTER_WORDS + OVERFLOWED_WORD], count);
}

// Every invocation of the workgroup calls this once, in uniform control flow.
void report(Counters mine) {
    uint word = gl_LocalInvocationIndex;
    if (word < COUNTED_WORDS) group_counts[word] = 0u;
    barrier();
    if (mine.primary_asked > 0u) atomicAdd(group_counts[0], mine.primary_asked);
    if (mine.primary_finished > 0u) atomicAdd(group_counts[1], mine.primary_finished);
    if (mine.ambient_asked > 0u) atomicAdd(group_counts[2], mine.ambient_asked);
    if (mine.ambient_finished > 0u) atomicAdd(group_counts[3], mine.ambient_finished);
    if (mine.overflowed > 0u) atomicAdd(group_counts[4], mine.overflowed);
    barrier();
    if (word < COUNTED_WORDS) {
        uint count = group_counts[word];
        uint slot = gl_WorkGroupID.x % COUNTER_SLOTS;
        if (count > 0u) atomicAdd(counter_words[slot * COUNTER_WORDS + word], count);
    }
}
