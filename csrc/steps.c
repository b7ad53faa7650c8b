/* A step, as long as its error permits or no touch can hide in it, up to where a contact leaves its
 * branch. Flights are steps without forces. */
#include "internal.h"

#define INTERPOLATION 0.0482 /* max |s (s - 1/2)(s - 1)| on [0, 1] */
#define KINKED 0.075         /* error of the parabola through t^(3/2), over its second difference */
#define EXACT 1e-2           /* of what a bound is met to: touches and releases are located so sharply */
#define RIPPLE 2.0           /* force of unresolved vibrations, over the error of a step's force */
#define LASTING 2000         /* steps between two events: with 200, 3 of 2000 random blows took 80x */
#define UNRESOLVED 0.1       /* half of the squared angle by which the bodies vibrate on a contact */
#define UNSEEN 0.5           /* the same, where steps grow beyond what a contact lets expect */
#define ADAPT 8              /* steps between two looks at that */

/* Whether one contact has taken far more steps than an ordinary impact does. */
static bool lasts(const aom_stepper *st) {
    return st->now.lasting >= LASTING && st->system.n_rows == 1 && !st->rated &&
           st->options.step == 0.0;
}

/* Whether a step is too long for the vibrations of the bodies on a single contact. */
static bool unresolved(const aom_stepper *st, const influence *local) {
    if (!lasts(st) || !pressing(st->contacts[0].branch))
        return false;
    double k = st->now.stiffness, residual = st->system.residual[0];
    const double *by = local->depth[1];
    return k * (by[0] + by[1] + by[2] - residual) > UNRESOLVED * (1.0 + k * residual);
}

/* Forces and motion of a step h, into the workspace; false if they are not found. */
static bool attempt(aom_stepper *st, int index, double h) {
    const influence *local = st->slots[index].local;
    ready_step(st, index, h);
    if (st->now.flying) {
        free_step(st, index, h, st->work.motion);
        return true;
    }
    ready_local(st, index, h);
    free_step(st, index, h, st->work.base);
    st->now.lacking = 0.0;
    int c = st->work.closed[0];
    bool single = st->n_closed == 1 && c < st->system.n_contacts;
    if (single)
        local = own_influence(st, local, c);
    if (single && unresolved(st, local))
        return long_force(st, h, local);
    bool found = single && one_force(st, h, local, c);
    for (int n = 0; n < st->n_closed && !found; n++)
        for (int i = st->work.closed[n], node = 0; node < 3; node++) {
            const row_state *row = st->rows + i; /* a first guess on the last parabola */
            double u = 0.5 * h * node, guess = row->force + u * (row->slope + 0.5 * u * row->bend);
            st->work.force[i].f[node] = acts(st, i) ? guess : 0.0;
        }
    if (!found)
        found = st->system.n_stretch > 0 ? stretched_forces(st, index) : all_forces(st, index);
    if (found)
        move_open(st, index, h, st->exit_contact);
    return found;
}

/* Where a branch is left between the start and a stage of the step: the time after the start of
 * that half, and by which bound. */
static double exit_time(const branch_bounds *b, const contact_state *contact, double a, double va,
                        double e, double ve, double half, bound *by) {
    double near = SHARP * contact->depth_scale, even = 1e-6 * contact->speed_scale;
    double found = INFINITY;
    *by = NOTHING;
    if (e < b->low - near) {
        found = crossing(a, va, e, ve, half, b->low);
        *by = LOW;
    } else if (e > b->high + near) {
        found = crossing(a, va, e, ve, half, b->high);
        *by = HIGH;
    }
    if (ve < b->slow - even || ve > b->fast + even) {
        double edge = ve < b->slow ? b->slow : b->fast;
        double at = ve != va ? half * within((edge - va) / (ve - va), 0.0, 1.0) : 0.0;
        if (at < found) {
            found = at;
            *by = ve < b->slow ? SLOW : FAST;
        }
    }
    return found;
}

