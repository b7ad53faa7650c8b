/* Products with the cells of `elastic.c` in the precision REAL. */
typedef REAL wide __attribute__((vector_size(sizeof(REAL) * AOM_LANES), may_alias, aligned(sizeof(REAL))));

/* slopes [3][3] of u along x, y, z at a corner, from grad λ_1, λ_2, λ_3 */
INLINE void slopes(wide u[NODES][3], int v, const wide *grad, wide H[3][3]) {
    for (int a = 0; a < 3; a++) {
        wide c[CORNERS];
        for (int i = 0; i < CORNERS; i++)
            c[i] = i == v ? 3.0 * u[v][a] : 4.0 * u[BETWEEN[v][i]][a] - u[i][a];
        for (int b = 0; b < 3; b++)
            H[a][b] = (c[1] - c[0]) * grad[b] + (c[2] - c[0]) * grad[3 + b] + (c[3] - c[0]) * grad[6 + b];
    }
}

/* forces of stresses [3][3] at a corner: the transpose of `slopes` */
INLINE void forces(wide T[3][3], int v, const wide *grad, wide f[NODES][3]) {
    for (int a = 0; a < 3; a++) {
        wide c[CORNERS];
        for (int i = 1; i < CORNERS; i++)
            c[i] = T[a][0] * grad[3 * i - 3] + T[a][1] * grad[3 * i - 2] + T[a][2] * grad[3 * i - 1];
        c[0] = -(c[1] + c[2] + c[3]);
        for (int i = 0; i < CORNERS; i++) {
            if (i == v) {
                f[v][a] += 3.0 * c[v];
            } else {
                f[BETWEEN[v][i]][a] += 4.0 * c[i];
                f[i][a] -= c[i];
            }
        }
    }
}

/* f += k K u */
INLINE void stiffness(REAL k, wide u[NODES][3], const wide *data, wide f[NODES][3]) {
    wide T[CORNERS][3][3], sum[3][3], lame = k * data[9], shear = k * data[10];
    memset(sum, 0, sizeof sum);
    for (int v = 0; v < CORNERS; v++) {
        wide H[3][3];
        slopes(u, v, data, H);
        wide mean = lame * (H[0][0] + H[1][1] + H[2][2]);
        for (int a = 0; a < 3; a++) {
            for (int b = 0; b < 3; b++) {
                T[v][a][b] = shear * (H[a][b] + H[b][a]);
                if (a == b)
                    T[v][a][b] += mean;
                sum[a][b] += T[v][a][b];
            }
        }
    }
    for (int v = 0; v < CORNERS; v++) {
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++)
                T[v][a][b] += sum[a][b];
        forces(T[v], v, data, f);
    }
}

/* f += m M u. Corners meet corners by 6 or 1, edges that end there by -4,
 * others by -6; edges meet themselves by 32, the opposite one by 8, others by 16. */
INLINE void inertia(REAL m, wide u[NODES][3], const wide *data, wide f[NODES][3]) {
    wide share = m * data[11];
    for (int a = 0; a < 3; a++) {
        wide corners = u[0][a] + u[1][a] + u[2][a] + u[3][a];
        wide edges = u[4][a] + u[5][a] + u[6][a] + u[7][a] + u[8][a] + u[9][a];
        wide own[NODES];
        for (int v = 0; v < CORNERS; v++)
            own[v] = 5.0 * u[v][a] + corners - 6.0 * edges;
        for (int e = CORNERS; e < NODES; e++) /* the opposite edge of the k-th is the (5 - k)-th */
            own[e] = 16.0 * (u[e][a] + edges) - 8.0 * u[13 - e][a] - 6.0 * corners;
        for (int v = 0; v < CORNERS; v++)
            for (int w = 0; w < CORNERS; w++)
                if (v != w) {
                    own[v] += 2.0 * u[BETWEEN[v][w]][a];
                    own[BETWEEN[v][w]] += 2.0 * u[v][a];
                }
        for (int n = 0; n < NODES; n++)
            f[n][a] += share * own[n];
    }
}

FOR_PROCESSORS
void NAMED(aom_tetra_product, REAL)(const aom_tetra *of, REAL k, REAL m, const REAL *u, REAL *out) {
    for (int64_t g = 0; g < of->n_groups; g++) {
        const int32_t *nodes = of->nodes + g * NODES * AOM_LANES;
        const wide *data = (const wide *)((const REAL *)of->data + g * AOM_TETRA_DATA * AOM_LANES);
        wide own[NODES][3], f[NODES][3];
        for (int n = 0; n < NODES; n++)
            for (int l = 0; l < AOM_LANES; l++)
                for (int a = 0; a < 3; a++)
                    own[n][a][l] = u[3 * (int64_t)nodes[n * AOM_LANES + l] + a];
        memset(f, 0, sizeof f);
        if (k != 0.0)
            stiffness(k, own, data, f);
        if (m != 0.0)
            inertia(m, own, data, f);
        for (int n = 0; n < NODES; n++)
            for (int l = 0; l < AOM_LANES; l++)
                for (int a = 0; a < 3; a++)
                    out[3 * (int64_t)nodes[n * AOM_LANES + l] + a] += f[n][a][l];
    }
}
