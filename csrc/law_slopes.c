/* How contact laws change with their parameters and with what they remember.
 *
 * The forces of the laws with memory are k f(delta, deepest, turn, y) with a yield or critical
 * indentation y, all lengths alike: F = k y^1.5 phi(delta/y), permanent = y p(deepest/y). */
#include "internal.h"

#define PATCH (AOM_LAW_SLOPES - 1) /* place of the compliance of a patch */

static void add_slopes(law_slopes *to, double share, const law_slopes *by) {
    for (int k = 0; k < AOM_LAW_SLOPES; k++)
        to->params[k] += share * by->params[k];
    for (int k = 0; k < 2; k++)
        to->memory[k] += share * by->memory[k];
}

/* Derivatives of the force of a new contact at a fixed whole indentation. */
static law_slopes whole_slopes(const aom_law *law, double delta) {
    law_slopes by = {{0.0}, {0.0}};
    const double *p = law->params;
    if (law->kind == AOM_TABLE || delta <= 0.0)
        return by;
    curve at = whole_loading(law, delta);
    by.params[0] = at.value / p[0];
    if (remembers(law->kind))
        by.params[1] = (1.5 * at.value - delta * at.slope) / p[1];
    else
        by.params[1] = at.value * log(delta);
    if (law->kind == AOM_ELASTIC_PLASTIC && delta > p[1])
        by.params[2] = p[0] * sqrt(p[1]) * delta * elastic_pressing(sqrt(sqrt(p[1] / delta))).value;
    return by;
}

/* Derivatives of the whole indentation of a new contact at a fixed one. */
static law_slopes depth_slopes(const aom_law *law, double whole) {
    double c = patch_compliance(law);
    curve force = whole_loading(law, whole);
    law_slopes by = {{0.0}, {0.0}}, of_force = whole_slopes(law, whole);
    double share = 1.0 / (1.0 - c * force.slope);
    add_slopes(&by, c * share, &of_force);
    by.params[PATCH] = force.value * share;
    return by;
}

/* Derivatives of the force of a new contact. */
static law_slopes loading_slopes(const aom_law *law, double delta) {
    double whole = whole_depth(law, delta);
    law_slopes by = whole_slopes(law, whole), of_depth = depth_slopes(law, whole);
    add_slopes(&by, whole_loading(law, whole).slope, &of_depth);
    return by;
}

/* Of a deepest whole indentation, which changes as `of_depth`: derivatives of the permanent one. */
static law_slopes low_slopes(const aom_law *law, double whole, const law_slopes *of_depth) {
    law_slopes by = {{0.0}, {0.0}};
    const double *p = law->params;
    curve low = whole_permanent(law, whole);
    add_slopes(&by, low.slope, of_depth);
    if (law->kind == AOM_TABLE || low.value <= 0.0)
        return by;
    by.params[1] += (low.value - whole * low.slope) / p[1];
    if (law->kind == AOM_TAN_SUN)
        by.params[2] += whole - p[1];
    if (law->kind == AOM_ELASTIC_PLASTIC)
        by.params[2] -= sqrt(p[1] * whole) * elastic_recovery(sqrt(sqrt(p[1] / whole))).value;
    return by;
}

/* Derivatives of the deepest whole indentation. */
static law_slopes deepest_slopes(const aom_law *law, double whole) {
    law_slopes by = depth_slopes(law, whole);
    by.memory[0] = 1.0 / (1.0 - patch_compliance(law) * whole_loading(law, whole).slope);
    return by;
}

static law_slopes permanent_slopes(const aom_law *law, double deepest) {
    double whole = whole_depth(law, deepest);
    law_slopes by = deepest_slopes(law, whole);
    return low_slopes(law, whole, &by);
}

/* Where unloading or reloading begins and ends, and the derivatives of that. */
typedef struct ends {
    unloading at;
    law_slopes low, width, force, power;
} ends;

