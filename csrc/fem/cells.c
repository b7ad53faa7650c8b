/* Integrals over the cells of a mesh by the compiled kernel of a finite-element form. */
#include "internal.h"

/* points of a cell's nodes, and its coefficients */
static void gather(const afe_cells *of, int64_t c, double *x, double *w) {
    memcpy(w, of->coefficients + c * of->n_coefficients, (size_t)of->n_coefficients * sizeof(double));
    for (int i = 0; i < of->n_nodes; i++)
        memcpy(x + 3 * i, of->points + 3 * (int64_t)of->nodes[c * of->n_nodes + i],
               3 * sizeof(double));
}

void afe_cell_sums(const afe_cells *of, int64_t begin, int64_t end, double *memory, double *out) {
    double *w = memory, *x = w + of->n_coefficients, *own = x + 3 * of->n_nodes;
    double *entries = w + of->first;
    size_t bytes = (size_t)of->n_dofs * sizeof(double);
    for (int64_t c = begin; c < end; c++) {
        const double *given = of->coefficients + c * of->n_coefficients;
        gather(of, c, x, w);
        for (int j = 0; j < of->n_dofs; j++) { /* the vectors lie side by side: each row is read once */
            const double *row = of->vectors + (int64_t)given[of->first + j] * of->n_vectors;
            for (int k = 0; k < of->n_vectors; k++)
                own[k * of->n_dofs + j] = row[k];
        }
        double sum = 0.0;
        for (int k = 0; k < of->n_vectors; k++) {
            double value = 0.0;
            memcpy(entries, own + k * of->n_dofs, bytes);
            of->kernel(&value, w, of->constants, x, NULL, NULL, NULL);
            sum += of->weights[k] * value;
        }
        out[c] = sum;
    }
}
