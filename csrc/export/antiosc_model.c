/* A run that goes on by communication steps: whole steps of the stepper, read in between. */
#include "antiosc_model.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "../arena.h"

struct axm_run {
    const axm_model *model;
    aom_stepper *stepper;
    aom_system system;               /* the model's, with the start of the parameters */
    double *v;                       /* [J] start */
    double *responses;               /* [6][J] of a port, over the last communication step */
    double *modal;                   /* [2][J] force and rate on the modes of a port */
    double *time;                    /* [1] */
    double *span;                    /* [1] of the responses */
    double *input;                   /* [2][n_sites] force and rate */
    double *parameter;               /* [n_parameters] */
    double *peak, *impulse;          /* [p] up to the start of the present step */
    double *now_peak, *now_impulse;  /* [p] up to the present time */
    double *state;                   /* [2][J] at the present time */
    double *force, *depth;           /* [m] at the present time */
    double *node_time;               /* [3] of the present step */
    double *node_force, *node_depth; /* [3][m] */
    double *node_state;              /* [2][J] at its start */
    double *filled;                  /* [1] nodes of the present step */
};

static double *run_doubles(arena *a, int count) { return take(a, (size_t)count, sizeof(double)); }

static bool is_port(const axm_model *model) { return model->system.n_contacts == 0; }

/* The arrays of a run behind it in its memory; returns the bytes of all. */
static size_t lay_out_run(const axm_model *model, void *memory) {
    int J = model->system.n_modes, m = model->system.n_rows, p = model->system.n_contacts;
    arena a = {memory, 0};
    axm_run unused, *run = take(&a, 1, sizeof *run);
    if (run == NULL)
        run = &unused;
    run->v = run_doubles(&a, J);
    run->responses = run_doubles(&a, 6 * J);
    run->modal = run_doubles(&a, 2 * J);
    run->time = run_doubles(&a, 1);
    run->span = run_doubles(&a, 1);
    run->input = run_doubles(&a, 2 * model->n_sites);
    run->parameter = run_doubles(&a, model->n_parameters);
    run->peak = run_doubles(&a, p);
    run->impulse = run_doubles(&a, p);
    run->now_peak = run_doubles(&a, p);
    run->now_impulse = run_doubles(&a, p);
    run->state = run_doubles(&a, 2 * J);
    run->force = run_doubles(&a, m);
    run->depth = run_doubles(&a, m);
    run->node_time = run_doubles(&a, 3);
    run->node_force = run_doubles(&a, 3 * m);
    run->node_depth = run_doubles(&a, 3 * m);
    run->node_state = run_doubles(&a, 2 * J);
    run->filled = run_doubles(&a, 1);
    if (!is_port(model))
        run->stepper = take(&a, aom_memory_size(&model->system), 1);
    return a.used;
}

static bool good_model(const axm_model *model) {
    const aom_system *s = &model->system;
    bool sizes = s->n_modes >= 0 && s->n_modes <= 1000000 && s->n_rows >= 0 && s->n_rows <= 10000 &&
                 s->n_breaks >= 1 && model->n_sites >= 0 && model->n_sites <= 10000 &&
                 model->n_parameters >= 0 && model->n_parameters <= 1000 && model->n_outputs >= 0;
    if (!sizes || (is_port(model) ? s->n_rows != model->n_sites : aom_memory_size(s) == 0))
        return false;
    for (int i = 0; i < model->n_outputs; i++) {
        const axm_output_spec *output = model->outputs + i;
        bool of_site = output->kind == AXM_DISPLACEMENT || output->kind == AXM_VELOCITY;
        if (output->kind < AXM_FORCE || output->kind > AXM_VELOCITY || output->index < 0 ||
            output->index >= (of_site ? model->n_sites : s->n_contacts))
            return false;
    }
    return true;
}

size_t axm_size(const axm_model *model) { return good_model(model) ? lay_out_run(model, NULL) : 0; }

int axm_create(const axm_model *model, void *memory, size_t bytes, axm_run **made) {
    if (!good_model(model))
        return AOM_BAD_SIZE;
    if (memory == NULL || bytes < lay_out_run(model, NULL))
        return AOM_SMALL_MEMORY;
    axm_run *run = memory;
    memset(memory, 0, bytes);
    lay_out_run(model, memory);
    run->model = model;
    run->system = model->system;
    run->system.v = run->v;
    for (int k = 0; k < model->n_parameters; k++)
        run->parameter[k] = model->parameters[k];
    if (!is_port(model)) {
        aom_stepper *stepper;
        int status =
            aom_create(&model->system, run->stepper, aom_memory_size(&model->system), &stepper);
        if (status != AOM_DONE)
            return status;
        run->stepper = stepper;
    }
    *made = run;
    return axm_start(run);
}

