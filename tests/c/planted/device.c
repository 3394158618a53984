/* A handle a millimetre below home that delivers what it is told, with one of the faults of a device. */
#include "planted.h"
#include "../handle.h"

#define FAULTS(X)                                                                                                         \
    X(none) X(loop_open) X(loop_caps) X(loop_activate) X(loop_read) X(loop_write) X(loop_stop) X(loop_deactivate)         \
    X(loop_close) X(segv_read) X(segv_write) X(segv_stop) X(segv_close) X(nan_pose) X(inf_twist) X(zero_quat)             \
    X(big_quat) X(far_pose) X(stuck) X(unknown_cycle) X(write_fault) X(write_stale) X(sleep_read) X(caps_nan)             \
    X(caps_neg) X(caps_inf) X(caps_zero) X(caps_zero_slew) X(caps_rate_swapped) X(caps_axes_junk) X(caps_range0)          \
    X(caps_change) X(time_lie) X(deliver_nan) X(exit_read) X(exit_stop) X(activate_fail) X(deactivate_fail)               \
    X(activate_busy3s) X(stop_slow) X(caps_huge) X(buttons_all) X(cond_junk)                                              \
    X(time_back) X(time_zero) X(heap) X(sighandlers) X(rounding) X(read_stale) X(sleep_write)

PLANTED_SCHEMA

typedef struct {
    Handle handle;
    int fault;
    unsigned asked;
    unsigned reads;
    unsigned writes;
    char *block;
} Planted;

static uint32_t open_handle(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)message;
    Planted *planted = calloc(1, sizeof *planted);
    if (planted == NULL) {
        return FlotorRefusalKind_Resource;
    }
    planted->fault = chosen(values, count);
    planted->block = malloc(64);
    if (planted->fault == FAULT_loop_open) {
        loop_for_ever();
    }
    *out = planted;
    return 0;
}

static void close_handle(FlotorInstance instance) {
    Planted *planted = instance;
    if (planted->fault == FAULT_loop_close) {
        loop_for_ever();
    }
    if (planted->fault == FAULT_segv_close) {
        crash();
    }
    free(planted->block);
    free(planted);
}

static void set(double *numbers, double value) {
    for (int axis = 0; axis < 3; axis++) {
        numbers[axis] = value;
    }
}

static uint32_t capabilities(FlotorInstance instance, FlotorCapabilities *out) {
    Planted *planted = instance;
    handle_capabilities(instance, out);
    out->max_force_slew_n_per_s = 1.0e4;
    out->max_torque_slew_nm_per_s = 1.0e3;
    planted->asked += 1;
    switch (planted->fault) {
    case FAULT_loop_caps: loop_for_ever(); break;
    case FAULT_caps_nan: out->max_force_n[1] = NAN; break;
    case FAULT_caps_neg: out->max_force_n[1] = -1.0; break;
    case FAULT_caps_inf: set(out->max_force_n, INFINITY), set(out->max_torque_nm, INFINITY); break;
    case FAULT_caps_huge: set(out->max_force_n, 1.0e308), set(out->max_torque_nm, 1.0e308); break;
    case FAULT_caps_zero: set(out->max_force_n, 0.0), set(out->max_torque_nm, 0.0); break;
    case FAULT_caps_zero_slew: out->max_force_slew_n_per_s = 0.0; break;
    case FAULT_caps_rate_swapped: out->rate_hz[0] = 10000.0, out->rate_hz[1] = 100.0; break;
    case FAULT_caps_axes_junk: out->sensed.bits = out->actuated.bits = 0xffffffffU; break;
    case FAULT_caps_range0: set(out->range_m, 0.0), set(out->range_rad, 0.0); break;
    case FAULT_caps_change: out->max_force_n[2] += planted->asked; break;
    default: break;
    }
    return FlotorCallStatus_Ok;
}

static void caught(int number) {
    (void)number;
}

static uint32_t activate(FlotorInstance instance, const FlotorLoopConfig *config, FlotorMessage *message) {
    Planted *planted = instance;
    switch (planted->fault) {
    case FAULT_loop_activate: loop_for_ever(); break;
    case FAULT_activate_busy3s: sleep_us(3000000); break;
    case FAULT_activate_fail: memcpy(message->text, "no power", 8), message->len = 8; return FlotorRefusalKind_Resource;
    case FAULT_sighandlers: signal(SIGINT, caught), signal(SIGTERM, caught); break;
    default: break;
    }
    return handle_activate(instance, config, message);
}

