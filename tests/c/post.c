/* A device in C: a post that does not move, a millimetre below home. It delivers what it is told until it is
 * stopped, from whatever thread. With KEEPS_FORCE it keeps its last force without a host, as its own log at the terminal
 * FIXTURE_FORCE_LOG says: a line for each command, with the vertical force in N; the message `0` and a line end stops it. */
#ifdef KEEPS_FORCE
#define _POSIX_C_SOURCE 200809L
#endif
#include "flotor.h"
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#ifdef KEEPS_FORCE
#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>
#endif

FLOTOR_METADATA("kind = \"device\"\nid = \"fixture-c-post\"\nname = \"Post\"\ndoc = \"A handle that does not move, in C\"\n"
                "version = \"0.1.0\"\nabi = \"" FLOTOR_CONTRACT "\"\nentry = \"flotor_entry_post\"\n");

#ifndef ORIENTATION_W
#define ORIENTATION_W 1.0
#endif

typedef struct {
    FlotorWrench held;
    atomic_bool stopped;
    bool active;
#ifdef KEEPS_FORCE
    int log;
#endif
} Post;

static uint32_t open_post(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)values, (void)count, (void)message;
    Post *post = calloc(1, sizeof *post);
    *out = post;
#ifdef KEEPS_FORCE
    const char *log = getenv("FIXTURE_FORCE_LOG");
    if (post != NULL && log != NULL) {
        post->log = open(log, O_WRONLY | O_NOCTTY | O_CLOEXEC);
    }
#endif
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
        .rate_hz = {100.0, 10000.0},
    };
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

#ifndef RESULT
#define RESULT FLOTOR_CYCLE_FRESH
#endif

static FlotorCycleCode read_post(FlotorInstance instance, const FlotorTick *tick, FlotorDeviceState *state) {
    const Post *post = instance;
    memset(state, 0, sizeof *state);
    state->pose.position_m[2] = -0.001;
    state->pose.orientation_xyzw[3] = ORIENTATION_W;
    state->sampled_ns = tick->time_ns;
    if (!atomic_load(&post->stopped)) {
        state->delivered = post->held;
    }
    return RESULT;
}

static FlotorCycleCode write_post(FlotorInstance instance, const FlotorTick *tick, const FlotorWrench *wrench) {
    (void)tick;
    Post *post = instance;
    post->held = *wrench;
#ifdef KEEPS_FORCE
    if (dprintf(post->log, "%.6f\n", wrench->force_n[2]) < 0) {
        return FLOTOR_CYCLE_STALE;
    }
#endif
    return FLOTOR_CYCLE_FRESH;
}

static void safe_stop(FlotorInstance instance) {
    Post *post = instance;
    atomic_store(&post->stopped, true);
}

static const FlotorDeviceTable table = {
    .size = sizeof(FlotorDeviceTable),
    .info = {.id = FLOTOR_STR("fixture-c-post"), .name = FLOTOR_STR("Post"),
             .doc = FLOTOR_STR("A handle that does not move, in C")},
    .open = open_post,
    .close = close_post,
    .capabilities = capabilities,
    .activate = activate,
    .deactivate = deactivate,
    .read = read_post,
    .write = write_post,
    .safe_stop = safe_stop,
};

#ifdef KEEPS_FORCE
static uint32_t independent_stop(FlotorInstance instance, FlotorIndependentStop *stop) {
    const Post *post = instance;
    *stop = (FlotorIndependentStop){.descriptor = post->log, .length = 2, .message = "0\n", .within_ns = 1000000};
    return FlotorCallStatus_Ok;
}

static const FlotorIndependentStopTable stop_table = {
    .size = sizeof(FlotorIndependentStopTable),
    .independent_stop = independent_stop,
};
#endif

static const void *get_interface(FlotorStr id) {
#ifdef KEEPS_FORCE
    static const char stop[] = FLOTOR_INTERFACE_INDEPENDENT_STOP;
    if (id.len == sizeof stop - 1 && memcmp(id.ptr, stop, id.len) == 0) {
        return &stop_table;
    }
#endif
    static const char device[] = FLOTOR_INTERFACE_DEVICE;
    return id.len == sizeof device - 1 && memcmp(id.ptr, device, id.len) == 0 ? &table : NULL;
}

FLOTOR_ENTRY(flotor_entry_post) = {
    FLOTOR_ENTRY_HEAD(FlotorPluginKind_Device),
    .get_interface = get_interface,
};
