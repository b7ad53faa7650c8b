/* antiosc_march.h - linear bodies under contact forces: the public header is the manual.
 *
 * All bodies stand side by side as modes with unit modal mass. With the modal displacements q,
 * rows beta (one a contact, then one or two more for its friction) and forces F of the rows,
 *
 *     q'' + 2 d q' + omega^2 q = load(t) - beta^T F,       delta = beta q - offset(t) - R F,
 *
 * and, where damping couples the modes (gamma, else NULL), for complex pairs and pairs of real poles
 *
 *     q' = v + drive(t) - gamma^T F,       delta = beta q + gamma v - offset(t) - R F,
 *     v' = -omega^2 q - 2 d v + load(t) - 2 d drive(t) - (beta - 2 d gamma)^T F.
 *
 * The last n_stretch rows are no contacts: without gaps and residual compliance, their forces are
 *
 *     F_k = sum quadratic_kij delta_i delta_j + sum cubic_kijl delta_i delta_j delta_l
 *
 * of the energy sum quadratic delta^3/3 + sum cubic delta^4/4: sheets that stretch as they bend.
 *
 * delta > 0 is the indentation of a contact, F >= 0 its force by a contact law F(delta, delta').
 * Over a step the force of each row is the parabola through its values at 0, h/2 and h, and the
 * motion under it is exact. The law is met at h/2 and h (collocation at Lobatto's nodes: order 4 for
 * a smooth force, 3 between the nodes). The error of the parabola is estimated from its third
 * divided difference and decides on the step, a power of two, so that the responses of a step are
 * found once. A law is smooth in branches; a step that leaves the branch of a contact ends where it
 * does. While nothing touches the motion is free, and no touch is stepped over: what a chord can
 * miss is bounded by the amplitudes of the modes.
 *
 * A run:
 *
 *     aom_system system = { ... };                       the bodies and their contacts
 *     aom_options options = aom_default_options(4e-3);   the duration, the error
 *     void *memory = malloc(aom_memory_size(&system));   or an array of your own
 *     aom_stepper *stepper;
 *     aom_create(&system, memory, size, &stepper);
 *     aom_start(stepper, &system, &options);
 *     do {
 *         aom_clear(&record);
 *         status = aom_integrate(stepper, &record, INFINITY, 100000);
 *         ... read the record ...
 *     } while (status == AOM_FULL || status == AOM_PAUSED);
 *
 * The library has no state of its own, allocates nothing and reads and writes no file: two threads
 * may run two steppers at once. Units are SI throughout. Arrays are row-major. It is C99:
 * compile antiosc_march.c, which includes the other files. What AOM_RUN_ONLY leaves out, a run alone
 * does not need.
 */
#ifndef ANTIOSC_MARCH_H
#define ANTIOSC_MARCH_H

#include <stddef.h>
#include <stdint.h>

#define AOM_VERSION 13 /* of this interface; aom_version() is that of the library */

#ifndef AOM_API
#if defined(_WIN32)
#define AOM_API __declspec(dllexport)
#elif defined(__GNUC__)
#define AOM_API __attribute__((visibility("default")))
#else
#define AOM_API
#endif
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ---- Statuses -------------------------------------------------------------------------------- */

typedef enum aom_status {
    AOM_DONE = 0,          /* the end is reached */
    AOM_FULL,              /* the record is full: empty it and go on */
    AOM_TOO_MANY_CONTACTS, /* more touches than options.max_contacts */
    AOM_TOO_MANY_STEPS,    /* more attempted steps than options.max_steps */
    AOM_GREW,              /* the bodies gained energy: unstable, use a smaller rel_tol or step */
    AOM_STUCK,             /* no step is small enough for the contact forces */
    AOM_PAUSED,            /* the time `until` or the number of attempts asked for is reached: go on */
    AOM_LAW_FAILED,        /* a user's law returned a value other than 0 */
    /* refused before anything is done: */
    AOM_BAD_SIZE,    /* a number of modes, rows, contacts or breaks out of range */
    AOM_BAD_MODES,   /* omega, decay, beta, residual, q or v: not finite, or negative where >= 0 */
    AOM_BAD_LOADS,   /* breaks do not increase from <= 0, or loads or offsets are not finite */
    AOM_BAD_LAW,     /* unknown kind, wrong number of parameters, or one out of its range */
    AOM_BAD_CONTACT, /* friction, tangential rows, or scales of a contact out of range */
    AOM_BAD_OPTIONS, /* an option out of range */
    AOM_SMALL_MEMORY /* less memory than aom_memory_size */
} aom_status;

