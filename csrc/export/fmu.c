/* FMI 2.0 and 3.0 for co-simulation: one library for every exported model.
 *
 * The model is read from the file resources/model.aom of the unpacked FMU. Value references: 0 the
 * time, then the forces on the sites of a port, then the outputs, then the parameters.
 * (https://fmi-standard.org; the declarations below are those of the standard that are used.)
 */
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "antiosc_model.h"

#include <math.h>

#if defined(_WIN32)
#define FMI_API __declspec(dllexport)
#else
#define FMI_API __attribute__((visibility("default")))
#endif

/* ---- the model file ------------------------------------------------------------------------- */

enum { N_COUNTS = 11, TOKEN = 64, CONTACT_INTS = 4, CONTACT_DOUBLES = 7, N_OPTIONS = 6 };
#define MAGIC "AOMMODEL"
#define ENDIAN_MARK 0x01020304

typedef struct model_file {
    axm_model model;
    char token[TOKEN];
    void *ints, *doubles;
    aom_contact *contacts;
} model_file;

static void free_model(model_file *file) {
    free(file->ints);
    free(file->doubles);
    free(file->contacts);
    memset(file, 0, sizeof *file);
}

/* The next numbers of the file's doubles. */
static const double *next(const double **at, size_t count) {
    const double *found = *at;
    *at += count;
    return found;
}

static void fill_contacts(model_file *file, const int32_t *ints, const double **at) {
    int p = file->model.system.n_contacts;
    const double *numbers = next(at, (size_t)p * CONTACT_DOUBLES);
    for (int c = 0; c < p; c++) {
        const int32_t *i = ints + c * CONTACT_INTS;
        const double *x = numbers + (ptrdiff_t)c * CONTACT_DOUBLES;
        aom_law law = {i[0], i[1], next(at, (size_t)i[1]), NULL};
        file->contacts[c] =
            (aom_contact){law, x[0], x[1], i[2], i[3], x[2], x[3], x[4], x[5], x[6], NULL, 0};
    }
    file->model.system.contacts = file->contacts;
}

/* Numbers of the quadratic forces of stretching. */
static size_t stretch_size(const int32_t *counts) {
    size_t n = (size_t)counts[8];
    return n * n * n;
}

static void fill_model(model_file *file, const int32_t *counts) {
    const double *at = file->doubles;
    const int32_t *ints = file->ints;
    size_t J = (size_t)counts[0], m = (size_t)counts[1], K = (size_t)counts[3];
    size_t S = (size_t)counts[4], N = (size_t)counts[5], s3 = stretch_size(counts);
    axm_model *model = &file->model;
    const double *o = next(&at, N_OPTIONS);
    model->options = (aom_options){o[0], o[1], o[2], o[3], o[4], INT64_MAX / 4, INT64_MAX / 4, 0};
    aom_system *s = &model->system;
    *s = (aom_system){.n_modes = counts[0],
                      .n_rows = counts[1],
                      .n_contacts = counts[2],
                      .n_breaks = counts[3],
                      .n_stretch = counts[8],
                      .stored = o[5]};
    s->omega = next(&at, J);
    s->decay = next(&at, J);
    s->beta = next(&at, m * J);
    s->residual = next(&at, m * m);
    s->breaks = next(&at, K);
    s->loads = next(&at, K * J);
    s->offsets = next(&at, K * m);
    s->q = next(&at, J);
    s->v = next(&at, J);
    model->n_sites = counts[4];
    model->site_modes = next(&at, S * J);
    model->site_forces = next(&at, S * m);
    model->site_shifts = next(&at, K * S);
    model->n_parameters = counts[5];
    model->parameters = next(&at, N);
    model->start = next(&at, N * J);
    model->n_outputs = counts[6];
    model->outputs = (const axm_output_spec *)(ints + CONTACT_INTS * counts[2]);
    fill_contacts(file, ints, &at);
    s->quadratic = next(&at, s3);
    s->cubic = next(&at, s3 * (size_t)counts[8]);
}

