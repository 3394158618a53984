/* A program that finds a Phantom as CHAI3D's device layer does: by name, at run time, fourteen functions, and no word about pace.
 * It drives the device in a way that its first argument names, for so many calls, and says what it saw, a fact a line. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

static int (*count)(void), (*open_)(int), (*close_)(int), (*buttons)(int);
static int (*position)(int, double *, double *, double *), (*velocity)(int, double *, double *, double *);
static int (*rotation)(int, double *, double *, double *, double *, double *, double *, double *, double *, double *);
static int (*force)(int, const double *, const double *, const double *);
static int (*torque)(int, const double *, const double *, const double *);
static int (*both)(int, const double *, const double *, const double *, const double *, const double *, const double *);
static int (*radius)(int, double *), (*type)(int, char *);
static void (*start)(void), (*stop)(void);

static void *library;

static void find(void *function, const char *name)
{
    void *found = dlsym(library, name);
    if (found == NULL) {
        printf("missing %s\n", name);
        exit(3);
    }
    memcpy(function, &found, sizeof found);
}

static double now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

static int send(double x, double y, double z)
{
    double none = 0.0;
    return both(0, &x, &y, &z, &none, &none, &none);
}

static void *hammer(void *calls)
{
    for (long call = 0; call < *(long *)calls; call++)
        send(call % 2 ? 40.0 : -40.0, 0.0, call % 3 ? 1e308 : -1e308);
    return NULL;
}

int main(int argc, char **argv)
{
    const char *way = argc > 1 ? argv[1] : "plain";
    long calls = argc > 2 ? atol(argv[2]) : 1000;

    if (dlopen("libHD.so", RTLD_LAZY | RTLD_GLOBAL) == NULL) {
        printf("no libHD\n");
        return 3;
    }
    library = dlopen("libhdPhantom.so", RTLD_LAZY | RTLD_GLOBAL);
    if (library == NULL) {
        printf("no libhdPhantom\n");
        return 3;
    }
    find(&count, "hdPhantomGetNumDevices");
    find(&open_, "hdPhantomOpen");
    find(&close_, "hdPhantomClose");
    find(&position, "hdPhantomGetPosition");
    find(&velocity, "hdPhantomGetLinearVelocity");
    find(&rotation, "hdPhantomGetRotation");
    find(&buttons, "hdPhantomGetButtons");
    find(&force, "hdPhantomSetForce");
    find(&torque, "hdPhantomSetTorque");
    find(&both, "hdPhantomSetForceAndTorque");
    find(&radius, "hdPhantomGetWorkspaceRadius");
    find(&type, "hdPhantomGetType");
    find(&start, "hdPhantomStartServo");
    find(&stop, "hdPhantomStopServo");

    char name[255];
    double metres = 0.0;
    memset(name, 'x', sizeof name);
    /* Before anything is open. */
    if (count() < 1 || radius(0, &metres) != 0 || type(0, name) != 0)
        return 4;
    printf("type %s\nradius %g\n", name, metres);
    if (position(0, &metres, &metres, &metres) != -1 || open_(77) != -1 || open_(-1) != -1)
        return 5;
    /* The scan and the constructor, before the program. */
    for (int time = 0; time < 2; time++)
        if (open_(0) < 0 || close_(0) != 0)
            return 6;
    if (open_(0) < 0)
        return 7;

    double lowest = 1.0, highest = -1.0, slant = 0.0, lag = 0.0, before = 0.0, began = now(), x, y, z;
    double r[9];
    long failed = 0;
    for (long call = 0; call < calls; call++) {
        if (position(0, &x, &y, &z) != 0 || !isfinite(x) || !isfinite(y) || !isfinite(z))
            return 8;
        if (rotation(0, r, r + 1, r + 2, r + 3, r + 4, r + 5, r + 6, r + 7, r + 8) != 0)
            return 9;
        for (int row = 0; row < 3; row++)
            for (int other = 0; other < 3; other++) {
                double product = r[3 * row] * r[3 * other] + r[3 * row + 1] * r[3 * other + 1] + r[3 * row + 2] * r[3 * other + 2];
                slant = fmax(slant, fabs(product - (row == other)));
            }
        double vx, vy, vz;
        velocity(0, &vx, &vy, &vz);
        if (call > 1)
            lag = fmax(lag, fabs((z - before) / 0.001 - vz));
        before = z;
        lowest = fmin(lowest, z);
        highest = fmax(highest, z);
        buttons(0);
        if (strcmp(way, "plain") == 0)
            failed += send(0.0, 0.0, -200.0 * z) != 0;
        else if (strcmp(way, "steps") == 0)
            failed += send(call / 20 % 2 ? 40.0 : -40.0, call / 30 % 2 ? 40.0 : -40.0, call / 50 % 2 ? 40.0 : -40.0) != 0;
        else if (strcmp(way, "huge") == 0)
            failed += send(1e308, -1e308, call % 2 ? 1e308 : -1e308) != 0;
        else if (strcmp(way, "nan") == 0)
            failed += send(call % 2 ? NAN : 1.0, 0.0, call % 3 ? INFINITY : 0.0) != 0;
        else if (strcmp(way, "stall") == 0) {
            failed += send(5.0, 0.0, 0.0) != 0;
            if (call % 100 == 99)
                usleep(120000);
        } else if (strcmp(way, "kill") == 0) {
            send(5.0, 0.0, 0.0);
            if (call == calls / 2)
                raise(SIGKILL);
        } else if (strcmp(way, "crash") == 0) {
            send(5.0, 0.0, 0.0);
            if (call == calls / 2)
                abort();
        } else if (strcmp(way, "fork") == 0) {
            send(2.0, 0.0, 0.0);
            if (call == calls / 2) {
                fflush(stdout);
                pid_t child = fork();
                if (child == 0) {
                    /* A copy has no device, and its end is not that of the run. */
                    int inert = position(0, &x, &y, &z) == -1 && send(40.0, 0.0, 0.0) == -1 && close_(0) == -1 && count() == 0;
                    exit(inert ? 0 : 9);
                }
                int status = 1;
                waitpid(child, &status, 0);
                printf("child %d\n", WEXITSTATUS(status));
            }
        } else if (strcmp(way, "threads") == 0) {
            pthread_t threads[10];
            for (int thread = 0; thread < 10; thread++)
                pthread_create(threads + thread, NULL, hammer, &calls);
            for (int thread = 0; thread < 10; thread++)
                pthread_join(threads[thread], NULL);
            break;
        } else if (strcmp(way, "forget") == 0) {
            send(5.0, 0.0, 0.0);
            if (call == calls / 2)
                return 0;
        } else
            return 2;
    }
    printf("hz %.1f\nlowest %.6f\nhighest %.6f\nslant %.3e\nlag %.6f\nfailed %ld\n", (double)calls / (now() - began), lowest, highest, slant, lag, failed);
    printf("close %d\n", close_(0));
    printf("close %d\n", close_(0));
    printf("after %d\n", send(1.0, 0.0, 0.0));
    if (open_(0) < 0 || position(0, &x, &y, &z) != 0)
        return 10;
    close_(0);
    stop();
    return 0;
}
