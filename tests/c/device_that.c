/* A device in C that is right as it stands: a handle at rest a millimetre below home. Each macro is a statement that runs at
 * one place of its life; `hang();` is there for it. */
#define _GNU_SOURCE
#define MAX_TORQUE_NM 1.0
#include "handle.h"
#include <unistd.h>

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

static inline void hang(void) {
    for (;;) {
        pause();
    }
}

static uint32_t open_that(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    IN_OPEN
    return handle_open(values, count, message, out);
}

static void close_that(FlotorInstance instance) {
    IN_CLOSE
    handle_close(instance);
}

static uint32_t activate_that(FlotorInstance instance, const FlotorLoopConfig *config, FlotorMessage *message) {
    IN_ACTIVATE
    return handle_activate(instance, config, message);
}

static uint32_t deactivate_that(FlotorInstance instance) {
    IN_DEACTIVATE
    return handle_deactivate(instance);
}

static FlotorCycleCode read_that(FlotorInstance instance, const FlotorTick *tick, FlotorDeviceState *state) {
    IN_READ
    return handle_read(instance, tick, state);
}

static FlotorCycleCode write_that(FlotorInstance instance, const FlotorTick *tick, const FlotorWrench *wrench) {
    IN_WRITE
    return handle_write(instance, tick, wrench);
}

static void stop_that(FlotorInstance instance) {
    IN_STOP
    handle_safe_stop(instance);
}

DEVICE(device_that, "fixture-c-device-that", "Device that", "A handle with a habit",
       .open = open_that, .close = close_that, .capabilities = handle_capabilities, .activate = activate_that,
       .deactivate = deactivate_that, .read = read_that, .write = write_that, .safe_stop = stop_that);
