// The samples that a pixel gets in one go: all, or, where each has its own number of them, as many as the host says.

STORAGE_BLOCK(BINDING_BUDGETS) readonly buffer BudgetBlock { Budget budgets[]; };

uvec2 sample_budget(uint pixel) {
    if (!BUDGETS) return uvec2(range.set_begin, range.set_end);
    Budget budget = budgets[pixel - range.pixel_base];
    return uvec2(budget.begin, budget.end);
}
