/* Contact laws: force by indentation and rate, where their branches end, what they remember.
 *
 * memory of a contact: damped (d/v0, fastest approach); with memory (deepest indentation, turning
 * point, indentation from which the loading goes on); a user's law its state, then the origin, then
 * whether it has touched. */
#include "internal.h"

#define FULLY_PLASTIC 84.0 /* Stronge's law */
#define PRESSURE 3.3

static const tangent NO_FORCE = {0.0, 0.0, 0.0};

static bool elastic_table(const aom_law *law) {
    return law->kind == AOM_TABLE && law->params[0] == 1.0;
}
static int loading_knots(const aom_law *law) { return (int)law->params[2]; }
static int unloading_knots(const aom_law *law) { return (int)law->params[3]; }
static const double *loading_table(const aom_law *law) { return law->params + 5; }
static const double *unloading_table(const aom_law *law) {
    return law->params + (int)law->params[4];
}

/* Value and slope of a monotone cubic of n knots, a straight line beyond its last. */
static curve table_at(const double *x, int n, double at) {
    if (at <= x[0])
        return (curve){0.0, 0.0};
    if (at >= x[n - 1]) {
        double value = x[5 * n], slope = x[5 * n + 1];
        return (curve){value + slope * (at - x[n - 1]), slope};
    }
    int low = 0, high = n - 1;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (x[middle] <= at)
            low = middle;
        else
            high = middle;
    }
    double d = at - x[low];
    double a = x[n + low], b = x[2 * n + low], c = x[3 * n + low], e = x[4 * n + low];
    return (curve){((a * d + b) * d + c) * d + e, (3.0 * a * d + 2.0 * b) * d + c};
}

/* Its integral from the first knot. */
static double table_area(const double *x, int n, double at) {
    double total = 0.0;
    for (int i = 0; i < n - 1 && at > x[i]; i++) {
        double d = smaller(at, x[i + 1]) - x[i];
        double a = x[n + i], b = x[2 * n + i], c = x[3 * n + i], e = x[4 * n + i];
        total += (((a * d / 4 + b / 3) * d + c / 2) * d + e) * d;
    }
    if (at > x[n - 1]) {
        double d = at - x[n - 1];
        total += d * (x[5 * n] + 0.5 * x[5 * n + 1] * d);
    }
    return total;
}

/* F/F_y of Stronge's law is `area growth`, with area = 2 delta/delta_y - 1. */
static double stronge_growth(double area) {
    return 1.0 + log(smaller(area, 2.0 * FULLY_PLASTIC - 1.0)) / PRESSURE;
}

/* Virgin force and its slope of a law with memory. */
curve law_loading(const aom_law *law, double delta) {
    if (delta <= 0.0)
        return (curve){0.0, 0.0};
    if (law->kind == AOM_TABLE)
        return table_at(loading_table(law), loading_knots(law), delta);
    double k = law->params[0], y = law->params[1];
    if (law->kind == AOM_THORNTON && delta > y)
        return (curve){k * sqrt(y) * (1.5 * delta - 0.5 * y), 1.5 * k * sqrt(y)};
    if (law->kind == AOM_STRONGE && delta > y) {
        double x = delta / y, area = 2.0 * x - 1.0, growth = stronge_growth(area);
        double top = k * y * sqrt(y), force = top * area * growth;
        if (x < FULLY_PLASTIC)
            growth += 1.0 / PRESSURE;
        return (curve){force, 2.0 * top / y * growth};
    }
    return (curve){k * delta * sqrt(delta), 1.5 * k * sqrt(delta)};
}

static double law_energy(const aom_law *law, double delta, const double *state);

