/* Systems made from bytes, run through the march's public header.
 *
 * Alone a test program: march_fuzz [FIRST [COUNT]] runs systems of random bytes and ends with 0; for
 * sanitizers and valgrind. With -DFUZZER the entry of libFuzzer. See .ci/fuzz-march. */
#include <stdio.h>
#include <stdlib.h>

#include "../../csrc/antiosc_march.h"

#include <math.h>
#include <string.h>

enum { MODES = 6, CONTACTS = 3, ROWS = 9, BREAKS = 3, KNOTS = 4, TABLE = 5 + 2 * (5 * KNOTS + 2) };

typedef struct source {
    const uint8_t *at, *end;
} source;

static unsigned byte(source *s) { return s->at < s->end ? *s->at++ : 0u; }

/* A number of any bits now and then, else one of a sensible size. */
static double number(source *s, double low, double high) {
    unsigned kind = byte(s);
    if (kind == 255u) {
        uint8_t bits[8];
        double x;
        for (int k = 0; k < 8; k++)
            bits[k] = (uint8_t)byte(s);
        memcpy(&x, bits, sizeof x);
        return x;
    }
    double part = (byte(s) + 256.0 * byte(s)) / 65535.0;
    return low > 0.0 ? low * pow(high / low, part) : low + (high - low) * part;
}

static void numbers(source *s, double *to, int n, double low, double high) {
    for (int k = 0; k < n; k++)
        to[k] = number(s, low, high);
}

static int user_force(void *context, double d, double rate, const double *state, double out[3]) {
    (void)context;
    out[0] = d > 0.0 ? state[0] * d * d : 0.0;
    out[1] = d > 0.0 ? 2.0 * state[0] * d : 0.0;
    out[2] = 0.0 * rate;
    return d > 1.0;
}

static int user_touch(void *context, double speed, int first, double *state, double *origin) {
    (void)context, (void)speed;
    if (first)
        state[0] = 1e9;
    *origin = 0.0;
    return 0;
}

static int user_advance(void *context, double d, double rate, double *state, double *origin) {
    (void)context, (void)d, (void)rate, (void)state;
    *origin = 0.0;
    return 0;
}

static int user_work(void *context, double speed, double d, double *work) {
    (void)context, (void)speed;
    *work = 3e8 * d * d * d;
    return d > 1.0;
}

static void table(source *s, double *to) {
    double *x = to + 5;
    memset(to, 0, TABLE * sizeof *to);
    to[0] = byte(s) % 2;
    to[1] = number(s, 0.0, 0.9);
    to[2] = to[3] = KNOTS;
    to[4] = 5 + 5 * KNOTS + 2;
    for (int curve = 0; curve < 2; curve++, x += 5 * KNOTS + 2)
        for (int k = 0; k < KNOTS; k++) {
            x[k] = curve == 0 ? 1e-5 * k : k / (KNOTS - 1.0);
            x[3 * KNOTS + k] = curve == 0 ? 1e7 : 1.0;
            x[4 * KNOTS + k] = x[3 * KNOTS + k] * x[k];
        }
    to[5 + 5 * KNOTS] = 1e7 * 1e-5 * (KNOTS - 1);
    to[5 + 5 * KNOTS + 1] = 1e7;
    to[TABLE - 2] = to[TABLE - 1] = 1.0;
    if (byte(s) == 1u)
        to[byte(s) % TABLE] = number(s, -1.0, 99.0);
}

static void law(source *s, aom_law *to, double *params, const aom_user_law *user) {
    static const int counts[] = {1, 2, 5, 3, 2, 2, 2, 3, TABLE, 0};
    to->kind = (int)(byte(s) % 10u);
    to->n_params = counts[to->kind];
    to->params = params;
    to->user = to->kind == AOM_USER ? user : NULL;
    if (to->kind == AOM_TABLE) {
        table(s, params);
        return;
    }
    params[0] = number(s, 1e5, 1e11);
    /* the second is an exponent, a compliance or an indentation */
    params[1] = to->kind == AOM_POWER || to->kind == AOM_DAMPED ? number(s, 1.0, 3.0)
                : to->kind == AOM_HERTZ                         ? 0.0
                                                                : number(s, 1e-7, 1e-3);
    params[2] = number(s, 1e-2, 0.9);
    if (to->kind == AOM_HERTZ && byte(s) % 2u) {
        double a = pow(params[0], -2.0 / 3.0), c = number(s, 1e-10, 1e-8);
        double end = 1.4 * a / (3.0 * c);
        params[1] = c, params[2] = a, params[3] = end, params[4] = 2.0 / 3.0 * a / end - c;
    }
    if (byte(s) == 1u)
        to->n_params = (int)byte(s);
}

