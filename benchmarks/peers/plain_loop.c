/* A loop as one writes it for one impact: exact modes, equal steps, a force that is linear in a step.
 *
 * x' = f on the ball (mode without frequency) and on the modes; Hertz' law with the indentation
 * beta q - residual f. The coefficients of a step are found once. Forces at the ends of the steps. */
#include <math.h>

void plain_loop(int modes, const double *omega, const double *beta, double residual, double stiffness,
               const double *velocity, double duration, int steps, double *force) {
    double h = duration / steps, f = 0.0, own = residual;
    double q[modes], v[modes], P[modes], S[modes], D[modes], A[modes], B[modes], C[modes];
    for (int j = 0; j < modes; j++) {
        double w = omega[j], z = w * h, w2 = w * w;
        q[j] = 0.0;
        v[j] = velocity[j];
        P[j] = cos(z);
        S[j] = w > 0.0 ? sin(z) / w : h;
        D[j] = w2 * S[j];
        double held = w > 0.0 ? (1.0 - P[j]) / w2 : h * h / 2.0;
        B[j] = beta[j] * (w > 0.0 ? (h - S[j]) / w2 / h : h * h / 6.0);
        A[j] = beta[j] * held - B[j];
        C[j] = beta[j] * held / h;
        own += beta[j] * B[j];
    }
    for (int n = 1; n <= steps; n++) {
        double free = 0.0, next = f;
        for (int j = 0; j < modes; j++) {
            double old = q[j];
            q[j] = P[j] * old + S[j] * v[j] - A[j] * f;
            v[j] = P[j] * v[j] - D[j] * old - (beta[j] * S[j] - C[j]) * f;
            free += beta[j] * q[j];
        }
        for (int tries = 0; tries < 30; tries++) {
            double depth = free - own * next, root = depth > 0.0 ? sqrt(depth) : 0.0;
            double change = (next - stiffness * depth * root) / (1.0 + 1.5 * stiffness * root * own);
            if (depth <= 0.0)
                change = next;
            next -= change;
            if (fabs(change) <= 1e-10 * fabs(next))
                break;
        }
        f = force[n] = next;
        for (int j = 0; j < modes; j++) {
            q[j] -= B[j] * f;
            v[j] -= C[j] * f;
        }
    }
}