double aom_law_loading_work(const aom_law *law, double delta) {
    const double *p = law->params;
    if (delta <= 0.0 || law->kind == AOM_USER)
        return 0.0;
    if (law->kind == AOM_TABLE)
        return table_area(loading_table(law), loading_knots(law), delta);
    if (!remembers(law->kind))
        return law_energy(law, delta, NULL);
    double k = p[0], y = p[1];
    bool yields = (law->kind == AOM_THORNTON || law->kind == AOM_STRONGE) && delta > y;
    double d = yields ? y : delta, elastic = 0.4 * k * d * d * sqrt(d);
    if (!yields)
        return elastic;
    if (law->kind == AOM_THORNTON)
        return elastic + k * sqrt(y) * (delta - y) * (0.75 * (delta + y) - 0.5 * y);
    /* the integral of s (1 + ln s/P) ds/2 from 1 to s = 2 x - 1 */
    double s = 2.0 * delta / y - 1.0, full = 2.0 * FULLY_PLASTIC - 1.0, a = smaller(s, full);
    double work = (a * a - 1.0) / 4 + (a * a * (2.0 * log(a) - 1.0) + 1.0) / (8.0 * PRESSURE);
    if (s > full)
        work += (s * s - full * full) / 4 * (1.0 + log(full) / PRESSURE);
    return elastic + k * y * sqrt(y) * y * work;
}

/* Permanent indentation after a deepest one. */
double law_permanent(const aom_law *law, double deepest) {
    double y = law->params[1];
    switch (law->kind) {
    case AOM_THORNTON: {
        if (deepest <= y)
            return 0.0;
        double x = sqrt(y / deepest);
        return deepest * (1.0 - x) * (1.0 - x) * (2.0 + x) / 2.0;
    }
    case AOM_STRONGE: {
        double x = deepest / y;
        if (x <= 1.0)
            return 0.0;
        double printed = y * (x - 1.0) * (x - 1.0) / (x + sqrt(2.0 * x - 1.0));
        /* what gives back no more than was put in */
        double work = aom_law_loading_work(law, deepest);
        return larger(printed, deepest - 2.5 * work / law_loading(law, deepest).value);
    }
    case AOM_YANG_SUN:
        return deepest <= y ? 0.0 : deepest * (1.0 - exp(0.4 * log(y / deepest)));
    case AOM_TAN_SUN:
        return law->params[2] * larger(deepest - y, 0.0);
    default: /* a table: the share that remains */
        return y * deepest;
    }
}

/* The power of the unloading (`back`) or the reloading curve. */
static double shape_power(const aom_law *law, bool back) {
    bool laminate = law->kind == AOM_YANG_SUN || law->kind == AOM_TAN_SUN;
    return back && laminate ? 2.5 : 1.5;
}

/* Unloading (`back`) or reloading curve from (0, 0) to (1, 1). */
curve law_shape(const aom_law *law, double x, bool back) {
    if (x <= 0.0)
        return (curve){0.0, 0.0};
    if (law->kind == AOM_TABLE)
        return table_at(unloading_table(law), unloading_knots(law), x);
    double root = sqrt(x);
    if (shape_power(law, back) > 2.0)
        return (curve){x * x * root, 2.5 * x * root};
    return (curve){x * root, 1.5 * root};
}

/* Its integral from 0. */
static double shape_area(const aom_law *law, double x, bool back) {
    if (x <= 0.0)
        return 0.0;
    if (law->kind == AOM_TABLE)
        return table_area(unloading_table(law), unloading_knots(law), x);
    double n = shape_power(law, back);
    return pow(x, n + 1.0) / (n + 1.0);
}

/* Force and slope of a law with memory (deepest indentation, turning point). */
static curve hysteretic(const aom_law *law, int branch, double delta, const double *memory) {
    double deepest = memory[0], turn = memory[1];
    if (branch == AOM_FORWARD && delta >= deepest)
        return law_loading(law, delta);
    double low = law_permanent(law, deepest);
    if (delta <= low || deepest <= 0.0)
        return (curve){0.0, 0.0};
    double top = law_loading(law, deepest).value, from = deepest;
    if (branch == AOM_BACK) {
        if (turn <= low)
            return (curve){0.0, 0.0};
        if (turn < deepest) {
            top *= law_shape(law, (turn - low) / (deepest - low), false).value;
            from = turn;
        }
    }
    curve part = law_shape(law, (delta - low) / (from - low), branch == AOM_BACK);
    return (curve){top * part.value, top * part.slope / (from - low)};
}