/* Number of doubles of a file with these counts, 0 if they are out of range. */
static size_t doubles_of(const int32_t *counts) {
    for (int k = 0; k < 9; k++)
        if (counts[k] < 0 || counts[k] > (k < 8 ? 10000000 : 1000))
            return 0;
    double J = counts[0], m = counts[1], p = counts[2], K = counts[3], S = counts[4], N = counts[5];
    double total = (double)N_OPTIONS + J * (4 + m + K + S + N) + m * (m + K + S) + K * (1 + S) + N +
                   p * (double)CONTACT_DOUBLES + counts[7] +
                   (double)stretch_size(counts) * (1.0 + counts[8]);
    return total < 1e9 ? (size_t)total : 0;
}

/* The bytes of a file behind which their checksum stands, and how many they are; NULL: damaged. */
static char *sound_bytes(FILE *stream, size_t *size) {
    uint64_t sum;
    long end = fseek(stream, 0, SEEK_END) == 0 ? ftell(stream) : -1;
    if (end < (long)sizeof sum || fseek(stream, 0, SEEK_SET) != 0)
        return NULL;
    *size = (size_t)end - sizeof sum;
    char *bytes = malloc(*size + 1);
    if (bytes != NULL && fread(bytes, 1, *size, stream) == *size &&
        fread(&sum, sizeof sum, 1, stream) == 1 && sum == axm_checksum(bytes, *size))
        return bytes;
    free(bytes);
    return NULL;
}

/* Copy the next bytes; `at` goes on. */
static void copy_next(const char **at, void *to, size_t size) {
    memcpy(to, *at, size);
    *at += size;
}

static bool read_bytes(model_file *file, const char *at, size_t size) {
    char magic[8];
    int32_t counts[N_COUNTS];
    size_t head = sizeof magic + sizeof counts + TOKEN;
    if (size < head)
        return false;
    copy_next(&at, magic, sizeof magic);
    copy_next(&at, counts, sizeof counts);
    copy_next(&at, file->token, TOKEN);
    file->token[TOKEN - 1] = '\0';
    size_t doubles = doubles_of(counts);
    if (memcmp(magic, MAGIC, sizeof magic) != 0 || counts[9] != ENDIAN_MARK ||
        counts[10] != AOM_VERSION || doubles == 0)
        return false;
    size_t ints = CONTACT_INTS * (size_t)counts[2] + 2 * (size_t)counts[6];
    if (size - head != ints * sizeof(int32_t) + doubles * sizeof(double))
        return false;
    file->ints = calloc(ints + 1, sizeof(int32_t));
    file->doubles = calloc(doubles, sizeof(double));
    file->contacts = calloc((size_t)counts[2] + 1, sizeof *file->contacts);
    if (file->ints == NULL || file->doubles == NULL || file->contacts == NULL)
        return false;
    copy_next(&at, file->ints, ints * sizeof(int32_t));
    copy_next(&at, file->doubles, doubles * sizeof(double));
    const int32_t *contact = file->ints;
    double numbers = 0.0;
    for (int c = 0; c < counts[2]; c++, contact += CONTACT_INTS)
        numbers += contact[1] >= 0 ? contact[1] : 1e12;
    if (numbers != counts[7])
        return false;
    fill_model(file, counts);
    return axm_size(&file->model) > 0;
}

static bool read_body(model_file *file, FILE *stream) {
    size_t size;
    char *bytes = sound_bytes(stream, &size);
    bool good = bytes != NULL && read_bytes(file, bytes, size);
    free(bytes);
    return good;
}

/* The path of a file in the folder of the resources, which is a path or a URI. */
static void resource_path(const char *folder, const char *name, char *path, size_t room) {
    bool uri = strncmp(folder, "file:", 5) == 0;
    const char *at = uri ? folder + 5 : folder;
    if (uri && strncmp(at, "//", 2) == 0) {
        at += 2;
        while (*at != '/' && *at != '\0') /* a host */
            at++;
    }
#if defined(_WIN32)
    if (uri && *at == '/')
        at++;
#endif
    size_t n = 0;
    for (; *at != '\0' && n + 2 < room; n++) {
        unsigned code;
        if (uri && *at == '%' && sscanf(at + 1, "%2x", &code) == 1) {
            path[n] = (char)code;
            at += 3;
        } else
            path[n] = *at++;
    }
    if (n > 0 && path[n - 1] != '/' && path[n - 1] != '\\')
        path[n++] = '/';
    snprintf(path + n, room - n, "%s", name);
}

