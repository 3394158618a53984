/* A force model in C that is right as it stands: a spring to home whose stiffness may change while it is felt. Each macro
 * makes one mistake, which `flotor validate` has to find; PRINTS is none. */
#include "../fixture.h"
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

DESCRIPTION("model", bad_model, "fixture-c-bad-model", "Bad model", "A spring with a mistake");

#if defined(SAVES) || defined(SAVES_NOTHING)
#define INTEGRATES_AND_RESETS
#endif

#if defined(INTEGRATES) || defined(INTEGRATES_AND_RESETS)
#define MEMORY FlotorMemory_PathDependent
#else
#define MEMORY FlotorMemory_Stateless
#endif

typedef struct {
    double stiffness_n_per_m;
    double way_m_s; /* height integrated over time */
} Spring;

#ifdef TEXT_OF_BYTES
#define DOC {(const uint8_t *)"Stiffness \xff", 11}
#elif defined(TEXT_WITHOUT_END)
#define DOC {(const uint8_t *)"Stiffness", (size_t)1 << 50}
#elif defined(TEXT_NOWHERE)
#define DOC {NULL, 9}
#else
#define DOC FLOTOR_STR("Stiffness of the spring")
#endif
#ifdef CHOICES_WITHOUT_END
static const FlotorStr word = FLOTOR_STR("one");
#define CHOICES {&word, (size_t)1 << 50}
#else
#define CHOICES {NULL, 0}
#endif

static const FlotorParameter parameters[] = {
    {.id = FLOTOR_STR("stiffness_n_per_m"), .unit = FLOTOR_STR("N/m"), .doc = DOC, .choices = CHOICES,
     .kind = FlotorParameterKind_Real, .mutability = FlotorMutability_Live, .min = 0.0, .max = 2000.0, .default_ = 500.0},
};

static uint32_t create(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)message;
#ifdef PRINTS
    for (int line = 0; line < 4000; line++) {
        puts("a model that says a lot, far more than a pipe holds");
    }
    fflush(stdout);
#endif
    Spring *spring = calloc(1, sizeof *spring);
    if (spring == NULL) {
        return FlotorRefusalKind_Resource;
    }
    spring->stiffness_n_per_m = count > 0 ? values[count - 1].number : parameters[0].default_;
    *out = spring;
    return 0;
}

static void destroy(FlotorInstance instance) {
    free(instance);
}

#ifdef STARTS_THREADS
static void *nothing(void *argument) {
    return argument;
}
#endif

static uint32_t step(FlotorInstance instance, const FlotorInput *input, FlotorOutput *output) {
    Spring *spring = instance;
    const double *position_m = input->pose.position_m;
    const double *velocity_m_per_s = input->twist.linear_m_per_s;
    memset(output, 0, sizeof *output);
    output->energy_j = NAN;
    bool is_finite = true;
    for (int axis = 0; axis < 7; axis++) {
        is_finite = is_finite && isfinite(axis < 3 ? position_m[axis] : input->pose.orientation_xyzw[axis - 3]);
    }
    if (!is_finite) {
        output->status = FlotorStepStatus_InvalidInput;
        return FlotorCallStatus_Ok;
    }
    double reached_m[3], square_m2 = 0.0;
    for (int axis = 0; axis < 3; axis++) {
        reached_m[axis] = fmax(fmin(position_m[axis], 0.1), -0.1);
        square_m2 += reached_m[axis] * reached_m[axis];
        output->wrench.force_n[axis] = -spring->stiffness_n_per_m * reached_m[axis];
    }
    bool moves = velocity_m_per_s[2] != 0.0;
    (void)moves;
    (void)square_m2;
#ifdef NAN_IN_MOTION
    if (moves) {
        output->wrench.force_n[0] = NAN;
    }
#endif
#ifdef CRASHES_IN_MOTION
    if (moves) {
        *(volatile int *)NULL = 1;
    }
#endif
#ifdef ALLOCATES
    void *volatile memory = malloc(100); /* volatile: or the compiler sees that nobody needs it */
    free(memory);
#endif
#ifdef OPENS_FILES
    FILE *file = fopen("/dev/null", "r");
    if (file != NULL) {
        fclose(file);
    }
#endif
#ifdef STARTS_THREADS
    pthread_t thread;
    if (pthread_create(&thread, NULL, nothing, NULL) == 0) {
        pthread_join(thread, NULL);
    }
#endif
#ifdef WRITES
    fprintf(stderr, "%g\n", output->wrench.force_n[2]);
#endif
#ifdef NEGATIVE_DAMPING
    for (int axis = 0; axis < 3; axis++) {
        output->wrench.force_n[axis] += 5.0 * velocity_m_per_s[axis];
    }
#endif
#ifdef FORCE_BY_DEMAND
    if (!(input->demand.bits & FLOTOR_DEMAND_TORQUE)) {
        output->wrench.force_n[2] *= 1.001;
    }
#endif
#ifdef DAMPING
    for (int axis = 0; axis < 3; axis++) {
        output->wrench.force_n[axis] -= 5.0 * velocity_m_per_s[axis];
    }
#endif
#ifdef WHIRLS
    output->wrench.force_n[0] -= 50.0 * reached_m[1];
    output->wrench.force_n[1] += 50.0 * reached_m[0];
#endif
#if defined(INTEGRATES) || defined(INTEGRATES_AND_RESETS)
    spring->way_m_s += reached_m[2] * 1.0e-9 * (double)input->dt_ns;
    output->wrench.force_n[2] -= 10.0 * spring->way_m_s;
#endif
#ifdef LOCAL
    if (sqrt(square_m2) > 0.002) {
        memset(&output->wrench, 0, sizeof output->wrench);
    }
#endif
    return FlotorCallStatus_Ok;
}