/* The name of a status, as "AOM_DONE". */
AOM_API const char *aom_status_name(int status);
/* AOM_VERSION of the compiled library. */
AOM_API int aom_version(void);
/* What the build gave as AOM_SOURCE_HASH (a hash of the sources), else "". */
AOM_API const char *aom_source_hash(void);

/* ---- Contact laws ---------------------------------------------------------------------------- */

/* Kinds of laws and their parameters. k [N/m^n] is a stiffness. All but Hertz's law, which has its
 * own, and AOM_USER may have one number more: the compliance c >= 0 of a patch [m/N], which the
 * structure has already, so that F = f(delta + c F). */
typedef enum aom_law_kind {
    AOM_LINEAR = 0, /* F = k delta.                                    k */
    AOM_POWER,      /* F = k delta^n.                                  k, n >= 1 */
    AOM_HERTZ,      /* delta = (F/k)^(2/3) - c F (c = 0: F = k delta^1.5), a straight line beyond
                       F = end^3.   k, c, a = k^(-2/3), end, slope d(delta)/dF beyond */
    AOM_DAMPED,     /* F = k delta^n (1 + d delta'/v0) >= 0, v0 the speed of approach (of which at
                       least 1 % of the fastest so far).               k, n, d >= 0 */
    AOM_THORNTON,   /* elastic, perfectly plastic sphere.              k, yield indentation */
    AOM_YANG_SUN,   /* laminates.                                      k, critical indentation */
    AOM_ELASTIC_PLASTIC, /* sphere and half-space, one of which yields. k, yield indentation,
                       the share of the flexibility of the other one to 1.5, k^(-2/3) */
    AOM_TABLE,      /* measured curves, monotone cubics.  elastic (0 or 1), permanent indentation
                       over the deepest, number of knots of loading and of unloading, index of the
                       first unloading parameter, loading, unloading; a curve of n knots is n each
                       of x, a, b, c, e (value ((a d + b) d + c) d + e at d beyond a knot), then
                       value and slope at its end: 5 n + 2 numbers */
    AOM_USER        /* functions of the caller's.                      none */
} aom_law_kind;

/* Branches of a law. */
typedef enum aom_branch {
    AOM_APART = 0, /* the bodies do not touch */
    AOM_FORWARD,   /* loading or reloading */
    AOM_CUT,       /* touching; the rate would make the force negative, it is 0 */
    AOM_BACK       /* unloading of a law with memory */
} aom_branch;

#define AOM_MEMORY 8 /* numbers that a contact may remember */

/* A law of the caller's. Each function returns 0, or another value to stop the run with
 * AOM_LAW_FAILED. `state` are the numbers that the law remembers of a contact, n_state of them. */
typedef struct aom_user_law {
    void *context; /* passed on to the functions */
    int n_state;   /* 0 to AOM_MEMORY - 2 */
    int rated;     /* whether the force depends on the rate */
    /* force, d force/d delta, d force/d rate into out */
    int (*force)(void *context, double delta, double rate, const double *state, double out[3]);
    /* a contact begins at the closing speed; `first`: for the first time, state is to be made.
     * Bring state up to date, and the indentation at which the bodies part and touch. */
    int (*touch)(void *context, double speed, int first, double *state, double *origin);
    /* a step ended: bring state and origin up to date */
    int (*advance)(void *context, double delta, double rate, double *state, double *origin);
    /* work of loading a new contact that closes at a speed up to delta; of aom_law_deepest alone */
    int (*work)(void *context, double speed, double delta, double *work);
} aom_user_law;

typedef struct aom_law {
    int kind;                 /* aom_law_kind */
    int n_params;             /* numbers in params */
    const double *params;     /* [n_params] */
    const aom_user_law *user; /* of AOM_USER, else NULL */
} aom_law;

/* The state of a law as a caller keeps it, n <= 3 numbers: damped (d/v0, fastest approach), with
 * memory (deepest indentation, turning point from which unloading starts, energy lost); AOM_USER has
 * its own. For all laws but AOM_USER, aom_law_check passed: */