static curve hertz(const double *p, double delta) {
    double k = p[0], c = p[1];
    if (c == 0.0) {
        double root = sqrt(delta);
        return (curve){k * delta * root, 1.5 * k * root};
    }
    double a = p[2], end = p[3]; /* delta = a s^2 - c s^3 up to s = end, a straight line beyond */
    double reach = (a - c * end) * end * end;
    if (delta >= reach)
        return (curve){end * end * end + (delta - reach) / p[4], 1.0 / p[4]};
    double s = sqrt(delta / a);
    for (int tries = 0; tries < 50; tries++) {
        double step = ((a - c * s) * s * s - delta) / ((2.0 * a - 3.0 * c * s) * s);
        s = smaller(s - step, end);
        if (fabs(step) <= 1e-9 * s)
            break;
    }
    return (curve){s * s * s, 1.0 / ((2.0 / 3.0) * a / s - c)};
}

static curve power(const double *p, double delta) {
    double n = p[1], force;
    if (n == 1.5)
        force = p[0] * delta * sqrt(delta);
    else if (n == 1.0)
        force = p[0] * delta;
    else
        force = p[0] * exp(n * log(delta));
    return (curve){force, n * force / delta};
}

static tangent user_tangent(aom_stepper *st, const aom_user_law *user, double delta, double rate,
                            const double *memory) {
    double out[3] = {0.0, 0.0, 0.0};
    if (st->law_failed || user->force(user->context, delta, rate, memory, out) != 0) {
        st->law_failed = true;
        return NO_FORCE;
    }
    return (tangent){out[0], out[1], out[2]};
}

/* Force of a branch and its slopes by indentation and rate; a linear law goes on below 0. `st` is
 * told when a user's law fails. */
tangent law_tangent(aom_stepper *st, const aom_law *law, int branch, double delta, double rate,
                    const double *memory) {
    const double *p = law->params;
    if (!pressing(branch))
        return NO_FORCE;
    if (law->kind == AOM_LINEAR)
        return (tangent){p[0] * delta, p[0], 0.0};
    if (law->kind == AOM_USER)
        return user_tangent(st, law->user, delta, rate, memory);
    if (delta <= 0.0)
        return NO_FORCE;
    curve found = law->kind == AOM_HERTZ ? hertz(p, delta)
                  : remembers(law->kind) ? hysteretic(law, branch, delta, memory)
                                         : power(p, delta);
    if (law->kind != AOM_DAMPED)
        return (tangent){found.value, found.slope, 0.0};
    double grip = 1.0 + memory[0] * rate;
    return (tangent){found.value * grip, found.slope * grip, found.value * memory[0]};
}

static double origin(const aom_law *law, const double *memory) {
    if (law->kind == AOM_USER)
        return memory[law->user->n_state];
    return remembers(law->kind) ? law_permanent(law, memory[0]) : 0.0;
}

/* Where a branch ends. */
branch_bounds law_bounds(const aom_law *law, int branch, const double *memory) {
    branch_bounds b = {origin(law, memory), INFINITY, -INFINITY, INFINITY};
    if (branch == AOM_APART) {
        b.high = b.low;
        b.low = -INFINITY;
    } else if (law->kind == AOM_DAMPED) {
        double slow = memory[0] > 0.0 ? -1.0 / memory[0] : -INFINITY;
        if (branch == AOM_CUT)
            b.fast = slow;
        else
            b.slow = slow;
    } else if (remembers(law->kind) && !elastic_table(law)) {
        if (branch == AOM_BACK) {
            b.high = memory[1];
            return b;
        }
        b.slow = 0.0; /* loading or reloading, up to the next kink */
        double deepest = memory[0], from = memory[2], y = law->params[1];
        if (from < deepest)
            b.high = deepest;
        else if (law->kind == AOM_THORNTON || law->kind == AOM_STRONGE) {
            if (from < y)
                b.high = y;
            else if (law->kind == AOM_STRONGE && from < FULLY_PLASTIC * y)
                b.high = FULLY_PLASTIC * y;
        }
    }
    return b;
}

