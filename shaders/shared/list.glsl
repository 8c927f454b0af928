// The list of pixels whose camera ray hit and that have samples to do. (passes: split, staged)

STORAGE_BLOCK(BINDING_LIST) buffer ListBlock { Listed listed[]; };
STORAGE_BLOCK(BINDING_ARGUMENTS) buffer ArgumentsBlock { ListArguments arguments; };

// This invocation's place in the list; it may lie behind its end.
uint list_place() { return gl_WorkGroupID.x * WORKGROUP_SIZE + gl_LocalInvocationIndex; }