/* What friction is beyond at 0, h/2, h of the step, and the slopes: where it sticks Coulomb's cone [N],
 * where it slips a slider that stands still [N/s]. */
static void beyond_friction(const aom_stepper *st, int c, double value[3], double slope[3]) {
    const aom_contact *contact = st->system.contacts + c;
    const contact_state *state = st->contacts + c;
    const double *f = st->work.force[c].f, h = st->now.step, mu = contact->friction;
    double of_normal[3] = {st->rows[c].slope, (f[2] - f[0]) / h,
                           (f[0] - 4.0 * f[1] + 3.0 * f[2]) / h};
    if (st->rows[c].fresh)
        of_normal[0] = (4.0 * f[1] - 3.0 * f[0] - f[2]) / h;
    for (int node = 0; node < 3; node++) {
        double size = 0.0, along = 0.0, forward = 0.0, moved = 0.0;

        for (int r = 0; r < contact->n_tangential; r++) {
            int i = contact->first_tangential + r;
            double T = st->work.force[i].f[node];
            double rate = node == 0 ? st->rows[i].rate : st->work.motion[i].rate[node - 1];
            size += T * T;
            along += T * rate;
            forward += state->direction[r] * rate;
            moved += rate * rate;
        }

        size = sqrt(size);
        double speed = state->slips ? forward : sqrt(moved); /* where friction has no direction */
        if (size > SHARP * mu * scale_of(st, c))
            speed = along / size;
        value[node] = size - mu * f[node];
        slope[node] = contact->tangential_stiffness * speed - mu * of_normal[node];
    }
    if (!state->slips)
        return;

    for (int node = 0; node < 3; node++)
        value[node] = -slope[node];
    slope[0] = (4.0 * value[1] - 3.0 * value[0] - value[2]) / h;
    slope[1] = (value[2] - value[0]) / h;
    slope[2] = (value[0] - 4.0 * value[1] + 3.0 * value[2]) / h;
}

/* What friction may be beyond: a force that is small beside a step's error. */
static double near_friction(const aom_stepper *st, int c) {
    double force = st->system.contacts[c].friction * scale_of(st, c);
    double near = 1e-3 * st->options.rel_tol * force;
    return st->contacts[c].slips ? near / st->now.step : near;
}

/* When the first contact leaves its branch in the step, INFINITY if none does. */
static double first_exit(aom_stepper *st) {
    double half = 0.5 * st->now.step, first = INFINITY;
    for (int c = 0; c < st->system.n_contacts; c++) {
        const contact_state *contact = st->contacts + c;
        const stages *motion = st->work.motion + c;
        bool apart = contact->branch == AOM_APART;
        if (apart && larger(motion->depth[0], motion->depth[1]) <= origin_of(st, c))
            continue;
        branch_bounds b = law_bounds(&st->system.contacts[c].law, contact->branch, contact->memory);
        const row_state *row = st->rows + c;
        double y[3] = {row->depth, motion->depth[0], motion->depth[1]};
        double d[3] = {row->rate, motion->rate[0], motion->rate[1]};
        for (int stage = 0; stage < 2; stage++) {
            bound by;
            double found = exit_time(&b, contact, y[stage], d[stage], y[stage + 1], d[stage + 1],
                                     half, &by);
            if (by == NOTHING)
                continue;
            found += half * stage;
            if (by <= HIGH && found > 1e-3 * half)
                found = polished(found, y, d, 2.0 * half, by == LOW ? b.low : b.high);
            if (found < first) {
                first = found;
                st->exit_contact = c;
                st->exit_bound = by;
            }
            break;
        }
        if (st->system.contacts[c].n_tangential == 0 || !pressing(contact->branch))
            continue;
        double near = near_friction(st, c), g[3], slope[3];
        beyond_friction(st, c, g, slope);
        for (int stage = 0; stage < 2; stage++) {
            double found = half * stage + rises(g[stage], slope[stage], g[stage + 1],
                                                slope[stage + 1], half, near);
            if (found < first) {
                first = found;
                st->exit_contact = c;
                st->exit_bound = contact->slips ? STICK : SLIP;
            }
        }
    }
    return first;
}