/* Error control in records that may be too small, with states of the first two. */
static void solve(aom_stepper *stepper, const aom_system *system, const aom_options *options) {
    enum { NODES = 256 };
    static double time[3][NODES], force[3][NODES * ROWS], depth[3][NODES * ROWS];
    static double states[2][NODES * 2 * MODES];
    static aom_event events[3][NODES];
    aom_record records[3];
    aom_solution solution = {0};
    int status = AOM_PAUSED;
    for (int k = 0; k < 3; k++)
        records[k] = (aom_record){.max_nodes = NODES, .max_states = NODES - 1, .max_events = NODES,
                                  .time = time[k], .force = force[k], .depth = depth[k],
                                  .states = k < 2 ? states[k] : NULL, .events = events[k]};
    for (int calls = 0; calls < 20 && status == AOM_PAUSED; calls++)
        status = aom_solve(stepper, system, options, &solution, records, 200);
    if (status == AOM_DONE && (solution.best < 0 || solution.best > 2 || !(solution.force >= 0.0)))
        abort();
}

/* The first row of a system as impacts of a batch, the second one of other modes, and its free modes
 * as if the frequencies were masses and the first loads poles. */
static void batch(const aom_system *s, const aom_options *options) {
    enum { NODES = 2 * 20000 + 1 };
    static double times[NODES], forces[NODES], x[MODES + 1];
    static double shape[(MODES + 1) * (MODES + 1)];
    const aom_contact *c = s->contacts;
    aom_contact alone = {.law = c->law, .first_tangential = 1, .mass = c->mass};
    aom_impact impacts[3] = {{*s, *options}};
    aom_system *one = &impacts[0].system;
    aom_outcome outcomes[3];
    aom_pulse_nodes nodes = {NODES, 0, times, forces};
    int64_t done = 0;
    size_t size = aom_batch_size(s->n_modes);
    void *memory = malloc(size);
    aom_batch *made;
    one->n_rows = one->n_contacts = one->n_breaks = 1;
    one->n_stretch = 0;
    one->gamma = NULL;
    one->contacts = &alone;
    impacts[1] = impacts[2] = impacts[0];
    impacts[1].system.omega = s->decay;
    impacts[2].system.beta = s->beta + (s->n_rows > 1 ? s->n_modes : 0);
    if (aom_batch_nodes(s->n_modes) > NODES || aom_batch_create(s->n_modes, memory, size, &made))
        abort();
    for (int status = AOM_PAUSED; status == AOM_PAUSED || status == AOM_FULL;) {
        status = aom_batch_solve(made, 3, impacts, outcomes, &nodes, 700, &done);
        if (status == AOM_FULL && nodes.n_nodes == 0)
            abort();
        if (status == AOM_FULL)
            nodes.n_nodes = 0;
    }
    if (done != 3 || nodes.n_nodes > NODES)
        abort();
    if (s->n_modes > 0)
        aom_arrow_modes(options->rel_tol, c->friction, s->n_modes, s->omega, s->loads, x, shape);
    free(memory);
}

