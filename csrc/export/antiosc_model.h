/* antiosc_model.h - an exported model: a run that goes on by communication steps.
 *
 * A model is a system of antiosc_march.h with named outputs (a contact's force, a site's
 * displacement ...), or a port: one linear body whose sites take forces and give motions. Both are
 * advanced to a time of the caller's; what they give does not depend on how often that is.
 *
 *     size_t size = axm_size(&model);
 *     axm_run *run;
 *     status = axm_create(&model, malloc(size), size, &run);
 *     while (status == AOM_DONE && t < end) {
 *         status = axm_advance(run, t += h);
 *         force = axm_output(run, 0);
 *     }
 *
 * Nothing is allocated, read or written, there is no global state: several runs of one model may
 * live at once. Units are SI. Times begin at 0.
 */
#ifndef ANTIOSC_MODEL_H
#define ANTIOSC_MODEL_H

#include "../antiosc_march.h"

/* What an output is; `index` is a contact or a site. */
typedef enum axm_kind {
    AXM_FORCE = 0,    /* of a contact [N], >= 0 */
    AXM_INDENTATION,  /* of a contact [m], negative: distance */
    AXM_PEAK,         /* largest force of a contact so far [N] */
    AXM_IMPULSE,      /* of a contact so far [N s] */
    AXM_DISPLACEMENT, /* of a site [m] */
    AXM_VELOCITY      /* of a site [m/s], of what has inertia there */
} axm_kind;

typedef struct axm_output_spec {
    int32_t kind, index;
} axm_output_spec;

/* A model. A port has system.n_contacts = 0 and as many rows as sites: its inputs are the forces
 * on the sites, its omega, decay, residual, q, v are used, and beta are its sites. */
typedef struct axm_model {
    aom_system system;
    aom_options options;
    int n_sites;
    const double *site_modes;  /* [n_sites][n_modes] displacement by modal displacements */
    const double *site_forces; /* [n_sites][n_rows] displacement by the rows' forces */
    const double *site_shifts; /* [n_breaks][n_sites] displacement by the loads on the residual */
    int n_parameters;          /* initial speeds that can be set */
    const double *parameters;  /* [n_parameters] their values in system.v */
    const double *start;       /* [n_parameters][n_modes] change of v by a unit of each */
    int n_outputs;
    const axm_output_spec *outputs;
} axm_model;

typedef struct axm_run axm_run; /* opaque, in the caller's memory */

/* Bytes that a run needs; 0 if sizes or outputs are out of range. */
AOM_API size_t axm_size(const axm_model *model);
/* Make a run in memory aligned as malloc's and start it. */
AOM_API int axm_create(const axm_model *model, void *memory, size_t bytes, axm_run **made);
/* Back to time 0, with the parameters and inputs as they are set now. */
AOM_API int axm_start(axm_run *run);
/* Go on to a time >= the present one [s]. AOM_DONE, or why it stopped. */
AOM_API int axm_advance(axm_run *run, double time);
AOM_API double axm_time(const axm_run *run);
AOM_API double axm_output(const axm_run *run, int output);
/* The force [N] on a site of a port from now on, and its rate [N/s] until the next call. */
AOM_API void axm_set_input(axm_run *run, int site, double force, double rate);
AOM_API double axm_input(const axm_run *run, int site);
/* An initial speed; axm_start uses it. */
AOM_API void axm_set_parameter(axm_run *run, int parameter, double value);
AOM_API double axm_parameter(const axm_run *run, int parameter);
/* FNV-1a of bytes: what a model file ends with, of all before it. */
AOM_API uint64_t axm_checksum(const void *bytes, size_t size);

#endif
