/* The functions of FMI 2.0 for co-simulation. Part of fmu.c. */

typedef int fmi2Status;
typedef int fmi2Boolean;
typedef const char *fmi2String;

typedef struct fmi2Callbacks {
    fmi2_logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} fmi2Callbacks;

FMI_API const char *fmi2GetTypesPlatform(void) { return "default"; }
FMI_API const char *fmi2GetVersion(void) { return "2.0"; }

FMI_API fmi2Status fmi2SetDebugLogging(void *self, fmi2Boolean on, size_t n,
                                       const fmi2String categories[]) {
    (void)on, (void)n, (void)categories;
    return self == NULL ? FMI_ERROR : FMI_OK;
}

FMI_API void *fmi2Instantiate(fmi2String name, int type, fmi2String guid, fmi2String resources,
                              const fmi2Callbacks *callbacks, fmi2Boolean visible,
                              fmi2Boolean logging) {
    (void)visible, (void)logging;
    if (type != 1) /* co-simulation */
        return NULL;
    return new_instance(name, guid, resources, callbacks ? callbacks->environment : NULL,
                        callbacks ? callbacks->logger : NULL, NULL);
}

FMI_API void fmi2FreeInstance(void *self) { free_instance(self); }

FMI_API fmi2Status fmi2SetupExperiment(void *self, fmi2Boolean has_tolerance, double tolerance,
                                       double start, fmi2Boolean has_stop, double stop) {
    (void)has_tolerance, (void)tolerance; /* the tolerance of the export is kept */
    if (!allowed(self, "fmi2SetupExperiment", IN(INSTANTIATED)))
        return FMI_ERROR;
    return set_experiment(self, start, has_stop, stop);
}

FMI_API fmi2Status fmi2EnterInitializationMode(void *self) {
    return begin(self, "fmi2EnterInitializationMode");
}
FMI_API fmi2Status fmi2ExitInitializationMode(void *self) {
    return finish_begin(self, "fmi2ExitInitializationMode");
}
FMI_API fmi2Status fmi2Terminate(void *self) { return terminate(self, "fmi2Terminate"); }
FMI_API fmi2Status fmi2Reset(void *self) { return reset(self, "fmi2Reset"); }

FMI_API fmi2Status fmi2GetReal(void *self, const unsigned refs[], size_t n, double values[]) {
    return get_values(self, refs, n, values);
}
FMI_API fmi2Status fmi2SetReal(void *self, const unsigned refs[], size_t n,
                               const double values[]) {
    return set_and_start(self, refs, n, values);
}
FMI_API fmi2Status fmi2GetInteger(void *self, const unsigned refs[], size_t n, int values[]) {
    (void)refs, (void)values;
    return no_values(self, n, "Integer");
}
FMI_API fmi2Status fmi2SetInteger(void *self, const unsigned refs[], size_t n,
                                  const int values[]) {
    (void)refs, (void)values;
    return no_values(self, n, "Integer");
}
FMI_API fmi2Status fmi2GetBoolean(void *self, const unsigned refs[], size_t n, int values[]) {
    (void)refs, (void)values;
    return no_values(self, n, "Boolean");
}
FMI_API fmi2Status fmi2SetBoolean(void *self, const unsigned refs[], size_t n,
                                  const int values[]) {
    (void)refs, (void)values;
    return no_values(self, n, "Boolean");
}
FMI_API fmi2Status fmi2GetString(void *self, const unsigned refs[], size_t n,
                                 fmi2String values[]) {
    (void)refs, (void)values;
    return no_values(self, n, "String");
}
FMI_API fmi2Status fmi2SetString(void *self, const unsigned refs[], size_t n,
                                 const fmi2String values[]) {
    (void)refs, (void)values;
    return no_values(self, n, "String");
}

