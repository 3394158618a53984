/* A library with the functions of DHD that the plugin uses, and one thing wrong: which, macros say. Nothing is behind it but a
 * log, where each change of force and every switch is a line. Written from names, numbers and types. */
#define _POSIX_C_SOURCE 200809L
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#ifndef MINOR
#define MINOR 17
#endif
#ifndef AFTER
#define AFTER 50
#endif

static int error = 0, sent = 0;
static bool is_initialised =
#ifdef UNINITIALISED
    false;
#else
    true;
#endif

static void note(const char *what, double x, double y, double z) {
    FILE *log = fopen(getenv("SDK_LOG"), "a");
    if (log != NULL) {
        fprintf(log, "%s %g %g %g\n", what, x, y, z);
        fclose(log);
    }
}

static int fail(int code) {
    error = code;
    return -1;
}

/* What goes wrong once forces have been sent for a while, from the first that is not zero: a busy machine begins late. */
__attribute__((unused)) static bool is_late(void) { return sent > AFTER; }

void dhdGetSDKVersion(int *major, int *minor, int *release, int *revision) {
    *major = 3;
    *minor = MINOR;
    *release = *revision = 0;
}
int dhdErrorGetLast(void) { return error; }
const char *dhdErrorGetLastStr(void) { return "as the test wants it"; }
int dhdGetDeviceCount(void) {
#ifdef NO_DEVICE
    return 0;
#else
    return 1;
#endif
}
int dhdOpenID(signed char index) {
#ifdef NO_DEVICE
    (void)index;
    return fail(5);
#elif defined NO_DRIVER
    (void)index;
    return fail(4);
#else
    return index == 0 ? 0 : fail(5);
#endif
}
int dhdClose(signed char id) {
    (void)id;
    note("close", 0, 0, 0);
    return 0;
}
int dhdGetSystemType(signed char id) { (void)id; return 33; }
const char *dhdGetSystemName(signed char id) { (void)id; return "omega.3"; }
int dhdGetSerialNumber(unsigned short *serial, signed char id) { (void)id; *serial = 4711; return 0; }
bool dhdHasWrist(signed char id) { (void)id; return false; }
bool dhdHasActiveWrist(signed char id) { (void)id; return false; }
#ifdef GRIPPER
bool dhdHasGripper(signed char id) { (void)id; return true; }
bool dhdHasActiveGripper(signed char id) { (void)id; return true; }
#else
bool dhdHasGripper(signed char id) { (void)id; return false; }
bool dhdHasActiveGripper(signed char id) { (void)id; return false; }
#endif
int dhdGetGripperGap(double *gap, signed char id) { (void)id; *gap = 0.015; return 0; }
int dhdGetGripperLinearVelocity(double *velocity, signed char id) { (void)id; *velocity = -0.02; return 0; }
int dhdGetStatus(int *status, signed char id) {
    (void)id;
    memset(status, 0, 17 * sizeof *status);
    status[0] = status[1] = status[2] = 1;
    status[3] = is_initialised;
#ifdef FORCE_OFF
    status[14] = is_late() ? FORCE_OFF : 0;
#endif
    return 0;
}
int dhdEnableForce(unsigned char on, signed char id) { (void)id; note("enable", on, 0, 0); return 0; }
int dhdStop(signed char id) { (void)id; note("stop", 0, 0, 0); return 0; }
int dhdSetBrakes(int on, signed char id) { (void)id; note("brakes", on, 0, 0); return 0; }
int dhdSetGravityCompensation(int on, signed char id) { (void)id; (void)on; return 0; }
int dhdSetMaxForce(double most, signed char id) { (void)id; note("most", most, 0, 0); return 0; }
int dhdSetMaxTorque(double most, signed char id) { (void)id; (void)most; return 0; }
int dhdConfigLinearVelocity(int ms, int mode, signed char id) { (void)id; note("window", ms, mode, 0); return 0; }
int dhdConfigAngularVelocity(int ms, int mode, signed char id) { (void)id; (void)ms; (void)mode; return 0; }
static bool is_expert = false;
int dhdEnableExpertMode(void) { is_expert = true; return 0; }
int dhdDisableExpertMode(void) { is_expert = false; return 0; }
#ifndef LACKS
int dhdSetWatchdog(unsigned char units, signed char id) {
    (void)id;
    note("watchdog", units, is_expert, 0);
    return is_expert ? 0 : fail(9);
}
#endif
int dhdGetPositionAndOrientationFrame(double *x, double *y, double *z, double rows[3][3], signed char id) {
    (void)id;
#ifdef LOST
    if (is_late()) {
        return fail(2);
    }
#endif
    /* 1 cm towards the user, 2 cm to the right, 3 cm up. */
    *x = 0.01;
    *y = 0.02;
    *z = 0.03;
    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 3; column++) {
            rows[row][column] = row == column;
        }
    }
    return 0;
}
int dhdGetLinearVelocity(double *x, double *y, double *z, signed char id) {
    (void)id;
    (void)x, (void)y, (void)z;
    return fail(7); /* its window is not filled yet */
}
int dhdGetAngularVelocityRad(double *x, double *y, double *z, signed char id) {
    (void)id;
    *x = *y = *z = 0;
    return 0;
}
static double force[3], gripper_force;
int dhdGetForceAndTorqueAndGripperForce(double *x, double *y, double *z, double *a, double *b, double *g, double *gripper, signed char id) {
    (void)id;
    *gripper = gripper_force;
    *x = force[0];
    *y = force[1];
    *z = force[2];
    *a = *b = *g = 0;
    return 1; /* from the last exchange */
}
unsigned dhdGetButtonMask(signed char id) { (void)id; return 5; }
int dhdSetForceAndTorqueAndGripperForce(double x, double y, double z, double a, double b, double g, double gripper, signed char id) {
    (void)id;
    (void)a, (void)b, (void)g;
    if (gripper != gripper_force) {
        note("gripper", gripper, 0, 0);
    }
    gripper_force = gripper;
    if (sent > 0 || x != 0 || y != 0 || z != 0) {
        sent++;
    }
    if (x != force[0] || y != force[1] || z != force[2]) {
        note("force", x, y, z);
    }
    force[0] = x;
    force[1] = y;
    force[2] = z;
#ifdef SILENT
    if (is_late()) {
        nanosleep(&(struct timespec){.tv_sec = 1}, NULL);
    }
#endif
#ifdef REFUSED
    if (is_late()) {
        return fail(19);
    }
#endif
    nanosleep(&(struct timespec){.tv_nsec = 200000}, NULL);
    return 0;
}
#ifndef NO_DRD
int drdOpenID(signed char index) { return dhdOpenID(index); }
int drdClose(signed char id) { return dhdClose(id); }
bool drdIsInitialized(signed char id) { (void)id; return is_initialised; }
int drdAutoInit(signed char id) {
    (void)id;
    note("initialise", 0, 0, 0);
    is_initialised = true;
    return 0;
}
int drdStop(bool on, signed char id) { (void)id; note("release", on, 0, 0); return 0; }
#endif
