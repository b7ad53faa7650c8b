/* The engine of the live report: an impact of two bodies with one contact, in one call.
 *
 * It is compiled to WebAssembly with the march, see packaging/library.py. It does what
 * antiosc.simulation does in `two_bodies.pose`, `expected`, `refinement` and `ContactHistory`, so
 * that its numbers are those of `simulate`. All pointers are offsets into its memory, which
 * page_take gives out and page_clear takes back; memory that grows makes views of it anew.
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
} found;

static aom_system posed;
static aom_contact contact;
static aom_record records[3];
static aom_solution solution;

/* ---- What is expected: antiosc.simulation.expected ---- */

static double potential(const aom_law *law, double depth, const double *state) {
    double energy;
    if (remembers(law->kind))
        return aom_law_loading_work(law, depth);
    aom_law_energies(law, 1, &depth, state, &energy);
    return energy;
}

/* Indentation, at most `high`, that absorbs an energy and the work of a force, to 10 %. */
static double deepest(const aom_law *law, double speed, double energy, double push, double high) {
    double state[AOM_MEMORY] = {0.0}, low = 0.0;
    aom_law_touch(law, speed, 1, state);
    double excess = potential(law, high, state) - energy - push * high;
    if (excess <= 0.0)
        return high;
    double wanted = energy + push * high;
    double guess = high * pow(wanted / (excess + wanted), 0.4);
    double first = 0.95 * guess, last = smaller(1.04 * guess, high);
    if (potential(law, last, state) - energy - push * last <= 0.0)
        low = last;
    else {
        low = potential(law, first, state) - energy - push * first <= 0.0 ? first : 0.0;
        high = last;
    }
    for (int i = 0; i < 400 && high > 1.1 * low; i++) {
        double middle = low > 0.0 ? 0.5 * (low + high) : 0.1 * high;
        if (potential(law, middle, state) - energy - push * middle > 0.0)
            high = middle;
        else
            low = middle;
    }
    return high;
}

static double expect(double duration) {
    double speed = 0.0, push = 0.0, gap = posed.offsets[0];
    for (int j = 0; j < posed.n_modes; j++) {
        speed += posed.beta[j] * posed.v[j];
        push += posed.beta[j] * posed.loads[j];
    }
    speed = fabs(speed);
    push = fabs(push) * contact.mass;
    speed = sqrt(speed * speed + 2.0 * push / contact.mass * gap);
    if (speed == 0.0 && push == 0.0) {
        contact.expected_depth = contact.expected_speed = 1e-300;
        return duration / 16.0;
    }
    double farthest = speed * duration + push / contact.mass * duration * duration;
    double energy = 0.5 * contact.mass * speed * speed;
    contact.expected_depth = deepest(&contact.law, speed, energy, push, farthest);
    contact.expected_speed = speed + sqrt(2.0 * push / contact.mass * contact.expected_depth);
    return smaller(3.0 * contact.expected_depth / contact.expected_speed, duration / 2.0);
}

/* ---- The run ---- */

/* What an array holds, in larger memory. */
static void *copied(const void *old, size_t bytes, size_t room) {
    void *made = page_take(room);
    if (made != NULL && bytes)
        __builtin_memcpy(made, old, bytes);
    return made;
}

/* Room for four times the nodes, and the states of all steps. */
static bool enlarge(aom_record *r, int J) {
    int64_t nodes = r->max_nodes ? 4 * r->max_nodes : 1024;
    size_t one = sizeof(double), state = 2 * one * (size_t)J, event = sizeof(aom_event);
    size_t room = (size_t)nodes * one, held = (size_t)r->n_nodes * one;
    if (8.0 * (double)nodes * (7.0 + (double)J) > MOST_BYTES)
        return false;
    r->max_nodes = nodes;
    r->max_states = nodes / 2 + 1;
    r->max_events = nodes + 2;
    r->every = r->every ? r->every : 1;
    r->time = copied(r->time, held, room);
    r->force = copied(r->force, held, room);
    r->depth = copied(r->depth, held, room);
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
        if (answer == AOM_FULL && !enlarge(records + solution.present, posed.n_modes))
            return AOM_TOO_MANY_STEPS;
    } while (answer == AOM_FULL || answer == AOM_PAUSED);
    return answer > AOM_LAW_FAILED ? answer : solution.answer;
}

/* ---- What is read from it: antiosc.simulation.scene_history ---- */

