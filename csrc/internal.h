/* What the files of the march share, which are one unit: the stepper's memory, and the functions of
 * each file.
 *
 * Words: a row is an indentation or a sliding; its modal vector (beta, gamma) says how it sees the
 * modes and how its force acts on them; its compliance is the indentation that a unit of its own
 * force takes away, its coupling with another row what a unit of that one's force does. A step is
 * tried (the attempt), and accepted or refused; a contact is in a branch of its law; the run state
 * is what a step changes. */
#ifndef AOM_INTERNAL_H
#define AOM_INTERNAL_H

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "antiosc_march.h"
#include "arena.h"

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__) || \
    defined(_M_FP_FAST)
#error "antiosc computes with infinity and NaN: compile without -Ofast, -ffast-math, /fp:fast."
#endif

/* Two numbers at once, which compilers other than GCC and Clang take one by one, to the same bits. */
#if defined(__GNUC__)
typedef double lanes __attribute__((vector_size(16), may_alias));
typedef lanes anywhere __attribute__((aligned(8)));
enum { LANES = 1 };
#else
typedef double lanes, anywhere;
enum { LANES = 2 };
#endif

enum {
    LEVELS = 64,          /* steps H, H/2, H/4 ... */
    SCRATCH = LEVELS,     /* slot of a step of any length; its half stands in the next */
    SLOTS = LEVELS + 2
};

/* What the `local` of a slot holds of the forces: nothing, or the rate of what has no mass as
 * ready_local says. */
enum { NO_LOCAL, PLAIN, WITH_SLOPE };

#define SHARP 1e-9 /* of the depth or the speed: a bound is met */

/* What ends a step: the bounds of a branch. */
typedef enum bound {
    LOW,
    HIGH,
    SLOW,
    FAST,
    SLIP,  /* friction reaches the cone */
    STICK, /* the slider stands still */
    NOTHING
} bound;

typedef struct branch_bounds {
    double low, high, slow, fast; /* least and largest indentation, least and largest rate */
} branch_bounds;

/* Force and its slopes by indentation and rate. */
typedef struct tangent {
    double force, by_delta, by_rate;
} tangent;

typedef struct curve {
    double value, slope;
} curve;

/* How the force of a row at the nodes 0, h/2, h holds back the indentation and the rate of another
 * at h/2 and h: [stage][node]. */
typedef struct influence {
    double depth[2][3], rate[2][3];
} influence;

/* Indentation and rate of a row. */
typedef struct motion {
    double depth, rate;
} motion;

/* The same at h/2 and h. */
typedef struct stages {
    double depth[2], rate[2];
} stages;

/* Forces of a row at 0, h/2 and h. */
typedef struct nodes {
    double f[3];
} nodes;

/* Responses after a time `span`, for the length of a step. */
typedef struct slot {
    double span; /* [s], NaN: none */
    double *response; /* [6][J]: P, W, S, J0, J1, J2 */
    double *coupling; /* [pairs][4]: beta S beta^T, beta J0 beta^T, ... */
    influence *local; /* [pairs]; of this step and the slot of its half */
    int *place;       /* [G] of a group among those whose coupling it holds, or -1 */
    bool *held;       /* [m] rows whose own coupling it holds */
    int n_held, local_kind;
} slot;

/* The modes that a row moves: two stretches, for a row has at most two bodies. All others are 0. */
typedef struct row_span {
    int begin[2], end[2];
} row_span;

/* By what a force acts on the modes, and sees them: the row of a contact, or loads. */
typedef struct modal_vector {
    const double *beta, *gamma; /* [J], by displacements and by rates; gamma may be NULL */
} modal_vector;

typedef struct row_state {
    double force, middle; /* at the end and in the middle of the last step */
    double slope, bend;   /* derivatives of the parabola at its end */
    double depth, rate;
    bool fresh; /* its contact has just begun: no parabola stands behind it */
    double kink; /* by which the rate changes where the gap begins to move otherwise */
} row_state;

typedef struct contact_state {
    int branch;
    double memory[AOM_MEMORY];  /* what the law remembers */
    double anchor[3][2];        /* where the tangential springs hang at 0, h/2, h */
    bool slips;                 /* else its tangential springs stick to their anchors */
    double direction[2];        /* of friction that slips, at the start of the step */
    double depth_scale, speed_scale; /* the largest that were met or are expected */
    double force_scale;              /* the same [N], or that of an earlier run */
} contact_state;