FMI_API fmi2Status fmi2GetFMUstate(void *self, void **state) {
    (void)state;
    return unsupported(self, "fmi2GetFMUstate");
}
FMI_API fmi2Status fmi2SetFMUstate(void *self, void *state) {
    (void)state;
    return unsupported(self, "fmi2SetFMUstate");
}
FMI_API fmi2Status fmi2FreeFMUstate(void *self, void **state) {
    (void)state;
    return unsupported(self, "fmi2FreeFMUstate");
}
FMI_API fmi2Status fmi2SerializedFMUstateSize(void *self, void *state, size_t *size) {
    (void)state, (void)size;
    return unsupported(self, "fmi2SerializedFMUstateSize");
}
FMI_API fmi2Status fmi2SerializeFMUstate(void *self, void *state, char bytes[], size_t size) {
    (void)state, (void)bytes, (void)size;
    return unsupported(self, "fmi2SerializeFMUstate");
}
FMI_API fmi2Status fmi2DeSerializeFMUstate(void *self, const char bytes[], size_t size,
                                           void **state) {
    (void)bytes, (void)size, (void)state;
    return unsupported(self, "fmi2DeSerializeFMUstate");
}

FMI_API fmi2Status fmi2GetDirectionalDerivative(void *self, const unsigned unknown[], size_t n,
                                                const unsigned known[], size_t m,
                                                const double seed[], double values[]) {
    (void)unknown, (void)n, (void)known, (void)m, (void)seed, (void)values;
    return unsupported(self, "fmi2GetDirectionalDerivative");
}

/* The rate of a force on a site: it is then linear over the next step. */
FMI_API fmi2Status fmi2SetRealInputDerivatives(void *self, const unsigned refs[], size_t n,
                                               const int order[], const double values[]) {
    instance *of = self;
    if (!allowed(of, "fmi2SetRealInputDerivatives", LIVING))
        return FMI_ERROR;
    for (size_t k = 0; k < n; k++) {
        if (order[k] != 1 || refs[k] < 1 || (int64_t)refs[k] > n_inputs(of) || !isfinite(values[k]))
            return failure(of, "inputs have finite derivatives of order 1 alone.");
        axm_set_input(of->run, (int)refs[k] - 1, axm_input(of->run, (int)refs[k] - 1), values[k]);
    }
    return FMI_OK;
}
FMI_API fmi2Status fmi2GetRealOutputDerivatives(void *self, const unsigned refs[], size_t n,
                                                const int order[], double values[]) {
    (void)refs, (void)n, (void)order, (void)values;
    return unsupported(self, "fmi2GetRealOutputDerivatives");
}

FMI_API fmi2Status fmi2DoStep(void *self, double at, double h, fmi2Boolean no_return) {
    (void)no_return;
    return do_step(self, at, h);
}
FMI_API fmi2Status fmi2CancelStep(void *self) { return unsupported(self, "fmi2CancelStep"); }

/* Steps are over when fmi2DoStep returns: there is nothing to ask for. */
FMI_API fmi2Status fmi2GetStatus(void *self, int kind, fmi2Status *value) {
    (void)self, (void)kind, (void)value;
    return FMI_DISCARD;
}
FMI_API fmi2Status fmi2GetRealStatus(void *self, int kind, double *value) {
    if (self == NULL || kind != 2 || value == NULL) /* the last time that was reached */
        return FMI_DISCARD;
    *value = ((instance *)self)->start + axm_time(((instance *)self)->run);
    return FMI_OK;
}
FMI_API fmi2Status fmi2GetIntegerStatus(void *self, int kind, int *value) {
    (void)self, (void)kind, (void)value;
    return FMI_DISCARD;
}
FMI_API fmi2Status fmi2GetBooleanStatus(void *self, int kind, fmi2Boolean *value) {
    if (self == NULL || kind != 3 || value == NULL) /* terminated */
        return FMI_DISCARD;
    *value = ((instance *)self)->phase == FAILED;
    return FMI_OK;
}
FMI_API fmi2Status fmi2GetStringStatus(void *self, int kind, fmi2String *value) {
    (void)self, (void)kind, (void)value;
    return FMI_DISCARD;
}
