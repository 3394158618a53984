/* A model in C that asks for anything: numbers of every size and none, by chance, changing its mind every now and then. At one step
 * it may end its process, or be late from then on. It offers a local linear field, which is as wild. */
#define _GNU_SOURCE
#include "../fixture.h"
#include <fenv.h>
#include <float.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

DESCRIPTION("model", wild, "fixture-wild", "Wild", "Asks for anything");

enum { SEED, SCALE, DEATH, AT, PARAMETERS };

#define DEATHS(X) X(none) X(segv) X(abort) X(fpe) X(exit) X(thread_exit) X(pthread_exit) X(stack) X(usr2) X(slow) X(panic)
#define DEATH_NAME(name) FLOTOR_STR(#name),
#define DEATH_ENUM(name) DEATH_##name,
enum { DEATHS(DEATH_ENUM) DEATH_COUNT };
static const FlotorStr deaths[] = {DEATHS(DEATH_NAME)};

#define NUMBER(name, least, most, usual, when)                                                                            \
    {.id = FLOTOR_STR(name), .doc = FLOTOR_STR(name), .kind = FlotorParameterKind_Real, .mutability = when, .min = least, \
     .max = most, .default_ = usual}

static const FlotorParameter parameters[PARAMETERS] = {
    [SEED] = NUMBER("seed", 0, 1e15, 0, FlotorMutability_Fixed),
    [SCALE] = NUMBER("scale", 0, 1e6, 10, FlotorMutability_Live),
    [DEATH] = {.id = FLOTOR_STR("death"), .doc = FLOTOR_STR("How it ends its process"), .choices = {deaths, DEATH_COUNT},
               .kind = FlotorParameterKind_Choice, .max = DEATH_COUNT - 1},
    [AT] = NUMBER("at", 0, 1e15, 0, FlotorMutability_Fixed),
};

typedef struct {
    double number[PARAMETERS];
    uint64_t random;
    uint64_t steps;
    int mood;
} Wild;

static volatile int zero = 0;

static double share(Wild *wild) {
    wild->random = wild->random * 6364136223846793005ULL + 1442695040888963407ULL;
    return (double)(wild->random >> 11) / 9007199254740992.0;
}

static uint32_t create(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)message;
    Wild *wild = calloc(1, sizeof *wild);
    for (uint32_t index = 0; index < PARAMETERS; index++) {
        wild->number[index] = parameters[index].default_;
    }
    for (uint32_t index = 0; index < count; index++) {
        wild->number[values[index].index] = values[index].number;
    }
    wild->random = (uint64_t)wild->number[SEED] * 2 + 1;
    *out = wild;
    return 0;
}

static void *leave(void *argument) {
    (void)argument;
    exit(0);
}

static int overflow(int depth) {
    volatile char frame[4096];
    frame[0] = (char)depth;
    return zero == 0 ? overflow(depth + 1) + frame[0] : 0;
}

static void loop_for(long ms) {
    struct timespec begin, now;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    do {
        clock_gettime(CLOCK_MONOTONIC, &now);
    } while ((now.tv_sec - begin.tv_sec) * 1000 + (now.tv_nsec - begin.tv_nsec) / 1000000 < ms);
}

static uint32_t die(int death) {
    pthread_t thread;
    switch (death) {
    case DEATH_segv: *(volatile int *)(uintptr_t)zero = 1; break;
    case DEATH_abort: abort(); break;
    case DEATH_fpe: raise(SIGFPE); break;
    case DEATH_exit: exit(0); break;
    case DEATH_thread_exit: pthread_create(&thread, NULL, leave, NULL), loop_for(100); break;
    case DEATH_pthread_exit: pthread_exit(NULL); break;
    case DEATH_stack: zero = overflow(0); break;
    case DEATH_usr2: kill(getpid(), SIGUSR2); break;
    case DEATH_slow: loop_for(3); break;
    case DEATH_panic: return FlotorCallStatus_Panicked;
    default: break;
    }
    return FlotorCallStatus_Ok;
}