static void user_touch(aom_stepper *st, const aom_user_law *user, double rate, double *memory) {
    int n = user->n_state, first = memory[n + 1] == 0.0;
    if (user->touch(user->context, larger(rate, 0.0), first, memory, memory + n) != 0)
        st->law_failed = true;
    memory[n + 1] = 1.0;
}

void user_advance(aom_stepper *st, const aom_user_law *user, double delta, double rate,
                  double *memory) {
    if (user->advance(user->context, delta, rate, memory, memory + user->n_state) != 0)
        st->law_failed = true;
}

static void damped_touch(const aom_law *law, double speed, double *memory) {
    memory[1] = larger(speed, memory[1]);
    double slow = larger(speed, SLOWEST * memory[1]);
    memory[0] = slow > 0.0 ? law->params[2] / slow : 0.0;
}

/* The branch of a contact that touches at a rate. */
static int touched_branch(aom_stepper *st, const aom_law *law, double rate, double *memory) {
    if (law->kind == AOM_DAMPED)
        damped_touch(law, rate, memory);
    else if (law->kind == AOM_USER)
        user_touch(st, law->user, rate, memory);
    else if (remembers(law->kind)) {
        double low = law_permanent(law, memory[0]);
        memory[2] = low;
        if (retraces(law->kind) && memory[0] > 0.0) {
            memory[1] = memory[0];
            return AOM_BACK;
        }
        memory[1] = low;
    }
    return AOM_FORWARD;
}

/* The branch beyond a bound; the memory is brought up to date. */
int next_branch(aom_stepper *st, const aom_law *law, int branch, bound exit, double delta,
                double rate, double *memory) {
    if (branch == AOM_APART)
        return touched_branch(st, law, rate, memory);
    if (exit == LOW)
        return AOM_APART;
    if (law->kind == AOM_DAMPED)
        return branch == AOM_FORWARD ? AOM_CUT : AOM_FORWARD;
    if (branch == AOM_BACK) {
        memory[2] = larger(delta, memory[1]);
        return AOM_FORWARD;
    }
    if (exit == SLOW) {
        memory[1] = delta;
        memory[0] = larger(memory[0], delta);
        return AOM_BACK;
    }
    memory[2] = delta * (1.0 + 1e-12); /* over a kink */
    memory[0] = larger(memory[0], memory[2]);
    return AOM_FORWARD;
}

/* Numbers of the state of a contact that goes on from touches before the start. */
int law_state_size(const aom_law *law) {
    if (law->kind == AOM_USER)
        return law->user->n_state + 1;
    return law->kind == AOM_DAMPED ? 2 : remembers(law->kind) ? 3 : 0;
}

/* The branch of such a contact at an indentation and rate; the memory of its law. */
int resumed_branch(const aom_law *law, const aom_contact *contact, double delta, double rate,
                   double *memory) {
    const double *state = contact->state;
    memcpy(memory, state, (size_t)law_state_size(law) * sizeof *memory);
    if (law->kind == AOM_USER)
        memory[law->user->n_state + 1] = 1.0;
    if (remembers(law->kind))
        memory[2] = larger(delta, law_permanent(law, memory[0]));
    if (!contact->closed && contact->preload == 0.0)
        return AOM_APART;
    if (law->kind == AOM_DAMPED && contact->preload == 0.0 && 1.0 + memory[0] * rate <= 0.0)
        return AOM_CUT;
    return remembers(law->kind) && delta < memory[1] ? AOM_BACK : AOM_FORWARD;
}