/* AOM_DONE, or AOM_BAD_LAW where parameters break the rules above. */
AOM_API int aom_law_check(const aom_law *law);
/* Force and its derivatives by indentation and rate, into out. */
AOM_API void aom_law_force(const aom_law *law, double delta, double rate, const double *state,
                           double out[3]);
/* Forces at n indentations at rest, into out [n]. */
AOM_API void aom_law_forces(const aom_law *law, int64_t n, const double *delta,
                            const double *state, double *out);
/* Energies [J] that the contact can still give back at n indentations, into out [n]. */
AOM_API void aom_law_energies(const aom_law *law, int64_t n, const double *delta,
                              const double *state, double *out);
/* Work [J] of loading a new contact up to delta. */
AOM_API double aom_law_loading_work(const aom_law *law, double delta);
/* A contact begins (`first`: new bodies) at a closing speed; state is brought up to date. */
AOM_API void aom_law_touch(const aom_law *law, double speed, int first, double *state);
/* A step ended at an indentation; state is brought up to date. */
AOM_API void aom_law_advance(const aom_law *law, double delta, double *state);
/* Indentation at which bodies part and touch again: 0, or the permanent one. */
AOM_API double aom_law_origin(const aom_law *law, const double *state);
/* Force [N] up to which the compliance of a patch stays below 0.7 of the law's own flexibility;
 * beyond, 0.7 of that is taken. */
AOM_API double aom_law_reach(const aom_law *law);

/* ---- The system ------------------------------------------------------------------------------ */

typedef struct aom_contact {
    aom_law law;
    double friction;             /* coefficient of Coulomb's friction, >= 0 */
    double tangential_stiffness; /* of the spring that slides [N/m], > 0 where there are rows */
    int first_tangential;        /* first row of its friction, >= n_contacts */
    int n_tangential;            /* their number: 0, 1 or 2 */
    double mass;                 /* inertia behind the contact [kg], roughly, > 0 */
    double expected_depth;       /* largest indentation [m], roughly, > 0 */
    double expected_speed;       /* closing speed [m/s], roughly, > 0 */
    double slowest;              /* what begins more slowly [m/s] counts as beginning so, >= 0 */
    double preload;              /* force at the start [N]; > 0: it is closed */
    const double *state;         /* of the law after touches before the start, or NULL; of AOM_USER
                                    n_state numbers, and the indentation at which the bodies part */
    int closed;                  /* of a contact with a state: whether it is closed at the start,
                                    also by a force of 0 */
} aom_contact;

typedef struct aom_system {
    int n_modes, n_rows, n_contacts; /* row c < n_contacts is contact c */
    int n_breaks;                    /* >= 1 */
    const double *omega;             /* [n_modes] natural frequencies [rad/s], >= 0 */
    const double *decay;             /* [n_modes] d = zeta omega [1/s], >= 0 */
    const double *beta;              /* [n_rows][n_modes], unit modal masses */
    const double *residual;          /* [n_rows][n_rows] compliance R of what has no mass [m/N] */
    const double *breaks;            /* [n_breaks] increasing times [s], the first 0 */
    const double *loads;             /* [n_breaks][n_modes] linear in between, then constant */
    const double *offsets;           /* [n_breaks][n_rows] likewise: gaps that may move [m] */
    const aom_contact *contacts;     /* [n_contacts] */
    const double *q, *v;             /* [n_modes] state at the start */
    double stored;                   /* energy that the contacts hold at the start [J] */
    const double *gamma;             /* [n_rows][n_modes] or NULL; with it each row of loads has
                                        2 n_modes numbers, load and drive. Without aom_state_at,
                                        and energies of aom_energies. */
    int n_stretch;                   /* of the last rows, whose forces are polynomials; 0 with gamma */
    const double *quadratic, *cubic; /* [m][m][m], [m][m][m][m] of these, symmetric in all indices */
} aom_system;

typedef struct aom_options {
    double duration;      /* [s], > 0 */
    double rel_tol;       /* error of a step's forces, over the force scale of its contact */
    double force_scale;   /* [N] of all contacts; 0: the largest force of each, found as the run goes,
                             of which a contact has at least 1e-3 of the heaviest's */
    double step;          /* [s] under contact, halved where need be; 0: chosen from rel_tol */
    double resolution;    /* [s]: touches closer than this may count as one */
    int64_t max_contacts; /* touches */
    int64_t max_steps;    /* attempted steps */
    int64_t max_runs;     /* of aom_solve; 0: 12 */
} aom_options;