/* All that a run changes, but for the arrays beside it. */
typedef struct run_state {
    double time, last_step, step, left; /* left: until the loads change */
    double force_scale, longest;   /* longest step */
    double stiffness, lacking; /* of the law at the last end; force that it lacks at h/2 of a long step */
    double cap, first_cap; /* of the present contact: longest step now and as its begin lets expect */
    double load_work, initial_energy, highest, surplus;
    double stretch_scale; /* [N] that errors of stretching are weighed by */
    double contact_work; /* energy that the contacts gave the bodies, of modes with gamma */
    int level, segment, flown_segment;
    bool flying;
    bool smooth; /* the slopes of the forces at the end of the last step go on */
    bool scaled; /* the scales of the forces are known from the start */
    int64_t steps, retries, touches, refused, idle;
    int64_t lasting; /* steps since a contact went over to another branch */
} run_state;

/* One contact in Newton's method for all forces: the slopes of its law and its residual, at h/2, h;
 * of a contact that slides, the forces of its rows over the normal one. */
typedef struct newton_row {
    double by_delta[2], by_rate[2], rest[2];
    double inverse[2][2], step[2]; /* of its own part of the matrix; the correction */
    double share[3][2];
} newton_row;

/* A row in two runs: time integrals of |F_a - F_b|^2, |F_b|^2, F_a - F_b and |F_b|, the largest forces,
 * those at the last node, and the first integral that ends what agrees. */
typedef struct row_pair {
    double apart, size, shift, impulse, peak[2], last[2], limit;
} row_pair;

typedef struct workspace {
    nodes *force;         /* [m] of the attempt */
    stages *base, *motion; /* [m] without and with the forces of the attempt */
    row_pair *pairs;      /* [m] of two runs */
    double *highest;      /* [p] forces of an earlier run */
    double *parabola;     /* [m][3]: value, slope, curvature at 0 */
    double *load, *load_rate;       /* [J], with gamma [2][J] */
    double *offset, *drift;         /* [m] */
    double *matrix, *rest;          /* [n][n], [n], n = 2 G; of stretching 2 (p + s) if that is more */
    newton_row *newton;   /* [p] */
    int *place;           /* [G] of a group among those that touch, or -1: others have no force */
    nodes *sum;           /* [n_touching] of the forces of a group */
    double *ahead;        /* [2][2][J]: q at h/2 and h, v */
    bool forced[2];       /* with the contact forces */
    double *kicks;        /* [J][4]: S, J0, J1, J2 of the modes */
    int *touching;        /* [n_touching] groups of closed rows */
    int *closed;          /* [n_closed] rows of contacts that touch, and of stretching */
    int *kept;            /* [n_touching] where a slot holds these groups, or -1 */
    double *coupling;     /* [pairs][4] into which that of a slot is brought */
    nodes *before;        /* [m] */
    int *active;          /* [p] */
    int *unknown;         /* [p + s] rows, s those of stretching */
    double *correction;   /* [2][p + s] of Newton's method */
    double *coordinates, *squares;           /* [s], [s][s]: of stretching, and their products */
    double *polynomial, *slopes;             /* [s], [s][s]: its forces and their slopes */
    double *depths;       /* [2][s][2 (p + s)] of its coordinates, by forces of unknown rows */
} workspace;

struct aom_stepper {
    aom_system system;
    aom_options options;
    double halved[LEVELS + 1]; /* 2^-level */
    bool loaded, shifted;
    bool rated; /* a law depends on the rate of what has no mass */
    bool rising; /* the loads, at present */
    bool law_failed;
    /* Rows that push the same place of other rows' bodies, such as contacts of one site, are a group:
     * between two rows the coupling is that of their groups. A pair is a row by itself (m of them),
     * or two groups (G G). A group of one row has its own coupling. */
    row_span *spans;     /* [m] */
    bool *softens;       /* [m] what has no mass couples the row with others */
    int n_groups, n_touching, n_closed;
    int *group;          /* [m] */
    int *owner;          /* [m] the contact of a row */
    int *first, *second; /* [G] two rows of a group, the same of a group of one */
    int exit_contact; /* the contact that leaves its branch at the end of the step, or -1 */
    bound exit_bound;
    slot slots[SLOTS];
    workspace work;
    run_state now;
    double *x; /* [2][J]: q, v, and one number beyond, 0 */
    row_state *rows;
    contact_state *contacts;
    /* bounds of a flight, found at its begin: */
    double *swing;  /* [p][J][2]: how a contact sees the amplitudes of the parts of a mode */
    double *bend;   /* [J][2]: second derivatives over them */
    double *sag;    /* [p]: the largest second derivative by rigid modes */
    double *missed; /* [LEVELS + 1][p]: what a chord can miss; last row: second derivatives */
    bool *known;    /* [LEVELS]: of missed */
};