static bool read_model(model_file *file, const char *resources) {
    char path[4096];
    memset(file, 0, sizeof *file);
    resource_path(resources, "model.aom", path, sizeof path);
    FILE *stream = fopen(path, "rb");
    bool good = stream != NULL && read_body(file, stream);
    if (stream != NULL)
        fclose(stream);
    if (!good)
        free_model(file);
    return good;
}

/* ---- an instance, for both versions of the standard ----------------------------------------- */

typedef enum phase { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED, FAILED } phase;

typedef enum fmi_status { FMI_OK, FMI_WARNING, FMI_DISCARD, FMI_ERROR, FMI_FATAL } fmi_status;

typedef void (*fmi2_logger)(void *, const char *, int, const char *, const char *, ...);
typedef void (*fmi3_logger)(void *, int, const char *, const char *);

typedef struct instance {
    model_file file;
    axm_run *run;
    double start;
    phase phase;
    char *name;
    void *environment;
    fmi2_logger log2;
    fmi3_logger log3;
} instance;

static int failure(instance *self, const char *text, ...) {
    char line[300];
    va_list rest;
    va_start(rest, text);
    vsnprintf(line, sizeof line, text, rest);
    va_end(rest);
    if (self->log2 != NULL)
        self->log2(self->environment, self->name, FMI_ERROR, "logStatusError", "%s", line);
    if (self->log3 != NULL)
        self->log3(self->environment, FMI_ERROR, "logStatusError", line);
    return FMI_ERROR;
}

static void free_instance(instance *self) {
    if (self == NULL)
        return;
    free_model(&self->file);
    free(self->run);
    free(self->name);
    free(self);
}

static instance *new_instance(const char *name, const char *token, const char *resources,
                              void *environment, fmi2_logger log2, fmi3_logger log3) {
    instance *self = calloc(1, sizeof *self);
    if (self == NULL)
        return NULL;
    self->environment = environment;
    self->log2 = log2;
    self->log3 = log3;
    size_t length = strlen(name == NULL ? "" : name) + 1;
    self->name = calloc(length, 1);
    if (self->name != NULL && name != NULL)
        memcpy(self->name, name, length);
    const char *wrong = NULL;
    if (resources == NULL || !read_model(&self->file, resources))
        wrong = "the file resources/model.aom is missing or damaged: export the model anew.";
    else if (token == NULL || strcmp(token, self->file.token) != 0)
        wrong = "the instantiation token is not that of resources/model.aom.";
    if (wrong == NULL) {
        size_t bytes = axm_size(&self->file.model);
        void *memory = malloc(bytes);
        int status = axm_create(&self->file.model, memory, bytes, &self->run);
        if (status != AOM_DONE) {
            free(memory);
            self->run = NULL;
            wrong = "the model cannot start: too little memory, or its numbers are out of range.";
        }
    }
    if (wrong != NULL) {
        failure(self, "%s", wrong);
        free_instance(self);
        return NULL;
    }
    return self;
}

/* Whether a call is allowed now. */
static bool allowed(instance *self, const char *call, unsigned phases) {
    if (self == NULL)
        return false;
    if (phases & (1u << self->phase))
        return true;
    failure(self, "%s is not allowed now.", call);
    return false;
}

#define IN(phase) (1u << (phase))
#define LIVING (IN(INSTANTIATED) | IN(INITIALIZING) | IN(STEPPING))
#define READABLE (LIVING | IN(TERMINATED))

static int n_inputs(const instance *self) {
    return self->file.model.system.n_contacts == 0 ? self->file.model.n_sites : 0;
}

static int set_experiment(instance *self, double start, bool has_stop, double stop) {
    if (!isfinite(start) || (has_stop && !(stop > start)))
        return failure(self, "start time %g and stop time %g do not fit.", start, stop);
    self->start = start;
    return FMI_OK;
}

static int begin(instance *self, const char *call) {
    if (!allowed(self, call, IN(INSTANTIATED)))
        return FMI_ERROR;
    self->phase = INITIALIZING;
    return FMI_OK;
}

static int finish_begin(instance *self, const char *call) {
    if (!allowed(self, call, IN(INITIALIZING)))
        return FMI_ERROR;
    int status = axm_start(self->run);
    if (status != AOM_DONE) {
        self->phase = FAILED;
        return failure(self, "the run cannot start (%s).", aom_status_name(status));
    }
    self->phase = STEPPING;
    return FMI_OK;
}