/* Derivatives of the share of a curve at which a contact is, where its indentation does not change,
 * onto those of its own; then of its force there. */
static void along_curve(const aom_law *law, const ends *e, double share, law_slopes *by_share,
                        law_slopes *by_force) {
    curve shape = law_shape(law, e->at.power, share);
    double c = e->at.compliance, force = e->at.force, steep = e->at.width - c * force * shape.slope;
    double by_power = law->kind == AOM_TABLE ? 0.0 : shape.value * log(share);
    add_slopes(by_share, -1.0 / steep, &e->low);
    add_slopes(by_share, -share / steep, &e->width);
    add_slopes(by_share, c * shape.value / steep, &e->force);
    add_slopes(by_share, c * force * by_power / steep, &e->power);
    by_share->params[PATCH] += shape.value * force / steep;
    add_slopes(by_force, shape.value, &e->force);
    add_slopes(by_force, force * by_power, &e->power);
    add_slopes(by_force, force * shape.slope, by_share);
}

/* The end of the reloading curve. */
static ends deepest_end(const aom_law *law, const double *memory) {
    ends e;
    memset(&e, 0, sizeof e);
    e.at = law_unloading(law, false, memory);
    double whole = e.at.low + e.at.width, by_depth = law_power(law, whole, false).slope;
    law_slopes depth = deepest_slopes(law, whole);
    e.low = low_slopes(law, whole, &depth);
    e.force = whole_slopes(law, whole);
    add_slopes(&e.force, whole_loading(law, whole).slope, &depth);
    add_slopes(&e.power, by_depth, &depth);
    e.power.params[1] -= by_depth * whole / law->params[1];
    e.width = depth;
    add_slopes(&e.width, -1.0, &e.low);
    return e;
}

/* The turning point on it, in its place. */
static void turning_end(const aom_law *law, const double *memory, ends *e) {
    double share = law_share(law, &e->at, memory[1]);
    curve shape = law_shape(law, e->at.power, share);
    law_slopes by_share = {{0.0}, {0.0}}, by_force = {{0.0}, {0.0}}, by_width = {{0.0}, {0.0}};
    by_share.memory[1] = 1.0 / (e->at.width - e->at.compliance * e->at.force * shape.slope);
    along_curve(law, e, share, &by_share, &by_force);
    add_slopes(&by_width, share, &e->width);
    add_slopes(&by_width, e->at.width, &by_share);
    e->at.width *= share;
    e->at.force *= shape.value;
    e->width = by_width;
    e->force = by_force;
}

static law_slopes hysteretic_slopes(const aom_law *law, int branch, double delta,
                                    const double *memory) {
    law_slopes by = {{0.0}, {0.0}}, by_share = {{0.0}, {0.0}};
    bool back = branch == AOM_BACK;
    if (!back && delta >= memory[0])
        return loading_slopes(law, delta);
    double low = law_permanent(law, memory[0]);
    if (delta <= low || memory[0] <= 0.0 || (back && memory[1] <= low))
        return by;
    ends e = deepest_end(law, memory);
    if (back && memory[1] < memory[0])
        turning_end(law, memory, &e);
    e.at.power = law_power(law, whole_depth(law, memory[0]), back).value;
    along_curve(law, &e, law_share(law, &e.at, delta), &by_share, &by);
    return by;
}