/* rel_tol 1e-3, no scale and step, resolution duration/1e4, 10 000 touches, 1 000 000 steps. */
AOM_API aom_options aom_default_options(double duration);

/* What a run writes down, into arrays of the caller's. An empty record begins with the present node;
 * each step adds two, its middle and its end: step k has the nodes 2 k, 2 k + 1, 2 k + 2. */
typedef struct aom_event {
    double time;    /* [s] */
    double contact; /* its number; doubles, so that events are one array of doubles */
    double branch;  /* AOM_APART: released, else touched */
    double speed;   /* closing speed [m/s] */
} aom_event;

typedef struct aom_record {
    int64_t max_nodes, max_states, max_events; /* room; >= 3, 1 (0 without states), n_contacts+2 */
    int64_t n_nodes, n_states, n_events;       /* written so far */
    int64_t every;                             /* states of the steps 0, every, 2 every ... */
    double *time;                              /* [max_nodes] */
    double *force;                             /* [max_nodes][n_rows] */
    double *depth;                             /* [max_nodes][n_rows] indentations, tangential ways */
    double *states;    /* [max_states][2][n_modes] q, v at the start of steps; may be NULL */
    aom_event *events; /* [max_events] */
} aom_record;

/* ---- The stepper ----------------------------------------------------------------------------- */

typedef struct aom_stepper aom_stepper; /* opaque, in the caller's memory */

/* Bytes that a stepper of this system needs; 0 if its sizes are out of range. */
AOM_API size_t aom_memory_size(const aom_system *system);

/* Make a stepper in memory aligned as doubles are. It keeps pointers into the memory alone. */
AOM_API int aom_create(const aom_system *system, void *memory, size_t bytes, aom_stepper **made);

/* Begin a run at time 0. The system must have the sizes, omega, decay, beta and residual of that
 * of aom_create: the responses that earlier runs found are used again. Its arrays must last, and not
 * change, as long as the run. */
AOM_API int aom_start(aom_stepper *stepper, const aom_system *system, const aom_options *options);

/* Go on to the end, a full record, the first step that ends at or after `until` [s] (no step is
 * shortened for it), or so many attempted steps. Adds to the record; returns a status. After
 * AOM_FULL and AOM_PAUSED call it again with a record that has room. */
AOM_API int aom_integrate(aom_stepper *stepper, aom_record *record, double until,
                          int64_t max_attempts);

/* Empty a record; states of every step. */
AOM_API void aom_clear(aom_record *record);

typedef struct aom_summary {
    double time;        /* reached [s] */
    double force_scale; /* [N] */
    double highest;     /* energy there was or was given, at most [J] */
    double gained;      /* energy beyond what was given, at most [J] */
    double work;        /* of the loads so far [J] */
    int64_t steps, attempts, touches;
    int64_t refused; /* attempts that were refused for their error */
} aom_summary;

AOM_API aom_summary aom_summarize(const aom_stepper *stepper);

#ifndef AOM_RUN_ONLY
typedef struct aom_solution {
    int best;             /* the record that holds the finest run that counts */
    int answer;           /* the status of this run */
    double force, peak;   /* estimated relative errors of its forces (L2 norm, impulse) and of their
                             peak, the largest of a contact (aom_compare); infinite where no finer run
                             reached the end */
    double certain;       /* until when two runs agree [s] */
    double share;         /* rel_tol of the next run */
    aom_summary summary;  /* of the best run */
    int present;          /* the record of the run that goes on */
    int before, runs, worse, failed, scaled; /* the rest is aom_solve's */
    int64_t used;
    double finer;
    aom_summary earlier;
} aom_solution;

/* Repeat the run from aom_start on with smaller steps until the forces of two agree to
 * options.rel_tol; all in one call but for AOM_FULL (the record `present` is full: make it larger,
 * or keep fewer of its states, and go on) and AOM_PAUSED (so many attempts are made: go on). The
 * solution is all 0 at first. The state of the end stands behind the others: records have room for
 * one more than max_states. With max_runs = 1 it is one run to rel_tol, whose errors are not known. */
AOM_API int aom_solve(aom_stepper *stepper, const aom_system *system, const aom_options *options,
                      aom_solution *solution, aom_record records[3], int64_t max_attempts);
#endif

/* ---- Reading runs ---------------------------------------------------------------------------- */

