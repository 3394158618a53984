/* A program that moves a handle as programs of the DRD do: waits for each motion, or asks whether it goes on. Says a fact a line. */
#include <dlfcn.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

static void *library;
static int (*drdOpen)(void), (*drdAutoInit)(signed char), (*drdStart)(signed char), (*drdClose)(signed char);
static int (*drdMoveToPos)(double, double, double, bool, signed char), (*drdMoveTo)(double *, bool, signed char);
static bool (*drdIsMoving)(signed char);
static void (*drdWaitForTick)(signed char);
static int (*dhdGetPosition)(double *, double *, double *, signed char), (*dhdErrorGetLast)(void);

static int find(void *function, const char *name)
{
    void *found = dlsym(library, name);
    if (found == NULL)
        printf("missing %s\n", name);
    memcpy(function, &found, sizeof found);
    return found == NULL;
}

#define FIND(name) find(&name, #name)

/* Name, result, number of the error, distance from the place in m, and whether the motion goes on. */
static void tell(const char *name, int result, double x, double y, double z)
{
    int error = result < 0 ? dhdErrorGetLast() : 0;
    double at[3];
    dhdGetPosition(&at[0], &at[1], &at[2], -1);
    double away = sqrt((at[0] - x) * (at[0] - x) + (at[1] - y) * (at[1] - y) + (at[2] - z) * (at[2] - z));
    printf("%s %d %d %.6f %d\n", name, result, error, away, drdIsMoving(-1));
}

int main(void)
{
    library = dlopen("libdrd.so.3", RTLD_NOW);
    if (library == NULL) {
        printf("%s\n", dlerror());
        return 3;
    }
    if (FIND(drdOpen) + FIND(drdAutoInit) + FIND(drdStart) + FIND(drdClose) + FIND(drdMoveToPos) + FIND(drdMoveTo)
        + FIND(drdIsMoving) + FIND(drdWaitForTick) + FIND(dhdGetPosition) + FIND(dhdErrorGetLast))
        return 3;
    if (drdOpen() < 0 || drdAutoInit(-1) < 0 || drdStart(-1) < 0)
        return 4;
    tell("right", drdMoveToPos(0.003, 0.0, 0.0, true, -1), 0.003, 0.0, 0.0);
    tell("left", drdMoveToPos(-0.003, 0.0, 0.0, true, -1), -0.003, 0.0, 0.0);
    double place[8] = {0.002, 0.0, 0.004, 0.05, 0.0, 0.0, 0.0, 0.0};
    tell("turned", drdMoveTo(place, true, -1), 0.002, 0.0, 0.004);
    int begun = drdMoveToPos(0.0, 0.0, 0.0, false, -1), was_moving = drdIsMoving(-1);
    while (drdIsMoving(-1))
        drdWaitForTick(-1);
    tell("home", begun, 0.0, 0.0, 0.0);
    printf("moving %d\n", was_moving);
    return drdClose(-1) < 0;
}