/* Derivatives of the force of a branch, at an indentation and a rate. */
law_slopes force_slopes(const aom_law *law, int branch, double delta, double rate,
                        const double *memory) {
    law_slopes by = {{0.0}, {0.0}};
    const double *p = law->params;
    if (!pressing(branch))
        return by;
    if (law->kind == AOM_LINEAR) {
        double share = 1.0 / (1.0 - patch_compliance(law) * p[0]);
        by.params[0] = share * share * delta;
        by.params[PATCH] = share * p[0] * share * p[0] * delta;
        return by;
    }
    if (delta <= 0.0)
        return by;
    if (remembers(law->kind))
        return hysteretic_slopes(law, branch, delta, memory);
    if (law->kind == AOM_HERTZ) { /* delta = k^(-2/3) F^(2/3) - c F */
        tangent at = law_tangent(NULL, law, branch, delta, rate, memory);
        by.params[0] = p[1] == 0.0 ? at.force / p[0]
                                   : at.by_delta * 2.0 / 3.0 * pow(at.force / p[0], 2.0 / 3.0) / p[0];
        by.params[PATCH] = at.by_delta * at.force;
        return by;
    }
    law_slopes elastic = loading_slopes(law, delta);
    bool damped = law->kind == AOM_DAMPED;
    add_slopes(&by, damped ? 1.0 + memory[0] * rate : 1.0, &elastic);
    if (damped)
        by.memory[0] = law_loading(law, delta).value * rate;
    return by;
}

void aom_law_slopes(const aom_law *law, double delta, double out[AOM_LAW_SLOPES]) {
    const double memory[AOM_MEMORY] = {0.0};
    memcpy(out, force_slopes(law, AOM_FORWARD, delta, 0.0, memory).params, AOM_LAW_SLOPES * sizeof *out);
}

/* Derivatives of the bound at which a branch ends. */
law_slopes bound_slopes(const aom_law *law, int branch, bound exit, const double *memory) {
    law_slopes by = {{0.0}, {0.0}};
    if (law->kind == AOM_DAMPED && exit >= SLOW) {
        by.memory[0] = 1.0 / (memory[0] * memory[0]);
        return by;
    }
    if (!remembers(law->kind) || exit >= SLOW)
        return by;
    if (exit == LOW || branch == AOM_APART)
        by = permanent_slopes(law, memory[0]);
    else if (branch == AOM_BACK)
        by.memory[1] = 1.0;
    else if (memory[2] < memory[0])
        by.memory[0] = 1.0;
    else { /* a kink of a law that yields */
        double high = law_bounds(law, branch, memory).high;
        bool last = high > law_kink(law, false).value;
        double whole = whole_depth(law, high), force = whole_loading(law, whole).value;
        by.params[0] = -patch_compliance(law) * force / law->params[0];
        by.params[1] = law_kink(law, last).slope;
        by.params[PATCH] = -force;
    }
    return by;
}

/* From derivatives by what a contact remembers after it went over to another branch to those by what
 * it remembered before, and by its indentation and its rate there. */
void undo_branch(const aom_law *law, const aom_exit *e, double slowest, law_slopes *by,
                 double *depth, double *rate) {
    if (law->kind == AOM_DAMPED) {
        if ((int)e->before[0] != AOM_APART)
            return;
        double speed = larger(e->speed, slowest), fastest = larger(speed, e->before[2]);
        double slow = larger(speed, SLOWEST * fastest), by_speed = 0.0;
        double by_slow = slow > 0.0 ? -by->memory[0] * law->params[2] / (slow * slow) : 0.0;
        by->params[2] += slow > 0.0 ? by->memory[0] / slow : 0.0;
        by->memory[0] = 0.0;
        if (speed >= SLOWEST * fastest)
            by_speed = by_slow;
        else
            by->memory[1] += SLOWEST * by_slow;
        if (speed >= e->before[2]) {
            by_speed += by->memory[1];
            by->memory[1] = 0.0;
        }
        if (e->speed > slowest)
            *rate += by_speed;
    } else if (remembers(law->kind)) {
        if ((int)e->before[0] == AOM_APART) {
            if ((int)e->after[0] == AOM_BACK) /* it turned where it is deepest */
                by->memory[0] += by->memory[1];
            by->memory[1] = 0.0;
            return;
        }
        if ((int)e->bound == SLOW) {
            *depth += by->memory[1];
            by->memory[1] = 0.0;
        }
        if (e->after[1] > e->before[1]) {
            *depth += by->memory[0];
            by->memory[0] = 0.0;
        }
    }
}
