/* A handle a millimetre below home that delivers what it is told, with one of the faults of a device. */
#include "planted.h"

FLOTOR_METADATA("kind = \"device\"\nid = \"fixture-planted-device\"\nname = \"Planted device\"\ndoc = \"A handle with a fault\"\n"
                "version = \"0.1.0\"\nabi = \"" FLOTOR_CONTRACT "\"\nentry = \"flotor_entry_planted_device\"\n");

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
    int fault;
    FlotorWrench held;
    atomic_bool stopped;
    bool active;
    unsigned asked;
    unsigned reads;
    unsigned writes;
    char *block;
} Handle;

static uint32_t open_handle(const FlotorParameterValue *values, uint32_t count, FlotorMessage *message, FlotorInstance *out) {
    (void)message;
    Handle *handle = calloc(1, sizeof *handle);
    if (handle == NULL) {
        return FlotorRefusalKind_Resource;
    }
    handle->fault = chosen(values, count);
    handle->block = malloc(64);
    if (handle->fault == FAULT_loop_open) {
        loop_for_ever();
    }
    *out = handle;
    return 0;
}

static void close_handle(FlotorInstance instance) {
    Handle *handle = instance;
    if (handle->fault == FAULT_loop_close) {
        loop_for_ever();
    }
    if (handle->fault == FAULT_segv_close) {
        crash();
    }
    free(handle->block);
    free(handle);
}

static void set(double *numbers, double value) {
    for (int axis = 0; axis < 3; axis++) {
        numbers[axis] = value;
    }
}

static uint32_t capabilities(FlotorInstance instance, FlotorCapabilities *out) {
    Handle *handle = instance;
    *out = (FlotorCapabilities){
        .sensed = {FLOTOR_AXES_ALL},
        .actuated = {FLOTOR_AXES_ALL},
        .range_m = {0.01, 0.01, 0.01},
        .range_rad = {0.1, 0.1, 0.1},
        .max_force_n = {10.0, 10.0, 10.0},
        .max_torque_nm = {0.5, 0.5, 0.5},
        .max_force_slew_n_per_s = 1.0e4,
        .max_torque_slew_nm_per_s = 1.0e3,
        .max_stiffness_n_per_m = 1.0e4,
        .rate_hz = {100.0, 10000.0},
    };
    handle->asked += 1;
    switch (handle->fault) {
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
    case FAULT_caps_change: out->max_force_n[2] += handle->asked; break;
    default: break;
    }
    return FlotorCallStatus_Ok;
}

static void caught(int number) {
    (void)number;
}

static uint32_t activate(FlotorInstance instance, const FlotorLoopConfig *config, FlotorMessage *message) {
    (void)config;
    Handle *handle = instance;
    switch (handle->fault) {
    case FAULT_loop_activate: loop_for_ever(); break;
    case FAULT_activate_busy3s: sleep_us(3000000); break;
    case FAULT_activate_fail: memcpy(message->text, "no power", 8), message->len = 8; return FlotorRefusalKind_Resource;
    case FAULT_sighandlers: signal(SIGINT, caught), signal(SIGTERM, caught); break;
    default: break;
    }
    memset(&handle->held, 0, sizeof handle->held);
    atomic_store(&handle->stopped, false);
    handle->active = true;
    return 0;
}

static uint32_t deactivate(FlotorInstance instance) {
    Handle *handle = instance;
    if (handle->fault == FAULT_loop_deactivate) {
        loop_for_ever();
    }
    bool was_active = handle->active;
    handle->active = false;
    return was_active && handle->fault != FAULT_deactivate_fail ? (uint32_t)FlotorCallStatus_Ok
                                                                : (uint32_t)FlotorCallStatus_WrongPhase;
}

static FlotorCycleCode read_handle(FlotorInstance instance, const FlotorTick *tick, FlotorDeviceState *state) {
    Handle *handle = instance;
    memset(state, 0, sizeof *state);
    state->pose.position_m[2] = -0.001;
    state->pose.orientation_xyzw[3] = 1.0;
    state->sampled_ns = tick->time_ns;
    if (!atomic_load(&handle->stopped)) {
        state->delivered = handle->held;
        /* It gives way a little: a micrometre a newton, and another for what is behind it. */
        state->pose.position_m[2] += 1.0e-6 * handle->held.force_n[2];
    }
    handle->reads += 1;
    if (handle->fault != FAULT_stuck) {
        state->pose.position_m[0] = 1.0e-7 * (handle->reads % 7);
    }
    if (handle->reads < 2) {
        return FLOTOR_CYCLE_FRESH;
    }
    switch (handle->fault) {
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
    case FAULT_heap: ((volatile char *)handle->block)[64] = 1; break;
    case FAULT_rounding: fesetround(FE_UPWARD); break;
    default: break;
    }
    return FLOTOR_CYCLE_FRESH;
}

static FlotorCycleCode write_handle(FlotorInstance instance, const FlotorTick *tick, const FlotorWrench *wrench) {
    (void)tick;
    Handle *handle = instance;
    handle->writes += 1;
    if (handle->fault == FAULT_write_stale) {
        return FLOTOR_CYCLE_STALE;
    }
    handle->held = *wrench;
    if (handle->writes < 2) {
        return FLOTOR_CYCLE_FRESH;
    }
    switch (handle->fault) {
    case FAULT_loop_write: loop_for_ever(); break;
    case FAULT_segv_write: crash(); break;
    case FAULT_sleep_write: sleep_us(3000); break;
    case FAULT_write_fault: return FLOTOR_CYCLE_FAULT(FlotorFault_OverCurrent);
    default: break;
    }
    return FLOTOR_CYCLE_FRESH;
}

static void safe_stop(FlotorInstance instance) {
    Handle *handle = instance;
    switch (handle->fault) {
    case FAULT_loop_stop: loop_for_ever(); break;
    case FAULT_segv_stop: crash(); break;
    case FAULT_exit_stop: exit(0);
    case FAULT_stop_slow: sleep_us(2000000); break;
    default: break;
    }
    atomic_store(&handle->stopped, true);
}

static const FlotorDeviceTable table = {
    .size = sizeof(FlotorDeviceTable),
    .parameter_count = 1,
    .parameters = parameters,
    .info = {.id = FLOTOR_STR("fixture-planted-device"), .name = FLOTOR_STR("Planted device"),
             .doc = FLOTOR_STR("A handle with a fault")},
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

FLOTOR_ENTRY(flotor_entry_planted_device) = {
    FLOTOR_ENTRY_HEAD(FlotorPluginKind_Device),
    .get_interface = get_interface,
};
