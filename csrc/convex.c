/* The laws of proved bounds: convex potentials, and the curves on which a contact that yields unloads.
 *
 * A contact that was p deep goes back on F = U(d; p), which is convex, and again up to p. The work W of
 * its force is a function of d and p: W' = F d'. In its first loading U lies below the loading curve g,
 * and W above its potential, so that the bounds of g hold until the reference goes back. From then on p
 * is known to lie between two depths. At a force the curves differ by a shift, which costs nothing, and
 * by their compliances, whose relative difference is the spread. */
#include "internal.h"

/* A convex law: value, slope and curvature of the force, and the potential; slope of the indentation
 * by the whole one. */
typedef struct convex {
    double g, slope, bend, G, give;
} convex;

/* F = k (d - low)^n of a whole indentation d, of which a patch takes c F; of a sphere beyond yield
 * its own curve. */
typedef struct shape {
    const aom_law *law;
    double k, n, low, c, yield;
} shape;

static double raised(double x, double n) {
    return n == 0.5 ? sqrt(x) : n == 0.0 ? 1.0 : n == 1.0 ? x : pow(x, n);
}

static convex whole_at(const shape *s, double d) {
    double z = d - s->low;
    if (!(z > 0.0))
        return (convex){0.0, 0.0, 0.0, 0.0, 1.0};
    if (d <= s->yield) {
        double root = s->k * raised(z, s->n - 1.0);
        return (convex){root * z, s->n * root, s->n * (s->n - 1.0) * root / z,
                        root * z * z / (s->n + 1.0), 1.0};
    }
    double y = s->yield, top = s->k * y * sqrt(y), term = top * d / y, less = sqrt(sqrt(y / d));
    convex sum = {0.0, 0.0, 0.0, 0.4 * top * y, 1.0};
    for (int i = 0; i < PRESSINGS; i++) {
        double n = 1.0 - 0.25 * i, c = PRESSING[i] + s->law->params[2] * PRESSING_ELASTIC[i];
        sum.g += c * term;
        sum.slope += n * c * term / d;
        sum.bend += n * (n - 1.0) * c * term / (d * d);
        sum.G += c * (term * d - top * y) / (n + 1.0);
        term *= less;
    }
    return sum;
}

static convex convex_at(const shape *s, double x) {
    double d = x, step = s->c > 0.0 ? d : 0.0;
    convex at = whole_at(s, d);
    for (int i = 0; i < 50 && step > 1e-9 * d; i++) { /* Newton, from below */
        step = (x - d + s->c * at.g) / larger(1.0 - s->c * at.slope, 1.0 - TAKEN);
        d += step;
        at = whole_at(s, d);
    }
    at.give = larger(1.0 - s->c * at.slope, 1.0 - TAKEN);
    at.slope /= at.give;
    at.bend /= at.give * at.give * at.give;
    at.G -= 0.5 * s->c * at.g * at.g;
    return at;
}

/* At least the indentation of an energy, from where the law begins: a patch makes it stiffer. */
static double depth_of(const shape *s, double energy) {
    double depth = pow(energy * (s->n + 1.0) / s->k, 1.0 / (s->n + 1.0));
    if (depth <= s->yield)
        return depth;
    convex at = whole_at(s, s->yield);
    return s->yield + (energy - at.G) / at.g;
}

/* What is known of a difference D of indentations: D^2/y + 2 H(D) <= 2 energy + x way^2 for all pairs
 * (x, y) of the rates and compliances, but for a shift of D. */
typedef struct limits {
    double energy, way, shift;
    int n;
    const double *rates, *compliances;
} limits;

/* Largest |D| of a law with 2 H >= stiffness D^2. */
static double reach_of(const limits *l, double stiffness) {
    double own = stiffness > 0.0 ? 2.0 * l->energy / stiffness : INFINITY, square = INFINITY;
    for (int i = 0; i < l->n; i++) {
        double both = 1.0 / l->compliances[i] + stiffness;
        square = smaller(square, (2.0 * l->energy + l->rates[i] * l->way * l->way) / both);
    }
    return smaller(sqrt(own), sqrt(square) + l->shift);
}

/* Largest D > 0 and D < 0 for indentations from `low` on. */
static double farther(const shape *s, double low, const limits *l) {
    double depth = larger(s->low - low, 0.0) + depth_of(s, l->energy);
    return smaller(depth, reach_of(l, convex_at(s, low).slope));
}

static double nearer(const shape *s, double low, const limits *l) {
    double inside = low - s->low;
    if (!(inside > 0.0))
        return reach_of(l, 0.0);
    double most = reach_of(l, convex_at(s, low).g / inside);
    for (int i = 0; i < 3 && most < inside; i++) /* g(x) - g(x - d) >= d g'(x - d) */
        most = smaller(most, reach_of(l, convex_at(s, low - most).slope));
    return most < inside ? most : reach_of(l, 0.0);
}

/* Curvature without the patch, which falls along a law of n < 2 and rises along others. */
static double own_bend(convex at) { return at.bend * at.give * at.give * at.give; }

