/* A library with the functions of HDAPI that the plugin uses, and one thing wrong: which, macros say. Nothing is behind it but a
 * scheduler and a log, where each change of force and every switch is a line. Written from names, numbers and types. */
#define _POSIX_C_SOURCE 200809L
#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#ifndef VERSION
#define VERSION "3.4.0"
#endif
#ifndef AFTER
#define AFTER 50
#endif

typedef struct { unsigned code; int internal; unsigned device; } Error;
typedef unsigned (*Callback)(void *);

static unsigned error = 0;
static int frames = 0;
static double force[3];
static Callback scheduled = NULL;
static void *scheduled_data = NULL;
static pthread_t thread;
static volatile bool is_running = false;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

static void note(const char *what, double x, double y, double z) {
    FILE *log = fopen(getenv("SDK_LOG"), "a");
    if (log != NULL) {
        fprintf(log, "%s %g %g %g\n", what, x, y, z);
        fclose(log);
    }
}

const char *hdGetString(unsigned parameter) { return parameter == 0x2500 ? VERSION : "Touch"; }
unsigned hdInitDevice(const char *name) {
    (void)name;
#ifdef NO_DEVICE
    error = 0x0300;
    return 0xFFFFFFFF;
#else
    return 0;
#endif
}
void hdDisableDevice(unsigned handle) { note("close", handle, 0, 0); }
void hdMakeCurrentDevice(unsigned handle) { (void)handle; }
void hdBeginFrame(unsigned handle) {
    (void)handle;
    /* From the first force that is not zero: a busy machine begins late. */
    if (frames > 0 || force[0] != 0 || force[1] != 0 || force[2] != 0) {
        frames++;
    }
#ifdef ERROR
    if (frames > AFTER) {
        error = ERROR;
    }
#endif
}
void hdEndFrame(unsigned handle) { (void)handle; }
void hdGetDoublev(unsigned parameter, double *numbers) {
    static const double workspace[6] = {-80, -60, -35, 80, 60, 45};
    static const double transform[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 10, 20, 30, 1};
    switch (parameter) {
    case 0x2551:
        for (int i = 0; i < 6; i++) {
            numbers[i] = workspace[i];
        }
        break;
    case 0x2052:
        for (int i = 0; i < 16; i++) {
            numbers[i] = transform[i];
        }
        break;
    case 0x2602:
        numbers[0] = 0.5;
        break;
    case 0x2603:
        numbers[0] = 3.3;
        break;
    case 0x2800:
        for (int i = 0; i < 3; i++) {
            numbers[i] = force[i];
        }
        break;
    case 0x2051:
    case 0x2053:
        numbers[0] = numbers[1] = numbers[2] = 0;
        break;
    default:
        error = 0x0100;
    }
}
void hdGetIntegerv(unsigned parameter, int *number) {
    *number = parameter == 0x2000 ? 2 : parameter == 0x2553 ? 6 : parameter == 0x2554 ? 3 : 2;
}
void hdSetDoublev(unsigned parameter, const double *numbers) {
    if (parameter != 0x2700) {
        error = 0x0100;
        return;
    }
    if (numbers[0] != force[0] || numbers[1] != force[1] || numbers[2] != force[2]) {
        note("force", numbers[0], numbers[1], numbers[2]);
    }
    for (int i = 0; i < 3; i++) {
        force[i] = numbers[i];
    }
}
void hdEnable(unsigned capability) { note("enable", capability, 0, 0); }
void hdDisable(unsigned capability) { note("disable", capability, 0, 0); }
Error hdGetError(void) {
    Error taken = {.code = error, .internal = 0, .device = 0};
    error = 0;
    return taken;
}
const char *hdGetErrorString(unsigned code) { (void)code; return "as the test wants it"; }
unsigned hdCheckCalibration(void) {
#ifdef UNCALIBRATED
    return UNCALIBRATED;
#else
    return 0x5000;
#endif
}
void hdUpdateCalibration(unsigned style) { note("calibrate", style, 0, 0); }
__attribute__((unused)) static void *run(void *nothing) {
    (void)nothing;
    while (is_running) {
        nanosleep(&(struct timespec){.tv_nsec = 900000}, NULL);
        pthread_mutex_lock(&lock);
        if (scheduled != NULL && scheduled(scheduled_data) == 0) {
            scheduled = NULL;
        }
        pthread_mutex_unlock(&lock);
    }
    return NULL;
}
void hdStartScheduler(void) {
#ifdef NO_TIMER
    error = 0x0304;
#else
    is_running = true;
    is_running = pthread_create(&thread, NULL, run, NULL) == 0;
#endif
}
#ifndef LACKS
void hdStopScheduler(void) {
    if (is_running) {
        is_running = false;
        pthread_join(thread, NULL);
    }
    note("stop", 0, 0, 0);
}
#endif
unsigned long hdScheduleAsynchronous(Callback callback, void *data, unsigned short priority) {
    (void)priority;
    scheduled_data = data;
    scheduled = callback;
    return 1;
}
void hdUnschedule(unsigned long handle) {
    (void)handle;
    pthread_mutex_lock(&lock);
    scheduled = NULL;
    pthread_mutex_unlock(&lock);
}