/* ---- the present step */

static aom_record present_record(const axm_run *run, aom_event *events, int room) {
    aom_record record = {.max_nodes = 3, .max_states = 1, .max_events = room,
                         .n_nodes = (int64_t)run->filled[0], .time = run->node_time,
                         .force = run->node_force, .depth = run->node_depth,
                         .states = run->node_state, .events = events};
    return record;
}

/* Largest value, and integral, of a parabola through values at 0, 1/2, 1, up to u. */
static double parabola_peak(double f0, double f1, double f2, double u) {
    double b = 4.0 * f1 - 3.0 * f0 - f2, c = 2.0 * (f0 - 2.0 * f1 + f2);
    double end = f0 + u * (b + u * c), top = c < 0.0 ? -0.5 * b / c : 0.0;
    double most = end > f0 ? end : f0;
    if (top > 0.0 && top < u && f0 + 0.5 * b * top > most)
        most = f0 + 0.5 * b * top;
    return most;
}

static double parabola_area(double f0, double f1, double f2, double u) {
    double b = 4.0 * f1 - 3.0 * f0 - f2, c = 2.0 * (f0 - 2.0 * f1 + f2);
    return u * (f0 + u * (b / 2.0 + u * c / 3.0));
}

/* Peaks and impulses at the share u of the present step. */
static void account(axm_run *run, double u) {
    int m = run->system.n_rows;
    double h = run->node_time[2] - run->node_time[0];
    for (int c = 0; c < run->system.n_contacts; c++) {
        const double *f = run->node_force + c;
        double peak = parabola_peak(f[0], f[m], f[2 * m], u);
        run->now_peak[c] = peak > run->peak[c] ? peak : run->peak[c];
        run->now_impulse[c] = run->impulse[c] + h * parabola_area(f[0], f[m], f[2 * m], u);
    }
}

/* The next step: the last node of this one becomes its first. */
static int next_step(axm_run *run) {
    int m = run->system.n_rows, p = run->system.n_contacts;
    size_t row = (size_t)m * sizeof(double);
    if (run->filled[0] == 3.0) {
        account(run, 1.0);
        memcpy(run->peak, run->now_peak, (size_t)p * sizeof(double));
        memcpy(run->impulse, run->now_impulse, (size_t)p * sizeof(double));
        run->node_time[0] = run->node_time[2];
        memcpy(run->node_force, run->node_force + 2 * (ptrdiff_t)m, row);
        memcpy(run->node_depth, run->node_depth + 2 * (ptrdiff_t)m, row);
        run->filled[0] = 1.0;
    }
    aom_event event;
    aom_record record = present_record(run, &event, 1);
    int status;
    do {
        record.n_events = 0;
        status = aom_integrate(run->stepper, &record, INFINITY, 1);
    } while (status == AOM_PAUSED && record.n_nodes < 3);
    run->filled[0] = (double)record.n_nodes;
    return record.n_nodes == 3 && status == AOM_PAUSED ? AOM_DONE : status;
}

static int advance_contacts(axm_run *run, double time) {
    while (run->filled[0] < 3.0 || run->node_time[2] < time) {
        int status = next_step(run);
        if (status != AOM_DONE)
            return status;
        if (run->filled[0] < 3.0) /* the end of the run */
            return AOM_TOO_MANY_STEPS;
    }
    aom_event event;
    aom_record record = present_record(run, &event, 1);
    double since = time - run->node_time[0], h = run->node_time[2] - run->node_time[0];
    aom_state_at(&run->system, &record, 0, since, run->state, run->force, run->depth);
    account(run, h > 0.0 ? since / h : 0.0);
    return AOM_DONE;
}

/* ---- a port */

static void advance_port(axm_run *run, double h) {
    const aom_system *s = &run->system;
    int J = s->n_modes, m = s->n_rows;
    if (h != run->span[0])
        aom_responses(J, s->omega, s->decay, &h, 0, run->responses);
    run->span[0] = h;
    const double *P = run->responses, *W = P + J, *S = W + J, *J0 = S + J, *J1 = J0 + J;
    double *q = run->state, *v = q + J;
    for (int j = 0; j < J; j++) {
        double force = 0.0, rate = 0.0, a = q[j], b = v[j], w = s->omega[j];
        for (int i = 0; i < m; i++) {
            double part = s->beta[(ptrdiff_t)i * J + j];
            force += part * run->input[i];
            rate += part * run->input[m + i];
        }
        q[j] = P[j] * a + S[j] * b + force * J0[j] + rate * J1[j];
        v[j] = W[j] * b - w * w * S[j] * a + force * S[j] + rate * J0[j];
    }
    for (int i = 0; i < m; i++) {
        run->input[i] += h * run->input[m + i];
        run->force[i] = run->input[i];
    }
}