/* Responses of n modes after times t (stride 1, or 0: one time for all), into out [6][n]: P, W, S,
 * J0, J1, J2. Free motion is q = P q0 + S v0, v = W v0 - omega^2 S q0; J0, J1, J2 are the
 * displacements that the modal forces 1, t, t^2/2 cause, S, J0, J1 the velocities. */
AOM_API void aom_responses(int64_t n, const double *omega, const double *decay, const double *t,
                           int t_stride, double *out);

/* State at a time t after the start of step k of a record with states, exact for the parabolas of
 * the forces: q and v [n_modes] into state, and, unless NULL, forces and indentations [n_rows]. */
AOM_API void aom_state_at(const aom_system *system, const aom_record *record, int64_t k, double t,
                          double *state, double *force, double *depth);

/* Kinetic and strain energy [J] of n states [n][2][n_modes], into out [n]. */
AOM_API void aom_energies(int64_t n, int n_modes, const double *states, const double *omega,
                          double *out);

typedef struct aom_difference {
    double force, peak; /* relative differences, in the L2 norm or of the impulse, and of the peak */
    double until;       /* the time up to which the L2 norm is below the tolerance [s] */
} aom_difference;

/* Compare the forces of two runs up to the end of the shorter one, at the nodes of both: the largest
 * difference of a row, over its own forces, or over 1e-3 of those of the row with the largest; aom_solve
 * takes rows of friction over their contact's. `memory` is AOM_COMPARED numbers a row to work in. */
#define AOM_COMPARED 9
AOM_API aom_difference aom_compare(int n_rows, int64_t n_a, const double *time_a,
                                   const double *force_a, int64_t n_b, const double *time_b,
                                   const double *force_b, double tol, double *memory);

#ifndef AOM_RUN_ONLY
/* Of n spans of steps, first to last [n][2], the time integral of the force of a row, and its largest
 * value, into out [n][2]. */
AOM_API void aom_pulses(const double *time, const double *force, int n_rows, int row, int64_t n,
                        const int64_t *spans, double *out);

/* A time that a contact is closed. */
typedef struct aom_touch {
    double start, end, speed; /* [s], closing speed [m/s] */
    double impulse, peak;     /* [N s], [N]; by aom_read_contact */
    int64_t first, last;      /* the steps that begin there */
} aom_touch;

/* The times that a contact is closed, into out, which has room for one more than the events; their
 * number. `closed`: it is so from the start. `open`: it is so at the end. What is over at once does
 * not count. */
AOM_API int64_t aom_touches(const aom_record *record, int contact, int closed, aom_touch *out,
                            int *open);

typedef struct aom_numbers {
    double peak, impulse; /* [N], [N s] */
    double contact_time;  /* of the main impact [s]: aom_main_impact */
    double restitution;   /* parting over closing speed by the rigid modes; NaN: open, or none */
    double closed;        /* in all [s] */
    int64_t steps;        /* of all touches */
} aom_numbers;

/* The numbers of a contact from its touches, of which impulse and peak are found. The modal velocities
 * [n_modes] of step k stand at v + k stride; with stride 0 those at the start and the end of each
 * touch at v, one after the other. Where a rigid mode knows the impulse, it is that. */
AOM_API aom_numbers aom_read_contact(const aom_system *system, const aom_record *record,
                                     int contact, int open, int64_t n, aom_touch *touches,
                                     const double *v, ptrdiff_t stride);

/* Time [s] from the first touch to the last release of the main impact, that with the largest
 * impulse; touches belong to one impact if the flight between them is shorter than it was until then. */
AOM_API double aom_main_impact(int64_t n, const aom_touch *touches);
/* ---- Models ---------------------------------------------------------------------------------- */

/* Free modes of k0, m0 and n > 0 anti-oscillators of masses m > 0 with distinct ascending squared
 * frequencies p > 0: squared frequencies into x [J], J = n + 1, n if m0 = 0, shapes of unit modal mass
 * into shape [n + 1][J], row 0 the site. All to full relative precision whatever the masses: each zero
 * of the driving-point stiffness is sought as a shift from its nearest pole. Returns how many have not
 * converged. */
AOM_API int aom_arrow_modes(double k0, double m0, int n, const double *m, const double *p,
                            double *x, double *shape);

/* ---- Batches --------------------------------------------------------------------------------- */

