/* A force model in C with a thread that ends the process FIXTURE_AT_MS milliseconds after the model is made, as the environment
 * variable FIXTURE_DEATH says. The model itself exerts no force. */
#define _GNU_SOURCE
#include "fixture.h"
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

static volatile int zero = 0;

static void *die(void *argument) {
    (void)argument;
    const char *death = getenv("FIXTURE_DEATH"), *at_ms = getenv("FIXTURE_AT_MS");
    long wait_ms = at_ms == NULL ? 0 : atol(at_ms);
    nanosleep(&(struct timespec){.tv_sec = wait_ms / 1000, .tv_nsec = wait_ms % 1000 * 1000000}, NULL);
    if (death == NULL) {
        return NULL;
    } else if (strcmp(death, "exit") == 0) {
        exit(0);
    } else if (strcmp(death, "_exit") == 0) {
        _exit(0);
    } else if (strcmp(death, "exec") == 0) {
        execl("/bin/true", "true", (char *)NULL);
    } else if (strcmp(death, "abort") == 0) {
        abort();
    } else if (strcmp(death, "segv") == 0) {
        *(volatile int *)(uintptr_t)zero = 1;
    }
    return NULL;
}

static void loop_at_exit(void) {
    while (zero == 0) {
    }
}

static uint32_t create(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)values, (void)count, (void)message;
    static int instance;
    pthread_t thread;
    *out = &instance;
    const char *death = getenv("FIXTURE_DEATH");
    if (death != NULL && strcmp(death, "atexit-loop") == 0) {
        atexit(loop_at_exit);
    }
    return pthread_create(&thread, NULL, die, NULL) == 0 ? 0 : 1;
}

static void destroy(FlotorInstance instance) {
    (void)instance;
}

static uint32_t step(FlotorInstance instance, const FlotorInput *input, FlotorOutput *output) {
    (void)instance, (void)input;
    memset(output, 0, sizeof *output);
    output->energy_j = NAN;
    return FlotorCallStatus_Ok;
}

MODEL(dies_early, "fixture-c-dies-early", "Dies early", "A thread that ends the process", FlotorMemory_Stateless,
      .create = create, .destroy = destroy, .step = step);