/* ---- responses.c */
static void ready_step(aom_stepper *st, int slot, double h);
static void find_touching(aom_stepper *st);
static void ready_local(aom_stepper *st, int slot, double h);
static int count_groups(const aom_system *system);
static void find_groups(aom_stepper *st);
static void find_spans(aom_stepper *st);
static void forget_rows(aom_stepper *st, slot *s);

/* ---- coupled.c */
static void couple(const aom_stepper *st, const double *response, const row_span *span,
                   modal_vector a, modal_vector b, double total[4]);
static void apply_force(const aom_stepper *st, const double *response, const row_span *span,
                        modal_vector a, const double f[3], double *q, double *v);
/* The forces of the attempt as value, slope and curvature at its start. */
static void parabolas(aom_stepper *st, double h);
/* The modes after both stages of a step under the loads alone, or now (index < 0), into work.ahead. */
static void modes_ahead(aom_stepper *st, int index);
/* The same at a stage under the contact forces of the attempt too, by its parabolas. */
static void force_ahead(aom_stepper *st, int index, int stage);
/* Indentations and rates of a row at both stages of a step h by these modes. */
static void seen_ahead(const aom_stepper *st, int i, double h, stages *out);
static void add_contact_work(aom_stepper *st, double h);

/* ---- laws.c */
#define SLOWEST 0.01 /* share of the fastest approach that a damped law's speed is held above */
static inline bool remembers(int kind) { return kind >= AOM_THORNTON && kind <= AOM_TABLE; }
/* Whether reloading goes back along the unloading curve. */
static inline bool retraces(int kind) { return kind != AOM_YANG_SUN; }
static tangent law_tangent(aom_stepper *st, const aom_law *law, int branch, double delta, double rate,
                    const double *memory);
static double origin(const aom_law *law, const double *memory);
static branch_bounds law_bounds(const aom_law *law, int branch, const double *memory);
static int next_branch(aom_stepper *st, const aom_law *law, int branch, bound exit, double delta,
                double rate, double *memory);
static int law_state_size(const aom_law *law);
static int resumed_branch(const aom_law *law, const aom_contact *contact, double delta, double rate,
                   double *memory);
static void law_expected(aom_stepper *st, const aom_law *law, double mass, double speed,
                  const double *memory, double *depth, double *force);
static void user_advance(aom_stepper *st, const aom_user_law *user, double delta, double rate,
                  double *memory);

#ifndef AOM_RUN_ONLY
/* ---- expected.c */
/* Give the only contact of a system the scales that are expected of it. */
static aom_expected scale_contact(const aom_system *s, aom_contact *only, double duration);
#endif

/* ---- forces.c */
static bool eliminate(double *A, double *b, int n);
static bool one_force(aom_stepper *st, double h, const influence *local, int c);
static bool long_force(aom_stepper *st, double h, const influence *local);
static void move_rows(aom_stepper *st, int slot);
static void move_open(aom_stepper *st, int slot, double h, int only);
static bool all_forces(aom_stepper *st, int slot);

static bool clear_of_touches(aom_stepper *st, int slot);
static void amplitudes(aom_stepper *st);

/* ---- stretch.c */
/* The first row of stretching. */
static int first_stretch(const aom_system *s);
/* Forces and slopes at the coordinates of the workspace; returns the energy. */
static double stretch_forces(aom_stepper *st);
/* The energy of stretching in the present state; its forces into the workspace. */
static double stretch_energy(aom_stepper *st);
/* The scale of the forces grows by what the present state needs. */
static void scale_stretch(aom_stepper *st);
/* Forces at the start of a run. */
static void start_stretch(aom_stepper *st);
/* clear_of_touches where forces of stretching act on the motion. */
static bool stretched_clear(aom_stepper *st, int slot);
/* all_forces with those of stretching, by Newton's method for all of them together. */
static bool stretched_forces(aom_stepper *st, int slot);

/* ---- steps.c */
static int try_step(aom_stepper *st);

/* ---- crossings.c */
static double crossing(double y0, double d0, double y1, double d1, double h, double edge);
static double polished(double at, const double y[3], const double d[3], double h, double edge);
static double rises(double y0, double d0, double y1, double d1, double h, double near);

/* ---- flight.c */
static double origin_of(const aom_stepper *st, int c);
static double acting_now(aom_stepper *st);
static void free_step(aom_stepper *st, int slot, double h, stages *out);
static int touching_now(const aom_stepper *st);

/* ---- memory.c */
static int check_input(const aom_system *s, const aom_options *o);

/* ---- start.c */
static int start_run(aom_stepper *st, const aom_system *system, const aom_options *options,
                     const double *highest);
