/* Products with the cells of `elastic.c` in the precision REAL. */
typedef REAL wide __attribute__((vector_size(sizeof(REAL) * LANES), may_alias, aligned(sizeof(REAL))));
typedef REAL quad __attribute__((vector_size(4 * sizeof(REAL)), may_alias, aligned(sizeof(REAL))));
typedef INTEGER picks __attribute__((vector_size(sizeof(REAL) * LANES)));

/* x, y, z at a node of a cell and a number beyond; eight lanes share the cells l and l + 4 */
INLINE void load(const REAL *u, const int32_t *nodes, int l, wide *own) {
    memcpy(own, u + 3 * (int64_t)nodes[l], sizeof *own);
#if LANES == 8
    wide second;
    memcpy(&second, u + 3 * (int64_t)nodes[l + 4], sizeof second);
    *own = SHUFFLE(*own, second, 0, 1, 2, 3, 8, 9, 10, 11);
#endif
}

/* values x, y, z at a node of each cell */
INLINE void gather_node(const REAL *u, const int32_t *nodes, wide own[3]) {
    wide with_x[2], others[2];
    for (int i = 0; i < 2; i++) {
        wide even, odd;
        load(u, nodes, 2 * i, &even);
        load(u, nodes, 2 * i + 1, &odd);
        with_x[i] = SHUFFLE(even, odd, ALTERNATE_FIRST);
        others[i] = SHUFFLE(even, odd, ALTERNATE_LAST);
    }
    own[0] = SHUFFLE(with_x[0], with_x[1], PAIRS_FIRST);
    own[BESIDE_X] = SHUFFLE(with_x[0], with_x[1], PAIRS_LAST);
    own[3 - BESIDE_X] = SHUFFLE(others[0], others[1], PAIRS_FIRST);
}

/* add x, y, z and 0 to a node of each cell: the transpose of `gather_node` */
INLINE void scatter_node(wide f[3], const int32_t *nodes, REAL *out) {
    wide zero, rows[4];
    memset(&zero, 0, sizeof zero);
    wide xy[2] = {SHUFFLE(f[0], f[1], ALTERNATE_FIRST), SHUFFLE(f[0], f[1], ALTERNATE_LAST)};
    wide z[2] = {SHUFFLE(f[2], zero, ALTERNATE_FIRST), SHUFFLE(f[2], zero, ALTERNATE_LAST)};
    for (int i = 0; i < 2; i++) {
        int row = i * (3 - BESIDE_X);
        rows[row] = SHUFFLE(xy[i], z[i], PAIRS_FIRST);
        rows[row + BESIDE_X] = SHUFFLE(xy[i], z[i], PAIRS_LAST);
    }
    for (int l = 0; l < LANES; l++) {
        quad own;
        memcpy(&own, (const REAL *)&rows[l % 4] + l / 4 * 4, sizeof own);
        *(quad *)(out + 3 * (int64_t)nodes[l]) += own;
    }
}

/* `count` numbers of each cell, of which the first cell is the one of `values` */
INLINE void taken(const REAL *values, int count, wide *own) {
    for (int i = 0; i < count; i++)
        memcpy(own + i, values + i * AFE_LANES, sizeof *own);
}

/* slopes c of u_a along the reference axes at corner v */
INLINE void corner_slopes(wide u[NODES][3], int v, int a, wide c[3]) {
    wide along[CORNERS];
    for (int i = 0; i < CORNERS; i++)
        along[i] = i == v ? 3.0 * u[v][a] : 4.0 * u[BETWEEN[v][i]][a] - u[i][a];
    for (int i = 1; i < CORNERS; i++)
        c[i - 1] = along[i] - along[0];
}

/* forces along a at the nodes, of stresses c along the reference axes at the corners: the transpose of
 * `corner_slopes` */
INLINE void node_forces(wide c[CORNERS][3], int a, wide f[NODES][3]) {
    wide along[CORNERS][CORNERS];
    for (int v = 0; v < CORNERS; v++) {
        along[v][0] = -(c[v][0] + c[v][1] + c[v][2]);
        for (int i = 1; i < CORNERS; i++)
            along[v][i] = c[v][i - 1];
    }
    for (int v = 0; v < CORNERS; v++) {
        f[v][a] = 3.0 * along[v][v];
        for (int w = 0; w < CORNERS; w++)
            if (w != v)
                f[v][a] -= along[w][v];
        for (int w = 0; w < v; w++)
            f[BETWEEN[v][w]][a] = 4.0 * (along[v][w] + along[w][v]);
    }
}