/* Depth and force at which a mass would have turned, roughly: F delta = m v^2. */
void law_expected(aom_stepper *st, const aom_law *law, double mass, double speed,
                  const double *memory, double *depth, double *force) {
    double base = remembers(law->kind) ? memory[2] : 0.0, work = mass * speed * speed, d = 1e-6;
    for (int tries = 0; tries < 60; tries++) {
        double f = law_tangent(st, law, AOM_FORWARD, base + d, 0.0, memory).force;
        double ratio = within(f * d > 0.0 ? work / (f * d) : 1e6, 1e-6, 1e6);
        d *= pow(ratio, 0.4);
        if (0.9 < ratio && ratio < 1.1)
            break;
    }
    *depth = d;
    *force = law_tangent(st, law, AOM_FORWARD, base + d, 0.0, memory).force;
}

/* ---- the laws as a caller keeps their states */

void aom_law_force(const aom_law *law, double delta, double rate, const double *state,
                   double out[3]) {
    bool cut = law->kind == AOM_DAMPED && 1.0 + state[0] * rate <= 0.0;
    int branch = AOM_FORWARD;
    if (cut || (law->kind == AOM_LINEAR && delta <= 0.0))
        branch = AOM_CUT;
    else if (remembers(law->kind) && delta < state[0] && delta < state[1])
        branch = AOM_BACK;
    tangent found = law_tangent(NULL, law, branch, delta, rate, state);
    out[0] = found.force;
    out[1] = found.by_delta;
    out[2] = found.by_rate;
}

static double force_at(const aom_law *law, double delta, const double *state) {
    double out[3];
    aom_law_force(law, delta, 0.0, state, out);
    return out[0];
}

static double hysteretic_energy(const aom_law *law, double delta, const double *state) {
    double deepest = state[0], turn = state[1], low = law_permanent(law, deepest);
    if (delta <= low)
        return 0.0;
    if (delta >= turn) {
        double left = law_permanent(law, larger(delta, deepest));
        return force_at(law, delta, state) * (delta - left) * shape_area(law, 1.0, true);
    }
    double part = shape_area(law, (delta - low) / (turn - low), true);
    return force_at(law, turn, state) * (turn - low) * part;
}

static double law_energy(const aom_law *law, double delta, const double *state) {
    const double *p = law->params;
    if (delta <= 0.0 || law->kind == AOM_USER)
        return 0.0;
    if (elastic_table(law))
        return aom_law_loading_work(law, delta);
    if (remembers(law->kind))
        return hysteretic_energy(law, delta, state);
    if (law->kind == AOM_LINEAR)
        return 0.5 * p[0] * delta * delta;
    if (law->kind != AOM_HERTZ)
        return power(p, delta).value * delta / (p[1] + 1.0);
    double force = hertz(p, delta).value;
    if (p[1] == 0.0)
        return 0.4 * force * delta;
    double top = smaller(force, p[3] * p[3] * p[3]);
    double stored = 0.4 * p[2] * pow(top, 5.0 / 3.0) - 0.5 * p[1] * top * top;
    return stored + 0.5 * p[4] * (force * force - top * top);
}

void aom_law_forces(const aom_law *law, int64_t n, const double *delta, const double *state,
                    double *out) {
    for (int64_t k = 0; k < n; k++)
        out[k] = force_at(law, delta[k], state);
}

void aom_law_energies(const aom_law *law, int64_t n, const double *delta, const double *state,
                      double *out) {
    for (int64_t k = 0; k < n; k++)
        out[k] = law_energy(law, delta[k], state);
}