static int64_t step_at(const aom_record *r, double t) {
    int64_t low = 0, high = r->n_nodes / 2;
    while (low < high) {
        int64_t middle = (low + high) / 2;
        if (r->time[2 * middle] < t)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static double velocity(const aom_record *r, int64_t step, int j) {
    return r->states[(2 * step + 1) * posed.n_modes + j];
}

/* The undamped rigid mode that the contact moves most, or -1. */
static int freest(void) {
    int best = -1;
    for (int j = 0; j < posed.n_modes; j++)
        if (posed.omega[j] == 0.0 && posed.decay[j] == 0.0 && posed.beta[j] != 0.0 &&
            (best < 0 || fabs(posed.beta[j]) > fabs(posed.beta[best])))
            best = j;
    return best;
}

static double closing(const aom_record *r, int64_t step) {
    double speed = 0.0;
    for (int j = 0; j < posed.n_modes; j++)
        if (posed.omega[j] == 0.0)
            speed += posed.beta[j] * velocity(r, step, j);
    return speed;
}

static double impulse_of(const aom_record *r, int64_t first, int64_t last, double area) {
    int j = freest();
    if (j < 0)
        return area;
    double before = velocity(r, first, j), after = velocity(r, last, j);
    double given = posed.loads[j] * (r->time[2 * last] - r->time[2 * first]);
    double change = given - (after - before);
    double size = larger(larger(fabs(before), fabs(after)), fabs(given));
    return fabs(change) > 1e-6 * size ? change / posed.beta[j] : area;
}

static void read_contacts(const aom_record *r) {
    double open = -1.0, start = 0.0, end = 0.0, own = 0.0, most = -1.0, parting = 0.0, approach = 0.0;
    for (int64_t e = 0; e <= r->n_events; e++) {
        bool over = e == r->n_events;
        double t = over ? r->time[r->n_nodes - 1] : r->events[e].time;
        if (!over && r->events[e].branch != AOM_APART) {
            open = open < 0.0 ? t : open;
            continue;
        }
        if (open >= 0.0 && t > open) {
            int64_t span[2] = {step_at(r, open), step_at(r, t)};
            double pulse[2];
            aom_pulses(r->time, r->force, 1, 0, 1, span, pulse);
            double impulse = impulse_of(r, span[0], span[1], pulse[0]);
            found.impulse += impulse;
            found.peak = larger(found.peak, pulse[1]);
            if (found.contacts == 0.0) {
                found.first = open;
                approach = closing(r, span[0]);
            }
            bool same = found.contacts > 0.0 && open - end < end - start;
            start = same ? start : open;
            own = same ? own + impulse : impulse;
            end = found.last = t;
            if (own > most) {
                most = own;
                found.contact_time = end - start;
            }
            found.contacts += 1.0;
            found.touching = over;
            parting = closing(r, span[1]);
        }
        open = -1.0;
    }
    if (found.contacts > 0.0 && !found.touching && approach > 0.0)
        found.restitution = -parting / approach;
}

/* The hash of the sources, so that a file tells what it was built from. */
EXPORT(page_sources) const char *page_sources(void) {
    return aom_source_hash();
}

/* Simulate an impact. Arrays of n_modes: omega, decay, beta, load, v; mobility [1/kg] of both bodies
 * (`ModalBody.mobility`). Returns the address of `found`. The answer is an aom_status. */
EXPORT(page_strike)
double *page_strike(int n_modes, const double *omega, const double *decay, const double *beta,
                    const double *load, const double *v, double residual, double gap, int kind,
                    int n_params, const double *params, double mobility, double duration,
                    double rel_tol, double max_steps) {
    double *few = page_take(3 * sizeof *few), *q = page_take((size_t)n_modes * sizeof *q);
    __builtin_memset(&found, 0, sizeof found);
    __builtin_memset(q, 0, (size_t)n_modes * sizeof *q);
    found.restitution = NAN;
    few[0] = residual, few[1] = 0.0, few[2] = gap;
    contact = (aom_contact){.law = {kind, n_params, params, NULL}, .first_tangential = 1};
    contact.mass = mobility > 0.0 ? 1.0 / mobility : 1.0;
    posed = (aom_system){.n_modes = n_modes, .n_rows = 1, .n_contacts = 1, .n_breaks = 1,
                         .omega = omega, .decay = decay, .beta = beta, .residual = few,
                         .breaks = few + 1, .loads = load, .offsets = few + 2,
                         .contacts = &contact, .q = q, .v = v};
    found.answer = aom_law_check(&contact.law);
    if (found.answer != AOM_DONE)
        return &found.answer;
    found.lasting = expect(duration);
    contact.slowest = 1e-4 * contact.expected_speed;
    found.answer = solve(duration, rel_tol, found.lasting, max_steps);
    const aom_record *best = records + (solution.best > 0 ? solution.best : 0);
    if (found.answer > AOM_LAW_FAILED || best->n_nodes < 3)
        return &found.answer;
    found.force_error = solution.force;
    found.peak_error = solution.peak;
    read_contacts(best);
    found.n_nodes = (double)best->n_nodes;
    found.time = (double)(size_t)best->time;
    found.force = (double)(size_t)best->force;
    found.depth = (double)(size_t)best->depth;
    return &found.answer;
}

/* q of the last impact at a time [s], and its force behind them, into out [2 n_modes + 1]. */
EXPORT(page_state) void page_state(double t, double *out) {
    const aom_record *best = records + (solution.best > 0 ? solution.best : 0);
    int64_t k = step_at(best, t), steps = best->n_nodes / 2;
    double depth;
    if (k > 0 && (k >= steps || best->time[2 * k] > t))
        k--;
    t = within(t - best->time[2 * k], 0.0, best->time[2 * k + 2] - best->time[2 * k]);
    aom_state_at(&posed, best, k, t, out, out + 2 * posed.n_modes, &depth);
}
