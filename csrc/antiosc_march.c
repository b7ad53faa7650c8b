/* The library as one translation unit. */
#include "contact_step.c"
#include "crossings.c"
#include "flight.c"
#include "forces.c"
#include "laws.c"
#include "responses.c"
#include "runs.c"
#include "stepper.c"
