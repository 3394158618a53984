/* A device in C that is right as it stands: a post a millimetre below home, which delivers what it is told until it is
 * stopped. Each macro makes one mistake, which `flotor validate` has to find; STOPS_AS_EMERGENCY is none. */
#include "flotor.h"
#include <math.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

FLOTOR_METADATA("kind = \"device\"\nid = \"fixture-c-bad-device\"\nname = \"Bad device\"\ndoc = \"A post with a mistake\"\n"
                "version = \"0.1.0\"\nabi = \"" FLOTOR_CONTRACT "\"\nentry = \"flotor_entry_bad_device\"\n");

#ifndef RATES
#define RATES {100.0, 10000.0}
#endif
#ifdef RATES_REVERSED
#undef RATES
#define RATES {10000.0, 100.0}
#endif
#ifdef RATES_WITHOUT_END
#undef RATES
#define RATES {100.0, INFINITY}
#endif

typedef struct {
    FlotorWrench held;
    atomic_bool stopped;
    bool active;
} Post;

static uint32_t open_post(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)values, (void)count, (void)message;
    Post *post = calloc(1, sizeof *post);
    *out = post;
    return post == NULL ? FlotorRefusalKind_Resource : 0;
}

static void close_post(FlotorInstance instance) {
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
        .max_torque_nm = {0.5, 0.5, 0.5},
        .max_force_slew_n_per_s = 1.0e6,
        .max_torque_slew_nm_per_s = 1.0e6,
        .max_stiffness_n_per_m = 1.0e4,
        .rate_hz = RATES,
    };
#ifdef NAN_STIFFNESS
    out->max_stiffness_n_per_m = NAN;
#endif
#ifdef NAN_LATENCY
    out->latency_s = NAN;
#endif
#ifdef NEGATIVE_RESOLUTION
    out->resolution_m = -1.0e-6;
#endif
#ifdef NO_RANGE
    memset(out->range_m, 0, sizeof out->range_m);
#endif
#ifdef ENDLESS_RANGE
    out->range_rad[1] = INFINITY;
#endif
#ifdef ENDLESS_FORCE
    out->max_force_n[2] = INFINITY;
#endif
#ifdef ABSURD_FORCE
    out->max_force_n[0] = 1.0e308;
#endif
#ifdef NO_FORCE
    out->max_force_n[1] = 0.0;
#endif
#ifdef NO_TORQUE
    memset(out->max_torque_nm, 0, sizeof out->max_torque_nm);
#endif
#ifdef NEGATIVE_TORQUE
    out->max_torque_nm[2] = -1.0;
#endif
#ifdef NO_SLEW
    out->max_force_slew_n_per_s = 0.0;
#endif
#ifdef ENDLESS_SLEW
    out->max_torque_slew_nm_per_s = INFINITY;
#endif
#ifdef ENDLESS_STIFFNESS
    out->max_stiffness_n_per_m = INFINITY;
#endif
#ifdef SEVEN_AXES
    out->sensed.bits = 0x7f;
#endif
#ifdef EVERY_AXIS
    out->actuated.bits = 0xffffffff;
#endif
#ifdef CHANGES_ITS_MIND
    static atomic_int calls;
    out->max_force_n[2] += atomic_fetch_add(&calls, 1) > CHANGES_ITS_MIND;
#endif
    return FlotorCallStatus_Ok;
}

static uint32_t activate(FlotorInstance instance, const FlotorLoopConfig *config, FlotorMessage *message) {
    (void)config, (void)message;
    Post *post = instance;
    memset(&post->held, 0, sizeof post->held);
    atomic_store(&post->stopped, false);
    post->active = true;
    return 0;
}

static uint32_t deactivate(FlotorInstance instance) {
    Post *post = instance;
    if (!post->active) {
        return FlotorCallStatus_WrongPhase;
    }
    post->active = false;
    return FlotorCallStatus_Ok;
}

static FlotorCycleCode read_post(FlotorInstance instance, const FlotorTick *tick, FlotorDeviceState *state) {
    const Post *post = instance;
    bool stopped = atomic_load(&post->stopped);
#ifdef STALE
    (void)stopped, (void)tick, (void)state;
    return FLOTOR_CYCLE_STALE;
#else
#ifdef FAULTS_AFTER_STOP
    if (stopped) {
        return FLOTOR_CYCLE_FAULT(FlotorFault_Broken);
    }
#endif
#ifdef STOPS_AS_EMERGENCY
    if (stopped) {
        return FLOTOR_CYCLE_FAULT(FlotorFault_EmergencyStop);
    }
#endif
#ifdef SILENT_AFTER_STOP
    if (stopped) {
        memset(&state->delivered, 0, sizeof state->delivered);
        return FLOTOR_CYCLE_STALE;
    }
#endif
    memset(state, 0, sizeof *state);
    state->pose.position_m[2] = -0.001;
    state->pose.orientation_xyzw[3] = 1.0;
    state->sampled_ns = tick->time_ns;
#ifdef NO_QUATERNION
    state->pose.orientation_xyzw[3] = 0.0;
#endif
#ifdef IGNORES_STOP
    stopped = false;
#endif
    if (!stopped) {
        state->delivered = post->held;
    }
#ifdef IGNORES_STOP_IN_SILENCE
    memset(&state->delivered, 0, sizeof state->delivered);
#endif
#ifdef NAN_DELIVERED
    state->delivered.torque_nm[1] = NAN;
#endif
    return FLOTOR_CYCLE_FRESH;
#endif
}

static FlotorCycleCode write_post(FlotorInstance instance, const FlotorTick *tick, const FlotorWrench *wrench) {
    (void)tick;
    Post *post = instance;
    post->held = *wrench;
    return FLOTOR_CYCLE_FRESH;
}

static void safe_stop(FlotorInstance instance) {
    Post *post = instance;
    atomic_store(&post->stopped, true);
}

static const FlotorDeviceTable table = {
    .size = sizeof(FlotorDeviceTable),
    .info = {.id = FLOTOR_STR("fixture-c-bad-device"), .name = FLOTOR_STR("Bad device"),
             .doc = FLOTOR_STR("A post with a mistake")},
    .open = open_post,
    .close = close_post,
    .capabilities = capabilities,
    .activate = activate,
    .deactivate = deactivate,
    .read = read_post,
    .write = write_post,
    .safe_stop = safe_stop,
};

static const void *get_interface(FlotorStr id) {
    static const char device[] = FLOTOR_INTERFACE_DEVICE;
    return id.len == sizeof device - 1 && memcmp(id.ptr, device, id.len) == 0 ? &table : NULL;
}

FLOTOR_ENTRY(flotor_entry_bad_device) = {
    FLOTOR_ENTRY_HEAD(FlotorPluginKind_Device),
    .get_interface = get_interface,
};
