// How much work a traversal is: node visits, triangle tests, and how full the subgroup is while they happen. Only
// kernels with COUNTS_WORK count; in the others nothing is left of it.

#ifdef COUNTS_WORK

struct Effort {
    uint visits;
    uint tests;
    // Visits and tests at which this invocation was the first active one of its subgroup: those of the whole
    // subgroup, each counted once.
    uint group_steps;
};

Effort effort;

void count_step() {
    if (subgroupElect()) effort.group_steps++;
}

#define COUNT_VISIT() effort.visits++; count_step()
#define COUNT_TEST() effort.tests++; count_step()

#else

#define COUNT_VISIT()
#define COUNT_TEST()

#endif
