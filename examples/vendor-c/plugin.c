/* A device behind a maker's C library: each call of the contract becomes one of the library's.
 *
 * The library may wait, allocate and start threads in `open`, `activate` and `close`. A function that `read` or `write` calls must
 * not: if the maker's function waits, call it in a thread of the plugin, and let `read` take the newest value. */
#include "flotor.h"
#include "knobkit.h"
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#define ID "maker-knob"
#define NAME "Maker's knob"
#define DOC "One axis behind a maker's library"

FLOTOR_METADATA("kind = \"device\"\nid = \"" ID "\"\nname = \"" NAME "\"\ndoc = \"" DOC "\"\n"
                "version = \"0.1.0\"\nabi = \"" FLOTOR_CONTRACT "\"\nentry = \"flotor_entry_maker_knob\"\n");

/* Axis 2 of six, z. */
#define FLOTOR_AXIS_Z (1u << 2)

typedef struct {
    KkDevice *knob;
    double before_m, force_n;
    atomic_bool stopped;
    bool active, has_sample;
} MakerKnob;

/* Copies the error text of the maker's library into the message of the refusal, which the host shows to the user. */
static uint32_t refuse(FlotorMessage *message) {
    const char *text = kk_last_error();
    size_t length = strlen(text);
    message->len = (uint32_t)(length < sizeof message->text ? length : sizeof message->text);
    memcpy(message->text, text, message->len);
    return FlotorRefusalKind_Resource;
}

static uint32_t open_device(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message,
                            FlotorInstance *out) {
    (void)values, (void)count;
    MakerKnob *device = calloc(1, sizeof *device);
    if (device == NULL) {
        return FlotorRefusalKind_Resource;
    }
    if (kk_open(&device->knob) != 0) {
        free(device);
        return refuse(message);
    }
    *out = device;
    return 0;
}

static void close_device(FlotorInstance instance) {
    MakerKnob *device = instance;
    kk_close(device->knob);
    free(device);
}

static uint32_t capabilities(FlotorInstance instance, FlotorCapabilities *out) {
    (void)instance;
    *out = (FlotorCapabilities){
        .sensed = {FLOTOR_AXIS_Z},
        .actuated = {FLOTOR_AXIS_Z},
        .range_m = {0.0, 0.0, 0.012},
        .max_force_n = {0.0, 0.0, 5.0},
        .max_force_slew_n_per_s = 10.0e3,
        .max_torque_slew_nm_per_s = 1.0e3,
        .max_stiffness_n_per_m = 2.0e3,
        .rate_hz = {100.0, 1000.0},
    };
    return FlotorCallStatus_Ok;
}

static uint32_t activate(FlotorInstance instance, const FlotorLoopConfig *config, FlotorMessage *message) {
    (void)config;
    MakerKnob *device = instance;
    if (kk_enable(device->knob, 1) != 0) {
        return refuse(message);
    }
    atomic_store(&device->stopped, false);
    device->force_n = 0.0;
    device->has_sample = false;
    device->active = true;
    return 0;
}

static uint32_t deactivate(FlotorInstance instance) {
    MakerKnob *device = instance;
    if (!device->active) {
        return FlotorCallStatus_WrongPhase;
    }
    kk_enable(device->knob, 0);
    device->active = false;
    return FlotorCallStatus_Ok;
}

static FlotorCycleCode read_state(FlotorInstance instance, const FlotorTick *tick, FlotorDeviceState *state) {
    MakerKnob *device = instance;
    double position_mm = 0.0;
    if (kk_get_position_mm(device->knob, &position_mm) != 0) {
        return FLOTOR_CYCLE_FAULT(FlotorFault_Disconnected);
    }
    double position_m = 1.0e-3 * position_mm;
    memset(state, 0, sizeof *state);
    state->pose.position_m[2] = position_m;
    state->pose.orientation_xyzw[3] = 1.0;
    if (device->has_sample && tick->dt_ns > 0) {
        state->twist.linear_m_per_s[2] = (position_m - device->before_m) / (1.0e-9 * (double)tick->dt_ns);
    }
    device->before_m = position_m;
    device->has_sample = true;
    state->delivered.force_n[2] = atomic_load(&device->stopped) ? 0.0 : device->force_n;
    state->sampled_ns = tick->time_ns;
    return FLOTOR_CYCLE_FRESH;
}

static FlotorCycleCode write_wrench(FlotorInstance instance, const FlotorTick *tick, const FlotorWrench *wrench) {
    (void)tick;
    MakerKnob *device = instance;
    device->force_n = atomic_load(&device->stopped) ? 0.0 : wrench->force_n[2];
    return kk_set_force_n(device->knob, device->force_n) == 0 ? FLOTOR_CYCLE_FRESH : FLOTOR_CYCLE_FAULT(FlotorFault_Disconnected);
}

/* From any thread, also during `read` and `write`: only what the maker allows from there. Here that is nothing, so the next write
 * sends zero. */
static void safe_stop(FlotorInstance instance) {
    MakerKnob *device = instance;
    atomic_store(&device->stopped, true);
}

static const FlotorDeviceTable table = {
    .size = sizeof(FlotorDeviceTable),
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

FLOTOR_ENTRY(flotor_entry_maker_knob) = {
    FLOTOR_ENTRY_HEAD(FlotorPluginKind_Device),
    .get_interface = get_interface,
};
