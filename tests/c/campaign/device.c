/* A device in C that a machine moves, and that writes down what the host does with it: each command and each step of its life, into a
 * file that outlives the process. It obeys: the force of the last command stays until the next one or a stop.
 *
 * Its handle goes round on its own, beyond the range too. Some samples are lost, some cannot be. SIMULATED makes it one that no
 * hand holds. */
#define _GNU_SOURCE
#include "../fixture.h"
#include <fcntl.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#ifdef SIMULATED
#define EMBODIMENT FlotorEmbodiment_Simulated
#else
#define EMBODIMENT FlotorEmbodiment_Physical
#endif

enum { LOG, SEED, LOST, IMPOSSIBLE, UNTAKEN, FAULT_AT, FORCE, TORQUE, SLEW, RANGE_MM, AMPLITUDE_MM, AXES, PARAMETERS };

#define NUMBER(name, least, most, usual)                                                                                  \
    {.id = FLOTOR_STR(name), .doc = FLOTOR_STR(name), .kind = FlotorParameterKind_Real, .min = least, .max = most, .default_ = usual}

static const FlotorParameter parameters[PARAMETERS] = {
    [LOG] = {.id = FLOTOR_STR("log"), .doc = FLOTOR_STR("file of the log"), .kind = FlotorParameterKind_Text},
    [SEED] = NUMBER("seed", 0, 1e15, 0),
    [LOST] = NUMBER("lost", 0, 1, 0),
    [IMPOSSIBLE] = NUMBER("impossible", 0, 1, 0),
    [UNTAKEN] = NUMBER("untaken", 0, 1, 0),
    [FAULT_AT] = NUMBER("fault_at", 0, 1e15, 0),
    [FORCE] = NUMBER("force", 0.01, 1000, 10),
    [TORQUE] = NUMBER("torque", 0.001, 100, 1),
    [SLEW] = NUMBER("slew", 1, 1e7, 1e4),
    [RANGE_MM] = NUMBER("range_mm", 1, 1000, 10),
    [AMPLITUDE_MM] = NUMBER("amplitude_mm", 0, 1000, 5),
    [AXES] = NUMBER("axes", 1, 63, 63),
};

/* 64 bytes of the file. */
typedef struct {
    uint32_t what;
    uint32_t reserved;
    uint64_t tick;
    double wrench[6];
} Entry;

enum { ACTIVATED = 1, COMMANDED, STOPPED, DEACTIVATED, CLOSED };
/* The file: an entry that says how many there are, then those. */
enum { MOST = 1 << 17 };

typedef struct {
    Entry *log;
    double number[PARAMETERS];
    uint64_t random;
    uint64_t period_ns;
    double frequency_hz[6], phase[6];
    bool active;
} Handle;

static double share(Handle *handle) {
    handle->random = handle->random * 6364136223846793005ULL + 1442695040888963407ULL;
    return (double)(handle->random >> 11) / 9007199254740992.0;
}

static void note(Handle *handle, uint32_t what, uint64_t tick, const FlotorWrench *wrench) {
    _Atomic uint64_t *count = (_Atomic uint64_t *)&handle->log[0].tick;
    uint64_t index = atomic_fetch_add(count, 1) + 1;
    if (index < MOST) {
        Entry *entry = &handle->log[index];
        entry->tick = tick;
        if (wrench != NULL) {
            memcpy(entry->wrench, wrench, sizeof entry->wrench);
        }
        entry->what = what;
    }
}

static uint32_t open_handle(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)message;
    Handle *handle = calloc(1, sizeof *handle);
    char path[4096] = {0};
    for (uint32_t index = LOG + 1; index < PARAMETERS; index++) {
        handle->number[index] = parameters[index].default_;
    }
    for (uint32_t index = 0; index < count; index++) {
        handle->number[values[index].index] = values[index].number;
        if (values[index].index == LOG && values[index].text.len < sizeof path) {
            memcpy(path, values[index].text.ptr, values[index].text.len);
        }
    }
    int file = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    if (file < 0 || ftruncate(file, MOST * sizeof(Entry)) != 0) {
        return FlotorRefusalKind_Resource;
    }
    handle->log = mmap(NULL, MOST * sizeof(Entry), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (handle->log == MAP_FAILED) {
        return FlotorRefusalKind_Resource;
    }
    handle->random = (uint64_t)handle->number[SEED] * 2 + 1;
    for (int axis = 0; axis < 6; axis++) {
        handle->frequency_hz[axis] = 0.2 + 12.0 * share(handle);
        handle->phase[axis] = 6.28 * share(handle);
    }
    *out = handle;
    return 0;
}

static void close_handle(FlotorInstance instance) {
    Handle *handle = instance;
    note(handle, CLOSED, 0, NULL);
    munmap(handle->log, MOST * sizeof(Entry));
    free(handle);
}

