/* A force model in C that is right as it stands: a spring to home, 100 N/m. Each macro is a statement that runs at one place
 * of its life; `hang();` and `leave();` are there for it. */
#define _GNU_SOURCE
#include "fixture.h"
#include <math.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <locale.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#ifndef IN_INITIALISER
#define IN_INITIALISER (void)0;
#endif
#ifndef IN_CREATE
#define IN_CREATE (void)0;
#endif
#ifndef IN_PREPARE
#define IN_PREPARE (void)0;
#endif
#ifndef IN_STEP
#define IN_STEP (void)0;
#endif
#ifndef IN_DESTROY
#define IN_DESTROY (void)0;
#endif

static void hang(void) {
    for (;;) {
        pause();
    }
}

static void leave(void) {
    exit(0);
}

__attribute__((constructor)) static void initialise(void) {
    (void)hang, (void)leave;
    IN_INITIALISER
}

static uint32_t create(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)values, (void)count, (void)message;
    IN_CREATE
    *out = calloc(1, 1);
    return *out == NULL ? FlotorRefusalKind_Resource : 0;
}

static void destroy(FlotorInstance instance) {
    IN_DESTROY
    free(instance);
}

static uint32_t prepare(FlotorInstance instance, const FlotorLoopConfig *config, FlotorMessage *message) {
    (void)instance, (void)config, (void)message;
    IN_PREPARE
    return 0;
}

static uint32_t step(FlotorInstance instance, const FlotorInput *input, FlotorOutput *output) {
    (void)instance;
    memset(output, 0, sizeof *output);
    output->energy_j = NAN;
    IN_STEP
    for (int axis = 0; axis < 3; axis++) {
        output->wrench.force_n[axis] = -100.0 * input->pose.position_m[axis];
    }
    return FlotorCallStatus_Ok;
}

MODEL(model_that, "fixture-c-model-that", "Model that", "A spring with a habit", FlotorMemory_Stateless,
      .create = create, .destroy = destroy, .prepare = prepare, .step = step);