static void run(const aom_system *system, const aom_options *options) {
    enum { NODES = 64 };
    static double time[NODES], force[NODES * ROWS], depth[NODES * ROWS], states[NODES * 2 * MODES];
    static aom_event events[NODES];
    size_t size = aom_memory_size(system);
    if (size == 0)
        return;
    void *memory = malloc(size);
    aom_stepper *stepper;
    int status = aom_create(system, memory, size, &stepper);
    for (int again = 0; again < 2 && status == AOM_DONE; again++) {
        aom_record record = {.max_nodes = NODES, .max_states = again ? 0 : NODES,
                             .max_events = NODES, .time = time, .force = force, .depth = depth,
                             .states = again ? NULL : states, .events = events};
        status = aom_start(stepper, system, options);
        for (int calls = 0; calls < 60 && (status == AOM_DONE || status == AOM_FULL ||
                                           status == AOM_PAUSED); calls++) {
            int64_t before = record.n_nodes;
            if (status == AOM_FULL)
                aom_clear(&record);
            status = aom_integrate(stepper, &record, options->duration * calls / 8.0, 500);
            if (record.n_nodes > record.max_nodes || record.n_nodes < 0 || before < 0)
                abort();
            if (status == AOM_DONE && aom_summarize(stepper).time == options->duration)
                break;
        }
        if (!again && record.n_states > 0 && record.n_nodes >= 3) {
            double state[2 * MODES], f[ROWS], d[ROWS], work[AOM_COMPARED * ROWS], out[2];
            double energy;
            int64_t span[2] = {0, (record.n_nodes - 1) / 2};
            aom_state_at(system, &record, 0, 0.3 * (time[2] - time[0]), state, f, d);
            aom_pulses(time, force, system->n_rows, 0, 1, span, out);
            aom_compare(system->n_rows, record.n_nodes, time, force, record.n_nodes, time, force,
                        1e-3, work);
            aom_energies(1, system->n_modes, states, system->omega, &energy);
        }
        if (status > AOM_LAW_FAILED)
            break;
        status = AOM_DONE;
    }
    if (status == AOM_DONE)
        solve(stepper, system, options);

    free(memory);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    source bytes = {data, data + size}, *s = &bytes;
    static double omega[MODES], decay[MODES], beta[ROWS * MODES], residual[ROWS * ROWS];
    static double breaks[BREAKS], loads[BREAKS * 2 * MODES], offsets[BREAKS * ROWS];
    static double q[MODES], v[MODES], gamma[ROWS * MODES];
    static double params[CONTACTS][TABLE];
    static const aom_user_law user = {NULL, 1, 0, user_force, user_touch, user_advance, user_work};
    aom_contact contacts[CONTACTS];
    double states[CONTACTS][AOM_MEMORY];
    aom_system system = {
        .n_modes = (int)(byte(s) % (MODES + 1)), .n_contacts = 1 + (int)(byte(s) % CONTACTS),
        .n_breaks = 1 + (int)(byte(s) % BREAKS), .omega = omega, .decay = decay, .beta = beta,
        .residual = residual, .breaks = breaks, .loads = loads, .offsets = offsets,
        .contacts = contacts, .q = q, .v = v};
    int tangents = (int)(byte(s) % 3u), J = system.n_modes, p = system.n_contacts;
    int m = system.n_rows = p * (1 + tangents);
    numbers(s, omega, J, 0.0, 1e5);
    numbers(s, decay, J, 0.0, byte(s) % 2u ? 1e3 : 0.0);
    if (J > 0 && byte(s) % 2u)
        omega[0] = decay[0] = 0.0;
    numbers(s, beta, m * J, -3.0, 3.0);
    system.gamma = byte(s) % 3u ? NULL : gamma;
    if (system.gamma != NULL)
        numbers(s, gamma, m * J, -1e-4, 1e-4);
    memset(residual, 0, sizeof residual);
    if (byte(s) % 2u)
        for (int i = 0; i < m; i++)
            residual[i * (m + 1)] = number(s, 1e-10, 1e-6);
    breaks[0] = 0.0;
    for (int k = 1; k < BREAKS; k++)
        breaks[k] = breaks[k - 1] + number(s, 1e-5, 1e-2);
    const int n_loads = system.n_breaks * J * (system.gamma == NULL ? 1 : 2);
    numbers(s, loads, n_loads, 0.0, byte(s) % 2u ? 100.0 : 0.0);
    numbers(s, offsets, system.n_breaks * m, -1e-5, 1e-3);
    numbers(s, q, J, -1e-5, 1e-5);
    numbers(s, v, J, -3.0, 3.0);
    for (int c = 0; c < p; c++) {
        aom_contact *to = contacts + c;
        law(s, &to->law, params[c], &user);
        to->friction = number(s, 0.0, 1.0);
        to->tangential_stiffness = number(s, 1e4, 1e8);
        to->first_tangential = p + c * tangents;
        to->n_tangential = tangents;
        to->mass = number(s, 1e-3, 1e2);
        to->expected_depth = number(s, 1e-8, 1e-2);
        to->expected_speed = number(s, 1e-3, 1e2);
        to->slowest = number(s, 0.0, 1e-3);
        to->preload = byte(s) % 4u ? 0.0 : number(s, 0.0, 1e3);
        numbers(s, states[c], AOM_MEMORY, 0.0, 1e-4);
        to->state = byte(s) % 4u ? NULL : states[c];
        to->closed = byte(s) % 2u;
    }
    aom_options options = aom_default_options(number(s, 1e-6, 1e-1));
    options.rel_tol = number(s, 1e-7, 0.5);
    options.step = byte(s) % 4u ? 0.0 : number(s, 1e-7, 1e-2);
    options.force_scale = byte(s) % 4u ? 0.0 : number(s, 1e-3, 1e6);
    options.max_steps = 3000;
    options.max_contacts = 100;
    run(&system, &options);
    batch(&system, &options);
    return 0;
}

#ifndef FUZZER
int main(int count, char **words) {
    unsigned first = count > 1 ? (unsigned)atoi(words[1]) : 0u;
    unsigned runs = count > 2 ? (unsigned)atoi(words[2]) : 1000u;
    uint8_t bytes[1024];
    for (unsigned seed = first; seed < first + runs; seed++) {
        uint64_t x = seed * 2654435761u + 88172645463325252u;
        for (size_t k = 0; k < sizeof bytes; k++) {
            x ^= x << 13, x ^= x >> 7, x ^= x << 17; /* Marsaglia's xorshift */
            bytes[k] = (uint8_t)(x >> 24);
        }
        LLVMFuzzerTestOneInput(bytes, sizeof bytes);
    }
    printf("%u systems\n", runs);
    return 0;
}
#endif
