/* The engine of the live report: an impact of two bodies with one contact, in one call.
 *
 * It is compiled to WebAssembly with the march, see packaging/library.py, and solves an impact as
 * aom_batch_solve does, so that its numbers are those of `simulate`; the record of the run stays, for
 * the chart and the motion. All pointers are offsets into its memory, which page_take gives out and
 * page_clear takes back; memory that grows makes views of it anew.
 */
#include "../antiosc_march.c"

#define EXPORT(name) __attribute__((export_name(#name)))
#define PAGE 65536u
#define MOST_BYTES (1u << 28) /* of one record; a run that needs more is given up */

extern char __heap_base;
static char *top = &__heap_base;

/* Bytes that stay until page_clear; NULL where there is no memory left. */
EXPORT(page_take) void *page_take(size_t bytes) {
    char *made = top;
    size_t end = (size_t)made + ((bytes + 15) & ~(size_t)15);
    size_t there = __builtin_wasm_memory_size(0) * PAGE;
    if (end > there && __builtin_wasm_memory_grow(0, (end - there + PAGE - 1) / PAGE) == (size_t)-1)
        return NULL;
    top = (char *)end;
    return made;
}

EXPORT(page_clear) void page_clear(void) {
    top = &__heap_base;
}

/* What page_strike found; the page reads it as an array of doubles. */
static struct {
    double answer;       /* aom_status */
    double peak, impulse, contact_time, restitution; /* NaN: not defined */
    double contacts, touching; /* whether the last one goes on at the end */
    double first, last;  /* touch and release [s] */
    double force_error, peak_error, lasting;
    double n_nodes, time, force, depth; /* arrays of the best run */
    double reach; /* force up to which the law holds without the patch's compliance [N] */
    double deepest, dent, work; /* of a law with memory: largest and permanent indentation [m], work
                                   of loading up to there [J], all with the patch's */
} found;

static aom_system posed;
static aom_contact contact;
static aom_record records[3];
static aom_solution solution;

/* ---- The run ---- */

/* What an array holds, in larger memory. */
static void *copied(const void *old, size_t bytes, size_t room) {
    void *made = page_take(room);
    if (made != NULL && bytes)
        __builtin_memcpy(made, old, bytes);
    return made;
}

/* Room for four times the nodes, and the states of all steps. */
static bool enlarge(aom_record *r) {
    int64_t nodes = r->max_nodes ? 4 * r->max_nodes : 1024;
    int J = posed.n_modes;
    size_t one = sizeof(double), state = 2 * one * (size_t)J, event = sizeof(aom_event);
    size_t room = (size_t)nodes * one, held = (size_t)r->n_nodes * one, m = (size_t)posed.n_rows;
    if (8.0 * (double)nodes * (5.0 + 2.0 * (double)m + (double)J) > MOST_BYTES)
        return false;
    r->max_nodes = nodes;
    r->max_states = nodes / 2 + 1;
    r->max_events = nodes + 2;
    r->every = r->every ? r->every : 1;
    r->time = copied(r->time, held, room);
    r->force = copied(r->force, m * held, m * room);
    r->depth = copied(r->depth, m * held, m * room);
    r->states = copied(r->states, (size_t)r->n_states * state, (size_t)(nodes / 2 + 2) * state);
    r->events = copied(r->events, (size_t)r->n_events * event, (size_t)(nodes + 2) * event);
    return r->time && r->force && r->depth && r->states && r->events;
}

static int solve(double duration, double rel_tol, double lasting, double max_steps) {
    aom_options options = aom_default_options(duration);
    options.rel_tol = rel_tol;
    options.resolution = lasting / 200.0;
    options.max_steps = (int64_t)max_steps;
    options.max_runs = 0;
    size_t bytes = aom_memory_size(&posed);
    void *memory = bytes ? page_take(bytes) : NULL;
    aom_stepper *stepper;
    if (memory == NULL)
        return AOM_SMALL_MEMORY;
    int answer = aom_create(&posed, memory, bytes, &stepper);
    if (answer != AOM_DONE)
        return answer;
    solution = (aom_solution){0};
    __builtin_memset(records, 0, sizeof records);
    do {
        answer = aom_solve(stepper, &posed, &options, &solution, records, INT64_MAX);
        if (answer == AOM_FULL && !enlarge(records + solution.present))
            return AOM_TOO_MANY_STEPS;
    } while (answer == AOM_FULL || answer == AOM_PAUSED);
    return answer > AOM_LAW_FAILED ? answer : solution.answer;
}

