/* The functions of FMI 3.0 for co-simulation. Part of fmu.c. */

typedef int fmi3Status;
typedef bool fmi3Boolean;
typedef const char *fmi3String;

FMI_API const char *fmi3GetVersion(void) { return "3.0"; }

FMI_API fmi3Status fmi3SetDebugLogging(void *self, fmi3Boolean on, size_t n,
                                       const fmi3String categories[]) {
    (void)on, (void)n, (void)categories;
    return self == NULL ? FMI_ERROR : FMI_OK;
}

FMI_API void *fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3Boolean event_mode, fmi3Boolean early_return,
                                          const uint32_t required[], size_t n_required,
                                          void *environment, fmi3_logger logger,
                                          void *intermediate_update) {
    (void)visible, (void)logging, (void)event_mode, (void)early_return, (void)required;
    (void)n_required, (void)intermediate_update;
    return new_instance(name, token, resources, environment, NULL, logger);
}
FMI_API void *fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                           fmi3Boolean visible, fmi3Boolean logging,
                                           void *environment, fmi3_logger logger) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)environment;
    (void)logger;
    return NULL;
}
FMI_API void *fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token,
                                                fmi3String resources, fmi3Boolean visible,
                                                fmi3Boolean logging, void *environment,
                                                fmi3_logger logger, void *clock_update, void *lock,
                                                void *unlock) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)environment;
    (void)logger, (void)clock_update, (void)lock, (void)unlock;
    return NULL;
}
FMI_API void fmi3FreeInstance(void *self) { free_instance(self); }

FMI_API fmi3Status fmi3EnterInitializationMode(void *self, fmi3Boolean has_tolerance,
                                               double tolerance, double start, fmi3Boolean has_stop,
                                               double stop) {
    (void)has_tolerance, (void)tolerance; /* the tolerance of the export is kept */
    int status = begin(self, "fmi3EnterInitializationMode");
    return status == FMI_OK ? set_experiment(self, start, has_stop, stop) : status;
}
FMI_API fmi3Status fmi3ExitInitializationMode(void *self) {
    return finish_begin(self, "fmi3ExitInitializationMode");
}
FMI_API fmi3Status fmi3Terminate(void *self) { return terminate(self, "fmi3Terminate"); }
FMI_API fmi3Status fmi3Reset(void *self) { return reset(self, "fmi3Reset"); }

