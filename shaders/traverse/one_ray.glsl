// The loop over rays of the methods that trace each ray by itself: they define
//     bool closest_hit(Ray ray, inout Hit hit)
//     bool any_hit(Ray ray, inout bool occluded)
// which return whether they came to their end. They may not: a driver can limit the iterations of a
// loop (Mesa's software device leaves it after 65,535 without a word), so every loop proves its end.

#ifdef USES_CLOSEST
void run_each_closest() {
    Ray ray;
    Hit hit;
    uint id;
    while (next_closest(ray, hit, id)) {
        bool finished = closest_hit(ray, hit);
        retire_closest(id, hit, finished);
    }
}

#if !defined(SHARES_START) && !defined(STEALS_CLOSEST)
void run_closest() { run_each_closest(); }
#endif
#endif

#if defined(USES_ANY) && !defined(STEALS)
void run_each_any() {
    Ray ray;
    bool occluded;
    uint id;
    while (next_any(ray, occluded, id)) {
        bool finished = any_hit(ray, occluded);
        retire_any(id, occluded, finished);
    }
}

#ifndef SHARES_START
void run_any() { run_each_any(); }
#endif
#endif
