/* Damaged model files, and calls of the FMI functions in any order.
 *
 * With -DFUZZER the entry of libFuzzer; alone a program for sanitizers: exports_fuzz FOLDER [COUNT]
 * runs COUNT random inputs and ends with 0. FOLDER (of libFuzzer: $MODEL_FOLDER) is that of a
 * model.aom. */
#define _POSIX_C_SOURCE 200809L
#include "../../csrc/export/fmu.c"

static char *whole; /* the sound file */
static size_t whole_size;
static const char *folder;

static void say(void *environment, const char *name, int status, const char *kind,
                const char *text, ...) {
    (void)environment, (void)name, (void)status, (void)kind, (void)text;
}

static void load(void) {
    char path[4096];
    resource_path(folder, "model.aom", path, sizeof path);
    FILE *stream = fopen(path, "rb");
    if (stream == NULL)
        exit(2);
    whole = malloc(1 << 20);
    whole_size = fread(whole, 1, 1 << 20, stream);
    fclose(stream);
}

/* Bytes of the file are set (place, value), the file is cut or goes on; its checksum is right or not. */
static void damaged_file(const uint8_t *data, size_t size) {
    char *bytes = malloc(whole_size + 8);
    memset(bytes, 0, whole_size + 8);
    memcpy(bytes, whole, whole_size);
    size_t length = whole_size;
    if (size > 1 && data[0] & 4)
        length = data[1] < 8 ? whole_size + data[1] : (whole_size * data[1]) / 256;
    for (size_t k = 2; k + 3 < size; k += 3)
        bytes[(data[k] + 256u * data[k + 1]) % whole_size] = (char)data[k + 2];
    if (data[0] & 2 && length >= sizeof(uint64_t)) {
        uint64_t sum = axm_checksum(bytes, length - sizeof sum);
        memcpy(bytes + length - sizeof sum, &sum, sizeof sum);
    }
    FILE *stream = fmemopen(bytes, length > 0 ? length : 1, "rb");
    model_file file;
    memset(&file, 0, sizeof file);
    if (stream != NULL && read_body(&file, stream)) {
        file.model.options.max_steps = 300;
        file.model.options.max_contacts = 300;
        size_t room = axm_size(&file.model);
        void *memory = room < 100000000 ? malloc(room) : NULL;
        axm_run *run;
        if (memory != NULL && axm_create(&file.model, memory, room, &run) == AOM_DONE)
            for (int k = 1; k < 4 && axm_advance(run, 1e-4 * k) == AOM_DONE; k++)
                for (int i = 0; i < file.model.n_outputs; i++)
                    (void)axm_output(run, i);
        free(memory);
    }
    free_model(&file);
    if (stream != NULL)
        fclose(stream);
    free(bytes);
}

static void calls(const uint8_t *data, size_t size) {
    fmi2Callbacks callbacks = {(fmi2_logger)say, NULL, NULL, NULL, NULL};
    char token[TOKEN + 1] = {0};
    memcpy(token, whole + 8 + N_COUNTS * sizeof(int32_t), TOKEN);
    void *some[2] = {fmi2Instantiate("a", 1, token, folder, &callbacks, 0, 0),
                     fmi2Instantiate("b", 1, token, folder, &callbacks, 0, 0)};
    double at = 0.0;
    for (size_t k = 1; k + 3 < size && some[0] != NULL && some[1] != NULL; k += 4) {
        void *self = some[data[k] & 1];
        unsigned refs[2] = {data[k + 2], data[k + 3]};
        double values[2] = {0.1 * data[k + 2], data[k + 3] == 255 ? NAN : -0.1 * data[k + 3]};
        double h = 1e-6 * data[k + 2];
        switch ((data[k] >> 1) % 10) {
        case 0:
            fmi2SetupExperiment(self, 0, 0.0, values[0] - 1.0, data[k + 1] & 1, values[1]);
            break;
        case 1:
            fmi2EnterInitializationMode(self);
            break;
        case 2:
            fmi2ExitInitializationMode(self);
            break;
        case 3:
        case 4:
            fmi2GetReal(self, (unsigned[]){0}, 1, &at);
            fmi2DoStep(self, data[k + 1] == 0 ? values[1] : at, h, 1);
            break;
        case 5:
            fmi2GetReal(self, refs, 2, values);
            break;
        case 6:
            fmi2SetReal(self, refs, 2, values);
            break;
        case 7:
            fmi2Terminate(self);
            break;
        case 8:
            fmi2Reset(self);
            break;
        default: {
            unsigned ref = data[k + 2];
            int order = 1;
            fmi2SetRealInputDerivatives(self, &ref, 1, &order, values);
            fmi2EnterInitializationMode(self);
            fmi2ExitInitializationMode(self);
        }
        }
    }
    fmi2FreeInstance(some[0]);
    fmi2FreeInstance(some[1]);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (whole == NULL) {
        folder = folder != NULL ? folder : getenv("MODEL_FOLDER");
        load();
    }
    if (size > 0 && data[0] & 1)
        damaged_file(data, size);
    else if (size > 0)
        calls(data, size);
    return 0;
}

#ifndef FUZZER
int main(int count, char **given) {
    folder = count > 1 ? given[1] : ".";
    uint64_t seed = 1;
    for (int n = count > 2 ? atoi(given[2]) : 1000; n > 0; n--) {
        uint8_t data[256];
        for (size_t k = 0; k < sizeof data; k++) {
            seed = seed * 6364136223846793005u + 1442695040888963407u;
            data[k] = (uint8_t)(seed >> 56);
        }
        LLVMFuzzerTestOneInput(data, 2 + (size_t)(seed >> 40) % (sizeof data - 2));
    }
    free(whole);
    return 0;
}
#endif