/* slopes H[v][a][b] of u_a along b at the corners v, from grad λ_1, λ_2, λ_3 */
INLINE void slopes(wide u[NODES][3], const wide *grad, wide H[CORNERS][3][3]) {
    for (int a = 0; a < 3; a++)
        for (int v = 0; v < CORNERS; v++) {
            wide c[3];
            corner_slopes(u, v, a, c);
            for (int b = 0; b < 3; b++)
                H[v][a][b] = c[0] * grad[b] + c[1] * grad[3 + b] + c[2] * grad[6 + b];
        }
}

/* stresses at the corners, with their sum over the corners added, in the order of PLACE */
INLINE void stresses(wide H[CORNERS][3][3], REAL k, const wide *data, wide T[CORNERS][6]) {
    wide lame = k * data[9], shear = k * data[10];
    for (int v = 0; v < CORNERS; v++) {
        wide mean = lame * (H[v][0][0] + H[v][1][1] + H[v][2][2]);
        for (int a = 0; a < 3; a++) {
            int b = (a + 1) % 3, c = (a + 2) % 3;
            T[v][a] = 2.0 * shear * H[v][a][a] + mean;
            T[v][3 + a] = shear * (H[v][b][c] + H[v][c][b]);
        }
    }
    for (int i = 0; i < 6; i++) {
        wide sum = T[0][i] + T[1][i] + T[2][i] + T[3][i];
        for (int v = 0; v < CORNERS; v++)
            T[v][i] += sum;
    }
}