static int terminate(instance *self, const char *call) {
    if (!allowed(self, call, IN(STEPPING)))
        return FMI_ERROR;
    self->phase = TERMINATED;
    return FMI_OK;
}

static int reset(instance *self, const char *call) {
    if (!allowed(self, call, READABLE | IN(FAILED)))
        return FMI_ERROR;
    const axm_model *model = &self->file.model;
    for (int k = 0; k < model->n_parameters; k++)
        axm_set_parameter(self->run, k, model->parameters[k]);
    for (int i = 0; i < n_inputs(self); i++)
        axm_set_input(self->run, i, 0.0, 0.0);
    self->phase = INSTANTIATED;
    self->start = 0.0;
    return axm_start(self->run) == AOM_DONE ? FMI_OK : FMI_ERROR;
}

static int get_values(instance *self, const uint32_t *refs, size_t n, double *values) {
    if (!allowed(self, "reading a value", READABLE))
        return FMI_ERROR;
    int inputs = n_inputs(self), outputs = self->file.model.n_outputs;
    int parameters = self->file.model.n_parameters;
    for (size_t k = 0; k < n; k++) {
        int64_t i = (int64_t)refs[k] - 1;
        if (i < 0)
            values[k] = self->start + axm_time(self->run);
        else if (i < inputs)
            values[k] = axm_input(self->run, (int)i);
        else if (i < inputs + outputs)
            values[k] = axm_output(self->run, (int)i - inputs);
        else if (i < inputs + outputs + parameters)
            values[k] = axm_parameter(self->run, (int)i - inputs - outputs);
        else
            return failure(self, "there is no variable with the reference %u.", refs[k]);
    }
    return FMI_OK;
}

static int set_values(instance *self, const uint32_t *refs, size_t n, const double *values) {
    if (!allowed(self, "setting a value", LIVING))
        return FMI_ERROR;
    int inputs = n_inputs(self), before = inputs + self->file.model.n_outputs;
    for (size_t k = 0; k < n; k++) {
        int64_t i = (int64_t)refs[k] - 1;
        if (!isfinite(values[k]))
            return failure(self, "the variable %u must be finite.", refs[k]);
        if (i >= 0 && i < inputs)
            axm_set_input(self->run, (int)i, values[k], 0.0);
        else if (i >= before && i < before + self->file.model.n_parameters &&
                 self->phase != STEPPING)
            axm_set_parameter(self->run, (int)i - before, values[k]);
        else
            return failure(self, "the variable %u cannot be set now.", refs[k]);
    }
    return FMI_OK;
}

/* Initial values that were set act on what is read before the first step. */
static int set_and_start(instance *self, const uint32_t *refs, size_t n, const double *values) {
    int status = set_values(self, refs, n, values);
    if (status == FMI_OK && n > 0 && self->phase != STEPPING && axm_start(self->run) != AOM_DONE)
        return failure(self, "the run cannot start with these values.");
    return status;
}

static int do_step(instance *self, double at, double h) {
    if (!allowed(self, "a step", IN(STEPPING)))
        return FMI_ERROR;
    double now = self->start + axm_time(self->run), size = fabs(at) + fabs(h) + fabs(self->start);
    if (!(h > 0.0) || !isfinite(h) || !(fabs(at - now) <= 1e-9 * size))
        return failure(self, "a step of %g s from %g s does not follow on %g s, or is not > 0.", h, at,
                       now);
    double to = at + h - self->start;
    int status = axm_advance(self->run, to > axm_time(self->run) ? to : axm_time(self->run));
    if (status != AOM_DONE) {
        self->phase = FAILED;
        return failure(self, "the run stopped between %g and %g s (%s).", at, at + h,
                       aom_status_name(status));
    }
    return FMI_OK;
}

static int unsupported(instance *self, const char *call) {
    return self == NULL ? FMI_ERROR : failure(self, "%s is not supported.", call);
}

/* Variables of other types: there are none. */
static int no_values(instance *self, size_t n, const char *type) {
    if (self == NULL)
        return FMI_ERROR;
    return n == 0 ? FMI_OK : failure(self, "there are no variables of the type %s.", type);
}

#include "fmi2.h"
#include "fmi3.h"