#ifndef LIVE_WITHOUT_SETTER
static uint32_t set_parameter(FlotorInstance instance, uint32_t index, double value) {
    Spring *spring = instance;
#ifdef FOLLOWS_INDICES
    if (index >= sizeof parameters / sizeof *parameters) {
        abort(); /* what an array out of bounds may do */
    }
#endif
    if (index != 0 || !(value >= parameters[0].min && value <= parameters[0].max)) {
        return FlotorCallStatus_OutOfRange;
    }
#ifdef ABORTS_WHEN_SET
    abort();
#endif
#ifdef REFUSES_WHEN_SET
    return FlotorCallStatus_OutOfRange;
#endif
#ifndef FORGETS_WHAT_IS_SET
    spring->stiffness_n_per_m = value;
#endif
    (void)spring;
    return FlotorCallStatus_Ok;
}
#endif

static double parameter(FlotorInstance instance, uint32_t index) {
    const Spring *spring = instance;
#ifdef FOLLOWS_INDICES
    if (index != 0) {
        abort();
    }
#endif
    return index == 0 ? spring->stiffness_n_per_m : NAN;
}

#if defined(INTEGRATES_AND_RESETS)
static uint32_t reset(FlotorInstance instance) {
    Spring *spring = instance;
    spring->way_m_s = 0.0;
    return FlotorCallStatus_Ok;
}
#endif

static const FlotorForceTable table = {
    .size = sizeof(FlotorForceTable),
#ifdef PARAMETERS_WITHOUT_END
    .parameter_count = 1000000,
#else
    .parameter_count = 1,
#endif
#ifndef PARAMETERS_NOWHERE
    .parameters = parameters,
#endif
#ifdef OTHER_ID
    .info = {.id = FLOTOR_STR("fixture-c-other-model"),
#else
    .info = {.id = FLOTOR_STR("fixture-c-bad-model"),
#endif
             .name = FLOTOR_STR("Bad model"),
             .doc = FLOTOR_STR("A spring with a mistake"),
             .serves = {FLOTOR_DEMAND_FORCE | FLOTOR_DEMAND_TORQUE}, .memory = MEMORY},
    .create = create,
    .destroy = destroy,
    .step = step,
#ifndef LIVE_WITHOUT_SETTER
    .set_parameter = set_parameter,
#endif
    .parameter = parameter,
#if defined(INTEGRATES_AND_RESETS)
    .reset = reset,
#endif
};

#if defined(LOCAL) || defined(ACTS_OUTSIDE)
static uint32_t region(FlotorInstance instance, FlotorActiveRegion *out) {
    (void)instance;
    *out = (FlotorActiveRegion){.shape = 1, .half_sides_m = {0.002, 0.002, 0.002}};
    return FlotorCallStatus_Ok;
}

static const FlotorActiveRegionTable activity_table = {.size = sizeof(FlotorActiveRegionTable), .region = region};
#endif

#if defined(SAVES) || defined(SAVES_NOTHING)
#ifdef SAVES
enum { STATE_BYTES = sizeof(double) };
#else
enum { STATE_BYTES = 0 };
#endif

static uint32_t count(FlotorInstance instance, uint64_t *out) {
    (void)instance;
    *out = STATE_BYTES;
    return FlotorCallStatus_Ok;
}

static uint32_t save(FlotorInstance instance, uint8_t *bytes, uint64_t length) {
    const Spring *spring = instance;
    if (length != STATE_BYTES) {
        return FlotorCallStatus_OutOfRange;
    }
    memcpy(bytes, &spring->way_m_s, STATE_BYTES);
    return FlotorCallStatus_Ok;
}

static uint32_t restore(FlotorInstance instance, const uint8_t *bytes, uint64_t length) {
    Spring *spring = instance;
    if (length != STATE_BYTES) {
        return FlotorCallStatus_OutOfRange;
    }
    memcpy(&spring->way_m_s, bytes, STATE_BYTES);
    return FlotorCallStatus_Ok;
}

static const FlotorSnapshotTable snapshot_table = {
    .size = sizeof(FlotorSnapshotTable), .count = count, .save = save, .restore = restore};
#endif

static const void *get_interface(FlotorStr id) {
#if defined(SAVES) || defined(SAVES_NOTHING)
    if (is_called(id, FLOTOR_INTERFACE_SNAPSHOT)) {
        return &snapshot_table;
    }
#endif
#if defined(LOCAL) || defined(ACTS_OUTSIDE)
    if (is_called(id, FLOTOR_INTERFACE_ACTIVE_REGION)) {
        return &activity_table;
    }
#endif
    return is_called(id, FLOTOR_INTERFACE_FORCE) ? &table : NULL;
}

ENTRY(FlotorPluginKind_Model, bad_model);
