/* Your name: a handle that goes up and down by itself. Put your hardware where the comments say so.
 *
 * A device is opened (it answers questions), then active (`read` and `write`, a thousand times a second), then
 * opened again. Metres, newtons, z up; the wrench is what the hand is to feel.
 *
 * Build it here: BUILD_COMMAND */
#include "flotor.h"
#include <math.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#define ID "your-name"
#define NAME "Your name"
#define DOC "A handle that goes up and down by itself"

/* Read without running the plugin: `flotor plugins` and scenes find it by this. */
FLOTOR_METADATA("kind = \"device\"\nid = \"" ID "\"\nname = \"" NAME "\"\ndoc = \"" DOC "\"\n"
                "version = \"0.1.0\"\nabi = \"" FLOTOR_CONTRACT "\"\nentry = \"flotor_entry_your_name\"\n");

/* One turn a second, in rad/s. */
static const double OMEGA_RAD_PER_S = 6.283185307179586;

typedef struct {
    double amplitude_m;
    FlotorWrench commanded;
    atomic_bool stopped;
    bool active;
} YourName;

static const FlotorParameter parameters[] = {
    {.id = FLOTOR_STR("amplitude_mm"), .unit = FLOTOR_STR("mm"),
     .doc = FLOTOR_STR("Half the distance from lowest to highest"), .kind = FlotorParameterKind_Real, .min = 0.0,
     .max = 10.0, .default_ = 5.0},
};

/* Look for the hardware here; a missing one is FlotorRefusalKind_Resource, with the reason in the message. */
static uint32_t open_device(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message,
                            FlotorInstance *out) {
    (void)message;
    YourName *device = calloc(1, sizeof *device);
    if (device == NULL) {
        return FlotorRefusalKind_Resource;
    }
    device->amplitude_m = 1.0e-3 * (count > 0 ? values[count - 1].number : parameters[0].default_);
    *out = device;
    return 0;
}

static void close_device(FlotorInstance instance) {
    free(instance);
}

/* The host enforces these numbers. A device that gives no force leaves `actuated` at zero. */
static uint32_t capabilities(FlotorInstance instance, FlotorCapabilities *out) {
    (void)instance;
    *out = (FlotorCapabilities){
        .sensed = {FLOTOR_AXES_ALL},
        .actuated = {FLOTOR_AXES_ALL},
        .range_m = {0.012, 0.012, 0.012},
        .range_rad = {0.1, 0.1, 0.1},
        .max_force_n = {10.0, 10.0, 10.0},
        .max_torque_nm = {0.5, 0.5, 0.5},
        .max_force_slew_n_per_s = 20.0e3,
        .max_torque_slew_nm_per_s = 1.0e3,
        .max_stiffness_n_per_m = 1.0e4,
        .rate_hz = {100.0, 10000.0},
    };
    return FlotorCallStatus_Ok;
}

/* Energise it here; it starts at zero wrench. */
static uint32_t activate(FlotorInstance instance, const FlotorLoopConfig *config, FlotorMessage *message) {
    (void)config, (void)message;
    YourName *device = instance;
    memset(&device->commanded, 0, sizeof device->commanded);
    atomic_store(&device->stopped, false);
    device->active = true;
    return 0;
}

static uint32_t deactivate(FlotorInstance instance) {
    YourName *device = instance;
    if (!device->active) {
        return FlotorCallStatus_WrongPhase;
    }
    device->active = false;
    return FlotorCallStatus_Ok;
}

/* The newest sample, without waiting: no allocation, no lock. Nothing new is FLOTOR_CYCLE_STALE. */
static FlotorCycleCode read_state(FlotorInstance instance, const FlotorTick *tick, FlotorDeviceState *state) {
    const YourName *device = instance;
    double phase_rad = OMEGA_RAD_PER_S * 1.0e-9 * (double)tick->time_ns;
    memset(state, 0, sizeof *state);
    state->pose.position_m[2] = device->amplitude_m * sin(phase_rad);
    state->pose.orientation_xyzw[3] = 1.0;
    state->twist.linear_m_per_s[2] = device->amplitude_m * OMEGA_RAD_PER_S * cos(phase_rad);
    state->delivered = device->commanded;
    state->sampled_ns = tick->time_ns;
    return FLOTOR_CYCLE_FRESH;
}

/* The wrench from now on, without waiting; none once somebody has stopped the device. */
static FlotorCycleCode write_wrench(FlotorInstance instance, const FlotorTick *tick, const FlotorWrench *wrench) {
    (void)tick;
    YourName *device = instance;
    device->commanded = atomic_load(&device->stopped) ? (FlotorWrench){0} : *wrench;
    return FLOTOR_CYCLE_FRESH;
}

/* Takes the force away: from any thread, at any time, also during `read` and `write`. */
static void safe_stop(FlotorInstance instance) {
    YourName *device = instance;
    atomic_store(&device->stopped, true);
}

static const FlotorDeviceTable table = {
    .size = sizeof(FlotorDeviceTable),
    .parameter_count = sizeof parameters / sizeof *parameters,
    .parameters = parameters,
    .info = {.id = FLOTOR_STR(ID), .name = FLOTOR_STR(NAME), .doc = FLOTOR_STR(DOC)},
    .open = open_device,
    .close = close_device,
    .capabilities = capabilities,
    .activate = activate,
    .deactivate = deactivate,
    .read = read_state,
    .write = write_wrench,
    .safe_stop = safe_stop,
};

static const void *get_interface(FlotorStr id) {
    static const char device[] = FLOTOR_INTERFACE_DEVICE;
    return id.len == sizeof device - 1 && memcmp(id.ptr, device, id.len) == 0 ? &table : NULL;
}

FLOTOR_ENTRY(flotor_entry_your_name) = {
    FLOTOR_ENTRY_HEAD(FlotorPluginKind_Device),
    .get_interface = get_interface,
};