/* The rate of a contact at the end of the step. Of what has no mass it is that which the slope of the
 * law's force leaves: of a stiff law that of the parabola is rounding. */
static double end_rate(aom_stepper *st, int c) {
    double compliance = st->system.residual[(ptrdiff_t)c * (st->system.n_rows + 1)];
    double rate = st->work.motion[c].rate[1];
    const contact_state *contact = st->contacts + c;
    if (compliance == 0.0 || st->rated || !pressing(contact->branch))
        return rate;
    const double *f = st->work.force[c].f;
    double stiffness = law_tangent(st, &st->system.contacts[c].law, contact->branch,
                                   st->work.motion[c].depth[1], rate, contact->memory).by_delta;
    double slope = (f[0] - 4.0 * f[1] + 3.0 * f[2]) / st->now.step;
    return (rate + compliance * slope) / (1.0 + compliance * stiffness);
}

/* How far the contact of the exit lies beyond its bound at the start (0) or the end (1) of the step; of
 * the indentation and of friction with the slope. */
static curve beyond(aom_stepper *st, const branch_bounds *b, int end) {
    int c = st->exit_contact;
    double depth = end ? st->work.motion[c].depth[1] : st->rows[c].depth;
    double rate = end ? st->work.motion[c].rate[1] : st->rows[c].rate;
    switch (st->exit_bound) {
    case LOW:
        return (curve){b->low - depth, -end_rate(st, c)};
    case HIGH:
        return (curve){depth - b->high, end_rate(st, c)};
    case SLOW:
        return (curve){b->slow - rate, 0.0};
    case FAST:
        return (curve){rate - b->fast, 0.0};
    default:
        break;
    }
    double g[3], slope[3];
    beyond_friction(st, c, g, slope);
    return (curve){g[2 * end], slope[2 * end]};
}

/* Shorten the step to end where the contact of the exit leaves its branch, at about `first`. */
static bool end_at_exit(aom_stepper *st, double first) {
    int c = st->exit_contact;
    bound exit = st->exit_bound;
    const contact_state *contact = st->contacts + c;
    const aom_law *law = &st->system.contacts[c].law;
    branch_bounds b = law_bounds(law, contact->branch, contact->memory);
    double low = 0.0, high = st->now.step;
    double aim = exit == STICK ? 0.5 * near_friction(st, c) : 0.0; /* it stands, and goes back */
    double g_low = beyond(st, &b, 0).value - aim, g_high = beyond(st, &b, 1).value - aim;
    double length = first;
    bool near = false;
    /* a damped law's force is cut where it is 0: what is left of it there is lost */
    double even = law->kind == AOM_DAMPED ? SHARP : 1e-6;
    double close = exit == STICK   ? aim
                   : exit == SLIP  ? near_friction(st, c)
                   : exit <= HIGH ? SHARP * contact->depth_scale
                                  : even * contact->speed_scale;
    for (int tries = 0; tries < 14; tries++) {
        st->now.retries++;
        st->now.step = length; /* of the attempt that counts, should the tries end before */
        if (!attempt(st, SCRATCH, length))
            return false;
        curve at = beyond(st, &b, 1);
        double g = at.value - aim;
        if (fabs(g) <= close) {
            bool sharply = exit == LOW ? at.slope * length >= 1e3 * close : st->now.flying;
            if (near || !sharply || fabs(g) <= EXACT * close)
                return true;
            near = true; /* a touch or a release is located to rounding: once more */
        }
        if (g > 0.0) {
            high = length;
            g_high = g;
        } else {
            low = length;
            g_low = g;
        }
        double new = at.slope > 0.0 ? length - g / at.slope : -1.0;
        if (!(low < new && new < high) && g_low < 0.0 && 0.0 < g_high && tries < 8)
            new = low + (high - low) * g_low / (g_low - g_high);
        if (!(low < new && new < high))
            new = 0.5 * (low + high);
        length = new;
    }
    if (exit >= SLIP) /* it did not reach its bound: the step ends without an exit */
        st->exit_contact = -1;
    return true;
}

