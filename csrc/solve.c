/* Error control: the march is repeated with a finer share of the error until its forces converge. */
#include "internal.h"

/* Of the tolerance, the share of the first run; by what the second run divides it, and a third: by
 * MORE if the estimate was at most NEAR times the tolerance, else by MOST. */
#define FIRST 0.5
#define SECOND 4.0
#define MORE 4.0
#define MOST 8.0
#define NEAR 1.5
#define FINEST 1e-6 /* share of the first run, at least: what max_steps permits is then known */
/* Error left in the finer run, of the difference of two whose errors have the ratio f, is 1/(f - 1),
 * times this margin. */
#define MARGIN 2.0
#define FLOOR 1.25 /* error at least, over the share: two runs with common steps differ by nothing */
#define RUNS 12
#define PATIENCE 3 /* runs without gain after which a scene counts as not convergent */
/* a finer run may take so many times the steps of the one before, twice being the rule, and so many
 * at least: one that takes more is stopped */
#define DEARER 50
#define CHEAP 50000

/* Whether friction of a contact acts in two directions. */
static bool two_directions(const aom_system *system) {
    for (int c = 0; c < system->n_contacts; c++)
        if (system->contacts[c].n_tangential == 2)
            return true;
    return false;
}

/* Error left in the finer of two runs, of their difference; `finer`: ratio of their shares. Errors
 * follow the share, as the cube of a step; of friction that turns they follow the square of it. */
static double left_over(const aom_stepper *st, double finer) {
    double ratio = two_directions(&st->system) ? pow(finer, 2.0 / 3.0) : finer;
    return MARGIN / (ratio - 1.0);
}

/* The largest force of each contact in a run; whether they are finite. */
static bool highest_forces(const aom_system *system, const aom_record *run, double *highest) {
    double most = 0.0;
    for (int c = 0; c < system->n_contacts; c++) {
        highest[c] = 1e-300;
        for (int64_t n = 0; n < run->n_nodes; n++)
            highest[c] = larger(highest[c], run->force[n * system->n_rows + c]);
        most = larger(most, highest[c]);
    }
    return isfinite(most);
}

static aom_difference apart(const aom_stepper *st, const aom_record *a, const aom_record *b,
                            double tol) {
    int width = st->system.n_rows, m = width - st->system.n_stretch;
    return compare_runs(m, width, st->owner, a, b, tol, st->work.pairs);
}

/* Begin the next run, in a record that holds neither the best run nor the one before. */
static int begin_run(aom_stepper *st, const aom_system *system, const aom_options *options,
                     aom_solution *s, aom_record *records) {
    aom_options run = *options;
    int64_t room = DEARER * s->earlier.attempts;
    run.max_steps -= s->used;
    if (s->before >= 0 && room < run.max_steps)
        run.max_steps = room > CHEAP ? room : run.max_steps < CHEAP ? run.max_steps : CHEAP;
    run.rel_tol = s->share;
    for (s->present = 0; s->present == s->best || s->present == s->before;)
        s->present++;
    aom_clear(records + s->present);
    return start_run(st, system, &run, s->scaled ? st->work.highest : NULL);
}

/* The run of a record is the best so far. */
static void take_best(aom_solution *s, int record, int answer, double force, double peak,
                      double certain, const aom_summary *summary) {
    s->best = record;
    s->answer = answer;
    s->force = force;
    s->peak = peak;
    s->certain = certain;
    s->summary = *summary;
}

/* What the end of a run means; whether it was the last one. */
static bool last_run(aom_stepper *st, const aom_options *options, aom_solution *s,
                     const aom_record *records, int answer) {
    const aom_record *now = records + s->present;
    aom_summary told = aom_summarize(st);
    double tol = options->rel_tol;
    bool unstable = answer == AOM_GREW || answer == AOM_STUCK;
    s->used += told.attempts;
    s->failed = unstable ? s->failed + 1 : 0;
    s->scaled = highest_forces(&st->system, now, st->work.highest);
    if (s->before >= 0 && answer == AOM_TOO_MANY_STEPS) {
        const aom_record *before = records + s->before;
        if (s->best < 0)
            take_best(s, s->before, AOM_DONE, INFINITY, INFINITY,
                      apart(st, before, now, tol / left_over(st, s->finer)).until, &s->earlier);
        return true;
    }
    if (unstable)
        s->finer = MOST;
    else if (s->before >= 0) {
        double part = left_over(st, s->finer), best = s->force;
        aom_difference d = apart(st, records + s->before, now, tol / part);
        double force = larger(part * d.force, FLOOR * s->share);
        /* the peak is one value, whose differences change sign from run to run */
        double worst = larger(force, part * d.peak);
        bool first = s->best < 0;
        s->worse = first || force < 0.7 * best ? 0 : s->worse + 1;
        if (first || force <= best || force <= tol)
            take_best(s, s->present, answer, force, worst, d.until, &told);
        if (worst <= tol || s->worse >= PATIENCE)
            return true;
        s->finer = worst <= NEAR * tol ? MORE : MOST;
    }
    s->before = answer == AOM_DONE ? s->present : -1;
    s->earlier = told;
    s->share /= s->finer;
    bool last = answer == AOM_TOO_MANY_CONTACTS || answer == AOM_TOO_MANY_STEPS ||
                s->failed >= PATIENCE || 2 * told.attempts > options->max_steps - s->used ||
                ++s->runs == (options->max_runs > 0 ? options->max_runs : RUNS);
    if (last && s->best < 0)
        take_best(s, s->present, answer, INFINITY, INFINITY, 0.0, &told);
    return last;
}

int aom_solve(aom_stepper *st, const aom_system *system, const aom_options *options,
              aom_solution *s, aom_record records[3], int64_t max_attempts) {
    bool first = s->finer == 0.0, next = first;
    if (first) {
        bool once = options->max_runs == 1;
        *s = (aom_solution){.best = -1, .before = -1};
        s->share = once ? options->rel_tol : larger(FIRST * options->rel_tol, FINEST);
        s->finer = SECOND;
    }
    for (;;) {
        int answer = next ? begin_run(st, system, options, s, records) : AOM_DONE;
        aom_record *now = records + s->present;
        if (answer == AOM_DONE)
            answer = aom_integrate(st, now, INFINITY, max_attempts);
        if (answer == AOM_FULL || answer == AOM_PAUSED || answer >= AOM_LAW_FAILED)
            return answer;
        write_state(st, now);
        if (last_run(st, options, s, records, answer))
            return AOM_DONE;
        next = true;
    }
}
