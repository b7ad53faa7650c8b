/* Many impacts in one call: each is solved as aom_solve does, in memory that all of them share. */
#include "internal.h"

#define BATCH_STEPS 20000 /* that the record of a run holds, at most: a longer one is left to the caller */
#define BATCH_BYTES 5e7 /* of all records, about */
#define FINE 200.0  /* touches closer than the expected contact time over this may count as one */

typedef enum batch_stage { BEGIN, GO_ON, WRITE } batch_stage;

struct aom_batch {
    int n_modes;
    batch_stage stage;
    double *omega, *decay; /* [n_modes] that the stepper's responses are of */
    aom_stepper *stepper;
    bool made;
    void *memory;
    size_t bytes;
    aom_record records[3];
    aom_touch *touches;
    aom_contact contact;
    aom_system system;
    aom_options options;
    aom_solution solution;
    aom_expected expected;
};

static int64_t room(int n_modes) {
    double each = 3.0 * (6.0 + 2.0 * n_modes + 4.0) * sizeof(double);
    return (int64_t)within(BATCH_BYTES / each, 256.0, BATCH_STEPS);
}

static size_t lay_out_batch(aom_batch *b, int n_modes, void *memory) {
    size_t J = (size_t)n_modes, steps = (size_t)room(n_modes);
    arena a = {memory, 0};
    aom_batch unused, *to = take(&a, 1, sizeof *b);
    to = b == NULL ? &unused : b;
    to->omega = take(&a, J, sizeof(double));
    to->decay = take(&a, J, sizeof(double));
    aom_system sizes = {.n_modes = n_modes, .n_rows = 1, .n_contacts = 1, .n_breaks = 1};
    to->bytes = aom_memory_size(&sizes);
    to->memory = take(&a, to->bytes, 1);
    to->touches = take(&a, steps + 4, sizeof(aom_touch));
    for (int k = 0; k < 3; k++) {
        aom_record *record = to->records + k;
        record->max_nodes = 2 * (int64_t)steps + 1;
        record->max_states = (int64_t)steps;
        record->max_events = (int64_t)steps + 3;
        record->time = take(&a, 2 * steps + 1, sizeof(double));
        record->force = take(&a, 2 * steps + 1, sizeof(double));
        record->depth = take(&a, 2 * steps + 1, sizeof(double));
        record->states = take(&a, 2 * J * (steps + 1), sizeof(double));
        record->events = take(&a, steps + 3, sizeof(aom_event));
    }
    return a.used;
}

size_t aom_batch_size(int n_modes) {
    aom_system sizes = {.n_modes = n_modes, .n_rows = 1, .n_contacts = 1, .n_breaks = 1};
    return aom_memory_size(&sizes) == 0 ? 0 : lay_out_batch(NULL, n_modes, NULL);
}

int64_t aom_batch_nodes(int n_modes) { return 2 * room(n_modes) + 1; }

int aom_batch_create(int n_modes, void *memory, size_t bytes, aom_batch **made) {
    size_t need = aom_batch_size(n_modes);
    if (need == 0)
        return AOM_BAD_SIZE;
    if (memory == NULL || bytes < need)
        return AOM_SMALL_MEMORY;
    aom_batch *b = *made = memory;
    memset(b, 0, sizeof *b);
    lay_out_batch(b, n_modes, memory);
    b->n_modes = n_modes;
    return AOM_DONE;
}

/* Be for other rows, each a group, of the same modes, whose responses stay. */
static void renew_rows(aom_stepper *st, const aom_system *system) {
    st->system = *system;
    find_spans(st);
    for (int k = 0; k < SLOTS; k++)
        forget_rows(st, st->slots + k);
}

/* Whether a batch takes such a system; `begin` looks at its numbers. */
static bool is_impact(const aom_system *s, int n_modes) {
    return s->n_modes == n_modes && s->n_rows == 1 && s->n_contacts == 1 && s->n_breaks == 1 &&
           s->gamma == NULL && s->n_stretch == 0;
}