static uint32_t capabilities(FlotorInstance instance, FlotorCapabilities *out) {
    const Handle *handle = instance;
    const double range_m = handle->number[RANGE_MM] * 1e-3, force_n = handle->number[FORCE], torque_nm = handle->number[TORQUE];
    const uint32_t axes = (uint32_t)handle->number[AXES];
    *out = (FlotorCapabilities){
        .sensed = {FLOTOR_AXES_ALL},
        .actuated = {axes},
        .range_m = {range_m, range_m * 0.8, range_m * 1.2},
        .range_rad = {0.2, 0.2, 0.3},
        .max_force_slew_n_per_s = handle->number[SLEW],
        .max_torque_slew_nm_per_s = handle->number[SLEW] * 0.1,
        .max_stiffness_n_per_m = 1.0e4,
        .rate_hz = {100.0, 10000.0},
    };
    for (int axis = 0; axis < 3; axis++) {
        out->max_force_n[axis] = axes >> axis & 1 ? force_n * (1.0 + 0.5 * axis) : 0.0;
        out->max_torque_nm[axis] = axes >> (axis + 3) & 1 ? torque_nm * (2.0 - 0.5 * axis) : 0.0;
    }
    return FlotorCallStatus_Ok;
}

static uint32_t activate(FlotorInstance instance, const FlotorLoopConfig *config, FlotorMessage *message) {
    (void)message;
    Handle *handle = instance;
    handle->period_ns = config->period_ns;
    handle->active = true;
    note(handle, ACTIVATED, config->period_ns, NULL);
    return 0;
}

static uint32_t deactivate(FlotorInstance instance) {
    Handle *handle = instance;
    note(handle, DEACTIVATED, 0, NULL);
    bool was_active = handle->active;
    handle->active = false;
    return was_active ? (uint32_t)FlotorCallStatus_Ok : (uint32_t)FlotorCallStatus_WrongPhase;
}

static void spoil(Handle *handle, FlotorDeviceState *state) {
    double *position = state->pose.position_m, *orientation = state->pose.orientation_xyzw;
    switch ((int)(10.0 * share(handle))) {
    case 0: position[1] = NAN; break;
    case 1: position[2] = -1.0e30; break;
    case 2: orientation[0] = 1.0e10; break;
    case 3: memset(orientation, 0, 4 * sizeof *orientation); break;
    case 4: position[0] += 0.02; break;
    case 5: state->twist.linear_m_per_s[0] = 1.0e300; break;
    case 6: state->twist.angular_rad_per_s[2] = INFINITY; break;
    case 7: state->sampled_ns = UINT64_MAX; break;
    case 8: state->sampled_ns = 0; break;
    default: orientation[3] *= 1.01; break;
    }
}

static FlotorCycleCode read_handle(FlotorInstance instance, const FlotorTick *tick, FlotorDeviceState *state) {
    Handle *handle = instance;
    if (handle->number[FAULT_AT] > 0.0 && tick->index >= (uint64_t)handle->number[FAULT_AT]) {
        return FLOTOR_CYCLE_FAULT(FlotorFault_OverTemperature);
    }
    if (share(handle) < handle->number[LOST]) {
        return FLOTOR_CYCLE_STALE;
    }
    memset(state, 0, sizeof *state);
    const double time_s = (double)tick->time_ns * 1.0e-9, amplitude_m = handle->number[AMPLITUDE_MM] * 1e-3;
    double turn[3];
    for (int axis = 0; axis < 6; axis++) {
        const double rate = 6.283 * handle->frequency_hz[axis], angle = rate * time_s + handle->phase[axis];
        if (axis < 3) {
            state->pose.position_m[axis] = amplitude_m * sin(angle);
            state->twist.linear_m_per_s[axis] = amplitude_m * rate * cos(angle);
        } else {
            turn[axis - 3] = 0.1 * sin(angle);
            state->twist.angular_rad_per_s[axis - 3] = 0.2 * rate * cos(angle);
        }
    }
    memcpy(state->pose.orientation_xyzw, turn, sizeof turn);
    state->pose.orientation_xyzw[3] = sqrt(1.0 - turn[0] * turn[0] - turn[1] * turn[1] - turn[2] * turn[2]);
    state->sampled_ns = tick->time_ns;
    if (share(handle) < handle->number[IMPOSSIBLE]) {
        spoil(handle, state);
    }
    return FLOTOR_CYCLE_FRESH;
}

static FlotorCycleCode write_handle(FlotorInstance instance, const FlotorTick *tick, const FlotorWrench *wrench) {
    Handle *handle = instance;
    note(handle, COMMANDED, tick->index, wrench);
    return share(handle) < handle->number[UNTAKEN] ? FLOTOR_CYCLE_STALE : FLOTOR_CYCLE_FRESH;
}

static void safe_stop(FlotorInstance instance) {
    note(instance, STOPPED, 0, NULL);
}

DEVICE(logs, "fixture-logs", "Logs", "A handle that goes round, with a log",
       .info.embodiment = EMBODIMENT, .parameter_count = PARAMETERS, .parameters = parameters,
       .open = open_handle, .close = close_handle, .capabilities = capabilities, .activate = activate,
       .deactivate = deactivate, .read = read_handle, .write = write_handle, .safe_stop = safe_stop);