static int read_contacts(const aom_record *run) {
    aom_touch *touches = page_take(((size_t)run->n_events + 1) * sizeof *touches);
    int open, J = posed.n_modes;
    if (touches == NULL)
        return AOM_SMALL_MEMORY;
    int64_t n = aom_touches(run, 0, 0, touches, &open);
    aom_numbers read = aom_read_contact(&posed, run, 0, open, n, touches, run->states + J, 2 * J);
    found.peak = read.peak;
    found.impulse = read.impulse;
    found.contact_time = read.contact_time;
    found.restitution = read.restitution;
    found.contacts = (double)n;
    found.touching = open;
    found.first = n ? touches[0].start : 0.0;
    found.last = n ? touches[n - 1].end : 0.0;
    return AOM_DONE;
}

/* What a contact leaves whose law remembers its deepest indentation. */
static void read_dent(const aom_record *run) {
    int m = posed.n_rows;
    double depth = 0.0;
    for (int64_t i = 0; i < run->n_nodes; i++)
        depth = larger(depth, run->depth[i * m]);
    found.deepest = whole_depth(&contact.law, depth);
    found.work = whole_work(&contact.law, found.deepest);
    found.dent = depth > 0.0 ? law_permanent(&contact.law, depth) : 0.0;
}

/* The hash of the sources, so that a file tells what it was built from. */
EXPORT(page_sources) const char *page_sources(void) {
    return aom_source_hash();
}

/* Simulate an impact. Arrays of n_modes: omega, decay, load, v, and each row of beta, first that of
 * the contact; mobility [1/kg] of both bodies (`ModalBody.mobility`). Other rows stretch, by the
 * tensors. Returns the address of `found`, whose forces are those of all rows at each node. The
 * answer is an aom_status. */
EXPORT(page_strike)
double *page_strike(int n_modes, const double *omega, const double *decay, const double *beta,
                    const double *load, const double *v, double residual, double gap, int kind,
                    int n_params, const double *params, double mobility, double duration,
                    double rel_tol, double max_steps, int n_stretch, const double *quadratic,
                    const double *cubic) {
    size_t m = 1 + (size_t)n_stretch, numbers = m * m + m + 1;
    double *few = page_take(numbers * sizeof *few), *q = page_take((size_t)n_modes * sizeof *q);
    __builtin_memset(&found, 0, sizeof found);
    __builtin_memset(q, 0, (size_t)n_modes * sizeof *q);
    found.restitution = NAN;
    __builtin_memset(few, 0, numbers * sizeof *few);
    few[0] = residual, few[m * m] = gap;
    contact = (aom_contact){.law = {kind, n_params, params, NULL}, .first_tangential = 1,
                            .mass = mobility > 0.0 ? 1.0 / mobility : 1.0};
    posed = (aom_system){.n_modes = n_modes, .n_rows = (int)m, .n_contacts = 1, .n_breaks = 1,
                         .n_stretch = n_stretch, .quadratic = quadratic, .cubic = cubic,
                         .omega = omega, .decay = decay, .beta = beta, .residual = few,
                         .breaks = few + numbers - 1, .loads = load, .offsets = few + m * m,
                         .contacts = &contact, .q = q, .v = v};
    found.answer = aom_law_check(&contact.law);
    if (found.answer != AOM_DONE)
        return &found.answer;
    found.reach = aom_law_reach(&contact.law);
    found.lasting = scale_contact(&posed, &contact, duration).time;
    found.answer = solve(duration, rel_tol, found.lasting, max_steps);
    const aom_record *best = records + (solution.best > 0 ? solution.best : 0);
    if (found.answer > AOM_LAW_FAILED || best->n_nodes < 3)
        return &found.answer;
    found.force_error = solution.force;
    found.peak_error = solution.peak;
    if (remembers(contact.law.kind))
        read_dent(best);
    int read = read_contacts(best);
    if (read != AOM_DONE)
        found.answer = read;
    found.n_nodes = (double)best->n_nodes;
    found.time = (double)(size_t)best->time;
    found.force = (double)(size_t)best->force;
    found.depth = (double)(size_t)best->depth;
    return &found.answer;
}

/* q of the last impact at a time [s], v, and the forces of its rows, into out [2 n_modes + 2 rows];
 * what is behind them is of no use. */
EXPORT(page_state) void page_state(double t, double *out) {
    const aom_record *best = records + (solution.best > 0 ? solution.best : 0);
    int64_t k = step_from(best, t), steps = best->n_nodes / 2;
    double *force = out + 2 * (ptrdiff_t)posed.n_modes;
    if (k > 0 && (k >= steps || best->time[2 * k] > t))
        k--;
    t = within(t - best->time[2 * k], 0.0, best->time[2 * k + 2] - best->time[2 * k]);
    aom_state_at(&posed, best, k, t, out, force, force + posed.n_rows);
}
