// What a pixel's rays cost, added to its record by the kernels that count it (COUNTS_WORK). An entry says where its
// closest hits and its any hits begin and end.

#ifdef COUNTS_WORK

STORAGE_BLOCK(BINDING_WORK) buffer WorkBlock { Work works[]; };

void begin_closest_work() { effort = Effort(0u, 0u, 0u); }

void begin_any_work() { effort = Effort(0u, 0u, 0u); }

// An invocation without a pixel may have counted for its subgroup all the same.
void end_closest_work() {
    uint i = pixel - range.pixel_base;
    if (pixel < range.pixel_end) {
        works[i].closest_visits += effort.visits;
        works[i].closest_tests += effort.tests;
        works[i].closest_group_steps += effort.group_steps;
        works[i].subgroup_size = gl_SubgroupSize;
    }
}

void end_any_work() {
    uint i = pixel - range.pixel_base;
    if (pixel < range.pixel_end) {
        works[i].any_visits += effort.visits;
        works[i].any_tests += effort.tests;
        works[i].any_group_steps += effort.group_steps;
    }
}

#else

void begin_closest_work() {}
void begin_any_work() {}
void end_closest_work() {}
void end_any_work() {}

#endif