typedef struct aom_expected {
    double depth, speed, time; /* largest indentation, closing speed, time of the contact, roughly */
} aom_expected;

/* What is expected of a contact in a run so long, by its law and mass, beta, and the motion, the loads
 * and the offset at the start alone; NaN where its law is none, or one of the caller's fails. */
AOM_API aom_expected aom_expect(const aom_system *system, int contact, double duration);

/* Indentation, at most `high`, that absorbs an energy and the work of a `force`, of a new contact
 * that closes at a speed; `close` is its relative error. aom_law_check passed the law. */
AOM_API double aom_law_deepest(const aom_law *law, double speed, double energy, double force,
                               double high, double close);

/* A system of one contact that is open at the start, with a gap >= 0, one row and one time of loads.
 * The batch finds the scales of the contact, and the resolution. */
typedef struct aom_impact {
    aom_system system;
    aom_options options;
} aom_impact;

typedef struct aom_outcome {
    int64_t status; /* of the best run; AOM_FULL: it is too long for a batch */
    int64_t contacts, touches, open, n_nodes;
    aom_numbers numbers;
    double force_error, peak_error, certain; /* as of aom_solution */
    double time, lasting;                    /* reached; expected of the contact [s] */
    double gained, highest;                  /* as of aom_summary */
} aom_outcome;

/* Nodes and forces of the touches, one impact behind the other; a pulse is parabolas as in a record. */
typedef struct aom_pulse_nodes {
    int64_t max_nodes, n_nodes;
    double *time, *force;
} aom_pulse_nodes;

typedef struct aom_batch aom_batch; /* opaque, in the caller's memory */

/* Bytes of a batch of impacts with so many modes, 0 if out of range; nodes that one may write. */
AOM_API size_t aom_batch_size(int n_modes);
AOM_API int64_t aom_batch_nodes(int n_modes);
AOM_API int aom_batch_create(int n_modes, void *memory, size_t bytes, aom_batch **made);

/* Solve the impacts from *done on as aom_solve does, which counts on. AOM_FULL: there is no room for
 * the nodes of the next one, empty them; AOM_PAUSED: so many attempts are made; then call it again
 * with the same impacts. */
AOM_API int aom_batch_solve(aom_batch *batch, int64_t n, const aom_impact *impacts,
                            aom_outcome *outcomes, aom_pulse_nodes *pulses, int64_t max_attempts,
                            int64_t *done);

/* ---- Bounds of what a model leaves out ------------------------------------------------------- */

/* A run with m contacts, and the residual of the model in the whole body.
 * Laws: AOM_LINEAR, AOM_POWER without a patch, AOM_HERTZ. The run starts with forces of 0. */
typedef struct aom_enclosure {
    int n_modes, n_channels, n_losses, n_contacts;
    const double *omega, *decay; /* [n_modes] */
    const double *load, *v;      /* [n_modes]; constant load, rates at the start */
    const double *beta;                 /* [m][n_modes], delta = beta q - gap */
    const double *gap;                  /* [m] */
    /* [k + l][5][n_modes]: channels by q, v, the modal forces and two of their rates; k of them drive
     * the error, the squares of l feed its energy */
    const double *rows;
    const double *brake;                /* [n_modes], sum brake |v| drives the error, too */
    /* [n_modes] > 0 of modes that follow their force F: q'' = F - omega^2 q - 2 decay q' + lag F' */
    const double *lag;
    /* [n_rates] x, [m][n_rates] compliance of all bodies by b'(K + x M)^-1 b */
    int n_rates;
    const double *rates, *compliances;
    const aom_law *laws;                /* [m] */
    double longest;                     /* piece of time [s] */
    int64_t n_nodes;                    /* of a record */
    const double *time, *force;         /* [n_nodes], [n_nodes][m] */
    double *clock, *lower, *upper;      /* [n_nodes], [n_nodes][m] bounds at the nodes, 0 at first */
    double *peak, *impulse;             /* [m][2] bounds; impulse, its largest error; 0 at first */
    int64_t *reached;                   /* last node with bounds */
} aom_enclosure;

AOM_API size_t aom_enclosure_size(const aom_enclosure *enclosure);
/* AOM_DONE; AOM_STUCK where no bound exists behind *reached. */
AOM_API int aom_enclose(const aom_enclosure *enclosure, void *memory);
#endif

#ifdef __cplusplus
}
#endif

#endif
