/* A device in C: a handle that does not move. */
#include "handle.h"

#ifndef ORIENTATION_W
#define ORIENTATION_W 1.0
#endif
#ifndef RESULT
#define RESULT FLOTOR_CYCLE_FRESH
#endif

static FlotorCycleCode read_post(FlotorInstance instance, const FlotorTick *tick, FlotorDeviceState *state) {
    handle_read(instance, tick, state);
    state->pose.orientation_xyzw[3] = ORIENTATION_W;
    return RESULT;
}

DEVICE(post, "fixture-c-post", "Post", "A handle that does not move, in C",
       .open = handle_open, .close = handle_close, .capabilities = handle_capabilities, .activate = handle_activate,
       .deactivate = handle_deactivate, .read = read_post, .write = handle_write, .safe_stop = handle_safe_stop);
