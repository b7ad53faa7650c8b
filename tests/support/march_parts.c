/* Functions inside the march, for tests of its parts. */
#include "../../csrc/antiosc_march.c"

AOM_API double part_crossing(double y0, double d0, double y1, double d1, double h, double edge) {
    return crossing(y0, d0, y1, d1, h, edge);
}

AOM_API double part_polished(double at, const double *y, const double *d, double h, double edge) {
    return polished(at, y, d, h, edge);
}

AOM_API double part_misfit(double earlier, const double *f, double before, double h, int fresh) {
    return misfit(earlier, f, before, h, fresh != 0);
}

/* The chord of a flight from the start, over h. */
AOM_API double part_chord(aom_stepper *st, int c, double h) {
    acting_now(st);
    st->now.left = st->options.duration;
    amplitudes(st);
    return chord(st, c, SCRATCH, h);
}

AOM_API double part_mass_felt(const aom_stepper *st, int c, double t) {
    return effective_mass(st, c, t);
}

/* Force that vibrations which a step h does not resolve may cause, with contacts closed. */
AOM_API double part_ripple(aom_stepper *st, double h, double depth, int fresh) {
    acting_now(st);
    for (int c = 0; c < st->system.n_contacts; c++)
        st->contacts[c].force_scale = 1.0;
    for (int c = 0; c < st->system.n_contacts; c++) {
        st->contacts[c].branch = AOM_FORWARD;
        st->rows[c].depth = depth;
        st->rows[c].fresh = fresh != 0;
    }
    return ripple(st, h);
}

AOM_API double part_left_over(double finer) {
    static const aom_stepper without_friction;
    return left_over(&without_friction, finer);
}

AOM_API void part_bounds(const aom_law *law, int branch, const double *memory, double *out) {
    branch_bounds b = law_bounds(law, branch, memory);
    memcpy(out, &b, sizeof b);
}

AOM_API int part_next_branch(const aom_law *law, int branch, int exit, double delta, double rate,
                             double *memory) {
    return next_branch(NULL, law, branch, (bound)exit, delta, rate, memory);
}

/* Bytes of the structures that Python mirrors. */
AOM_API void part_sizes(size_t *out) {
    const size_t sizes[] = {sizeof(aom_user_law), sizeof(aom_law),    sizeof(aom_contact),
                            sizeof(aom_system),   sizeof(aom_options), sizeof(aom_record),
                            sizeof(aom_summary),  sizeof(aom_difference), sizeof(aom_solution),
                            sizeof(aom_touch),    sizeof(aom_numbers),
                            sizeof(aom_impact),   sizeof(aom_expected), sizeof(aom_outcome),
                            sizeof(aom_pulse_nodes)};
    memcpy(out, sizes, sizeof sizes);
}