/* The same; where another contact has touched before the end of a flight, the flight ends there. */
static bool end_at_exits(aom_stepper *st, double first) {
    for (int n = st->system.n_contacts; n > 0 && first < INFINITY; n--) {
        if (!end_at_exit(st, first)) {
            st->exit_contact = -1;
            return false;
        }
        first = st->now.flying ? first_exit(st) : INFINITY;
    }
    if (!st->now.flying)
        move_open(st, SCRATCH, st->now.step, -1);
    return true;
}

/* Error of a step's parabola: from the third difference with the value before/2 before the step; in
 * the first step of a contact, whose force may rise as t^(3/2), from the second difference. */
static double misfit(double earlier, const double f[3], double before, double h, bool fresh) {
    if (fresh)
        return KINKED * fabs(f[0] - 2.0 * f[1] + f[2]);
    double g = 0.5 * before, e = 0.5 * h;
    double d1 = (f[0] - earlier) / g, d2 = (f[1] - f[0]) / e, d3 = (f[2] - f[1]) / e;
    double third = ((d3 - d2) / h - (d2 - d1) / (g + e)) / (g + h);
    return INTERPOLATION * h * h * h * fabs(third);
}

/* Largest error of the parabolas of the step, over the scales of their contacts. */
static double worst_misfit(const aom_stepper *st) {
    double worst = st->now.lacking > 0.0 ? st->now.lacking / scale_of(st, 0) : 0.0;
    for (int n = 0; n < st->n_closed; n++) {
        int i = st->work.closed[n];
        worst = larger(worst, misfit(st->rows[i].middle, st->work.force[i].f, st->now.last_step,
                                     st->now.step, st->rows[i].fresh) /
                                  scale_of(st, st->owner[i]));
    }
    return worst;
}

/* Force that the vibrations which a step h does not resolve may cause, at most, over its scale.
 *
 * A mode with omega h > 2 vibrates about its deflection under the present forces. Unresolved
 * vibrations can be driven by the steps themselves, and at omega h = 2 pi the nodes do not see
 * them. */
static double ripple(aom_stepper *st, double h) {
    int J = st->system.n_modes, m = st->system.n_rows;
    double worst = 0.0;
    for (int c = 0; c < st->system.n_contacts; c++) {
        const contact_state *contact = st->contacts + c;
        const aom_law *law = &st->system.contacts[c].law;
        const row_state *row = st->rows + c;
        if (!pressing(contact->branch))
            continue;
        double stiffness =
            law_tangent(st, law, contact->branch, row->depth, row->rate, contact->memory).by_delta;
        double residual = st->system.residual[(ptrdiff_t)c * (m + 1)];
        double begun = 0.0, swing = 0.0, soft = residual;
        if (row->fresh) {
            stiffness = larger(stiffness, scale_of(st, c) / contact->depth_scale);
            double depth = row->depth + h * row->rate;
            double after =
                law_tangent(st, law, contact->branch, depth, row->rate, contact->memory).force;
            begun = fabs(after - row->force);
        }
        const double *beta = beta_row(st, c);
        for (int j = 0; j < J; j++) {
            double w = st->system.omega[j], w2 = w * w, pull = -st->work.load[j], change = 0.0;
            if (w * h <= 2.0)
                continue;
            for (int i = 0; i < m; i++) {
                pull += beta_row(st, i)[j] * st->rows[i].force;
                change += beta_row(st, i)[j] * st->rows[i].slope;
            }
            double q = st->x[j] + pull / w2, v = st->x[J + j] + change / w2;
            swing += fabs(beta[j]) * sqrt(q * q + v * v / w2);
            soft += beta[j] * beta[j] / w2;
        }
        swing += begun * (soft - residual);
        worst = larger(worst, stiffness * swing / (1.0 + stiffness * soft) / scale_of(st, c));
    }
    return worst;
}