static uint32_t deactivate(FlotorInstance instance) {
    Planted *planted = instance;
    if (planted->fault == FAULT_loop_deactivate) {
        loop_for_ever();
    }
    const uint32_t status = handle_deactivate(instance);
    return planted->fault == FAULT_deactivate_fail ? (uint32_t)FlotorCallStatus_WrongPhase : status;
}

static FlotorCycleCode read_handle(FlotorInstance instance, const FlotorTick *tick, FlotorDeviceState *state) {
    Planted *planted = instance;
    handle_read(instance, tick, state);
    /* It gives way a little: a micrometre a newton, and another for what is behind it. */
    state->pose.position_m[2] += 1.0e-6 * state->delivered.force_n[2];
    planted->reads += 1;
    if (planted->fault != FAULT_stuck) {
        state->pose.position_m[0] = 1.0e-7 * (planted->reads % 7);
    }
    if (planted->reads < 2) {
        return FLOTOR_CYCLE_FRESH;
    }
    switch (planted->fault) {
    case FAULT_loop_read: loop_for_ever(); break;
    case FAULT_segv_read: crash(); break;
    case FAULT_exit_read: exit(0);
    case FAULT_sleep_read: sleep_us(3000); break;
    case FAULT_nan_pose: state->pose.position_m[2] = NAN; break;
    case FAULT_inf_twist: state->twist.linear_m_per_s[2] = INFINITY; break;
    case FAULT_zero_quat: state->pose.orientation_xyzw[3] = 0.0; break;
    case FAULT_big_quat:
        for (int axis = 0; axis < 4; axis++) {
            state->pose.orientation_xyzw[axis] = 1.0e10;
        }
        break;
    case FAULT_far_pose: state->pose.position_m[2] = -1.0e30; break;
    case FAULT_unknown_cycle: return flotor_cycle(0xdeadU);
    case FAULT_read_stale: return FLOTOR_CYCLE_STALE;
    case FAULT_time_lie: state->sampled_ns = UINT64_MAX; break;
    case FAULT_time_zero: state->sampled_ns = 0; break;
    case FAULT_time_back: state->sampled_ns = 1000000000000U - tick->time_ns; break;
    case FAULT_deliver_nan: state->delivered.force_n[2] = NAN; break;
    case FAULT_buttons_all: state->buttons = 0xffffffffU; break;
    case FAULT_cond_junk: state->conditions.bits = 0xffffffffU; break;
    case FAULT_heap: ((volatile char *)planted->block)[64] = 1; break;
    case FAULT_rounding: fesetround(FE_UPWARD); break;
    default: break;
    }
    return FLOTOR_CYCLE_FRESH;
}

static FlotorCycleCode write_handle(FlotorInstance instance, const FlotorTick *tick, const FlotorWrench *wrench) {
    Planted *planted = instance;
    planted->writes += 1;
    if (planted->fault == FAULT_write_stale) {
        return FLOTOR_CYCLE_STALE;
    }
    handle_write(instance, tick, wrench);
    if (planted->writes < 2) {
        return FLOTOR_CYCLE_FRESH;
    }
    switch (planted->fault) {
    case FAULT_loop_write: loop_for_ever(); break;
    case FAULT_segv_write: crash(); break;
    case FAULT_sleep_write: sleep_us(3000); break;
    case FAULT_write_fault: return FLOTOR_CYCLE_FAULT(FlotorFault_OverCurrent);
    default: break;
    }
    return FLOTOR_CYCLE_FRESH;
}

static void safe_stop(FlotorInstance instance) {
    Planted *planted = instance;
    switch (planted->fault) {
    case FAULT_loop_stop: loop_for_ever(); break;
    case FAULT_segv_stop: crash(); break;
    case FAULT_exit_stop: exit(0);
    case FAULT_stop_slow: sleep_us(2000000); break;
    default: break;
    }
    handle_safe_stop(instance);
}

DEVICE(planted_device, "fixture-planted-device", "Planted device", "A handle with a fault",
       .parameter_count = 1, .parameters = parameters, .open = open_handle, .close = close_handle,
       .capabilities = capabilities, .activate = activate, .deactivate = deactivate, .read = read_handle,
       .write = write_handle, .safe_stop = safe_stop);
