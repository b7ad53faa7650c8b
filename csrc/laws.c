/* Contact laws: force by indentation and rate, where their branches end, what they remember.
 *
 * memory of a contact: damped (d/v0, fastest approach); with memory (deepest indentation, turning
 * point, indentation from which the loading goes on); a user's law its state, then the origin, then
 * whether it has touched. */
#include "internal.h"

/* Share of a law's own flexibility that the compliance of a patch may take; beyond, it takes this. */
#define TAKEN 0.7
#define HERTZIAN 1.5 /* the power of Hertz's law */
#define DEEP_POWER 1.25 /* of unloading from far beyond yield */

/* Numbers of the kinds before AOM_TABLE, but for a compliance behind them. */
static const int NUMBERS[] = {1, 2, 5, 3, 2, 2, 4};

/* A sphere that yields, of s = (yield indentation/delta)^(1/4): F = F_y P(s)/s^4, and the share of
 * the indentation that unloading recovers s^2 Q(s); behind each what a side that stays elastic adds,
 * times its share of the flexibility to 1.5. Fitted by benchmarks/elastoplastic/fit.py. */
static const double PRESSING[] = {10.156065, -28.117782, 42.624046, -40.571769,
                                  21.962204, -5.052764};
static const double PRESSING_ELASTIC[] = {2.4294718, -3.6671647, -4.0542905, 9.392188, -4.1002046,
                                          0.0};
static const double RECOVERY[] = {4.506655, -7.059605, 5.444735, -1.891785};
static const double RECOVERY_ELASTIC[] = {0.16412376, 3.3252718, -7.3789789, 3.8895833};
#define PRESSINGS ((int)(sizeof PRESSING / sizeof *PRESSING))
#define RECOVERIES ((int)(sizeof RECOVERY / sizeof *RECOVERY))

/* Unloading or reloading by the whole indentation: from `low` over `width` to `force` by a power,
 * less a compliance times the force. */
typedef struct unloading {
    double low, width, force, compliance, power;
} unloading;

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

/* Value and slope of a polynomial, its constant first. */
static curve polynomial(const double *c, int n, double s) {
    curve sum = {0.0, 0.0};
    for (int i = n - 1; i >= 0; i--) {
        sum.slope = sum.slope * s + sum.value;
        sum.value = sum.value * s + c[i];
    }
    return sum;
}