FMI_API fmi3Status fmi3GetFloat64(void *self, const uint32_t refs[], size_t n, double values[],
                                  size_t n_values) {
    return n_values < n ? FMI_ERROR : get_values(self, refs, n, values);
}
FMI_API fmi3Status fmi3SetFloat64(void *self, const uint32_t refs[], size_t n,
                                  const double values[], size_t n_values) {
    return n_values < n ? FMI_ERROR : set_and_start(self, refs, n, values);
}
FMI_API fmi3Status fmi3GetFloat32(void *self, const uint32_t refs[], size_t n, float values[],
                                  size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "Float32");
}
FMI_API fmi3Status fmi3SetFloat32(void *self, const uint32_t refs[], size_t n, const float values[],
                                  size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "Float32");
}
FMI_API fmi3Status fmi3GetInt8(void *self, const uint32_t refs[], size_t n, int8_t values[],
                               size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "Int8");
}
FMI_API fmi3Status fmi3SetInt8(void *self, const uint32_t refs[], size_t n, const int8_t values[],
                               size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "Int8");
}
FMI_API fmi3Status fmi3GetUInt8(void *self, const uint32_t refs[], size_t n, uint8_t values[],
                                size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "UInt8");
}
FMI_API fmi3Status fmi3SetUInt8(void *self, const uint32_t refs[], size_t n, const uint8_t values[],
                                size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "UInt8");
}
FMI_API fmi3Status fmi3GetInt16(void *self, const uint32_t refs[], size_t n, int16_t values[],
                                size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "Int16");
}
FMI_API fmi3Status fmi3SetInt16(void *self, const uint32_t refs[], size_t n, const int16_t values[],
                                size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "Int16");
}
FMI_API fmi3Status fmi3GetUInt16(void *self, const uint32_t refs[], size_t n, uint16_t values[],
                                 size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "UInt16");
}
FMI_API fmi3Status fmi3SetUInt16(void *self, const uint32_t refs[], size_t n,
                                 const uint16_t values[], size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "UInt16");
}
FMI_API fmi3Status fmi3GetInt32(void *self, const uint32_t refs[], size_t n, int32_t values[],
                                size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "Int32");
}
FMI_API fmi3Status fmi3SetInt32(void *self, const uint32_t refs[], size_t n, const int32_t values[],
                                size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "Int32");
}
FMI_API fmi3Status fmi3GetUInt32(void *self, const uint32_t refs[], size_t n, uint32_t values[],
                                 size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "UInt32");
}
FMI_API fmi3Status fmi3SetUInt32(void *self, const uint32_t refs[], size_t n,
                                 const uint32_t values[], size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "UInt32");
}
FMI_API fmi3Status fmi3GetInt64(void *self, const uint32_t refs[], size_t n, int64_t values[],
                                size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "Int64");
}
FMI_API fmi3Status fmi3SetInt64(void *self, const uint32_t refs[], size_t n, const int64_t values[],
                                size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "Int64");
}
FMI_API fmi3Status fmi3GetUInt64(void *self, const uint32_t refs[], size_t n, uint64_t values[],
                                 size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "UInt64");
}
FMI_API fmi3Status fmi3SetUInt64(void *self, const uint32_t refs[], size_t n,
                                 const uint64_t values[], size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "UInt64");
}
FMI_API fmi3Status fmi3GetBoolean(void *self, const uint32_t refs[], size_t n, fmi3Boolean values[],
                                  size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "Boolean");
}
FMI_API fmi3Status fmi3SetBoolean(void *self, const uint32_t refs[], size_t n,
                                  const fmi3Boolean values[], size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "Boolean");
}
FMI_API fmi3Status fmi3GetString(void *self, const uint32_t refs[], size_t n, fmi3String values[],
                                 size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "String");
}
FMI_API fmi3Status fmi3SetString(void *self, const uint32_t refs[], size_t n,
                                 const fmi3String values[], size_t n_values) {
    (void)refs, (void)values, (void)n_values;
    return no_values(self, n, "String");
}
FMI_API fmi3Status fmi3GetBinary(void *self, const uint32_t refs[], size_t n, size_t sizes[],
                                 const uint8_t *values[], size_t n_values) {
    (void)refs, (void)sizes, (void)values, (void)n_values;
    return no_values(self, n, "Binary");
}
FMI_API fmi3Status fmi3SetBinary(void *self, const uint32_t refs[], size_t n, const size_t sizes[],
                                 const uint8_t *const values[], size_t n_values) {
    (void)refs, (void)sizes, (void)values, (void)n_values;
    return no_values(self, n, "Binary");
}
FMI_API fmi3Status fmi3GetClock(void *self, const uint32_t refs[], size_t n, fmi3Boolean values[]) {
    (void)refs, (void)values;
    return no_values(self, n, "Clock");
}
FMI_API fmi3Status fmi3SetClock(void *self, const uint32_t refs[], size_t n,
                                const fmi3Boolean values[]) {
    (void)refs, (void)values;
    return no_values(self, n, "Clock");
}
FMI_API fmi3Status fmi3GetFMUState(void *self, void **state) {
    return fmi2GetFMUstate(self, state);
}
FMI_API fmi3Status fmi3SetFMUState(void *self, void *state) {
    return fmi2SetFMUstate(self, state);
}
FMI_API fmi3Status fmi3FreeFMUState(void *self, void **state) {
    return fmi2FreeFMUstate(self, state);
}
FMI_API fmi3Status fmi3SerializedFMUStateSize(void *self, void *state, size_t *size) {
    return fmi2SerializedFMUstateSize(self, state, size);
}
FMI_API fmi3Status fmi3SerializeFMUState(void *self, void *state, uint8_t bytes[], size_t size) {
    return fmi2SerializeFMUstate(self, state, (char *)bytes, size);
}
FMI_API fmi3Status fmi3DeserializeFMUState(void *self, const uint8_t bytes[], size_t size,
                                           void **state) {
    return fmi2DeSerializeFMUstate(self, (const char *)bytes, size, state);
}