/* The law of a contact: now, and in its first loading; the force up to which a patch is known. Of one
 * that unloads: the indentation from which it does in the reference, the whole ones from between which
 * it does, the relative difference of its compliances, and that of its indentations at a force. */
typedef struct yielding {
    shape now, loading;
    double limit, reached; /* largest whole indentation so far */
    double deepest, least, most, spread, shift;
} yielding;

static yielding first_loading(const aom_law *law) {
    const double *p = law->params;
    shape first = {law, p[0], HERTZIAN, 0.0, patch_compliance(law), INFINITY};
    if (law->kind == AOM_LINEAR)
        first.k = linear_stiffness(law), first.n = 1.0, first.c = 0.0;
    else if (law->kind == AOM_POWER)
        first.n = p[1];
    else if (law->kind == AOM_HERTZ)
        first.c = p[1];
    else
        first.yield = p[1];
    return (yielding){.now = first, .loading = first, .limit = aom_law_reach(law), .deepest = INFINITY};
}

static double whole_of(const shape *s, double x) { return x + s->c * convex_at(s, x).g; }

/* How a contact unloads that was so deep: F = force ((d - low)/width)^n; slopes by its depth. */
typedef struct release {
    double low, width, force, n, low_slope, force_slope;
} release;

static release release_at(const shape *loading, double deepest) {
    curve low = whole_permanent(loading->law, deepest);
    convex at = whole_at(loading, deepest);
    double n = law_power(loading->law, deepest, false);
    return (release){low.value, deepest - low.value, at.g, n, low.slope, at.slope};
}

static shape unloads(const shape *loading, release r) {
    return (shape){loading->law, r.force / pow(r.width, r.n), r.n, r.low, loading->c, INFINITY};
}

static bool may_have_yielded(const yielding *law, double depth) {
    return law->deepest == INFINITY && depth > law->loading.yield;
}

/* At least the slope of the curves on which contacts of depths between two unload. */
static double steepest(release a, release b, double c) {
    double whole = a.n * b.force / a.width;
    return whole / larger(1.0 - c * whole, 1.0 - TAKEN);
}

/* At least what the force may be below the law's, of a contact whose indentation is more than `low`. */
static double below(const yielding *law, double low, double energy) {
    const shape *loading = &law->loading;
    if (!may_have_yielded(law, law->reached))
        return 0.0;
    double depth = larger(whole_of(loading, larger(low, 0.0)), loading->yield);
    release a = release_at(loading, depth), b = release_at(loading, law->reached);
    return sqrt(2.0 * energy * steepest(a, b, loading->c));
}

/* Depth over that at yield up to which an unloading curve may cross the loading curve. */
#define CROSSING 1.12

/* At least what its force may be above the law's, of a contact that was at most so deep; *room, from
 * how far above its indentation it unloads. */
static double above(const shape *loading, double low, double most, double *room) {
    double least = larger(whole_of(loading, low), loading->yield);
    most = smaller(most, CROSSING * loading->yield);
    if (!(least < most))
        return 0.0;
    release a = release_at(loading, least), b = release_at(loading, most);
    double steep = steepest(a, b, loading->c), inside = larger(low - b.low, 0.0) / b.width;
    double flatter = (1.0 - pow(inside, a.n - 1.0)) * steep * steep * a.width / (a.n * b.force);
    *room = most - loading->c * b.force - low;
    return flatter * *room;
}

#define PARTS 16
#define NEGLIGIBLE 1e-9 /* share of a force below which it is rounding */

/* Largest relative difference of the compliance of unloading curves, of whole depths between two, from
 * that from one, at the same force; INFINITY where the curve from a deeper one may not be below. */
static double compliance_spread(const shape *loading, double deepest, double least, double most) {
    if (!(least > CROSSING * loading->yield))
        return INFINITY;
    release here = release_at(loading, deepest), a = release_at(loading, least), b = a;
    double top = log(whole_at(loading, most).g), forces[2] = {top, top + log(NEGLIGIBLE)}, spread = 0.0;

    for (int i = 0; i <= PARTS; i++, a = b) {
        b = release_at(loading, least + (most - least) * i / PARTS);
        double margin = 1.0 - b.low_slope * (most - least) / b.width;
        if (b.force_slope * b.width > b.n * b.force * margin)
            return INFINITY;
        for (int k = 0; k < 2; k++) { /* the width and the force rise with the depth, n falls */
            double own = log(here.width / here.n) - (log(here.force) - forces[k]) / here.n;
            double fa = log(a.force) - forces[k], fb = log(b.force) - forces[k];
            double high = log(b.width / b.n) - fa / (fa > 0.0 ? a.n : b.n);
            double low = log(a.width / a.n) - fb / (fb > 0.0 ? b.n : a.n);
            spread = larger(spread, larger(expm1(high - own), -expm1(low - own)));
        }
    }
    return spread;
}

static double relative_energy(const shape *law, double delta, double change) {
    convex at = convex_at(law, delta);
    return larger(convex_at(law, delta + change).G - at.G - at.g * change, 0.0);
}