/* P(s) or Q(s) of a sphere that yields, and its slope: what an elastic side adds, times its share. */
static curve fitted(const aom_law *law, const double *c, const double *elastic, int n, double s) {
    curve rigid = polynomial(c, n, s), more = polynomial(elastic, n, s);
    double share = law->params[2];
    return (curve){rigid.value + share * more.value, rigid.slope + share * more.slope};
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

/* Force and its slope of a new contact by its whole indentation, with that of a patch. */
static curve whole_loading(const aom_law *law, double delta) {
    if (delta <= 0.0)
        return (curve){0.0, 0.0};
    if (law->kind == AOM_TABLE)
        return table_at(loading_table(law), loading_knots(law), delta);
    if (!remembers(law->kind))
        return power(law->params, delta);
    double k = law->params[0], y = law->params[1];
    if (law->kind == AOM_ELASTIC_PLASTIC && delta > y) {
        double s = sqrt(sqrt(y / delta)), top = k * y * sqrt(y);
        curve p = fitted(law, PRESSING, PRESSING_ELASTIC, PRESSINGS, s);
        return (curve){top * delta / y * p.value, top / y * (p.value - 0.25 * s * p.slope)};
    }
    if (law->kind == AOM_THORNTON && delta > y)
        return (curve){k * sqrt(y) * (1.5 * delta - 0.5 * y), 1.5 * k * sqrt(y)};
    return (curve){k * delta * sqrt(delta), 1.5 * k * sqrt(delta)};
}

/* The integral of F/F_y from 1 to x of a sphere that yields. */
static double pressing_area(const aom_law *law, double x) {
    double s = sqrt(sqrt(1.0 / x)), power_of_s = 1.0, total = 0.0;
    for (int i = 0; i < PRESSINGS; i++) {
        double c = PRESSING[i] + law->params[2] * PRESSING_ELASTIC[i];
        total += c / (2.0 - 0.25 * i) * (x * x * power_of_s - 1.0);
        power_of_s *= s;
    }
    return total;
}

/* Work of loading a new contact to a whole indentation. */
static double whole_work(const aom_law *law, double delta) {
    const double *p = law->params;
    if (law->kind == AOM_TABLE)
        return table_area(loading_table(law), loading_knots(law), delta);
    if (!remembers(law->kind))
        return power(p, delta).value * delta / (p[1] + 1.0);
    double k = p[0], y = p[1], d = smaller(y, delta);
    if (law->kind == AOM_YANG_SUN || delta <= y)
        return 0.4 * k * delta * delta * sqrt(delta);
    double elastic = 0.4 * k * d * d * sqrt(d);
    if (law->kind == AOM_THORNTON)
        return elastic + k * sqrt(y) * (delta - y) * (0.75 * (delta + y) - 0.5 * y);
    return elastic + k * y * sqrt(y) * y * pressing_area(law, delta / y);
}

/* Permanent indentation after a deepest one, and its slope. */
static curve whole_permanent(const aom_law *law, double deepest) {
    double y = law->params[1];
    if (law->kind == AOM_TABLE) /* the share that remains */
        return (curve){y * deepest, y};
    if (deepest <= y)
        return (curve){0.0, 0.0};
    double x = deepest / y;
    switch (law->kind) {
    case AOM_THORNTON: {
        double t = sqrt(1.0 / x);
        return (curve){deepest * (1.0 - t) * (1.0 - t) * (2.0 + t) / 2.0,
                       1.0 - 0.75 * t - 0.25 * t * t * t};
    }
    case AOM_YANG_SUN: {
        double kept = exp(0.4 * log(1.0 / x));
        return (curve){deepest * (1.0 - kept), 1.0 - 0.6 * kept};
    }
    default: {
        double s = sqrt(sqrt(1.0 / x));
        curve q = fitted(law, RECOVERY, RECOVERY_ELASTIC, RECOVERIES, s);
        double recovers = s * s * q.value;
        return (curve){larger(deepest * (1.0 - recovers), 0.0),
                       1.0 - 0.5 * recovers + 0.25 * s * s * s * q.slope};
    }
    }
}

/* The power of the unloading (`back`) or the reloading curve of a contact that was so deep, by the
 * whole indentation. */
static double law_power(const aom_law *law, double deepest, bool back) {
    double x = deepest / law->params[1];
    if (law->kind == AOM_ELASTIC_PLASTIC && x > 1.0)
        return DEEP_POWER + (HERTZIAN - DEEP_POWER) / sqrt(x);
    return back && law->kind == AOM_YANG_SUN ? 2.5 : HERTZIAN;
}

/* Unloading (`back`) or reloading curve of a power n from (0, 0) to (1, 1); a table has its own. */
static curve law_shape(const aom_law *law, double n, double x) {
    if (x <= 0.0)
        return (curve){0.0, 0.0};
    if (law->kind == AOM_TABLE)
        return table_at(unloading_table(law), unloading_knots(law), x);
    double root = sqrt(x);
    if (n == HERTZIAN)
        return (curve){x * root, 1.5 * root};
    if (n == 2.5)
        return (curve){x * x * root, 2.5 * x * root};
    double value = exp(n * log(x));
    return (curve){value, n * value / x};
}

/* Its integral from 0. */
static double shape_area(const aom_law *law, double n, double x) {
    if (x <= 0.0)
        return 0.0;
    if (law->kind == AOM_TABLE)
        return table_area(unloading_table(law), unloading_knots(law), x);
    return law_shape(law, n, x).value * x / (n + 1.0);
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

/* Energy [J] of Hertz's law. */
static double hertz_energy(const double *p, double delta) {
    double force = hertz(p, delta).value;
    if (p[1] == 0.0)
        return 0.4 * force * delta;
    double top = smaller(force, p[3] * p[3] * p[3]);
    double stored = 0.4 * p[2] * pow(top, 5.0 / 3.0) - 0.5 * p[1] * top * top;
    return stored + 0.5 * p[4] * (force * force - top * top);
}

/* ---- the compliance of a patch, which is the structure's already */

static int count_numbers(const aom_law *law) {
    if (law->kind == AOM_TABLE)
        return (int)law->params[4] + 5 * unloading_knots(law) + 2;
    return law->kind == AOM_USER ? 0 : NUMBERS[law->kind];
}

/* c [m/N], 0: none. That of Hertz's law is a number of its own. */
static double patch_compliance(const aom_law *law) {
    int n = count_numbers(law);
    return law->n_params > n ? law->params[n] : 0.0;
}

static double linear_stiffness(const aom_law *law) {
    return law->params[0] / (1.0 - patch_compliance(law) * law->params[0]);
}

/* The most that the patch may take off an indentation, over what unloading recovers. */
static double most_taken(const aom_law *law) {
    if (law->kind == AOM_TABLE)
        return TAKEN / law_shape(law, HERTZIAN, 1.0).slope;
    return TAKEN / (remembers(law->kind) ? law_power(law, 0.0, true) : law->params[1]);
}

/* Whether a patch may take so much off a whole indentation. */
static bool in_reach(const aom_law *law, double taken, double delta) {
    double low = remembers(law->kind) ? whole_permanent(law, delta).value : 0.0;
    return taken <= most_taken(law) * (delta - low);
}

/* The indentation without the patch's, by the whole one. */
static curve outside(const aom_law *law, double delta) {
    double c = patch_compliance(law), most = most_taken(law);
    curve force = whole_loading(law, delta), low = {0.0, 0.0};
    if (remembers(law->kind))
        low = whole_permanent(law, delta);
    if (c * force.value <= most * (delta - low.value))
        return (curve){delta - c * force.value, 1.0 - c * force.slope};
    return (curve){delta - most * (delta - low.value), 1.0 - most * (1.0 - low.slope)};
}

static curve inside_shape(const aom_law *law, const double with[3], double z) {
    curve shape = law_shape(law, with[2], z);
    return (curve){with[0] * z - with[1] * shape.value, with[0] - with[1] * shape.slope};
}

static curve inside_loading(const aom_law *law, const double with[3], double delta) {
    (void)with;
    return outside(law, delta);
}

/* Where a rising function of x in low to high has a value. */
static double inverse(curve (*function)(const aom_law *, const double *, double), const aom_law *law,
                    const double with[3], double value, double low, double high) {
    double x = low;
    for (int tries = 0; tries < 100; tries++) {
        curve at = function(law, with, x);
        if (at.value < value)
            low = x;
        else
            high = x;
        double next = x + (value - at.value) / at.slope;
        if (!(next >= low && next <= high))
            next = 0.5 * (low + high);
        bool close = fabs(next - x) <= 1e-9 * x; /* Newton's error is the square of it */
        x = next;
        if (close)
            break;
    }
    return x;
}

/* The whole indentation of a new contact. */
static double whole_depth(const aom_law *law, double delta) {
    double c = patch_compliance(law), d = delta;
    if (delta <= 0.0 || c == 0.0)
        return delta;
    for (int tries = 0; tries < 10; tries++) { /* Newton, quick within the law's range */
        curve force = whole_loading(law, d);
        double slope = 1.0 - c * force.slope, step = (delta - d + c * force.value) / slope;
        if (slope < 1.0 - TAKEN)
            break;
        d += step;
        if (fabs(step) > 1e-7 * d) /* the error is the square of it, or less */
            continue;
        if (in_reach(law, c * force.value, d))
            return d;
        break;
    }
    return inverse(inside_loading, law, NULL, delta, delta, delta / (1.0 - most_taken(law)));
}

/* Share of the width of an unloading or reloading curve at an indentation. */
static double law_share(const aom_law *law, const unloading *u, double delta) {
    double with[3] = {u->width, u->compliance * u->force, u->power};
    double low = (delta - u->low) / u->width;
    if (with[1] == 0.0)
        return low;
    return inverse(inside_shape, law, with, delta - u->low, low, low / (1.0 - TAKEN));
}

/* Compliance that the patch takes from a contact that unloads from a deepest whole indentation. */
static double taken_compliance(const aom_law *law, double force, double width) {
    double c = patch_compliance(law), most = most_taken(law) * width;
    return c * force <= most ? c : most / force;
}

/* Of an elastic-plastic law below yield: Hertz's law, and where it ends. */
typedef struct elastic_part {
    double hertz[5], end;
} elastic_part;

static elastic_part elastic_of(const aom_law *law) {
    const double *p = law->params;
    double k = p[0], y = p[1], a = p[3], c = patch_compliance(law);
    if (c == 0.0)
        return (elastic_part){{k, 0.0, a, INFINITY, 0.0}, y};
    double end = TAKEN * 2 * a / (3 * c), reach = (a - c * end) * end * end;
    return (elastic_part){{k, c, a, end, (2.0 / 3.0) * a / end - c},
                          smaller(outside(law, y).value, reach)};
}

/* Force and its slope of a new contact. */
static curve law_loading(const aom_law *law, double delta) {
    if (law->kind == AOM_ELASTIC_PLASTIC && delta > 0.0) {
        elastic_part part = elastic_of(law);
        if (delta <= part.end)
            return hertz(part.hertz, delta);
    }
    double d = whole_depth(law, delta);
    curve force = whole_loading(law, d);
    double taken = patch_compliance(law) * force.value;
    bool whole = fabs(d - delta - taken) <= 1e-9 * d; /* all of it is taken */
    if (d > delta)
        force.slope /= whole ? 1.0 - taken * force.slope / force.value : outside(law, d).slope;
    return force;
}

/* Permanent indentation after a deepest one. */
static double law_permanent(const aom_law *law, double deepest) {
    return whole_permanent(law, whole_depth(law, deepest)).value;
}

double aom_law_loading_work(const aom_law *law, double delta) {
    if (delta <= 0.0 || law->kind == AOM_USER)
        return 0.0;
    if (law->kind == AOM_HERTZ)
        return hertz_energy(law->params, delta);
    if (law->kind == AOM_LINEAR)
        return 0.5 * linear_stiffness(law) * delta * delta;
    if (law->kind == AOM_ELASTIC_PLASTIC) {
        elastic_part part = elastic_of(law);
        if (delta <= part.end)
            return hertz_energy(part.hertz, delta);
    }
    double d = whole_depth(law, delta);
    return whole_work(law, d) - 0.5 * (d - delta) * whole_loading(law, d).value;
}

/* How a contact unloads (`back`) from its turning point, or reloads to its deepest indentation. */
static unloading law_unloading(const aom_law *law, bool back, const double *memory) {
    double deepest = whole_depth(law, memory[0]);
    unloading u = {.low = whole_permanent(law, deepest).value};
    u.force = whole_loading(law, deepest).value;
    u.width = deepest - u.low;
    u.compliance = taken_compliance(law, u.force, u.width);
    u.power = law_power(law, deepest, false);
    if (back && memory[1] < memory[0]) {
        double share = law_share(law, &u, memory[1]);
        u.force *= law_shape(law, u.power, share).value;
        u.width *= share;
    }
    u.power = law_power(law, deepest, back);
    return u;
}

/* Force and slope of a law with memory (deepest indentation, turning point). */
static curve hysteretic(const aom_law *law, int branch, double delta, const double *memory) {
    bool back = branch == AOM_BACK;
    if (!back && delta >= memory[0])
        return law_loading(law, delta);
    unloading u = law_unloading(law, back, memory);
    if (delta <= u.low || memory[0] <= 0.0 || (back && memory[1] <= u.low))
        return (curve){0.0, 0.0};
    curve part = law_shape(law, u.power, law_share(law, &u, delta));
    double rise = u.force * part.slope;
    return (curve){u.force * part.value, rise / (u.width - u.compliance * rise)};
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
    if (law->kind == AOM_LINEAR) {
        double k = linear_stiffness(law);
        return (tangent){k * delta, k, 0.0};
    }
    if (law->kind == AOM_USER)
        return user_tangent(st, law->user, delta, rate, memory);
    if (delta <= 0.0)
        return NO_FORCE;
    curve found = law->kind == AOM_HERTZ ? hertz(p, delta)
                  : remembers(law->kind) ? hysteretic(law, branch, delta, memory)
                                         : law_loading(law, delta);
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

/* The indentation at the kink of the loading curve, where the contact yields; infinite: none. */
static double law_kink(const aom_law *law) {
    bool yields = law->kind == AOM_THORNTON || law->kind == AOM_ELASTIC_PLASTIC;
    return yields ? outside(law, law->params[1]).value : INFINITY;
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
        double deepest = memory[0], from = memory[2];
        double first = law_kink(law);
        if (law->kind == AOM_ELASTIC_PLASTIC && larger(deepest, from) < first)
            b.slow = -INFINITY; /* it goes back as it came */
        if (from < deepest)
            b.high = deepest;
        else if (from < first)
            b.high = first;
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
    double memory[2] = {larger(state[0], delta), larger(state[1], delta)};
    double force = force_at(law, delta, state);
    if (force <= 0.0)
        return 0.0;
    if (delta >= state[1])
        memory[1] = delta;
    unloading u = law_unloading(law, true, memory);
    double taken = u.compliance * force, part = (delta + taken - u.low) / u.width;
    return u.force * u.width * shape_area(law, u.power, part) - 0.5 * taken * force;
}

static double law_energy(const aom_law *law, double delta, const double *state) {
    if (delta <= 0.0 || law->kind == AOM_USER)
        return 0.0;
    if (remembers(law->kind) && !elastic_table(law))
        return hysteretic_energy(law, delta, state);
    return aom_law_loading_work(law, delta);
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
    double memory[2] = {deepest, deepest}, reached = smaller(delta, deepest);
    unloading u = law_unloading(law, false, memory);
    double share = law_share(law, &u, reached);
    double force = u.force * law_shape(law, u.power, share).value;
    double work = u.force * u.width * shape_area(law, u.power, share);
    work -= 0.5 * u.compliance * force * force;
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

double aom_law_reach(const aom_law *law) {
    double c = patch_compliance(law), most, low = 1e-30, high = 1e30;
    if (law->kind == AOM_HERTZ && law->params[1] > 0.0)
        return law->params[3] * law->params[3] * law->params[3];
    if (c == 0.0 || law->kind == AOM_LINEAR)
        return INFINITY;
    most = most_taken(law);
    for (int tries = 0; tries < 80; tries++) {
        double middle = sqrt(low * high), left = middle;
        if (remembers(law->kind))
            left -= whole_permanent(law, middle).value;
        if (c * whole_loading(law, middle).value <= most * left)
            low = middle;
        else
            high = middle;
    }
    return low < 1e29 ? whole_loading(law, low).value : INFINITY;
}

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
    return p[4] == second && most - (second + 5.0 * floor(p[3]) + 2.0) <= 1.0 &&
           most >= second + 5.0 * floor(p[3]) + 2.0 &&
           good_table(loading_table(law), loading_knots(law)) &&
           good_table(unloading_table(law), unloading_knots(law));
}

/* The right number of parameters, and what may stand behind them. */
static bool good_numbers(const aom_law *law) {
    int n = NUMBERS[law->kind];
    if (law->params == NULL || law->n_params < n || law->n_params > n + (law->kind != AOM_HERTZ))
        return false;
    double c = patch_compliance(law);
    return c >= 0.0 && c < INFINITY && (law->kind != AOM_LINEAR || c * law->params[0] < 1.0);
}

int aom_law_check(const aom_law *law) {
    const double *p = law->params;
    bool good;
    if (law->kind == AOM_USER)
        good = law->user != NULL && law->user->n_state >= 0 &&
               law->user->n_state <= AOM_MEMORY - 2 && law->user->force && law->user->touch &&
               law->user->advance;
    else if (law->kind == AOM_TABLE)
        good = p != NULL && good_tables(law) && patch_compliance(law) >= 0.0;
    else if (law->kind < 0 || law->kind > AOM_USER || !good_numbers(law) || !positive(p[0]))
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
        good = positive(p[1]) &&
               (law->kind != AOM_ELASTIC_PLASTIC ||
                (p[2] >= 0.0 && p[2] <= 1.0 && positive(p[3])));
    return good ? AOM_DONE : AOM_BAD_LAW;
}