/* A contact may last far longer than its own masses let expect, as that of a heavy mass that bends a
 * beam. Its longest step grows while no vibration shows in the force, and shrinks where one does. */
static void adapt_cap(aom_stepper *st, double h, bool coarser) {
    run_state *now = &st->now;
    if (!lasts(st) || now->flying || now->steps % ADAPT != 0)
        return;
    double limit = UNSEEN * st->options.rel_tol;
    if (coarser && 2.0 * h > now->cap && ripple(st, 2.0 * h) <= limit)
        now->cap = 2.0 * h;
    else if (h > now->first_cap && !(ripple(st, h) <= limit))
        now->cap = larger(0.5 * h, now->first_cap);
}

/* The level at which the tries begin. */
static int first_level(aom_stepper *st, bool blind) {
    int level = st->now.level;
    while (level_step(st, level) > st->now.cap && level < LEVELS - 3)
        level++;
    if (blind)
        return level + 3 < LEVELS - 3 ? level + 3 : LEVELS - 3;
    while (st->options.step > 0.0 && level < LEVELS - 3 &&
           !(ripple(st, level_step(st, level)) <= RIPPLE * st->options.rel_tol)) {
        level++;
        st->now.refused++;
    }
    return level;
}

/* By how many levels the step that was tried is to be finer; `worst`: its error over its limit. */
static int refinement(aom_stepper *st, int index, bool found, bool blind, double *worst) {
    run_state *now = &st->now;
    if (now->flying)
        return !clear_of_touches(st, index);
    bool jump = now->step <= 1e-9 * now->cap; /* no smaller step helps */
    *worst = found ? worst_misfit(st) / st->options.rel_tol : INFINITY;
    if (!(*worst > 1.0) || (found && (blind || jump)))
        return st->system.n_stretch > 0 && nothing_touches(st) && !stretched_clear(st, index);
    now->refused++;
    return !found || *worst < 16.0 ? 1 : *worst < 128.0 ? 2 : 3;
}

/* The next step, up to the first exit: its slot, AT_ONCE or NO_STEP. */
int try_step(aom_stepper *st) {
    run_state *now = &st->now;
    /* exits without end at one time: step over them */
    bool blind = !now->flying && now->idle > 4 * st->system.n_contacts + 8;
    int level = now->flying ? now->level : first_level(st, blind);
    while (level < LEVELS - 2 && !st->law_failed) {
        int index = level;
        double h = level_step(st, level), left = now->left, worst = 0.0;
        if (h >= left) {
            index = SCRATCH;
            h = left;
        }
        now->step = h;
        bool found = attempt(st, index, h);
        int finer = refinement(st, index, found, blind, &worst);
        if (finer == 0 && !blind) {
            double first = first_exit(st);
            if (first <= (now->flying ? 1e-15 * st->options.duration : 1e-9 * h))
                return AT_ONCE;
            if (first < INFINITY && end_at_exits(st, first)) {
                finer = now->flying ? 0 : refinement(st, SCRATCH, true, blind, &worst);
                if (finer == 0) {
                    now->level = level;
                    return SCRATCH;
                }
                st->exit_contact = -1; /* what lies before the exit is too long for one step */
                while (level_step(st, level) > now->step && level < LEVELS - 2)
                    level++;
            } else
                finer = first < INFINITY;
        }
        if (finer == 0) {
            bool coarser = worst < 1.0 / 16.0 && level > 0 && (now->flying || index != SCRATCH);
            now->level = coarser ? level - 1 : level;
            adapt_cap(st, h, coarser);
            return index;
        }
        now->retries++;
        level += finer;
        while (index == SCRATCH && level_step(st, level) >= 0.5 * left && level < LEVELS)
            level++;
    }
    return NO_STEP;
}
