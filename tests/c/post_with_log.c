/* A device in C that keeps its last force without a host, as its own log at the terminal FIXTURE_FORCE_LOG says: a line for each
 * command, with the vertical force in N; the message `0` and a line end stops it. */
#define _POSIX_C_SOURCE 200809L
#include "handle.h"
#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>

typedef struct {
    Handle handle;
    int log;
} Post;

static uint32_t open_post(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)values, (void)count, (void)message;
    Post *post = calloc(1, sizeof *post);
    *out = post;
    const char *log = getenv("FIXTURE_FORCE_LOG");
    if (post != NULL && log != NULL) {
        post->log = open(log, O_WRONLY | O_NOCTTY | O_CLOEXEC);
    }
    return post == NULL ? FlotorRefusalKind_Resource : 0;
}

static FlotorCycleCode write_post(FlotorInstance instance, const FlotorTick *tick, const FlotorWrench *wrench) {
    handle_write(instance, tick, wrench);
    if (dprintf(((Post *)instance)->log, "%.6f\n", wrench->force_n[2]) < 0) {
        return FLOTOR_CYCLE_STALE;
    }
    return FLOTOR_CYCLE_FRESH;
}

static uint32_t independent_stop(FlotorInstance instance, FlotorIndependentStop *stop) {
    const Post *post = instance;
    *stop = (FlotorIndependentStop){.descriptor = post->log, .length = 2, .message = "0\n", .within_ns = 1000000};
    return FlotorCallStatus_Ok;
}

static const FlotorIndependentStopTable stop_table = {
    .size = sizeof(FlotorIndependentStopTable),
    .independent_stop = independent_stop,
};

DEVICE_TABLE(post, "fixture-c-post", "Post", "A handle that does not move, in C",
             .open = open_post, .close = handle_close, .capabilities = handle_capabilities, .activate = handle_activate,
             .deactivate = handle_deactivate, .read = handle_read, .write = write_post, .safe_stop = handle_safe_stop);

static const void *get_interface(FlotorStr id) {
    if (is_called(id, FLOTOR_INTERFACE_INDEPENDENT_STOP)) {
        return &stop_table;
    }
    return is_called(id, FLOTOR_INTERFACE_DEVICE) ? &table : NULL;
}

ENTRY(FlotorPluginKind_Device, post);
