/* What the plugins of this folder share: a fault is chosen by the setting `fault`, and comes with the second step, read or write
 * where it is one of those. Everything here is wrong on purpose. */
#define _GNU_SOURCE
#include "../fixture.h"
#include <errno.h>
#include <fenv.h>
#include <float.h>
#include <math.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define FAULT_NAME(name) FLOTOR_STR(#name),
#define FAULT_ENUM(name) FAULT_##name,

/* The schema of a plugin whose faults are the list FAULTS(X). */
#define PLANTED_SCHEMA                                                                                                    \
    enum { FAULTS(FAULT_ENUM) FAULT_COUNT };                                                                              \
    static const FlotorStr fault_names[] = {FAULTS(FAULT_NAME)};                                                          \
    static const FlotorParameter parameters[] = {                                                                         \
        {.id = FLOTOR_STR("fault"), .doc = FLOTOR_STR("What goes wrong"), .choices = {fault_names, FAULT_COUNT},          \
         .kind = FlotorParameterKind_Choice, .min = 0.0, .max = FAULT_COUNT - 1, .default_ = 0.0},                        \
    };

static inline int chosen(const FlotorParameterValue *values, uint32_t count) {
    int fault = 0;
    for (uint32_t index = 0; index < count; index++) {
        if (values[index].index == 0) {
            fault = (int)values[index].number;
        }
    }
    return fault;
}

static volatile int forever = 1;

static inline void loop_for_ever(void) {
    while (forever) {
    }
}

static inline void crash(void) {
    int *volatile nowhere = NULL;
    *(volatile int *)nowhere = 1;
}

static inline void sleep_us(long us) {
    struct timespec time = {us / 1000000, us % 1000000 * 1000};
    nanosleep(&time, NULL);
}