void aom_law_touch(const aom_law *law, double speed, int first, double *state) {
    if (first)
        state[0] = state[1] = state[2] = 0.0;
    if (law->kind == AOM_DAMPED)
        damped_touch(law, speed, state);
    else if (remembers(law->kind) && !first)
        state[1] = retraces(law->kind) ? state[0] : law_permanent(law, state[0]);
}

/* Work along reloading and virgin loading up to delta >= the turning point, from a fixed origin. */
static double reloading_work(const aom_law *law, double delta, double deepest) {
    if (deepest == 0.0)
        return aom_law_loading_work(law, delta);
    double low = law_permanent(law, deepest);
    double part = shape_area(law, (smaller(delta, deepest) - low) / (deepest - low), false);
    double work = law_loading(law, deepest).value * (deepest - low) * part;
    if (delta > deepest)
        work += aom_law_loading_work(law, delta) - aom_law_loading_work(law, deepest);
    return work;
}

void aom_law_advance(const aom_law *law, double delta, double *state) {
    if (!remembers(law->kind) || elastic_table(law) || delta <= state[1])
        return;
    double work = reloading_work(law, delta, state[0]) - reloading_work(law, state[1], state[0]);
    double before = law_energy(law, state[1], state);
    state[0] = larger(state[0], delta);
    state[1] = delta;
    state[2] += larger(work - (law_energy(law, delta, state) - before), 0.0); /* rounding */
}

double aom_law_origin(const aom_law *law, const double *state) { return origin(law, state); }

/* ---- checks */

static bool positive(double x) { return x > 0.0 && x < INFINITY; }

static bool good_table(const double *x, int n) {
    for (int i = 0; i < 5 * n + 2; i++)
        if (!isfinite(x[i]))
            return false;
    for (int i = 1; i < n; i++)
        if (!(x[i] > x[i - 1]))
            return false;
    return true;
}

static bool good_tables(const aom_law *law) {
    const double *p = law->params;
    if (law->n_params < 5 || !(p[0] == 0.0 || p[0] == 1.0) || !(p[1] >= 0.0 && p[1] < 1.0))
        return false;
    double most = law->n_params;
    if (!(p[2] >= 2.0 && p[2] <= most && p[3] >= 2.0 && p[3] <= most))
        return false;
    double second = 5.0 + 5.0 * floor(p[2]) + 2.0;
    return p[4] == second && second + 5.0 * floor(p[3]) + 2.0 == most &&
           good_table(loading_table(law), loading_knots(law)) &&
           good_table(unloading_table(law), unloading_knots(law));
}

int aom_law_check(const aom_law *law) {
    static const int numbers[] = {1, 2, 5, 3, 2, 2, 2, 3};
    const double *p = law->params;
    bool good;
    if (law->kind == AOM_USER)
        good = law->user != NULL && law->user->n_state >= 0 &&
               law->user->n_state <= AOM_MEMORY - 2 && law->user->force && law->user->touch &&
               law->user->advance;
    else if (law->kind == AOM_TABLE)
        good = p != NULL && good_tables(law);
    else if (law->kind < 0 || law->kind > AOM_USER || law->n_params != numbers[law->kind] ||
             p == NULL || !positive(p[0]))
        good = false;
    else if (law->kind == AOM_LINEAR)
        good = true;
    else if (law->kind == AOM_POWER || law->kind == AOM_DAMPED)
        good = p[1] >= 1.0 && p[1] < INFINITY &&
               (law->kind == AOM_POWER || (p[2] >= 0.0 && p[2] < INFINITY));
    else if (law->kind == AOM_HERTZ)
        good = p[1] == 0.0 || (positive(p[1]) && positive(p[2]) && positive(p[3]) &&
                               positive(p[4]) && 2.0 * p[2] - 3.0 * p[1] * p[3] > 0.0);
    else
        good = positive(p[1]) && (law->kind != AOM_TAN_SUN || (p[2] > 0.0 && p[2] < 1.0));
    return good ? AOM_DONE : AOM_BAD_LAW;
}
