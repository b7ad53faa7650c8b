/* How contact laws change with their parameters and with what they remember.
 *
 * The forces of the laws with memory are k f(delta, deepest, turn, y) with a yield or critical
 * indentation y, all lengths alike: F = k y^1.5 phi(delta/y), permanent = y p(deepest/y). */
#include "internal.h"

/* Derivatives of a virgin force by the parameters k and y; none of a table. */
static void loading_slopes(const aom_law *law, double delta, double by[AOM_LAW_SLOPES]) {
    if (law->kind == AOM_TABLE || delta <= 0.0)
        return;
    curve at = law_loading(law, delta);
    by[0] = at.value / law->params[0];
    by[1] = (1.5 * at.value - delta * at.slope) / law->params[1];
}

/* Derivative of the permanent indentation by the deepest one, and by parameters. */
static double permanent_slopes(const aom_law *law, double deepest, double by[AOM_LAW_SLOPES]) {
    const double *p = law->params;
    double y = p[1], low = law_permanent(law, deepest), slope = 0.0;
    if (law->kind == AOM_TABLE)
        return y;
    if (low <= 0.0)
        return 0.0;
    switch (law->kind) {
    case AOM_THORNTON: {
        double x = sqrt(y / deepest);
        slope = 1.0 - 0.75 * x - 0.25 * x * x * x;
        break;
    }
    case AOM_STRONGE: {
        double root = sqrt(2.0 * deepest / y - 1.0);
        slope = 1.0 - 1.0 / root;
        if (low > y * (deepest / y - root) * (1.0 + 1e-14)) { /* the one without loss */
            curve top = law_loading(law, deepest);
            double work = aom_law_loading_work(law, deepest);
            slope = 2.5 * work * top.slope / (top.value * top.value) - 1.5;
        }
        break;
    }
    case AOM_YANG_SUN:
        slope = 1.0 - 0.6 * exp(0.4 * log(y / deepest));
        break;
    default:
        slope = p[2];
        by[2] = deepest - y;
    }
    by[1] = (low - deepest * slope) / y;
    return slope;
}

static law_slopes hysteretic_slopes(const aom_law *law, int branch, double delta,
                                    const double *memory) {
    law_slopes by = {{0.0}, {0.0}};
    double deepest = memory[0], turn = memory[1], from = deepest;
    if (branch == AOM_FORWARD && delta >= deepest) {
        loading_slopes(law, delta, by.params);
        return by;
    }
    double low = law_permanent(law, deepest), by_low[AOM_LAW_SLOPES] = {0.0};
    if (delta <= low || deepest <= 0.0 || (branch == AOM_BACK && turn <= low))
        return by;
    curve top = law_loading(law, deepest), whole = {1.0, 0.0};
    double low_deepest = permanent_slopes(law, deepest, by_low), width = deepest - low;
    bool turned = branch == AOM_BACK && turn < deepest;
    if (turned) {
        whole = law_shape(law, (turn - low) / width, false);
        from = turn;
    }
    curve part = law_shape(law, (delta - low) / (from - low), branch == AOM_BACK);
    /* F = top whole(a) part(b), a = (turn - low)/(deepest - low), b = (delta - low)/(from - low) */
    double force = whole.value * part.value, slope = top.value * whole.value * part.slope;
    double b_low = (delta - from) / ((from - low) * (from - low));
    double b_from = -(delta - low) / ((from - low) * (from - low));
    double by_low_all = slope * b_low;
    if (turned) {
        double steep = top.value * whole.slope * part.value;
        by_low_all += steep * (turn - deepest) / (width * width);
        by.memory[1] = steep / width + slope * b_from;
        by.memory[0] = -steep * (turn - low) / (width * width);
    } else
        by.memory[0] = slope * b_from;
    by.memory[0] += top.slope * force + by_low_all * low_deepest;
    loading_slopes(law, deepest, by.params);
    for (int k = 0; k < AOM_LAW_SLOPES; k++)
        by.params[k] = by.params[k] * force + by_low_all * by_low[k];
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
        by.params[0] = delta;
        return by;
    }
    if (delta <= 0.0)
        return by;
    if (remembers(law->kind))
        return hysteretic_slopes(law, branch, delta, memory);
    tangent at = law_tangent(NULL, law, branch, delta, rate, memory);
    if (law->kind == AOM_HERTZ) { /* delta = k^(-2/3) F^(2/3) - c F */
        by.params[0] = p[1] == 0.0 ? at.force / p[0]
                                   : at.by_delta * 2.0 / 3.0 * pow(at.force / p[0], 2.0 / 3.0) / p[0];
        by.params[1] = at.by_delta * at.force;
        return by;
    }
    by.params[0] = at.force / p[0];
    by.params[1] = at.force * log(delta);
    if (law->kind == AOM_DAMPED)
        by.memory[0] = at.force / (1.0 + memory[0] * rate) * rate;
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
        by.memory[0] = permanent_slopes(law, memory[0], by.params);
    else if (branch == AOM_BACK)
        by.memory[1] = 1.0;
    else if (memory[2] < memory[0])
        by.memory[0] = 1.0;
    else /* a kink of Thornton's or Stronge's law */
        by.params[1] = law_bounds(law, branch, memory).high / law->params[1];
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
