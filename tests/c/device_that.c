/* A device in C that is right as it stands: a handle at rest a millimetre below home. Each macro is a statement that runs at
 * one place of its life; `hang();` is there for it. */
#define _GNU_SOURCE
#include "flotor.h"
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

FLOTOR_METADATA("kind = \"device\"\nid = \"fixture-c-device-that\"\nname = \"Device that\"\ndoc = \"A handle with a habit\"\n"
                "version = \"0.1.0\"\nabi = \"" FLOTOR_CONTRACT "\"\nentry = \"flotor_entry_device_that\"\n");

#ifndef IN_OPEN
#define IN_OPEN (void)0;
#endif
#ifndef IN_ACTIVATE
#define IN_ACTIVATE (void)0;
#endif
#ifndef IN_READ
#define IN_READ (void)0;
#endif
#ifndef IN_WRITE
#define IN_WRITE (void)0;
#endif
#ifndef IN_STOP
#define IN_STOP (void)0;
#endif
#ifndef IN_DEACTIVATE
#define IN_DEACTIVATE (void)0;
#endif
#ifndef IN_CLOSE
#define IN_CLOSE (void)0;
#endif

typedef struct {
    FlotorWrench held;
    atomic_bool stopped;
    bool active;
} Handle;

static void hang(void) {
    for (;;) {
        pause();
    }
}

static uint32_t open_handle(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)values, (void)count, (void)message, (void)hang;
    IN_OPEN
    *out = calloc(1, sizeof(Handle));
    return *out == NULL ? FlotorRefusalKind_Resource : 0;
}

static void close_handle(FlotorInstance instance) {
    IN_CLOSE
    free(instance);
}

static uint32_t capabilities(FlotorInstance instance, FlotorCapabilities *out) {
    (void)instance;
    *out = (FlotorCapabilities){
        .sensed = {FLOTOR_AXES_ALL},
        .actuated = {FLOTOR_AXES_ALL},
        .range_m = {0.01, 0.01, 0.01},
        .range_rad = {0.1, 0.1, 0.1},
        .max_force_n = {10.0, 10.0, 10.0},
        .max_torque_nm = {1.0, 1.0, 1.0},
        .max_force_slew_n_per_s = 1.0e6,
        .max_torque_slew_nm_per_s = 1.0e6,
        .max_stiffness_n_per_m = 1.0e4,
        .rate_hz = {100.0, 10000.0},
    };
    return FlotorCallStatus_Ok;
}

static uint32_t activate(FlotorInstance instance, const FlotorLoopConfig *config, FlotorMessage *message) {
    (void)config, (void)message;
    IN_ACTIVATE
    Handle *handle = instance;
    memset(&handle->held, 0, sizeof handle->held);
    atomic_store(&handle->stopped, false);
    handle->active = true;
    return 0;
}

static uint32_t deactivate(FlotorInstance instance) {
    Handle *handle = instance;
    IN_DEACTIVATE
    if (!handle->active) {
        return FlotorCallStatus_WrongPhase;
    }
    handle->active = false;
    return FlotorCallStatus_Ok;
}

static FlotorCycleCode read_handle(FlotorInstance instance, const FlotorTick *tick, FlotorDeviceState *state) {
    const Handle *handle = instance;
    IN_READ
    memset(state, 0, sizeof *state);
    state->pose.position_m[2] = -0.001;
    state->pose.orientation_xyzw[3] = 1.0;
    state->sampled_ns = tick->time_ns;
    if (!atomic_load(&handle->stopped)) {
        state->delivered = handle->held;
    }
    return FLOTOR_CYCLE_FRESH;
}

static FlotorCycleCode write_handle(FlotorInstance instance, const FlotorTick *tick, const FlotorWrench *wrench) {
    (void)tick;
    Handle *handle = instance;
    IN_WRITE
    handle->held = *wrench;
    return FLOTOR_CYCLE_FRESH;
}

static void safe_stop(FlotorInstance instance) {
    Handle *handle = instance;
    IN_STOP
    atomic_store(&handle->stopped, true);
}

static const FlotorDeviceTable table = {
    .size = sizeof(FlotorDeviceTable),
    .info = {.id = FLOTOR_STR("fixture-c-device-that"), .name = FLOTOR_STR("Device that"),
             .doc = FLOTOR_STR("A handle with a habit")},
    .open = open_handle,
    .close = close_handle,
    .capabilities = capabilities,
    .activate = activate,
    .deactivate = deactivate,
    .read = read_handle,
    .write = write_handle,
    .safe_stop = safe_stop,
};

static const void *get_interface(FlotorStr id) {
    static const char device[] = FLOTOR_INTERFACE_DEVICE;
    return id.len == sizeof device - 1 && memcmp(id.ptr, device, id.len) == 0 ? &table : NULL;
}

FLOTOR_ENTRY(flotor_entry_device_that) = {
    FLOTOR_ENTRY_HEAD(FlotorPluginKind_Device),
    .get_interface = get_interface,
};
