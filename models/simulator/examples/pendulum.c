/* A pendulum that one can hold: a ball of 100 g on a rod of 0.2 m, in the plane of x and z, moved at 1 kHz of its own time.
 *
 *     cc -O2 -I models/simulator/include models/simulator/examples/pendulum.c -o pendulum -lm
 *
 * The handle is a ball of 10 mm that pushes the ball of 20 mm of the pendulum. The force on the pendulum is that which the loop
 * computes for the hand: stiffness times depth, and damping times approach. */
#include "flotor_simulator.h"

#define GRAVITY_M_PER_S2 9.81
#define LENGTH_M 0.2
#define MASS_KG 0.1
#define REACH_M 0.03 /* both radii */
#define TOOL_RADIUS_M 0.01
#define STIFFNESS_N_PER_M 400.0
#define DAMPING_NS_PER_M 4.0
#define STEP_S 1.0e-3

/* The pivot is above home, so that the ball hangs beside the handle: their surfaces are 1 mm apart. */
static const double PIVOT_M[3] = {REACH_M + 0.001, 0.0, LENGTH_M};

int main(void) {
    double angle_rad = 0.0, speed_rad_per_s = 0.0;
    uint64_t before_ns = 0;
    FlotorSimulatorPose pose;
    while (flotor_simulator_receive(&pose) > 0) {
        double time_s = before_ns == 0 ? 0.0 : (double)(pose.time_ns - before_ns) * 1.0e-9;
        before_ns = pose.time_ns;
        if (time_s > 0.1) {
            time_s = 0.1;
        }
        double normal[3] = {0, 0, 0}, ball_m[3] = {0, 0, 0}, velocity[3] = {0, 0, 0}, gap_m = 0.0;
        int steps = (int)ceil(time_s / STEP_S);
        for (int step = 0; step <= steps; step++) {
            ball_m[0] = PIVOT_M[0] + LENGTH_M * sin(angle_rad);
            ball_m[2] = PIVOT_M[2] - LENGTH_M * cos(angle_rad);
            velocity[0] = LENGTH_M * cos(angle_rad) * speed_rad_per_s;
            velocity[2] = LENGTH_M * sin(angle_rad) * speed_rad_per_s;
            /* The handle moved with constant velocity to where it is now. */
            double left_s = time_s * (steps - step) / (steps > 0 ? steps : 1), distance_m = 0.0;
            for (int axis = 0; axis < 3; axis++) {
                normal[axis] = pose.position_m[axis] - pose.linear_m_per_s[axis] * left_s - ball_m[axis];
                distance_m += normal[axis] * normal[axis];
            }
            distance_m = sqrt(distance_m);
            for (int axis = 0; axis < 3; axis++) {
                normal[axis] = distance_m > 0.0 ? normal[axis] / distance_m : axis == 0 ? -1.0 : 0.0;
            }
            gap_m = distance_m - REACH_M;
            if (step == steps) {
                break; /* the last round is for the contact alone */
            }
            double force_n = 0.0, along = cos(angle_rad) * normal[0] + sin(angle_rad) * normal[2];
            if (gap_m < 0.0) {
                double approach = 0.0;
                for (int axis = 0; axis < 3; axis++) {
                    approach += normal[axis] * (velocity[axis] - pose.linear_m_per_s[axis]);
                }
                force_n = fmax(0.0, -STIFFNESS_N_PER_M * gap_m + DAMPING_NS_PER_M * approach);
            }
            double torque_nm = -MASS_KG * GRAVITY_M_PER_S2 * LENGTH_M * sin(angle_rad) - force_n * along * LENGTH_M;
            speed_rad_per_s += torque_nm / (MASS_KG * LENGTH_M * LENGTH_M) * time_s / steps;
            angle_rad += speed_rad_per_s * time_s / steps;
        }
        FlotorSimulatorSet set = flotor_simulator_set(&pose);
        FlotorSimulatorContact *contact = &set.contacts[set.count++];
        for (int axis = 0; axis < 3; axis++) {
            double on_tool_m = -TOOL_RADIUS_M * normal[axis];
            contact->normal[axis] = normal[axis];
            contact->surface_point_m[axis] = pose.position_m[axis] + on_tool_m - gap_m * normal[axis];
            contact->surface_velocity_m_per_s[axis] = velocity[axis];
            contact->tool_point_m[axis] = on_tool_m; /* the handle does not turn here */
        }
        contact->gap_m = gap_m;
        contact->stiffness_n_per_m = STIFFNESS_N_PER_M;
        contact->damping_ns_per_m = DAMPING_NS_PER_M;
        set.valid_m = 0.005;
        set.valid_s = 0.05;
        if (flotor_simulator_send(&set) <= 0) {
            break;
        }
    }
    return 0;
}