/* ---- the interface */

int axm_start(axm_run *run) {
    const axm_model *model = run->model;
    int J = run->system.n_modes, p = run->system.n_contacts, m = run->system.n_rows;
    memcpy(run->v, model->system.v, (size_t)J * sizeof(double));
    for (int k = 0; k < model->n_parameters; k++)
        for (int j = 0; j < J; j++)
            run->v[j] +=
                (run->parameter[k] - model->parameters[k]) * model->start[(ptrdiff_t)k * J + j];
    run->time[0] = run->filled[0] = 0.0;
    run->span[0] = -1.0;
    memset(run->peak, 0, (size_t)p * sizeof(double));
    memset(run->impulse, 0, (size_t)p * sizeof(double));
    if (is_port(model)) {
        memcpy(run->state, model->system.q, (size_t)J * sizeof(double));
        memcpy(run->state + J, run->v, (size_t)J * sizeof(double));
        memcpy(run->force, run->input, (size_t)m * sizeof(double));
        return AOM_DONE;
    }
    int status = aom_start(run->stepper, &run->system, &model->options);
    return status == AOM_DONE ? advance_contacts(run, 0.0) : status;
}

int axm_advance(axm_run *run, double time) {
    if (!(time >= run->time[0]) || time == INFINITY)
        return AOM_BAD_OPTIONS;
    int status = AOM_DONE;
    if (is_port(run->model))
        advance_port(run, time - run->time[0]);
    else
        status = advance_contacts(run, time);
    if (status == AOM_DONE)
        run->time[0] = time;
    return status;
}

double axm_time(const axm_run *run) { return run->time[0]; }

/* Displacement of a site by the loads on what has no mass there. */
static double site_shift(const axm_run *run, int site) {
    const aom_system *s = &run->system;
    int k = 0, width = run->model->n_sites;
    while (k + 1 < s->n_breaks && s->breaks[k + 1] <= run->time[0])
        k++;
    const double *at = run->model->site_shifts + (ptrdiff_t)k * width + site;
    if (k + 1 == s->n_breaks)
        return at[0];
    double share = (run->time[0] - s->breaks[k]) / (s->breaks[k + 1] - s->breaks[k]);
    return at[0] + share * (at[width] - at[0]);
}

static double site_motion(const axm_run *run, int site, const double *modal) {
    int J = run->system.n_modes;
    const double *row = run->model->site_modes + (ptrdiff_t)site * J;
    double total = 0.0;
    for (int j = 0; j < J; j++)
        total += row[j] * modal[j];
    return total;
}

double axm_output(const axm_run *run, int output) {
    const axm_output_spec *spec = run->model->outputs + output;
    int c = spec->index, m = run->system.n_rows;
    double total;
    switch (spec->kind) {
    case AXM_FORCE:
        return run->force[c] > 0.0 ? run->force[c] : 0.0;
    case AXM_INDENTATION:
        return run->depth[c];
    case AXM_PEAK:
        return run->now_peak[c];
    case AXM_IMPULSE:
        return run->now_impulse[c];
    case AXM_VELOCITY:
        return site_motion(run, c, run->state + run->system.n_modes);
    default:
        total = site_motion(run, c, run->state) + site_shift(run, c);
        for (int i = 0; i < m; i++)
            total += run->model->site_forces[(ptrdiff_t)c * m + i] * run->force[i];
        return total;
    }
}

void axm_set_input(axm_run *run, int site, double force, double rate) {
    run->input[site] = run->force[site] = force;
    run->input[run->model->n_sites + site] = rate;
}

double axm_input(const axm_run *run, int site) { return run->input[site]; }

void axm_set_parameter(axm_run *run, int parameter, double value) {
    run->parameter[parameter] = value;
}

double axm_parameter(const axm_run *run, int parameter) { return run->parameter[parameter]; }

uint64_t axm_checksum(const void *bytes, size_t size) {
    const unsigned char *at = bytes;
    uint64_t sum = 14695981039346656037u;
    for (size_t k = 0; k < size; k++)
        sum = (sum ^ at[k]) * 1099511628211u;
    return sum;
}