/* Have the stepper ready for an impact; what depends on the frequencies alone is kept. */
static int begin(aom_batch *b, const aom_impact *impact) {
    size_t size = (size_t)b->n_modes * sizeof(double);
    const aom_system *s = &b->system;
    const aom_user_law *user;
    if (!is_impact(&impact->system, b->n_modes))
        return AOM_BAD_SIZE;
    b->system = impact->system;
    b->contact = *s->contacts;
    b->system.contacts = &b->contact;
    b->options = impact->options;
    user = b->contact.law.user;
    if (!(b->options.duration > 0.0 && b->options.duration < INFINITY && s->offsets[0] >= 0.0))
        return AOM_BAD_OPTIONS;
    if (!(b->contact.mass > 0.0) || b->contact.preload > 0.0 || b->contact.state != NULL)
        return AOM_BAD_CONTACT;
    if (aom_law_check(&b->contact.law) != AOM_DONE || (user != NULL && user->work == NULL))
        return AOM_BAD_LAW;
    b->expected = scale_contact(s, &b->contact, b->options.duration);
    b->options.resolution = b->expected.time / FINE;
    b->solution = (aom_solution){0};
    if (b->made && memcmp(b->omega, s->omega, size) == 0 && memcmp(b->decay, s->decay, size) == 0) {
        renew_rows(b->stepper, s);
        return AOM_DONE;
    }
    memcpy(b->omega, s->omega, size);
    memcpy(b->decay, s->decay, size);
    int status = aom_create(s, b->memory, b->bytes, &b->stepper);
    b->made = status == AOM_DONE;
    return status;
}

/* Write down what a run gave; false if its pulses do not fit behind those of the others. */
static bool write_outcome(aom_batch *b, aom_outcome *out, aom_pulse_nodes *to) {
    const aom_solution *found = &b->solution;
    const aom_record *run = b->records + found->best;
    int open;
    int64_t n = aom_touches(run, 0, 0, b->touches, &open), nodes = 0;
    for (int64_t k = 0; k < n; k++)
        nodes += 2 * (b->touches[k].last - b->touches[k].first) + 1;
    if (to->n_nodes + nodes > to->max_nodes)
        return false;
    *out = (aom_outcome){.status = found->answer,
                         .contacts = n,
                         .touches = found->summary.touches,
                         .open = open,
                         .n_nodes = nodes,
                         .force_error = found->force,
                         .peak_error = found->peak,
                         .certain = found->certain,
                         .time = run->time[run->n_nodes - 1],
                         .lasting = b->expected.time,
                         .gained = found->summary.gained,
                         .highest = found->summary.highest};
    out->numbers = aom_read_contact(&b->system, run, 0, open, n, b->touches,
                                    run->states + b->n_modes, 2 * b->n_modes);
    for (int64_t k = 0; k < n; k++)
        for (int64_t i = 2 * b->touches[k].first; i <= 2 * b->touches[k].last; i++) {
            to->time[to->n_nodes] = run->time[i];
            to->force[to->n_nodes++] = larger(run->force[i], 0.0);
        }
    return true;
}

int aom_batch_solve(aom_batch *b, int64_t n, const aom_impact *impacts, aom_outcome *outcomes,
                    aom_pulse_nodes *to, int64_t max_attempts, int64_t *done) {
    while (*done < n) {
        const aom_impact *s = impacts + *done;
        aom_outcome *out = outcomes + *done;
        if (b->stage == BEGIN) {
            *out = (aom_outcome){.status = begin(b, s)};
            if (out->status != AOM_DONE) {
                ++*done;
                continue;
            }
            b->stage = GO_ON;
        }
        if (b->stage == GO_ON) {
            if (max_attempts <= 0)
                return AOM_PAUSED;
            int64_t before = b->solution.used;
            int status = aom_solve(b->stepper, &b->system, &b->options, &b->solution, b->records,
                                   max_attempts);
            max_attempts -= b->solution.used - before;
            if (status == AOM_PAUSED)
                return AOM_PAUSED;
            b->stage = status == AOM_DONE ? WRITE : BEGIN;
            if (status != AOM_DONE) {
                out->status = status;
                ++*done;
                continue;
            }
        }
        if (!write_outcome(b, out, to))
            return AOM_FULL;
        b->stage = BEGIN;
        ++*done;
    }
    return AOM_DONE;
}
