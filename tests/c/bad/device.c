/* A device in C that is right as it stands: a post a millimetre below home, which delivers what it is told until it is
 * stopped. Each macro makes one mistake, which `flotor validate` has to find; STOPS_AS_EMERGENCY is none. */
#include "../handle.h"
#include <math.h>

static uint32_t capabilities(FlotorInstance instance, FlotorCapabilities *out) {
    handle_capabilities(instance, out);
#ifdef RATES_REVERSED
    out->rate_hz[0] = 10000.0;
    out->rate_hz[1] = 100.0;
#endif
#ifdef RATES_WITHOUT_END
    out->rate_hz[1] = INFINITY;
#endif
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

static FlotorCycleCode read_post(FlotorInstance instance, const FlotorTick *tick, FlotorDeviceState *state) {
    const Handle *post = instance;
    const bool stopped = atomic_load(&post->stopped);
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
    (void)stopped;
    handle_read(instance, tick, state);
#ifdef NO_QUATERNION
    state->pose.orientation_xyzw[3] = 0.0;
#endif
#ifdef IGNORES_STOP
    state->delivered = post->held;
#endif
#ifdef IGNORES_STOP_IN_SILENCE
    memset(&state->delivered, 0, sizeof state->delivered);
#endif
#ifdef NAN_DELIVERED
    state->delivered.torque_nm[1] = NAN;
#endif
    return FLOTOR_CYCLE_FRESH;
#endif
}

DEVICE(bad_device, "fixture-c-bad-device", "Bad device", "A post with a mistake",
       .open = handle_open, .close = handle_close, .capabilities = capabilities, .activate = handle_activate,
       .deactivate = handle_deactivate, .read = read_post, .write = handle_write, .safe_stop = handle_safe_stop);