static void set_scale(aom_stepper *st, int c, double force);
static double expect_contact(aom_stepper *st, int c, double speed);
static double body_energy(aom_stepper *st);

/* ---- stepper.c */
static void write_state(const aom_stepper *st, aom_record *out);

/* ---- runs.c */
#define LIGHT 1e-3 /* of the heaviest contact's: the least force, and impulse, that errors are over */
static aom_difference compare_runs(int m, int width, const int *owner, const aom_record *a,
                                   const aom_record *b, double tol, row_pair *pairs);
static double mechanical_energy(int n, const double *x, const double *omega);

/* Answers of try_step other than the slot of the step. */
enum { AT_ONCE = -1, NO_STEP = -2 };

static inline double larger(double a, double b) { return a > b ? a : b; }
static inline double smaller(double a, double b) { return a < b ? a : b; }
static inline double within(double x, double low, double high) {
    return smaller(larger(x, low), high);
}
static inline bool nothing_touches(const aom_stepper *st) {
    for (int c = 0; c < st->system.n_contacts; c++)
        if (st->contacts[c].branch != AOM_APART)
            return false;
    return true;
}
/* Whether row i is of a contact that touches, or of stretching. */
static inline bool is_closed(const aom_stepper *st, int i) {
    int c = st->owner[i];
    return c == st->system.n_contacts || st->contacts[c].branch != AOM_APART;
}
static inline bool pressing(int branch) { return branch == AOM_FORWARD || branch == AOM_BACK; }
/* Whether row i is the normal one of a contact that presses. */
static inline bool presses(const aom_stepper *st, int i) {
    return i < st->system.n_contacts && pressing(st->contacts[i].branch);
}
/* Whether a row has forces: of a contact that presses, or of stretching. */
static inline bool acts(const aom_stepper *st, int i) {
    int c = st->owner[i];
    return c == st->system.n_contacts || pressing(st->contacts[c].branch);
}
static inline const double *beta_row(const aom_stepper *st, int i) {
    return st->system.beta + (ptrdiff_t)i * st->system.n_modes;
}
static inline const double *gamma_row(const aom_stepper *st, int i) {
    return st->system.gamma + (ptrdiff_t)i * st->system.n_modes;
}
static inline double gamma_at(const aom_stepper *st, int i, int j) {
    return st->system.gamma == NULL ? 0.0 : gamma_row(st, i)[j];
}
static inline modal_vector row_vector(const aom_stepper *st, int i) {
    return (modal_vector){beta_row(st, i), st->system.gamma == NULL ? NULL : gamma_row(st, i)};
}
/* Of loads or their slopes, one behind the other for displacements and for rates. */
static inline modal_vector load_vector(const aom_stepper *st, const double *load) {
    return (modal_vector){load, st->system.gamma == NULL ? NULL : load + st->system.n_modes};
}
/* Whether row i moves mode j. */
static inline bool moves_mode(const aom_system *s, int i, int j) {
    ptrdiff_t at = (ptrdiff_t)i * s->n_modes + j;
    return s->beta[at] != 0.0 || (s->gamma != NULL && s->gamma[at] != 0.0);
}
/* Numbers of a row of loads. */
static inline int load_width(const aom_system *s) {
    return s->gamma == NULL ? s->n_modes : 2 * s->n_modes;
}
/* The force [N] that errors of a contact's rows are weighed by, or those of stretching. */
static inline double scale_of(const aom_stepper *st, int c) {
    double own = c < st->system.n_contacts ? st->contacts[c].force_scale : st->now.stretch_scale;
    return larger(own, LIGHT * st->now.force_scale);
}
/* Whether a group has one row: its coupling with itself is then that of the group. */
static inline bool alone(const aom_stepper *st, int g) { return st->first[g] == st->second[g]; }
/* The pair of two groups that touch. */
static inline ptrdiff_t pair_of(const aom_stepper *st, int g, int h) {
    const int *place = st->work.place;
    return st->system.n_rows + (ptrdiff_t)place[g] * st->n_touching + place[h];
}
/* How the force of row i holds back the row itself. */
static inline const influence *own_influence(const aom_stepper *st, const influence *local, int i) {
    int g = st->group[i];
    return local + (alone(st, g) ? pair_of(st, g, g) : i);
}
/* Whether the step takes the slopes with which the last one ended (ready_local). */
static inline bool with_slope(const aom_stepper *st) { return st->rated && st->now.smooth; }
/* Length of a step of a level. */
static inline double level_step(const aom_stepper *st, int level) {
    return st->now.longest * st->halved[level];
}

#endif
