/* What is expected of a contact before it is integrated, roughly: its depth, speed and length. */
#include "internal.h"

#define CLOSE 0.1 /* relative error of the depth */

/* Work of loading a new contact that closes at a speed up to delta, less that of a force. */
static double excess(const aom_law *law, double speed, double delta, double push) {
    double work = 0.0;
    if (law->kind != AOM_USER)
        work = aom_law_loading_work(law, delta);
    else if (law->user->work(law->user->context, speed, delta, &work) != 0)
        return NAN;
    return work - push * delta;
}

double aom_law_deepest(const aom_law *law, double speed, double energy, double push, double high,
                       double close) {
    double beyond = excess(law, speed, high, push) - energy;
    if (!(beyond > 0.0)) /* the law is softer than the whole run can show */
        return high;
    double wanted = energy + push * high, low = 0.0;
    double guess = high * pow(wanted / (beyond + wanted), 0.4); /* of Hertz's law without push */
    double first = 0.95 * guess, last = smaller(1.04 * guess, high);
    if (excess(law, speed, last, push) <= energy)
        low = last;
    else {
        high = last;
        if (excess(law, speed, first, push) <= energy)
            low = first;
    }
    for (int tries = 0; tries < 400 && high > (1.0 + close) * low; tries++) {
        double middle = low > 0.0 ? 0.5 * (low + high) : 0.1 * high;
        if (excess(law, speed, middle, push) > energy)
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

aom_expected aom_expect(const aom_impact *s) {
    if (aom_law_check(&s->law) != AOM_DONE || (s->law.user != NULL && s->law.user->work == NULL))
        return (aom_expected){NAN, NAN, NAN};
    double push = s->mass * approach(s->n_modes, s->beta, s->load);
    double speed = approach(s->n_modes, s->beta, s->v), T = s->duration;
    speed = sqrt(speed * speed + 2.0 * push / s->mass * s->gap);
    if (speed == 0.0 && push == 0.0)
        return (aom_expected){1e-300, 1e-300, T / 16.0};
    double farthest = speed * T + push / s->mass * T * T;
    double depth = aom_law_deepest(&s->law, speed, 0.5 * s->mass * speed * speed, push, farthest,
                                   CLOSE);
    double pace = speed + sqrt(2.0 * push / s->mass * depth);
    return (aom_expected){depth, pace, smaller(3.0 * depth / pace, 0.5 * T)};
}