/* forces of stresses at the nodes: the transpose of `slopes` */
INLINE void forces(wide T[CORNERS][6], const wide *grad, wide f[NODES][3]) {
    for (int a = 0; a < 3; a++) {
        wide c[CORNERS][3];
        for (int v = 0; v < CORNERS; v++)
            for (int i = 0; i < 3; i++) {
                const wide *g = grad + 3 * i;
                c[v][i] = T[v][PLACE[a][0]] * g[0] + T[v][PLACE[a][1]] * g[1] + T[v][PLACE[a][2]] * g[2];
            }
        node_forces(c, a, f);
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
void NAMED(afe_tetra_product, REAL)(const afe_tetra *of, REAL k, REAL m, const REAL *u, REAL *out) {
    for (int64_t cell = 0; cell < of->n_groups * AFE_LANES; cell += LANES) {
        const int32_t *nodes = of->nodes + PLACE_OF(cell, NODES);
        wide own[NODES][3], f[NODES][3], data[AFE_TETRA_DATA];
        taken((const REAL *)of->data + PLACE_OF(cell, AFE_TETRA_DATA), AFE_TETRA_DATA, data);
        for (int n = 0; n < NODES; n++)
            gather_node(u, nodes + n * AFE_LANES, own[n]);
        memset(f, 0, sizeof f);
        if (k != 0.0) {
            wide H[CORNERS][3][3], T[CORNERS][6];
            slopes(own, data, H);
            stresses(H, k, data, T);
            forces(T, data, f);
        }
        if (m != 0.0)
            inertia(m, own, data, f);
        for (int n = 0; n < NODES; n++)
            scatter_node(f[n], nodes + n * AFE_LANES, out);
    }
}

/* what is linear along the reference axes, from its values at the corners, at barycentric coordinates */
INLINE void interpolated(wide slope[3][CORNERS][3], const REAL *at, wide out[3][3]) {
    for (int a = 0; a < 3; a++)
        for (int c = 0; c < 3; c++)
            out[a][c] = at[0] * slope[a][0][c] + at[1] * slope[a][1][c] + at[2] * slope[a][2][c] +
                        at[3] * slope[a][3][c];
}

/* |det J| and, times det J, the inverse of J */
INLINE void adjugate(wide J[3][3], wide adj[3][3], wide *size) {
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            int c = (b + 1) % 3, d = (b + 2) % 3, e = (a + 1) % 3, g = (a + 2) % 3;
            adj[a][b] = J[c][e] * J[d][g] - J[c][g] * J[d][e];
        }
    wide det = J[0][0] * adj[0][0] + J[0][1] * adj[1][0] + J[0][2] * adj[2][0];
    *size = (wide)((picks)det & WITHOUT_SIGN);
}

/* add to the stresses `sum` along the reference axes at the corners those of a quadrature point: its
 * barycentric coordinates and weight; slopes [a][v][axis] of u and x; constants as of afe_curved */
INLINE void stiffness_at(REAL k, wide u[3][CORNERS][3], wide x[3][CORNERS][3], const REAL *at,
                         const wide *constants, wide sum[3][CORNERS][3]) {
    wide J[3][3], adj[3][3], size, along[3][3], H[3][3];
    interpolated(x, at, J);
    interpolated(u, at, along);
    adjugate(J, adj, &size);
    wide factor = k * at[CORNERS] / size;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            H[a][b] = along[a][0] * adj[0][b] + along[a][1] * adj[1][b] + along[a][2] * adj[2][b];

    wide mean = factor * constants[0] * (H[0][0] + H[1][1] + H[2][2]), shear = factor * constants[1];
    for (int a = 0; a < 3; a++) {
        wide T[3];
        for (int b = 0; b < 3; b++)
            T[b] = shear * (H[a][b] + H[b][a]);
        T[a] += mean;
        for (int c = 0; c < 3; c++) {
            wide own = T[0] * adj[c][0] + T[1] * adj[c][1] + T[2] * adj[c][2];
            for (int v = 0; v < CORNERS; v++)
                sum[a][v][c] += at[v] * own;
        }
    }
}

/* f += m M u of a quadrature point as above, with the values of the shape functions */
INLINE void inertia_at(REAL m, wide u[NODES][3], wide x[3][CORNERS][3], const REAL *at, const REAL *values,
                       const wide *constants, wide f[NODES][3]) {
    wide J[3][3], adj[3][3], size;
    interpolated(x, at, J);
    adjugate(J, adj, &size);
    wide mass = m * at[CORNERS] * constants[2] * size;
    for (int a = 0; a < 3; a++) {
        wide motion = values[0] * u[0][a];
        for (int n = 1; n < NODES; n++)
            motion += values[n] * u[n][a];
        motion *= mass;
        for (int n = 0; n < NODES; n++)
            f[n][a] += values[n] * motion;
    }
}

/* u and its slopes [a][v][axis] along the reference axes at the corners */
INLINE void gather_slopes(const REAL *u, const int32_t *nodes, wide own[NODES][3], wide slope[3][CORNERS][3]) {
    for (int n = 0; n < NODES; n++)
        gather_node(u, nodes + n * AFE_LANES, own[n]);
    for (int a = 0; a < 3; a++)
        for (int v = 0; v < CORNERS; v++)
            corner_slopes(own, v, a, slope[a][v]);
}

FOR_PROCESSORS
void NAMED(afe_curved_product, REAL)(const afe_curved *of, REAL k, REAL m, const REAL *u, REAL *out) {
    const REAL *points = of->points, *mass_points = of->mass_points, *values = of->values;
    for (int64_t cell = 0; cell < of->n_groups * AFE_LANES; cell += LANES) {
        const int32_t *nodes = of->nodes + PLACE_OF(cell, NODES);
        wide own[NODES][3], f[NODES][3], along_u[3][CORNERS][3], along_x[3][CORNERS][3];
        wide sum[3][CORNERS][3], constants[AFE_CONSTANTS];
        taken((const REAL *)of->constants + PLACE_OF(cell, AFE_CONSTANTS), AFE_CONSTANTS, constants);
        gather_slopes(of->x, nodes, own, along_x);
        gather_slopes(u, nodes, own, along_u);

        memset(sum, 0, sizeof sum);
        for (int64_t q = 0; q < of->n_points && k != 0.0; q++)
            stiffness_at(k, along_u, along_x, points + q * AFE_POINT_DATA, constants, sum);
        for (int a = 0; a < 3; a++)
            node_forces(sum[a], a, f);
        for (int64_t q = 0; q < of->n_masses && m != 0.0; q++)
            inertia_at(m, own, along_x, mass_points + q * AFE_POINT_DATA, values + q * NODES, constants, f);
        for (int n = 0; n < NODES; n++)
            scatter_node(f[n], nodes + n * AFE_LANES, out);
    }
}

/* f = k K u of linear elements, whose strains are constant, at the corners */
INLINE void corner_forces(REAL k, wide u[CORNERS][3], const wide *data, wide f[CORNERS][3]) {
    wide H[3][3];
    for (int a = 0; a < 3; a++) {
        wide c[CORNERS];
        for (int v = 1; v < CORNERS; v++)
            c[v] = u[v][a] - u[0][a];
        for (int b = 0; b < 3; b++)
            H[a][b] = c[1] * data[b] + c[2] * data[3 + b] + c[3] * data[6 + b];
    }
    wide shear = 20 * k * data[10], mean = 20 * k * data[9] * (H[0][0] + H[1][1] + H[2][2]);
    for (int a = 0; a < 3; a++) {
        wide T[3];
        for (int b = 0; b < 3; b++)
            T[b] = shear * (H[a][b] + H[b][a]);
        T[a] += mean;
        for (int v = 1; v < CORNERS; v++) {
            const wide *grad = data + 3 * v - 3;
            f[v][a] = T[0] * grad[0] + T[1] * grad[1] + T[2] * grad[2];
        }
        f[0][a] = -(f[1][a] + f[2][a] + f[3][a]);
    }
}

FOR_PROCESSORS
void NAMED(afe_linear_product, REAL)(const afe_tetra *of, REAL k, REAL m, const REAL *u, REAL *out) {
    for (int64_t cell = 0; cell < of->n_groups * AFE_LANES; cell += LANES) {
        const int32_t *nodes = of->nodes + PLACE_OF(cell, CORNERS);
        wide own[CORNERS][3], f[CORNERS][3], data[AFE_TETRA_DATA];
        taken((const REAL *)of->data + PLACE_OF(cell, AFE_TETRA_DATA), AFE_TETRA_DATA, data);
        for (int v = 0; v < CORNERS; v++)
            gather_node(u, nodes + v * AFE_LANES, own[v]);

        corner_forces(k, own, data, f);
        wide share = 21 * m * data[11]; /* of 1/20 of the mass */
        for (int a = 0; a < 3; a++) {
            wide sum = own[0][a] + own[1][a] + own[2][a] + own[3][a];
            for (int v = 0; v < CORNERS; v++)
                f[v][a] += share * (sum + own[v][a]);
        }
        for (int v = 0; v < CORNERS; v++)
            scatter_node(f[v], nodes + v * AFE_LANES, out);
    }
}

/* Where u is linear in a quadratic cell, its constant stresses act on the middles of the edges alone: the
 * mean of grad N is grad λ_v + grad λ_w there, and zero at the corners. */
FOR_PROCESSORS
void NAMED(afe_tetra_of_linear, REAL)(const afe_tetra *of, REAL k, REAL m, const REAL *u, REAL *out) {
    for (int64_t cell = 0; cell < of->n_groups * AFE_LANES; cell += LANES) {
        const int32_t *nodes = of->nodes + PLACE_OF(cell, NODES);
        wide own[NODES][3], f[NODES][3], at_corners[CORNERS][3], data[AFE_TETRA_DATA];
        taken((const REAL *)of->data + PLACE_OF(cell, AFE_TETRA_DATA), AFE_TETRA_DATA, data);
        for (int v = 0; v < CORNERS; v++)
            gather_node(u, nodes + v * AFE_LANES, own[v]);

        corner_forces(k, own, data, at_corners);
        memset(f, 0, sizeof f);
        for (int v = 0; v < CORNERS; v++)
            for (int w = 0; w < v; w++)
                for (int a = 0; a < 3; a++) {
                    f[BETWEEN[v][w]][a] = at_corners[v][a] + at_corners[w][a];
                    own[BETWEEN[v][w]][a] = 0.5 * (own[v][a] + own[w][a]);
                }
        if (m != 0.0)
            inertia(m, own, data, f);
        for (int n = m == 0.0 ? CORNERS : 0; n < NODES; n++)
            scatter_node(f[n], nodes + n * AFE_LANES, out);
    }
}