/* One number of the mood it is in. */
static double any(Wild *wild) {
    static const double odd[] = {NAN, INFINITY, -INFINITY, 1e308, -1e308, 5e-324, DBL_MIN, DBL_MAX, -DBL_MAX, 1e154, 1e155, 0.0, -0.0};
    const double even = (2.0 * share(wild) - 1.0) * wild->number[SCALE];
    switch (wild->mood) {
    case 0: return even;
    case 1: return even * pow(10.0, 6.0 * share(wild) - 3.0);
    case 2: return share(wild) < 0.5 ? 1e3 * wild->number[SCALE] : -1e3 * wild->number[SCALE];
    case 3: return odd[(int)(share(wild) * (sizeof odd / sizeof *odd))];
    case 4: return share(wild) < 0.02 ? odd[(int)(share(wild) * (sizeof odd / sizeof *odd))] : even;
    case 5: return wild->number[SCALE];
    default: return 0.0;
    }
}

static void change_mood(Wild *wild) {
    if (share(wild) < 0.01) {
        wild->mood = (int)(7.0 * share(wild));
    }
}

static uint32_t step(FlotorInstance instance, const FlotorInput *input, FlotorOutput *output) {
    (void)input;
    Wild *wild = instance;
    wild->steps += 1;
    change_mood(wild);
    memset(output, 0, sizeof *output);
    output->energy_j = any(wild);
    for (int axis = 0; axis < 3; axis++) {
        output->wrench.force_n[axis] = any(wild);
        output->wrench.torque_nm[axis] = 0.1 * any(wild);
    }
    const double chance = share(wild);
    if (chance < 0.001) {
        output->status = (uint32_t)(1e4 * share(wild));
    } else if (chance < 0.002) {
        fesetround(share(wild) < 0.5 ? FE_UPWARD : FE_TONEAREST);
    }
    if (wild->number[AT] > 0.0 && wild->steps >= (uint64_t)wild->number[AT]) {
        return die((int)wild->number[DEATH]);
    }
    return FlotorCallStatus_Ok;
}

static uint32_t set_parameter(FlotorInstance instance, uint32_t index, double value) {
    Wild *wild = instance;
    if (share(wild) < 0.1) {
        return FlotorCallStatus_OutOfRange;
    }
    wild->number[index] = value;
    return FlotorCallStatus_Ok;
}

static double parameter(FlotorInstance instance, uint32_t index) {
    return ((Wild *)instance)->number[index];
}

static uint32_t linear_field(FlotorInstance instance, const FlotorInput *input, FlotorLinearField *field) {
    Wild *wild = instance;
    change_mood(wild);
    memset(field, 0, sizeof *field);
    field->anchor = input->pose;
    field->time_ns = input->time_ns;
    field->valid_m = 0.1 * fabs(any(wild));
    field->valid_rad = fabs(any(wild));
    for (int row = 0; row < 6; row++) {
        *(row < 3 ? &field->wrench.force_n[row] : &field->wrench.torque_nm[row - 3]) = any(wild);
        for (int column = 0; column < 6; column++) {
            field->stiffness[row][column] = 100.0 * any(wild);
        }
    }
    return FlotorCallStatus_Ok;
}

static const FlotorForceTable table = {
    .size = sizeof(FlotorForceTable),
    .parameter_count = PARAMETERS,
    .parameters = parameters,
    .info = {.id = FLOTOR_STR("fixture-wild"), .name = FLOTOR_STR("Wild"), .doc = FLOTOR_STR("Asks for anything"),
             .serves = {FLOTOR_DEMAND_FORCE | FLOTOR_DEMAND_TORQUE | FLOTOR_DEMAND_ENERGY},
             .memory = FlotorMemory_PathDependent},
    .create = create,
    .destroy = free,
    .step = step,
    .set_parameter = set_parameter,
    .parameter = parameter,
};

static const FlotorLinearFieldTable field_table = {.size = sizeof(FlotorLinearFieldTable), .linear_field = linear_field};

static const void *get_interface(FlotorStr id) {
    if (is_called(id, FLOTOR_INTERFACE_LINEAR_FIELD)) {
        return &field_table;
    }
    return is_called(id, FLOTOR_INTERFACE_FORCE) ? &table : NULL;
}

ENTRY(FlotorPluginKind_Model, wild);
