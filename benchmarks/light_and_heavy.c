/* The classical Runge-Kutta method of order 4 for modes under contacts: the reference of
 * light_and_heavy.py, which compiles it. It shares nothing with csrc. */
#include <math.h>
#include <string.h>

enum { MODES = 64, ROWS = 16 };

typedef struct scene {
    int modes, rows, contacts;
    const double *omega, *decay, *load;   /* [modes] */
    const double *beta;                   /* [rows][modes] */
    const double *gap;                    /* [contacts] */
    const double *law;                    /* [contacts][3]: stiffness, exponent, damping factor */
    const double *slip;                   /* [contacts][2]: coefficient, tangential stiffness */
    const int *tangents;                  /* [contacts][2]: first row, their number */
    double *fastest;                      /* [contacts] speed of approach */
    double duration;
    long steps, room;
} scene;

/* What a contact remembers from step to step. */
typedef struct memory {
    int closed;
    double speed, start, impulse, peak, anchor[2], rate;
} memory;

static double along(const scene *s, int row, const double *x) {
    double total = 0.0;
    for (int j = 0; j < s->modes; j++)
        total += s->beta[row * s->modes + j] * x[j];
    return total;
}

static double normal(const scene *s, const memory *m, int c, const double *x) {
    double depth = along(s, c, x) - s->gap[c];
    const double *law = s->law + 3 * c;
    if (depth <= 0.0)
        return 0.0;
    double force = law[0] * pow(depth, law[1]);
    if (law[2] > 0.0 && m->speed > 0.0)
        force *= 1.0 + law[2] * along(s, c, x + s->modes) / m->speed;
    return force > 0.0 ? force : 0.0;
}

/* Forces of all rows; with `go_on` the slider's ends go on. */
static void forces(const scene *s, memory *m, const double *x, int go_on, double *f) {
    for (int c = 0; c < s->contacts; c++) {
        f[c] = normal(s, m + c, c, x);
        double pull[2] = {0.0, 0.0}, most = s->slip[2 * c] * f[c], stiff = s->slip[2 * c + 1];
        int first = s->tangents[2 * c], count = s->tangents[2 * c + 1];
        for (int r = 0; r < count; r++)
            pull[r] = stiff * (along(s, first + r, x) - m[c].anchor[r]);
        double size = hypot(pull[0], pull[1]), cut = size > most ? most / size : 1.0;
        for (int r = 0; r < count; r++) {
            f[first + r] = cut * pull[r];
            if (go_on)
                m[c].anchor[r] = along(s, first + r, x) - cut * pull[r] / stiff;
        }
    }
}

static void slope(const scene *s, memory *m, const double *x, double *out) {
    double f[ROWS];
    const double *v = x + s->modes;
    forces(s, m, x, 0, f);
    for (int j = 0; j < s->modes; j++) {
        double pull = s->load[j] - s->omega[j] * s->omega[j] * x[j] - 2.0 * s->decay[j] * v[j];
        for (int i = 0; i < s->rows; i++)
            pull -= s->beta[i * s->modes + j] * f[i];
        out[j] = v[j];
        out[s->modes + j] = pull;
    }
}

static void step(const scene *s, memory *m, double *x, double h) {
    double k[4][2 * MODES], y[2 * MODES];
    const double at[4] = {0.0, 0.5, 0.5, 1.0};
    for (int stage = 0; stage < 4; stage++) {
        for (int j = 0; j < 2 * s->modes; j++)
            y[j] = x[j] + (stage > 0 ? at[stage] * h * k[stage - 1][j] : 0.0);
        slope(s, m, y, k[stage]);
    }
    for (int j = 0; j < 2 * s->modes; j++)
        x[j] += h / 6.0 * (k[0][j] + 2.0 * (k[1][j] + k[2][j]) + k[3][j]);
}

/* Touches of a contact into out [room][5]: contact, start, end, impulse, peak; their number. */
long integrate(const scene *s, double *x, double *out) {
    memory m[ROWS];
    double f[ROWS], before[ROWS] = {0.0}, h = s->duration / (double)s->steps;
    long found = 0;
    memset(m, 0, sizeof m);
    for (long n = 0; n <= s->steps; n++) {
        for (int c = 0; c < s->contacts; c++) {
            double depth = along(s, c, x) - s->gap[c], rate = along(s, c, x + s->modes);
            double since = rate != 0.0 ? fabs(depth / rate) : 0.0;
            int closed = depth > 0.0 || (n == 0 && depth == 0.0 && rate > 0.0);
            if (closed && !m[c].closed) {
                double speed = n > 0 ? rate + since / h * (m[c].rate - rate) : rate;
                s->fastest[c] = fmax(s->fastest[c], speed);
                m[c] = (memory){.closed = 1, .start = (double)n * h - since};
                m[c].speed = fmax(speed, 0.01 * s->fastest[c]);
                for (int r = 0; r < s->tangents[2 * c + 1]; r++) {
                    int row = s->tangents[2 * c] + r;
                    m[c].anchor[r] = along(s, row, x) - since * along(s, row, x + s->modes);
                }
                before[c] = 0.0;
            } else if (m[c].closed && (!closed || n == s->steps)) {
                if (found == s->room)
                    return -1;
                const double touch[5] = {c, m[c].start, (double)n * h, m[c].impulse, m[c].peak};
                memcpy(out + 5 * found++, touch, sizeof touch);
                m[c].closed = 0;
            }
            m[c].rate = rate;
        }
        forces(s, m, x, 1, f);
        for (int c = 0; c < s->contacts; c++) {
            m[c].peak = fmax(m[c].peak, f[c]);
            m[c].impulse += 0.5 * h * (f[c] + before[c]);
            before[c] = f[c];
        }
        step(s, m, x, h);
    }
    return found;
}
