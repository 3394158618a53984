/* A handle at rest a millimetre below home that delivers the wrench of the last command until a stop, from whatever thread.
 * A device made of it replaces the functions that do something else; an instance of more fields begins with a Handle. */
#pragma once
#include "fixture.h"
#include <stdatomic.h>
#include <stdlib.h>

#ifndef MAX_TORQUE_NM
#define MAX_TORQUE_NM 0.5
#endif

typedef struct {
    FlotorWrench held;
    atomic_bool stopped;
    bool active;
} Handle;

static inline uint32_t handle_open(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message,
                                   FlotorInstance *out) {
    (void)values, (void)count, (void)message;
    *out = calloc(1, sizeof(Handle));
    return *out == NULL ? FlotorRefusalKind_Resource : 0;
}

static inline void handle_close(FlotorInstance instance) {
    free(instance);
}

static inline uint32_t handle_capabilities(FlotorInstance instance, FlotorCapabilities *out) {
    (void)instance;
    *out = (FlotorCapabilities){
        .sensed = {FLOTOR_AXES_ALL},
        .actuated = {FLOTOR_AXES_ALL},
        .range_m = {0.01, 0.01, 0.01},
        .range_rad = {0.1, 0.1, 0.1},
        .max_force_n = {10.0, 10.0, 10.0},
        .max_torque_nm = {MAX_TORQUE_NM, MAX_TORQUE_NM, MAX_TORQUE_NM},
        .max_force_slew_n_per_s = 1.0e6,
        .max_torque_slew_nm_per_s = 1.0e6,
        .max_stiffness_n_per_m = 1.0e4,
        .rate_hz = {100.0, 10000.0},
    };
    return FlotorCallStatus_Ok;
}

static inline uint32_t handle_activate(FlotorInstance instance, const FlotorLoopConfig *config, FlotorMessage *message) {
    (void)config, (void)message;
    Handle *handle = instance;
    memset(&handle->held, 0, sizeof handle->held);
    atomic_store(&handle->stopped, false);
    handle->active = true;
    return 0;
}

static inline uint32_t handle_deactivate(FlotorInstance instance) {
    Handle *handle = instance;
    const bool was_active = handle->active;
    handle->active = false;
    return was_active ? (uint32_t)FlotorCallStatus_Ok : (uint32_t)FlotorCallStatus_WrongPhase;
}

static inline FlotorCycleCode handle_read(FlotorInstance instance, const FlotorTick *tick, FlotorDeviceState *state) {
    const Handle *handle = instance;
    memset(state, 0, sizeof *state);
    state->pose.position_m[2] = -0.001;
    state->pose.orientation_xyzw[3] = 1.0;
    state->sampled_ns = tick->time_ns;
    if (!atomic_load(&handle->stopped)) {
        state->delivered = handle->held;
    }
    return FLOTOR_CYCLE_FRESH;
}

static inline FlotorCycleCode handle_write(FlotorInstance instance, const FlotorTick *tick, const FlotorWrench *wrench) {
    (void)tick;
    ((Handle *)instance)->held = *wrench;
    return FLOTOR_CYCLE_FRESH;
}

static inline void handle_safe_stop(FlotorInstance instance) {
    atomic_store(&((Handle *)instance)->stopped, true);
}
