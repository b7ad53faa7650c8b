/* What is expected of a contact before it is integrated, roughly: its depth, speed and length. */
#include "internal.h"

#define CLOSE 0.1    /* relative error of the depth */
#define AT_REST 1e-4 /* what closes more slowly than so of what is expected begins at that speed */

/* Work of loading a new contact that closes at a speed up to delta, less that of a force. */
static double excess(const aom_law *law, double speed, double delta, double force) {
    double work = 0.0;
    if (law->kind != AOM_USER)
        work = aom_law_loading_work(law, delta);
    else if (law->user->work(law->user->context, speed, delta, &work) != 0)
        return NAN;
    return work - force * delta;
}

double aom_law_deepest(const aom_law *law, double speed, double energy, double force, double high,
                       double close) {
    double beyond = excess(law, speed, high, force) - energy;
    if (!(beyond > 0.0)) /* the law is softer than the whole run can show */
        return high;
    double wanted = energy + force * high, low = 0.0;
    double guess = high * pow(wanted / (beyond + wanted), 0.4); /* of Hertz's law without force */
    double first = 0.95 * guess, last = smaller(1.04 * guess, high);
    if (excess(law, speed, last, force) <= energy)
        low = last;
    else {
        high = last;
        if (excess(law, speed, first, force) <= energy)
            low = first;
    }
    for (int tries = 0; tries < 400 && high > (1.0 + close) * low; tries++) {
        double middle = low > 0.0 ? 0.5 * (low + high) : 0.1 * high;
        if (excess(law, speed, middle, force) > energy)
            high = middle;
        else
            low = middle;
    }
    return high;
}

/* |beta x| of a modal velocity or force. */
static double approach(int n, const double *beta, const double *modal) {
    double total = 0.0;
    for (int j = 0; j < n; j++)
        total += beta[j] * modal[j];
    return fabs(total);
}

aom_expected aom_expect(const aom_system *s, int contact, double duration) {
    const aom_contact *c = s->contacts + contact;
    const aom_user_law *user = c->law.user;
    if (aom_law_check(&c->law) != AOM_DONE || (user != NULL && user->work == NULL))
        return (aom_expected){NAN, NAN, NAN};
    const double *beta = s->beta + (ptrdiff_t)contact * s->n_modes;
    double force = c->mass * approach(s->n_modes, beta, s->loads);
    double speed = approach(s->n_modes, beta, s->v);
    speed = sqrt(speed * speed + 2.0 * force / c->mass * s->offsets[contact]);
    if (speed == 0.0 && force == 0.0)
        return (aom_expected){1e-300, 1e-300, duration / 16.0};
    double farthest = speed * duration + force / c->mass * duration * duration;
    double energy = 0.5 * c->mass * speed * speed;
    double depth = aom_law_deepest(&c->law, speed, energy, force, farthest, CLOSE);
    double pace = speed + sqrt(2.0 * force / c->mass * depth);
    return (aom_expected){depth, pace, smaller(3.0 * depth / pace, 0.5 * duration)};
}

aom_expected scale_contact(const aom_system *s, aom_contact *only, double duration) {
    aom_expected expected = aom_expect(s, 0, duration);
    only->expected_depth = expected.depth;
    only->expected_speed = expected.speed;
    only->slowest = AT_REST * expected.speed;
    return expected;
}