FMI_API fmi3Status fmi3DoStep(void *self, double at, double h, fmi3Boolean no_return,
                              fmi3Boolean *event, fmi3Boolean *terminated, fmi3Boolean *early,
                              double *last) {
    (void)no_return;
    int status = do_step(self, at, h);
    if (event != NULL)
        *event = false;
    if (terminated != NULL)
        *terminated = false;
    if (early != NULL)
        *early = false;
    if (last != NULL && self != NULL)
        *last = ((instance *)self)->start + axm_time(((instance *)self)->run);
    return status;
}
FMI_API fmi3Status fmi3EnterStepMode(void *self) { /* of FMUs with events: this is in it */
    return allowed(self, "fmi3EnterStepMode", IN(STEPPING)) ? FMI_OK : FMI_ERROR;
}

/* ---- what this FMU does not have */

FMI_API fmi3Status fmi3GetNumberOfVariableDependencies(void *self, uint32_t ref, size_t *n) {
    (void)ref, (void)n;
    return unsupported(self, "fmi3GetNumberOfVariableDependencies");
}
FMI_API fmi3Status fmi3GetVariableDependencies(void *self, uint32_t ref, size_t of[], uint32_t on[],
                                               size_t on_element[], int kinds[], size_t n) {
    (void)ref, (void)of, (void)on, (void)on_element, (void)kinds, (void)n;
    return unsupported(self, "fmi3GetVariableDependencies");
}
FMI_API fmi3Status fmi3GetDirectionalDerivative(void *self, const uint32_t unknown[], size_t n,
                                                const uint32_t known[], size_t m,
                                                const double seed[], size_t n_seed, double values[],
                                                size_t n_values) {
    (void)unknown, (void)n, (void)known, (void)m, (void)seed, (void)n_seed, (void)values,
        (void)n_values;
    return unsupported(self, "fmi3GetDirectionalDerivative");
}
FMI_API fmi3Status fmi3GetAdjointDerivative(void *self, const uint32_t unknown[], size_t n,
                                            const uint32_t known[], size_t m, const double seed[],
                                            size_t n_seed, double values[], size_t n_values) {
    (void)unknown, (void)n, (void)known, (void)m, (void)seed, (void)n_seed, (void)values,
        (void)n_values;
    return unsupported(self, "fmi3GetAdjointDerivative");
}
FMI_API fmi3Status fmi3EnterConfigurationMode(void *self) {
    return unsupported(self, "fmi3EnterConfigurationMode");
}
FMI_API fmi3Status fmi3ExitConfigurationMode(void *self) {
    return unsupported(self, "fmi3ExitConfigurationMode");
}
FMI_API fmi3Status fmi3EnterEventMode(void *self) {
    return unsupported(self, "fmi3EnterEventMode");
}
FMI_API fmi3Status fmi3GetIntervalDecimal(void *self, const uint32_t refs[], size_t n,
                                          double values[], int qualifiers[]) {
    (void)refs, (void)n, (void)values, (void)qualifiers;
    return unsupported(self, "fmi3GetIntervalDecimal");
}
FMI_API fmi3Status fmi3GetIntervalFraction(void *self, const uint32_t refs[], size_t n,
                                           uint64_t counters[], uint64_t resolutions[],
                                           int qualifiers[]) {
    (void)refs, (void)n, (void)counters, (void)resolutions, (void)qualifiers;
    return unsupported(self, "fmi3GetIntervalFraction");
}
FMI_API fmi3Status fmi3GetShiftDecimal(void *self, const uint32_t refs[], size_t n,
                                       double values[]) {
    (void)refs, (void)n, (void)values;
    return unsupported(self, "fmi3GetShiftDecimal");
}
FMI_API fmi3Status fmi3GetShiftFraction(void *self, const uint32_t refs[], size_t n,
                                        uint64_t counters[], uint64_t resolutions[]) {
    (void)refs, (void)n, (void)counters, (void)resolutions;
    return unsupported(self, "fmi3GetShiftFraction");
}
FMI_API fmi3Status fmi3SetIntervalDecimal(void *self, const uint32_t refs[], size_t n,
                                          const double values[]) {
    (void)refs, (void)n, (void)values;
    return unsupported(self, "fmi3SetIntervalDecimal");
}
FMI_API fmi3Status fmi3SetIntervalFraction(void *self, const uint32_t refs[], size_t n,
                                           const uint64_t counters[],
                                           const uint64_t resolutions[]) {
    (void)refs, (void)n, (void)counters, (void)resolutions;
    return unsupported(self, "fmi3SetIntervalFraction");
}
FMI_API fmi3Status fmi3SetShiftDecimal(void *self, const uint32_t refs[], size_t n,
                                       const double values[]) {
    (void)refs, (void)n, (void)values;
    return unsupported(self, "fmi3SetShiftDecimal");
}
FMI_API fmi3Status fmi3SetShiftFraction(void *self, const uint32_t refs[], size_t n,
                                        const uint64_t counters[], const uint64_t resolutions[]) {
    (void)refs, (void)n, (void)counters, (void)resolutions;
    return unsupported(self, "fmi3SetShiftFraction");
}
FMI_API fmi3Status fmi3EvaluateDiscreteStates(void *self) {
    return unsupported(self, "fmi3EvaluateDiscreteStates");
}
FMI_API fmi3Status fmi3UpdateDiscreteStates(void *self, fmi3Boolean *again,
                                            fmi3Boolean *terminate_now, fmi3Boolean *nominals,
                                            fmi3Boolean *values, fmi3Boolean *has_next,
                                            double *next_event) {
    (void)again, (void)terminate_now, (void)nominals, (void)values, (void)has_next,
        (void)next_event;
    return unsupported(self, "fmi3UpdateDiscreteStates");
}
FMI_API fmi3Status fmi3EnterContinuousTimeMode(void *self) {
    return unsupported(self, "fmi3EnterContinuousTimeMode");
}
FMI_API fmi3Status fmi3CompletedIntegratorStep(void *self, fmi3Boolean no_set, fmi3Boolean *event,
                                               fmi3Boolean *stop) {
    (void)no_set, (void)event, (void)stop;
    return unsupported(self, "fmi3CompletedIntegratorStep");
}
FMI_API fmi3Status fmi3SetTime(void *self, double time) {
    (void)time;
    return unsupported(self, "fmi3SetTime");
}
FMI_API fmi3Status fmi3SetContinuousStates(void *self, const double states[], size_t n) {
    (void)states, (void)n;
    return unsupported(self, "fmi3SetContinuousStates");
}
FMI_API fmi3Status fmi3GetContinuousStateDerivatives(void *self, double values[], size_t n) {
    (void)values, (void)n;
    return unsupported(self, "fmi3GetContinuousStateDerivatives");
}
FMI_API fmi3Status fmi3GetEventIndicators(void *self, double values[], size_t n) {
    (void)values, (void)n;
    return unsupported(self, "fmi3GetEventIndicators");
}
FMI_API fmi3Status fmi3GetContinuousStates(void *self, double values[], size_t n) {
    (void)values, (void)n;
    return unsupported(self, "fmi3GetContinuousStates");
}
FMI_API fmi3Status fmi3GetNominalsOfContinuousStates(void *self, double values[], size_t n) {
    (void)values, (void)n;
    return unsupported(self, "fmi3GetNominalsOfContinuousStates");
}
FMI_API fmi3Status fmi3GetNumberOfEventIndicators(void *self, size_t *n) {
    (void)n;
    return unsupported(self, "fmi3GetNumberOfEventIndicators");
}
FMI_API fmi3Status fmi3GetNumberOfContinuousStates(void *self, size_t *n) {
    (void)n;
    return unsupported(self, "fmi3GetNumberOfContinuousStates");
}
FMI_API fmi3Status fmi3GetOutputDerivatives(void *self, const uint32_t refs[], size_t n,
                                            const int orders[], double values[], size_t n_values) {
    (void)refs, (void)n, (void)orders, (void)values, (void)n_values;
    return unsupported(self, "fmi3GetOutputDerivatives");
}
FMI_API fmi3Status fmi3ActivateModelPartition(void *self, uint32_t clock, double time) {
    (void)clock, (void)time;
    return unsupported(self, "fmi3ActivateModelPartition");
}
