CONSTANT(SPEC_SAMPLE_LANES, uint, SAMPLE_LANES, 1);

// The list of pixels whose camera ray hit and that have samples to do. (passes: split, staged)

STORAGE_BLOCK(BINDING_LIST) buffer ListBlock { Listed listed[]; };
STORAGE_BLOCK(BINDING_ARGUMENTS) buffer ArgumentsBlock { ListArguments arguments; };

// The samples that a listed pixel gets in this go. A list serves several goes where they are the same for all.
uvec2 listed_budget(Listed entry) {
    return BUDGETS ? uvec2(entry.begin, entry.end) : uvec2(range.set_begin, range.set_end);
}

// This invocation's place in the list; it may lie behind its end.
uint list_place() { return gl_WorkGroupID.x * WORKGROUP_SIZE + gl_LocalInvocationIndex; }
